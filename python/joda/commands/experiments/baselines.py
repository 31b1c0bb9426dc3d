"""The paper's two baselines in MuJoCo's own elements, each fitted to what the profile does.

Constant: friction and damping that are the same everywhere. Spring: besides these a linear return
force that is zero somewhere within the range, its rest. Both are fitted to the very profile that
they are compared with: to its forces, or to the very motions of the case and where they should end.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.commands.experiments.subject import Subject
from joda.compiling import reference_scales
from joda.component import Component
from joda.field import evaluate
from joda.joints.joint_model import joint_model
from joda.measured.quasi_static import static_force
from joda.profile import Channel, Channels, Profile, Resistance
from joda.scenes.context import Context
from joda.scenes.engine import set_strength
from joda.scenes.model import find_joint, load, load_model
from joda.scenes.motion import Motion

Array = NDArray[np.float64]

GRID = 201
"""At how many positions forces are fitted."""
MAX_VALUES = {"friction": 3.0, "damping": 5.0, "stiffness": 20.0}
"""Largest value that is tried, in reference forces, dampings, and reference forces per range."""
STIFFEST = 0.9999
PATHS = 0.1
"""Weight of the way that it takes to where it ends, in fits of motions."""
STEP = 0.002
"""Of the simulation with which motions are fitted, s."""


@dataclass(frozen=True)
class Baseline:
    """A joint without a profile.

    Attributes:
        friction: N·m or N, everywhere.
        damping: N·m·s/rad or N·s/m, everywhere.
        stiffness: of the spring, N·m/rad or N/m; 0: there is none.
        rest: where the spring's force is zero, rad or m.
    """

    friction: float
    damping: float
    stiffness: float = 0.0
    rest: float = 0.0

    def profile(self, found: Context) -> Profile:
        """The same as a profile of the joint: to be simulated by itself, and drawn."""
        lo, hi = found.joint.range
        spring = (-self.stiffness * (lo - self.rest), -self.stiffness * (hi - self.rest))
        return Profile(
            joint=found.joint,
            channels=Channels(
                conservative=Channel(components=(_line("spring", *spring),)),
                friction=Resistance(components=(_line("friction", self.friction, self.friction),)),
                damping=Resistance(components=(_line("damping", self.damping, self.damping),)),
            ),
        )

    def written(self, model: Path, joint: str, usual: bool = False) -> mujoco.MjSpec:
        """The bare model with the baseline as attributes of the joint.

        `usual`: friction with MuJoCo's usual solver parameters, not with its stiffest ones. It then
        creeps under load, and hardly acts on light joints that are slow.
        """
        spec, compiled = load(model)
        element = spec.joints[find_joint(compiled, joint)]
        element.frictionloss, element.springref = self.friction, self.rest
        set_strength(element, "damping", self.damping)
        set_strength(element, "stiffness", self.stiffness)
        if not usual:
            element.solref_friction[:] = 0, -1 / compiled.opt.timestep
            element.solimp_friction[:2] = STIFFEST
        return spec

    def subject(self, model: Path, found: Context, usual: bool = False) -> Subject:
        """The bare model with the baseline, see `written`."""
        return Subject(found, self.written(model, found.joint.name, usual).compile())


def fit_forces(profile: Profile, found: Context, spring: bool) -> Baseline:
    """The baseline whose forces are nearest to the profile's, in the mean square over the range.

    The force that slowly moves the joint either way tells friction and spring, by non-negative
    least squares: a spring that rests within the range is a sum of one that rests at the low end
    and one that rests at the high end. Damping is the profile's mean.
    """
    from scipy.optimize import nnls

    lo, hi = found.joint.range
    q = np.tile(np.linspace(lo, hi, GRID), 2)
    way = np.repeat([1.0, -1.0], GRID)
    inside = np.clip(q, lo + 1e-9 * (hi - lo), hi - 1e-9 * (hi - lo))
    weight = static_force(Baseline(0, 0).profile(found), found, inside, way)
    wanted = static_force(profile, found, inside, way) - weight
    columns = np.stack([way, q - lo, q - hi], axis=1)
    least = nnls(columns if spring else columns[:, :1], wanted)[0]
    friction, *springs = (float(x) for x in least)
    low, high = springs if spring else (0.0, 0.0)
    damping = float(evaluate(profile.channels.damping, np.linspace(0, 1, GRID))[0].mean())
    total = low + high
    rest = (low * lo + high * hi) / total if total else lo
    return Baseline(friction, damping, total, rest)


def fit_motions(
    profile: Profile,
    model: Path,
    found: Context,
    motions: list[Motion],
    ends: Sequence[float],
    spring: bool,
) -> Baseline:
    """The baseline that does best what the joint should do after it was let go.

    Differential evolution over all numbers, from a Sobol sequence and the fitted forces, on the
    largest distance to where it should end, plus a tenth of the root mean square of the difference
    in position from the motions. The joint is simulated by itself, its friction ideal.

    Args:
        profile: begins the search, with its forces.
        model: the bare model.
        found: the joint.
        motions: what it should do, let go at rest.
        ends: normalised positions where they should end; empty where only the way matters.
        spring: whether there is one.
    """
    from scipy.optimize import differential_evolution

    lo, hi = found.joint.range
    bare = load_model(model)
    own = joint_model(found, Profile(joint=found.joint), bare, find_joint(bare, found.joint.name))
    references = reference_scales(found)
    most = np.array([MAX_VALUES[name] for name in ("friction", "damping", "stiffness")])
    most *= references["friction"], references["damping"], references["friction"] / (hi - lo)

    lengths = [round(motion.time[-1] / STEP) for motion in motions]
    at = np.cumsum([0, *lengths[:-1]])
    start = np.array([(motion.position[0], 0.0) for motion in motions])
    force, fresh = np.zeros(sum(lengths)), np.ones(len(motions), bool)
    wanted = np.concatenate([motion.position[1:] for motion in motions])
    shown = [
        a + np.rint(m.time[1:] / STEP).astype(int) - 1 for a, m in zip(at, motions, strict=True)
    ]
    samples, last = np.concatenate(shown), at + np.array(lengths) - 1

    def numbers(u: Array) -> Baseline:
        friction, damping = most[:2] * u[:2] ** 3
        if not spring:
            return Baseline(float(friction), float(damping))
        stiffness, rest = most[2] * u[2] ** 3, lo + (hi - lo) * u[3]
        return Baseline(float(friction), float(damping), float(stiffness), float(rest))

    def missed(u: Array) -> float:
        simulator = own.simulator(numbers(u).profile(found), STEP)
        after = simulator.replay(force, at, start, fresh, STEP)[1]
        path = np.sqrt(np.mean((after[samples] - wanted) ** 2)) / (hi - lo)
        shares = (after[last] - lo) / (hi - lo)
        end = np.abs(shares - np.array(ends)).max() if len(ends) else 0.0
        return float(end + PATHS * path)

    candidate = fit_forces(profile, found, spring)
    first = np.cbrt(np.array([candidate.friction, candidate.damping, candidate.stiffness]) / most)
    first = np.append(first, (candidate.rest - lo) / (hi - lo))[: 4 if spring else 2]
    found_best = differential_evolution(
        missed,
        [(0.0, 1.0)] * len(first),
        x0=np.clip(first, 0, 1),
        init="sobol",
        popsize=12,
        maxiter=40,
        tol=1e-4,
        polish=False,
        seed=np.random.default_rng(0),
    )
    return numbers(np.asarray(found_best.x))


def _line(label: str, first: float, last: float) -> Component:
    return Component(label=label, interval=(0, 1), x=(0, 1), y=(first, last))
