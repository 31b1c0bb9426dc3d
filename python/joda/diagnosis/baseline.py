"""The model as it is, with the strengths of its components as numbers to be fitted again."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from joda._core import Solo
from joda.diagnosis.cutting import windows_of
from joda.diagnosis.hypotheses import Hypothesis, Units
from joda.diagnosis.judge import Make, Unknowns
from joda.diagnosis.static import Still, curve_windows
from joda.diagnosis.windows import GRID, Windows
from joda.joints.single import Single
from joda.measured.reading import Measured
from joda.measured.trust import USUAL, Trust
from joda.profile import CHANNELS, Profile
from joda.scenes.actuators import Servo
from joda.scenes.native import DAMPING, FRICTION, SPRING

Array = NDArray[np.float64]

BASE_DOUBT = 0.15
"""How far off (one standard deviation, relative) the model's own strengths may be."""
DRIVEN_DOUBT = 3.0
"""The same of joints that an actuator drives, whose friction few models know."""
GAIN_AT_MOST, GAIN_DOUBT = 7.0, 0.7
"""Largest logarithm of the factor by which an actuator's gain may be off, and its doubt."""
HELD = 1e-6
"""Doubt of a number that is not there."""
DELAY_AT_MOST, DELAY_DOUBT = 0.1, 0.02
"""Longest delay of commands, and its doubt, s."""
FAR_AWAY = ((-4.0, -2.0, 10.0), (-2.0, -1.0, 3.0), (2.0, 1.0, 1.0))
"""Logarithms of gain and damping, and factors of friction, from which fits begin besides."""
SOFT = (0.02, 1.0)
"""MuJoCo's own `solreflimit`: time constant (s) and damping ratio of the ends of a range."""
BEYOND, STRAYS = 4.0, 3
"""So many noises outside its range a joint is beyond it; at most so many samples are by chance."""
SLOWEST = 0.02
"""Least speed that counts as a usual one, in ranges in the time of the longest run."""
LEAST = 4
"""Fewest samples of a window that counts."""
AT_END = 0.02
"""Of the range: what was measured as near to its end goes to the end."""


@dataclass(frozen=True)
class Base:
    """The model as it is, with numbers: a factor for each of its components' strengths, and of an
    actuator the logarithms of its gain's and its damping's factors and its delay (s). Where it
    damps, the joint's own damping has the same factor: no run tells one from the other.

    Attributes:
        profile: of the joint.
        single: the joint.
        h: step, s.
        places: channel and number of each component that has a factor.
        unknowns: the numbers, the factors first.
    """

    profile: Profile
    single: Single
    h: float
    places: tuple[tuple[str, int], ...]
    unknowns: Unknowns

    @property
    def count(self) -> int:
        """Of the numbers."""
        return len(self.unknowns.mean)

    def beginnings(self) -> list[Array]:
        """Numbers from which a fit may begin besides those of the model: of an actuator that is
        much stiffer or softer, beside a friction that is larger."""
        out = []
        for gain, drag, rubs in FAR_AWAY if self.single.servo else ():
            x = self.unknowns.mean.copy()
            x[: len(self.places)] = [rubs if name == "friction" else 1.0 for name, _ in self.places]
            x[len(self.places) : len(self.places) + 2] = gain, drag
            out.append(x)
        return out

    def own(self, x: Array) -> Single:
        """The joint but for its profile, with its actuator's numbers."""
        if (servo := self.single.servo) is None:
            return self.single
        gain, drag, delay = map(float, x[len(self.places) : self.count])
        return replace(self.single, servo=servo.changed(np.exp(gain), np.exp(drag), delay))

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
        shared = shared_damping(self.profile, self.single.servo)
        return own + [(place, float(np.exp(x[len(self.places) + 1]))) for place in shared]

    def coarser(self) -> "Base":
        """The same for `GRID` times longer steps."""
        return replace(self, h=GRID * self.h)

    def solo(self, x: Array) -> Solo:
        """The joint with its numbers."""
        return self.with_profile(self.written(x), x)

    def with_profile(self, profile: Profile, x: Array) -> Solo:
        """The joint with its numbers but another profile."""
        return self.own(x).stepped(self.h).solo(profile, self.h)


def base_of(profile: Profile, single: Single, h: float, trust: Trust = USUAL) -> Base:
    """The model as it is; `trust`: how far off its numbers may be."""
    shared = shared_damping(profile, single.servo)
    places = tuple(
        (name, number)
        for name in CHANNELS
        for number, part in enumerate(getattr(profile.channels, name).components)
        if any(part.y) and (name, number) not in shared
    )
    k = len(places)
    doubt, most = (BASE_DOUBT, 20.0) if single.servo is None else (DRIVEN_DOUBT, 100.0)
    doubts = np.array([_doubt(profile, place, trust, doubt) for place in places])
    unknowns = Unknowns(np.zeros(k), np.full(k, most), np.full(k, 0.01), np.ones(k), doubts)
    if single.servo is not None:
        unknowns = unknowns.and_(_of_servo(single.servo, trust))
    return Base(profile, single, h, places, unknowns)


def shared_damping(profile: Profile, servo: Servo | None) -> list[tuple[str, int]]:
    """Channel and number of the joint's own damping, where an actuator damps too."""
    if servo is None or not servo.damping > 0:
        return []
    parts = enumerate(profile.channels.damping.components)
    return [("damping", number) for number, part in parts if part.label == DAMPING]


