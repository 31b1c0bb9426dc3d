"""A joint's model with a plain neural network's force, fitted through simulations in JAX.

Two layers of tanh over position and velocity, beside the model's own forces. It is fitted to the
windows that a learned law is, with the strengths of the model's friction and damping, by Adam with
weight decay (Loshchilov and Hutter, Decoupled weight decay regularization, ICLR 2019).
"""

import jax
import jax.numpy as jnp
import numpy as np
import optax

from joda.diagnosis.learning.fitting import Learner
from joda.diagnosis.shape_refinement import Likelihood
from joda.diagnosis.units import units_of
from joda.estimation.base_model import BASE_DOUBT
from joda.estimation.estimator import CAUCHY_SCALE
from joda.measured.replay import Replayer

WIDTH = 32
"""Units of a layer."""
ROUNDS = ((600, 1e-2), (100, 3e-3))
"""Iterations and first learning rate: in short segments, and in longer ones at the scene's step."""
EVERY = 50
"""Iterations after which the runs held out are looked at; they divide all."""


class Network:
    """A joint's model with a network's force, simulated in JAX."""

    def __init__(self, measured) -> None:
        """Args: the joint, whose friction and damping are constant, and runs to fit."""
        self.segments = Learner(measured).segments[:2]
        units, joint_model = units_of(self.segments[0], measured), measured.joint_model
        channels = measured.profile.channels
        assert not channels.conservative.components and not measured.profile.effects
        self.own = [
            sum(part.y[0] for part in channel.components)
            for channel in (channels.friction, channels.damping)
        ]
        self.lo, self.hi = measured.profile.joint.range
        self.fastest = np.abs(self.segments[0].start[:, 1]).max()
        self.force, self.inertia = units.force, joint_model.inertia
        self.weight, self.hinge = joint_model.weight, joint_model.hinge
        self.paths = jax.jit(self._paths)

    def begun(self, key) -> dict:
        """A network without force, and the model as it is."""
        sizes = (2, WIDTH, WIDTH, 1)
        keys = jax.random.split(key, 3)
        layers = [
            (jax.random.normal(key, (a, b)) * (b > 1) / np.sqrt(a), jnp.zeros(b))
            for key, a, b in zip(keys, sizes[:-1], sizes[1:], strict=True)
        ]
        return {"layers": layers, "own": jnp.ones(2)}

    def residual(self, numbers, q, v):
        """The network's force, N·m or N."""
        s = (q - self.lo) / (self.hi - self.lo)
        x = jnp.stack([2 * s - 1, v / self.fastest], axis=-1)
        *hidden, (W, b) = numbers["layers"]
        for inner, bias in hidden:
            x = jnp.tanh(x @ inner + bias)
        return self.force * (x @ W + b)[..., 0]

    def _paths(self, numbers, start, force, h):
        """Positions from starts (k, 2) under forces (k, n), shape (k, n + 1), and velocities."""
        dry, drag = (
            own * jnp.maximum(factor, 0)
            for own, factor in zip(self.own, numbers["own"], strict=True)
        )
        a, b = self.weight
        slowed = self.inertia * (1 + h * drag / self.inertia)

        def step(state, push):
            q, v = state
            pull = a * jnp.cos(q) + b * jnp.sin(q) if self.hinge else a
            v = (self.inertia * v + h * (push + pull + self.residual(numbers, q, v))) / slowed
            v = jnp.sign(v) * jnp.maximum(jnp.abs(v) - h * dry / slowed, 0)
            at = jnp.clip(q + h * v, self.lo, self.hi)
            v = jnp.where(at == q + h * v, v, 0)
            return (at, v), (at, v)

        _, path = jax.lax.scan(step, (start[:, 0], start[:, 1]), force.T)
        return tuple(
            jnp.concatenate([start[:, k : k + 1], each.T], axis=1) for k, each in enumerate(path)
        )

    def fitted(self, numbers, decay: float, held: Likelihood) -> tuple[float, dict]:
        """The numbers with which what was held out has the least loss, and that."""
        best = held.estimator.started(Moved(self, numbers)).loss, numbers
        for segments, (count, rate) in zip(self.segments, ROUNDS, strict=True):
            both = numbers, jnp.zeros((len(segments.at), 2))
            shrinks = {"layers": [(True, False)] * len(numbers["layers"]), "own": False}, False
            slower = optax.cosine_decay_schedule(rate, count)
            descent = optax.adamw(slower, weight_decay=decay, mask=shrinks)
            state, go = descent.init(both), self._descent(segments, descent)
            for _ in range(0, count, EVERY):
                both, state = go(both, state)
                numbers = both[0]
                loss = held.estimator.started(Moved(self, numbers)).loss
                best = min(best, (loss, numbers), key=lambda one: one[0])
        return best

    def _descent(self, segments, descent):
        """`EVERY` iterations over a network's numbers and the segments' starts in prior standard
        deviations."""
        counts = segments.usable
        ends = np.append(segments.at[1:], len(segments.force))
        force = _filled(segments.force, segments.at, ends)
        rows, there = np.maximum(segments.rows, 0), segments.rows >= 0
        at = np.where(there, segments.step[rows] - segments.at[:, None], 0)
        share, position = segments.share[rows], segments.position[rows]
        room = CAUCHY_SCALE * np.maximum(segments.count, 1)

        def loss(both):
            numbers, z = both
            path, _ = self._paths(
                numbers, segments.start + segments.prior_std * z, force, segments.h
            )
            first, last = (jnp.take_along_axis(path, at + k, axis=1) for k in (0, 1))
            r = segments.sharpness * (first + share * (last - first) - position)
            r = r - jnp.einsum("mnr,mkr,mk->mn", segments.shared, segments.shared, r)
            squares = (r**2).sum(1) + (z**2).sum(1)
            known = (((numbers["own"] - 1) / BASE_DOUBT) ** 2).sum()
            return jnp.where(counts, room * jnp.log1p(squares / room), 0).sum() + known

        def once(both_state, _):
            both, state = both_state
            updates, state = descent.update(jax.grad(loss)(both), state, both)
            return (optax.apply_updates(both, updates), state), None

        return jax.jit(lambda *both_state: jax.lax.scan(once, both_state, length=EVERY)[0])


