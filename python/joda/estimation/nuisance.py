"""Numbers of a joint's body and of its measurement that may be off, as numbers to be fitted."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from joda._core import JointSimulator
from joda.estimation.base_model import BaseModel
from joda.estimation.estimator import Make
from joda.estimation.unknowns import Unknowns
from joda.joints.joint_model import JointModel
from joda.measured.measured_joint import Measured
from joda.measured.sensing import Sensing
from joda.profile import Profile

Array = NDArray[np.float64]
Integers = NDArray[np.intp]
NuisanceName = Literal[
    "mass",
    "inertia",
    "gravity",
    "center_of_mass",
    "force_scale",
    "force_offset",
    "time_delay",
    "position_offset",
]

FACTORS: tuple[NuisanceName, ...] = ("mass", "inertia", "gravity", "force_scale")
"""Those that are factors, whose logarithms are fitted."""
USUAL: dict[NuisanceName, float] = {
    "mass": 0.3,
    "inertia": 0.03,
    "gravity": 0.03,
    "center_of_mass": 0.0,
    "force_scale": 0.3,
    "force_offset": 0.1,
    "time_delay": 0.02,
    "position_offset": 0.02,
}
"""How far off they usually are (one standard deviation): factors relatively, an offset of the force
in units of its root mean square, a delay in s, a position's zero in ranges, the direction of the
centre of mass as seen from the hinge in rad: an encoder's zero stands in for it unless told."""
FULL_SCALE, MAX_OFFSET = 0.05, 0.25
"""How far off an offset of the force usually is, of the largest force, if that is more: of joints
that go by themselves most of the time; and the most, of the root mean square: an offset that is
about all that was recorded is a force that was held against."""
MAX_VALUES = {"factor": 7.0, "time_delay": 0.1}
"""Largest logarithm of a factor, and longest delay (s)."""
FAR = 20.0
"""The same of offsets, in what they usually are."""
STEPS = {"factor": 0.01, "time_delay": 2e-4, "other": 0.05}
"""Of differences: of a logarithm, of a delay (s), of others in what they usually are."""

NEAR_END = 0.1
"""How near an end of the range runs come at least that may tell of a position's zero, in ranges."""
MIN_ERRORS, MIN_OTHER_ERROR = {"factor": 0.02, "time_delay": 1e-3}, 0.1
"""By how much a logarithm or a delay (s) must be off to be worth a word; others by this part of
what they usually are."""


def _kind(name: NuisanceName) -> str:
    """What it is in tables of bounds."""
    return "factor" if name in FACTORS else name


class MeasuredSimulator:
    """A joint as its measurement sees it: stepped under the true force, told as it is logged."""

    def __init__(self, simulator: JointSimulator, sensing: Sensing) -> None:
        """Args: the joint, and what is wrong with its measurement."""
        self.simulator, self.sensing = simulator, sensing

    def replay(
        self,
        force: Array,
        at: Integers,
        start: Array,
        fresh: NDArray[np.bool_],
        h: float,
        command: Array | None = None,
    ) -> tuple[Array, Array]:
        """As `JointSimulator.replay`, of logged forces and positions."""
        own, zero = self.sensing, self.sensing.position_offset
        late = own.time_delay / h
        if late:
            begins = at[fresh]
            run = np.searchsorted(begins, np.arange(len(force)), side="right") - 1
            first, last = begins[run], np.append(begins[1:], len(force))[run] - 1
            where = np.clip(np.arange(len(force)) - late, first, last)
            force = np.interp(where, np.arange(len(force)), force)
        force = own.force_scale * force + own.force_offset
        before, after = self.simulator.replay(force, at, start - (zero, 0.0), fresh, h, command)
        return before + zero, after + zero