def _doubt(profile: Profile, place: tuple[str, int], trust: Trust, usual: float) -> float:
    """How far off a component's strength may be: those of a profile as usual."""
    channel, number = place
    label = getattr(profile.channels, channel).components[number].label
    named = {DAMPING: "damping", FRICTION: "frictionloss", SPRING: "stiffness"}
    width = trust.width(named[label], usual) if label in named else usual
    return max(width, HELD)


def _of_servo(servo: Servo, trust: Trust) -> Unknowns:
    """Gain, damping and delay of an actuator, of which a model's are rarely right."""
    damps = trust.width("damping", GAIN_DOUBT) if servo.damping else HELD  # else only the joint's
    doubt = trust.width("actuator_gain", GAIN_DOUBT), damps, trust.width("time_delay", DELAY_DOUBT)
    return Unknowns(
        low=np.array([-GAIN_AT_MOST, -GAIN_AT_MOST, 0.0]),
        high=np.array([GAIN_AT_MOST, GAIN_AT_MOST, DELAY_AT_MOST]),
        step=np.array([0.01, 0.01, 2e-4]),
        mean=np.array([0.0, 0.0, servo.delay]),
        doubt=np.maximum(doubt, HELD),
    )


def joined(base: Base, hypothesis: Hypothesis) -> tuple[Make, Unknowns]:
    """The model's factors and the hypothesis' numbers as one vector."""
    n = base.count

    def make(x: Array) -> Solo:
        return base.with_profile(hypothesis.write(base.written(x), x[n:]), x)

    return make, base.unknowns.and_(hypothesis.unknowns)


def units_of(windows: Windows, measured: Measured) -> Units:
    """The joint's own units, from the measured motion."""
    profile, inertia = measured.profile, measured.single.inertia
    velocity = windows.start[:, 1]
    same = ~windows.fresh[1:]
    pace = np.diff(windows.at)[same] * windows.h
    acceleration = np.diff(velocity)[same] / pace
    longest = max((float(np.ptp(run.time)) for run in measured.runs), default=np.inf)
    slowest = SLOWEST * float(np.ptp(profile.joint.range)) / longest
    speed = max(float(np.sqrt(np.mean(velocity**2))), slowest)
    exerted = [float(np.mean(measured.exerted(run) ** 2)) for run in measured.runs]
    pushed = float(np.sqrt(np.mean(windows.force**2) + max(exerted, default=0.0)))
    force = max(pushed, inertia * float(np.sqrt(np.mean(acceleration**2))) if len(pace) else 0.0)
    friction = max((max(c.y) for c in profile.channels.friction.components), default=0.0)
    return Units(
        force=force or inertia,
        speed=speed or 1.0,
        inertia=inertia,
        span=float(np.ptp(profile.joint.range)),
        visited=_visited(windows, measured),
        friction=friction,
        forced=not measured.runs or any(run.pushed for run in measured.runs),
        weight=max(map(abs, measured.context.gravity_force)),
        hinge=measured.single.hinge,
    )


def _visited(windows: Windows, measured: Measured) -> tuple[float, float]:
    """Part of the range that was measured in windows that count: where a knock is, none does."""
    lo, hi = measured.profile.joint.range
    if measured.runs:
        rows = windows.rows[usable(windows)]
        positions = windows.position[rows[rows >= 0]]
    else:
        positions = np.concatenate([gauged.curve.position for gauged in measured.curves])
    if not len(positions):
        return 0.0, 1.0
    s = (positions - lo) / (hi - lo)
    first, last = float(s.min()), float(s.max())
    first, last = first if first > AT_END else 0.0, last if last < 1 - AT_END else 1.0
    return (first, last) if last - first > AT_END else (0.0, 1.0)


def windows_for(measured: Measured, length: float | None = None, fine: bool = True) -> Windows:
    """The runs in windows of some length (s), see `windows_of`; curves where there are no runs."""
    if not measured.runs:
        return curve_windows(measured)
    lo, hi = measured.profile.joint.range
    fixed = lo, measured.single.inertia, measured.timestep
    return windows_of(measured.runs, measured.sigma, hi - lo, *fixed, length, fine)


def single_for(measured: Measured, h: float) -> Single:
    """The joint, to be simulated in steps of h (s) where there are runs.

    MuJoCo's own ends of a range yield by more than an encoder's noise to what presses on them. They
    are hard here, unless somebody chose others or the measured ones yield too.
    """
    single = as_it_is(measured)
    if single.solref != SOFT or not measured.runs or _yields(measured):
        return single
    return replace(single, solref=(2 * h, 1.0))


def as_it_is(measured: Measured) -> Single:
    """The joint as its scene has it, with the plugin; where there are only curves it is not
    simulated."""
    single = measured.single.with_plugin
    return single if measured.runs else Still(**vars(single))


def _yields(measured: Measured) -> bool:
    """Whether the joint was beyond its range by more than noise."""
    beyond = (
        np.abs(run.position - np.clip(run.position, *measured.profile.joint.range)) / sigma
        for run, sigma in zip(measured.runs, measured.sigma, strict=True)
    )
    return sum(int(np.sum(noises > BEYOND)) for noises in beyond) > STRAYS


def usable(windows: Windows) -> NDArray[np.bool_]:
    """Which windows tell of the joint: enough samples, and neither a knock at an end of the range
    nor nothing but rest there."""
    return np.asarray((windows.count >= LEAST) & ~windows.knocks & ~windows.rests)
