"""The model as it is, with the strengths of its components as numbers to be fitted again."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from joda._core import JointSimulator
from joda.estimation.segments import GRID
from joda.estimation.unknowns import Unknowns
from joda.joints.joint_model import JointModel
from joda.measured.trust import USUAL, Trust
from joda.profile import CHANNELS, Profile
from joda.scenes.actuators import Servo
from joda.scenes.native import DAMPING, FRICTION, SPRING

Array = NDArray[np.float64]

BASE_STD = 0.15
"""How far off (one standard deviation, relative) the model's own strengths may be."""
DRIVEN_STD = 3.0
"""The same of joints that an actuator drives, whose friction few models know."""
MAX_GAIN, GAIN_STD = 7.0, 0.7
"""Largest logarithm of the factor by which an actuator's gain may be off, and its prior
standard deviation."""
HELD = 1e-6
"""Prior standard deviation of a number that is not there."""
MAX_DELAY, DELAY_STD = 0.1, 0.02
"""Longest delay of commands, and its prior standard deviation, s."""
FAR_AWAY = ((-4.0, -2.0, 10.0), (-2.0, -1.0, 3.0), (2.0, 1.0, 1.0))
"""Logarithms of gain and damping, and factors of friction, from which fits begin besides."""


@dataclass(frozen=True)
class BaseModel:
    """The model as it is, with numbers: a factor for each of its components' strengths, and of an
    actuator the logarithms of its gain's and its damping's factors and its delay (s). Where it
    damps, the joint's own damping has the same factor: no run tells one from the other.

    Attributes:
        profile: of the joint.
        joint_model: the joint.
        h: step, s.
        places: channel and number of each component that has a factor.
        unknowns: the numbers, the factors first.
        accurate: whether its steps stand for none; else they are MuJoCo's.
    """

    profile: Profile
    joint_model: JointModel
    h: float
    places: tuple[tuple[str, int], ...]
    unknowns: Unknowns
    accurate: bool

    @property
    def count(self) -> int:
        """Of the numbers."""
        return len(self.unknowns.mean)

    def beginnings(self) -> list[Array]:
        """Numbers from which a fit may begin besides those of the model: of an actuator that is
        much stiffer or softer, beside a friction that is larger."""
        out = []
        for gain, drag, rubs in FAR_AWAY if self.joint_model.servo else ():
            x = self.unknowns.mean.copy()
            x[: len(self.places)] = [rubs if name == "friction" else 1.0 for name, _ in self.places]
            x[len(self.places) : len(self.places) + 2] = gain, drag
            out.append(x)
        return out

    def own(self, x: Array) -> JointModel:
        """The joint but for its profile, with its actuator's numbers."""
        if (servo := self.joint_model.servo) is None:
            return self.joint_model
        gain, drag, delay = map(float, x[len(self.places) : self.count])
        return replace(self.joint_model, servo=servo.changed(np.exp(gain), np.exp(drag), delay))

    def written(self, x: Array) -> Profile:
        """The profile with its factors."""
        channels = {}
        for name in CHANNELS:
            channel = getattr(self.profile.channels, name)
            parts = list(channel.components)
            for (where, number), factor in self._factors(x):
                if where == name:
                    old = parts[number]
                    y = tuple(factor * value for value in old.y)
                    parts[number] = old.model_copy(update={"y": y})
            channels[name] = channel.model_copy(update={"components": tuple(parts)})
        return self.profile.model_copy(
            update={"channels": self.profile.channels.model_copy(update=channels)}
        )

    def _factors(self, x: Array) -> list[tuple[tuple[str, int], float]]:
        """Of each component that has one."""
        own = [(place, float(factor)) for place, factor in zip(self.places, x, strict=False)]
        shared = shared_damping(self.profile, self.joint_model.servo)
        return own + [(place, float(np.exp(x[len(self.places) + 1]))) for place in shared]

    def in_steps(self, h: float, accurate: bool) -> Self:
        """The same for steps of h, s."""
        return replace(self, h=h, accurate=accurate)

    def coarser(self) -> Self:
        """The same for `GRID` times longer steps."""
        return self.in_steps(GRID * self.h, self.accurate)

    def simulator(self, x: Array) -> JointSimulator:
        """The joint with its numbers."""
        return self.with_profile(self.written(x), x)

    def with_profile(self, profile: Profile, x: Array) -> JointSimulator:
        """The joint with its numbers but another profile."""
        return self.stepped(self.own(x)).simulator(profile, self.h)

    def stepped(self, joint_model: JointModel) -> JointModel:
        """A joint for its steps."""
        return joint_model.stepped(self.h) if self.accurate else joint_model


def base_of(
    profile: Profile,
    joint_model: JointModel,
    h: float,
    trust: Trust = USUAL,
    accurate: bool = True,
) -> BaseModel:
    """The model as it is; `trust`: how far off its numbers may be; the rest: see `BaseModel`."""
    shared = shared_damping(profile, joint_model.servo)
    places = tuple(
        (name, number)
        for name in CHANNELS
        for number, part in enumerate(getattr(profile.channels, name).components)
        if any(part.y) and (name, number) not in shared
    )
    k = len(places)
    prior_std, most = (BASE_STD, 20.0) if joint_model.servo is None else (DRIVEN_STD, 100.0)
    prior_stds = np.array([_prior_std(profile, place, trust, prior_std) for place in places])
    unknowns = Unknowns(np.zeros(k), np.full(k, most), np.full(k, 0.01), np.ones(k), prior_stds)
    if joint_model.servo is not None:
        unknowns = unknowns.and_(_of_servo(joint_model.servo, trust))
    return BaseModel(profile, joint_model, h, places, unknowns, accurate)


def shared_damping(profile: Profile, servo: Servo | None) -> list[tuple[str, int]]:
    """Channel and number of the joint's own damping, where an actuator damps too."""
    if servo is None or not servo.damping > 0:
        return []
    parts = enumerate(profile.channels.damping.components)
    return [("damping", number) for number, part in parts if part.label == DAMPING]


def _prior_std(profile: Profile, place: tuple[str, int], trust: Trust, usual: float) -> float:
    """How far off a component's strength may be: those of a profile as usual."""
    channel, number = place
    label = getattr(profile.channels, channel).components[number].label
    named = {DAMPING: "damping", FRICTION: "frictionloss", SPRING: "stiffness"}
    width = trust.width(named[label], usual) if label in named else usual
    return max(width, HELD)


def _of_servo(servo: Servo, trust: Trust) -> Unknowns:
    """Gain, damping and delay of an actuator, of which a model's are rarely right."""
    damps = trust.width("damping", GAIN_STD) if servo.damping else HELD  # else only the joint's
    prior_std = (
        trust.width("actuator_gain", GAIN_STD),
        damps,
        trust.width("time_delay", DELAY_STD),
    )
    return Unknowns(
        low=np.array([-MAX_GAIN, -MAX_GAIN, 0.0]),
        high=np.array([MAX_GAIN, MAX_GAIN, MAX_DELAY]),
        step=np.array([0.01, 0.01, 2e-4]),
        mean=np.array([0.0, 0.0, servo.delay]),
        prior_std=np.maximum(prior_std, HELD),
    )