@dataclass(frozen=True)
class Nuisances:
    """Numbers that are fitted besides a model's strengths.

    Attributes:
        base: the model.
        names: of the numbers.
        prior_stds: standard deviation of each, as it is fitted.
    """

    base: BaseModel
    names: tuple[NuisanceName, ...]
    prior_stds: tuple[float, ...]

    @property
    def unknowns(self) -> Unknowns:
        """The strengths and these numbers."""
        prior_std = np.array(self.prior_stds)
        most, step = [], []
        for name, width in zip(self.names, self.prior_stds, strict=True):
            kind = _kind(name)
            most.append(MAX_VALUES.get(kind, FAR * width))
            step.append(STEPS.get(kind, STEPS["other"] * width))
        high = np.array(most)
        none = np.zeros(len(prior_std))
        return self.base.unknowns.and_(Unknowns(-high, high, np.array(step), none, prior_std))

    @property
    def make(self) -> Make:
        """The joint as it is seen, by the strengths and these numbers."""
        return lambda x: self.with_profile(self.base.written(x), x)

    def with_profile(self, profile: Profile, x: Array) -> JointSimulator:
        """The joint with them, but another profile."""
        own = self.base.stepped(self.body(self.base.own(x), x))
        return MeasuredSimulator(own.simulator(profile, self.base.h), self.sensing(x))  # type: ignore[return-value]

    def values(self, x: Array) -> dict[NuisanceName, float]:
        """Factors, and the other numbers in their units; more may follow in x."""
        own = zip(self.names, map(float, x[self.base.count :]), strict=False)
        return {name: float(np.exp(v)) if name in FACTORS else v for name, v in own}

    def little(self, x: Array) -> list[bool]:
        """Which of them are off by too little to be worth a word."""
        own = zip(self.names, self.prior_stds, x[self.base.count :], strict=True)
        least = (
            MIN_ERRORS.get(_kind(name), MIN_OTHER_ERROR * width) - abs(value)
            for name, width, value in own
        )
        return [float(left) > 0 for left in least]

    def body(self, joint_model: JointModel, x: Array) -> JointModel:
        """The joint with the numbers of its body."""
        found = self.values(x)
        mass = found.get("mass", 1.0)
        inertia, gravity = mass * found.get("inertia", 1.0), mass * found.get("gravity", 1.0)
        return joint_model.heavier(inertia, gravity, found.get("center_of_mass", 0.0))

    def sensing(self, x: Array) -> Sensing:
        """What is wrong with the measurement."""
        found = self.values(x)
        own = {name: value for name, value in found.items() if hasattr(Sensing, name)}
        return Sensing(**own)

    def taken(self, x: Array, names: Sequence[NuisanceName]) -> Array:
        """Strengths and other of the numbers where these are x.

        What the runs cannot tell apart goes over from those that are left out: all forces and
        masses by one factor are none, and a mass is an inertia and its weight.
        """
        n = self.base.count
        own = dict.fromkeys(USUAL, 0.0) | dict(zip(self.names, x[n:], strict=True))
        gone = set(self.names) - set(names)
        if "mass" in names and gone & {"inertia", "gravity"}:
            more = own["inertia" if "inertia" in gone else "gravity"]
            own["mass"] += more
            own["inertia"] -= more
            own["gravity"] -= more
        strengths = np.array(x[:n])
        if gone & {"mass", "force_scale"} and not {"mass", "force_scale"} <= gone:
            less = own["mass" if "mass" in gone else "force_scale"]
            own["mass"] -= less
            own["force_scale"] -= less
            own["force_offset"] *= float(np.exp(-less))
            strengths *= np.exp(-less)
        unknowns = self.base.unknowns
        strengths = np.clip(strengths, unknowns.low, unknowns.high)
        return np.append(strengths, [own[name] for name in names])

    def only(self, names: Sequence[NuisanceName]) -> "Nuisances":
        """Some of them."""
        widths = dict(zip(self.names, self.prior_stds, strict=True))
        return replace(self, names=tuple(names), prior_stds=tuple(widths[name] for name in names))

    def coarser(self) -> "Nuisances":
        """The same in longer steps, see `BaseModel.coarser`."""
        return replace(self, base=self.base.coarser())


@dataclass(frozen=True)
class CorrectedBase(BaseModel):
    """A model with numbers of its body and of the measurement that were set right, and are fitted
    besides its strengths within the errors that are left of them."""

    nuisances: Nuisances

    def in_steps(self, h: float, accurate: bool) -> Self:
        """The same for steps of h, s."""
        own = self.nuisances
        own = replace(own, base=own.base.in_steps(h, accurate))
        return replace(self, h=h, accurate=accurate, nuisances=own)

    def with_profile(self, profile: Profile, x: Array) -> JointSimulator:
        """The joint with its numbers but another profile."""
        return self.nuisances.with_profile(profile, x)


def corrected_base(base: BaseModel, loose: Mapping[str, float]) -> BaseModel:
    """A model whose numbers that were set right may be off by their errors; itself without such."""
    names = tuple(name for name in USUAL if name in loose)
    return with_numbers(Nuisances(base, names, tuple(map(loose.__getitem__, names))))


def with_numbers(own: Nuisances) -> BaseModel:
    """A model whose numbers are its strengths and these; itself without such."""
    base = own.base
    plain = base.profile, base.joint_model, base.h, base.places
    return CorrectedBase(*plain, own.unknowns, base.accurate, own) if own.names else base


def nuisances_of(measured: Measured, base: BaseModel) -> Nuisances:
    """The numbers of a joint and its runs that may be off, and that runs can tell.

    Those of a force only where one was recorded, those of gravity where there is some, the
    position's zero where a force depends on the position or an end of the range was near. None of
    joints among others that move, nor of those that an actuator drives: there the actuator's gain
    and delay are the base's own.
    """
    joint = measured.profile.joint
    usual = dict(USUAL)
    force = np.concatenate([run.force for run in measured.runs if run.forced] or [np.zeros(1)])
    mean, largest = float(np.sqrt(np.nanmean(force**2))), float(np.nanmax(np.abs(force)))
    usual["force_offset"] = min(
        max(usual["force_offset"] * mean, FULL_SCALE * largest), MAX_OFFSET * mean
    )
    usual["position_offset"] *= float(np.ptp(joint.range))
    weight = max(map(abs, measured.context.gravity_force))
    near_end = bool(zeros_at_ends(measured))
    shaped = any(len(set(part.y)) > 1 for part in measured.profile.channels.conservative.components)
    told: dict[NuisanceName, bool] = {
        "mass": bool(force.any()) and weight > 0,
        "inertia": True,
        "gravity": weight > 0,
        "center_of_mass": weight > 0 and joint.type == "hinge",
        "force_scale": bool(force.any()),
        "force_offset": bool(force.any()),
        "time_delay": bool(force.any()),
        "position_offset": (weight > 0 and joint.type == "hinge") or shaped or near_end,
    }
    if measured.joint_model.servo or any(run.among for run in measured.runs):
        told = dict.fromkeys(told, False)
    widths = {name: measured.trust.width(name, usual[name]) for name in told}
    names = tuple(name for name, there in told.items() if there and widths[name] > 0)
    return Nuisances(base, names, tuple(widths[name] for name in names))


def zeros_at_ends(measured: Measured) -> list[float]:
    """By how much a position's zero is off (rad or m) if an end of the range is where runs came
    nearest to it; none for an end that they did not come near."""
    lo, hi = measured.profile.joint.range
    first = min((float(run.position.min()) for run in measured.runs), default=np.inf)
    last = max((float(run.position.max()) for run in measured.runs), default=-np.inf)
    far = NEAR_END * (hi - lo)
    return [first - lo] * (first < lo + far) + [last - hi] * (last > hi - far)
