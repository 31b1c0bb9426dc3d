"""The scene as a whole in MJX, as what a fit of motions simulates with."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property

import jax
import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from joda.estimation.estimator import Make, SegmentEstimator
from joda.estimation.profile_parameters import Parameters
from joda.estimation.segmentation import segments_of, starts
from joda.estimation.segments import Segments, Simulator
from joda.estimation.unknowns import Unknowns
from joda.measured import smoothing
from joda.measured.runs import known
from joda.measured.scene_log import SceneRun
from joda.mjx.shooting import Numbers, Scene
from joda.refining.engine import FINEST
from joda.scenes.model import joint_name

Array = NDArray[np.float64]

STEEP = 1e5
"""Largest slope of a residual: where a small difference decides to which side a joint snaps there
are larger ones, and they lead nowhere."""


@dataclass(frozen=True)
class SceneSimulator:
    """A scene with numbers of a joint's profile.

    Attributes:
        scene: in MJX.
        numbers: of the scene.
        units: of the joints' positions, rad or m, shape (joints,): see `SceneEngine`.
        jumps: which of the fit's numbers are places where a curve jumps, shape (n,).
    """

    scene: Scene
    numbers: Numbers
    units: Array
    jumps: NDArray[np.bool_]

    def replay(
        self,
        force: ArrayLike,
        at: ArrayLike,
        start: ArrayLike,
        fresh: ArrayLike,
        h: float,
        command: ArrayLike | None = None,
    ) -> tuple[Array, Array]:
        """Positions before and after each step, of one joint after the other.

        Friction begins anew in each segment, without a load.

        Args:
            force: all that is put into the scene at each step, shape (steps, inputs).
            at: step at which each segment begins, shape (m,).
            start: states there, shape (m, 2 joints).
            fresh, h, command: not used.
        """
        paths = self.scene.paths(self.numbers, self.states(start), pieces(force, at))
        return in_turn(np.concatenate([path[:-1] for path in paths]) / self.units), in_turn(
            np.concatenate([path[1:] for path in paths]) / self.units
        )

    def states(self, start: ArrayLike) -> Array:
        """Starts of segments in rad or m, and per s."""
        return np.asarray(start) * np.repeat(self.units, 2)


def pieces(force: ArrayLike, at: ArrayLike) -> list[Array]:
    """What is put into the scene in each segment."""
    return np.split(np.asarray(force), np.asarray(at)[1:])


def in_turn(paths: Array) -> Array:
    """Of shape (steps, ..., joints) to (joints steps, ...): one joint after the other."""
    return np.concatenate(np.moveaxis(paths, -1, 0))


@dataclass(frozen=True)
class SceneEstimator(SegmentEstimator):
    """Fits a scene to segments: slopes are the motion's derivatives, but differences by the places
    of jumps, which no motion along them shows."""

    def slopes(
        self,
        make: Make,
        simulator: Simulator,
        unknowns: Unknowns,
        x: Array,
        start: Array,
        r: Array,
        central: bool,
    ) -> tuple[Array, Array]:
        """See `SegmentEstimator.slopes`."""
        assert isinstance(simulator, SceneSimulator)
        segments, k = self.segments, len(x)
        jumps = np.flatnonzero(simulator.jumps[:k])
        smooth = np.setdiff1d(np.arange(k), jumps)
        ways = [_way(make, x, number, unknowns.step[number]) for number in smooth]
        turns = (
            segments.prior_std[:, None, :] * np.eye(start.shape[1]) * np.repeat(simulator.units, 2)
        )
        put = pieces(segments.force, segments.at)
        found = simulator.scene.slopes(simulator.numbers, ways, simulator.states(start), turns, put)
        before, after = (
            in_turn(np.concatenate([one[a:b] for one in found]) / simulator.units)
            for a, b in ((None, -1), (1, None))
        )
        slopes = segments.whitened(segments.sampled(before, after))
        slopes = np.nan_to_num(np.clip(slopes, -STEEP, STEEP))
        J = np.zeros((*r.shape, k))
        J[:, :, smooth] = slopes[:, :, : len(smooth)]
        for number in jumps:
            off = unknowns.step[number] * np.eye(k)[number]
            up, down = (segments.misfit(make(x + way * off), start) for way in (1, -1))
            J[:, :, number] = segments.whitened(up - down) / (2 * unknowns.step[number])
        return J, slopes[:, :, len(smooth) :]


def _way(make: Make, x: Array, number: int, step: float) -> Numbers:
    """How the scene's numbers change with one of a fit's, by central differences: nearly all of
    them are proportional to it."""
    off = step * np.eye(len(x))[number]
    up, down = make(x + off), make(x - off)
    assert isinstance(up, SceneSimulator) and isinstance(down, SceneSimulator)
    way: Numbers = jax.tree.map(lambda a, b: (a - b) / (2 * step), up.numbers, down.numbers)
    return way


@dataclass(frozen=True)
class SceneEngine:
    """The scene as a whole in MJX: all joints of the runs move, the others are held.

    Positions of the other joints are in units in which they have the noise of the fitted one.

    Attributes:
        scene: in MJX, with the joints of the runs.
        joint: id of the fitted joint.
        range, runs, sigma, h, inertia, quick: see `joda.refining.engine.Engine`.
    """

    scene: Scene
    joint: int
    range: tuple[float, float]
    runs: Sequence[SceneRun]
    sigma: float
    inertia: float
    quick: bool = field(default=False, init=False)
    _cut: dict[float, Segments] = field(default_factory=dict, init=False, repr=False)

    @property
    def h(self) -> float:
        """See `Engine`."""
        return float(self.scene.model.opt.timestep)

    @cached_property
    def units(self) -> Array:
        """Noise of each joint's position in that of the fitted one, shape (joints,)."""
        joints = self.runs[0].joints
        spans = np.ptp(self.scene.model.jnt_range[list(joints)], axis=1)
        noises = [[smoothing.noise(run.time, own) for own in run.positions.T] for run in self.runs]
        usual = np.maximum(np.median(noises, axis=0), FINEST * spans)
        return np.asarray(np.append(1.0, usual[1:] / self.sigma))

    def simulator(self, parameters: Parameters, theta: Array) -> SceneSimulator:
        """See `Engine`."""
        profile = parameters.written(theta, exact=True)
        changed = {}
        if factor := np.expm1(parameters.number(theta, "inertia")):
            heavier = _heavier(self.scene.model, self.joint, factor * self.inertia)
            names = ("dof_armature", "dof_M0", "dof_invweight0", "body_invweight0")
            changed = {name: getattr(heavier, name) for name in names}
        if ratio := parameters.number(theta, "damping_ratio"):
            changed["jnt_solref"] = self.scene.model.jnt_solref.copy()
            changed["jnt_solref"][self.joint, 1] *= np.exp(ratio)
        name = joint_name(self.scene.model, self.joint)
        numbers = self.scene.numbers({name: profile}, changed)
        return SceneSimulator(self.scene, numbers, self.units, _jumps(parameters))

    def segments(self, length: float) -> Segments:
        """See `Engine`."""
        if length not in self._cut:
            self._cut[length] = self._together(length)
        return self._cut[length]

    def estimator(self, segments: Segments, counts: NDArray[np.bool_]) -> SceneEstimator:
        """See `Engine`."""
        return SceneEstimator(segments, counts)

    def _together(self, length: float) -> Segments:
        """Segments of the fitted joint, with the other joints' samples after its own."""
        lo, hi = self.range
        sigmas = [self.sigma] * len(self.runs)
        own = segments_of(self.runs, sigmas, hi - lo, lo, self.inertia, self.h, length, fine=False)
        begun, ends = np.flatnonzero(own.fresh), len(own.force)
        parts = [(run, piece) for run in self.runs for piece in known(run)]
        firsts = np.append(own.at[begun], ends)
        put, start, prior_std, position = [], [own.start], [own.prior_std], [own.position]
        for (run, piece), a, b in zip(parts, firsts[:-1], firsts[1:], strict=True):
            put.append(run.inputs(run.time[piece[0]] + self.h * np.arange(b - a + 1)))
        count, steps = len(own.position), len(own.force)
        for k, unit in enumerate(self.units[1:], start=1):
            states = []
            for number, (run, piece) in enumerate(parts):
                there = (firsts[number] <= own.at) & (own.at < firsts[number + 1])
                time, measured = run.time[piece], run.positions[piece, k] / unit
                at = time[0] + self.h * (own.at[there] - firsts[number])
                states.append(starts(time, measured, at, self.sigma))
                position.append(measured)
            start.append(np.concatenate([one for one, _ in states]))
            prior_std.append(np.concatenate([one for _, one in states]))
        others, same = range(1, len(self.units)), np.tile(own.rows, len(self.units))
        several = np.repeat(np.arange(len(self.units)), own.rows.shape[1])
        shared = np.zeros((len(own.at), same.shape[1], own.shared.shape[2]))
        shared[:, : own.rows.shape[1]] = own.shared
        return replace(
            own,
            force=np.concatenate(put),
            command=None,
            start=np.concatenate(start, axis=1),
            prior_std=np.concatenate(prior_std, axis=1),
            step=np.concatenate([own.step, *(own.step + k * steps for k in others)]),
            share=np.tile(own.share, len(self.units)),
            position=np.concatenate(position),
            time=np.tile(own.time, len(self.units)),
            stays=np.pad(own.stays, (0, count * len(others))),
            rows=np.where(same >= 0, same + count * several, -1),
            sharpness=np.tile(own.sharpness, len(self.units)),
            shared=shared,
        )


def _heavier(model: mujoco.MjModel, joint: int, by: float) -> mujoco.MjModel:
    """The model with more inertia about a joint, kg·m² or kg."""
    other = copy(model)
    other.dof_armature[other.jnt_dofadr[joint]] += by
    mujoco.mj_setConst(other, mujoco.MjData(other))
    return other


def _jumps(parameters: Parameters) -> NDArray[np.bool_]:
    """Which numbers are places where a curve jumps, shape (n,)."""
    out = []
    for slot in parameters.slots:
        jump = False
        if slot.kind == "intervals":
            channel = getattr(parameters.profile.channels, slot.channel)
            jump = channel.components[slot.component].y[-slot.index] != 0
        out.append(jump)
    return np.array(out, bool)