def _filled(force, at, ends):
    """The forces of each window, filled up with zeros; shape (m, most steps)."""
    out = np.zeros((len(at), int((ends - at).max())))
    for row, a, b in zip(out, at, ends, strict=True):
        row[: b - a] = force[a:b]
    return out


class Moved:
    """A network's joint as a `joda.estimation.segments.Simulator`."""

    def __init__(self, network: Network, numbers: dict) -> None:
        self.network, self.numbers = network, numbers

    def replay(self, force, at, start, fresh, h, command=None):
        """See Mover."""
        ends = np.append(at[1:], len(force))
        path = np.asarray(self.network.paths(self.numbers, start, _filled(force, at, ends), h)[0])
        pieces = [
            (row[: b - a], row[1 : b - a + 1]) for row, a, b in zip(path, at, ends, strict=True)
        ]
        before, after = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
        return before, after


class Replays(Replayer):
    """Replays runs with a network's force, and all else as with a profile."""

    def __init__(self, measured, moved: Moved) -> None:
        super().__init__(
            measured.context, measured.profile, measured.joint_model, measured.timestep
        )
        self.moved, self.simulator = moved, None  # which knows of no network

    def _roll(self, initial, forces, command):
        """See Replayer; after time, a state has position and velocity."""
        steps = forces.shape[1]
        filled = np.zeros((len(forces), 1 << (steps - 1).bit_length()))
        filled[:, :steps] = forces
        paths, velocities = self.moved.network.paths(
            self.moved.numbers, initial[:, 1:3], filled, self.h
        )
        last = initial.copy()
        last[:, 1], last[:, 2] = paths[:, steps], velocities[:, steps]
        return np.asarray(paths[:, : steps + 1]), last
