"""The restitution of the ends of the range, by the segments with impacts: no others tell of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.hypotheses import Hypothesis
from joda.diagnosis.settings import SETTINGS
from joda.estimation.base_model import BaseModel
from joda.estimation.estimator import SegmentEstimator
from joda.estimation.segments import Segments
from joda.joints.joint_model import JointModel
from joda.measured.runs import CLEAR
from joda.profile import Channels, Profile
from joda.scenes.limits import IMPACT_STEPS, IMPEDANCE, Stops, rebounding

IMPACTS = SETTINGS.impacts

Array = NDArray[np.float64]

MAX_SEGMENTS = 24
"""Segments with impacts at an end from which on only some are looked at."""
RATIOS = np.linspace(0.2, 0.95, 11)
"""Restitutions that are tried."""
MIN_RATIOS = 3
"""Restitutions between which the best one is told, at the least."""
SHORTEST, TIMES = 6, 8
"""Steps that an impact lasts at the least without damping, and how many durations are tried."""
IMPACT_SAMPLES = 5
"""Samples before and after an impact that tell its speeds."""
IMPACT_TIME = 0.6
"""In which a joint goes through its range towards an impact, s."""


def best_ratio(
    whole: "Rebound", segments: Segments, base: BaseModel, ends: Sequence[int]
) -> tuple[float, float]:
    """The restitution of one end or of both, and its standard error.

    What suits the impacts best is jagged where stops are hard, and the speeds before and after them
    are changed by a force: where none acted, the mean of both is nearer.
    """
    seen = speed_ratios(segments, base, ends)
    if len(seen) < IMPACTS.min_impacts:
        return whole.ratio, whole.error
    speeds = mean_of(seen)[0]
    ratio = whole.ratio if segments.pushed else (whole.ratio + speeds) / 2
    return ratio, float(np.hypot(whole.error, (whole.ratio - speeds) / 2))


@dataclass(frozen=True)
class Rebound:
    """How well stops of some restitutions suit the impacts at an end.

    Attributes:
        ratios: of the speed after an impact to that before it, rising, shape (n,).
        losses: of the segments with each of them, shape (n,).
        own: loss with the model's own restitution, or one that is not clearly larger.
        samples: how many there are.
    """

    ratios: Array
    losses: Array
    own: float
    samples: float

    @classmethod
    def together(cls, ends: Sequence["Rebound"]) -> "Rebound":
        """Of ends that have the same restitution."""
        ratios = np.unique(np.concatenate([end.ratios for end in ends]))
        losses = sum(np.interp(ratios, end.ratios, end.losses) for end in ends)
        own, samples = sum(end.own for end in ends), sum(end.samples for end in ends)
        return cls(ratios, np.asarray(losses), own, samples)

    @property
    def gain(self) -> float:
        """In loss, by the best restitution."""
        return self.own - float(self.losses.min())

    @property
    def clearly_larger(self) -> bool:
        """Whether a restitution that is larger than the model's is clearly better."""
        return self.gain > max(IMPACTS.min_gain, IMPACTS.min_share * self.own)

    def may_be(self, ratio: float) -> bool:
        """Whether a restitution is not clearly worse than the best one, or the model's."""
        loss = float(np.interp(ratio, self.ratios, self.losses))
        least = min(self.own, float(self.losses.min()))
        return loss - least < max(IMPACTS.min_gain, IMPACTS.min_share * least)

    @property
    def ratio(self) -> float:
        """The best restitution, between those that were tried."""
        return self._parabola[0]

    @property
    def error(self) -> float:
        """Its standard error, with what the best one leaves as noise."""
        return self._parabola[1]

    @property
    def _parabola(self) -> tuple[float, float]:
        """Where the least one through the three losses about the best is, and its error."""
        k = int(np.clip(np.argmin(self.losses), 1, len(self.ratios) - 2))
        e, loss = self.ratios[k - 1 : k + 2], self.losses[k - 1 : k + 2]
        curvature, slope, _ = np.polyfit(e - e[1], loss, 2)
        noise = max(float(self.losses.min()) / max(self.samples, 1.0), 1.0)
        if curvature <= 0:
            return float(self.ratios[np.argmin(self.losses)]), float(e[2] - e[0])
        best = e[1] - slope / curvature / 2
        return float(np.clip(best, e[0], e[2])), float(np.sqrt(noise / curvature))


@dataclass(frozen=True)
class Impacts:
    """The segments with impacts at an end.

    How long and how deep an impact is tells of the stop's stiffness, which is another matter: every
    restitution is tried with the stiffness that suits it best.

    Attributes:
        estimator: of these segments alone.
        given: the joint with the model's own ends.
        own: the model's restitution there.
        times: that impacts may last without damping, s.
        ratios: restitutions that are tried.
    """

    estimator: SegmentEstimator
    given: JointModel
    own: float
    times: Array
    ratios: Array

    def rebound(self, profile: Profile) -> Rebound:
        """How well restitutions suit the impacts of a joint with a profile."""
        alike = (
            self._best(ratio, profile) for ratio in (self.own, self.own + IMPACTS.min_restitution)
        )
        own = min(self._loss(self.given, profile), *alike)
        losses = np.array([self._best(ratio, profile) for ratio in self.ratios])
        return Rebound(self.ratios, losses, own, self.estimator.samples)

    def _best(self, ratio: float, profile: Profile) -> float:
        """Loss with a restitution, and the stiffness that suits it best."""
        return min(self._loss(stopped(self.given, ratio, t), profile) for t in self.times)

    def _loss(self, joint_model: JointModel, profile: Profile) -> float:
        return self.estimator.started(
            joint_model.simulator(profile, self.estimator.segments.h)
        ).loss


def impacts_at(segments: Segments, base: BaseModel, given: JointModel) -> dict[int, Impacts]:
    """Of each end that has impacts, -1 low and 1 high, some of them, evenly spread.

    None of ends that throw back so much in the model that hardly more can be tried, nor of such
    that the speeds around impacts tell to be no bouncier: what else is wrong, or falls between two
    samples, makes a bouncier end fit better all the same.
    """
    sides, own, shortest = impact_sides(segments, base), rebound(base, given), SHORTEST * base.h
    times = np.geomspace(shortest, max(2 * segments.length, 2 * shortest), TIMES)
    out = {}
    for side in (-1, 1):
        numbers = np.flatnonzero(sides == side)
        if not len(numbers):
            continue
        ratios = RATIOS
        if len(seen := speed_ratios(segments, base, [side])):
            mean, error = mean_of(seen)
            if mean + error < own + IMPACTS.min_restitution:
                continue
            ratios = np.append(RATIOS, mean)
        tried = np.unique(ratios[(ratios > own + IMPACTS.min_restitution) & (ratios <= RATIOS[-1])])
        if len(tried) < MIN_RATIOS:
            continue
        out[side] = Impacts(some_of(segments, numbers), given, own, times, tried)
    return out


def some_of(segments: Segments, numbers: NDArray[np.intp]) -> SegmentEstimator:
    """Of the segments with these numbers, or of `MAX_SEGMENTS` of them at most, evenly spread."""
    kept = np.isin(np.arange(len(segments.at)), numbers[:: len(numbers) // MAX_SEGMENTS + 1])
    return SegmentEstimator(segments.only(kept), np.ones(int(kept.sum()), bool))


def stopped(joint_model: JointModel, ratio: float, time: float) -> JointModel:
    """The joint with ends of a restitution, at which an impact without damping lasts a time (s)."""
    solimp = IMPEDANCE, IMPEDANCE, *joint_model.solimp[2:]
    return joint_model.stopped(Stops(rebounding(ratio, time / IMPACT_STEPS), solimp))


def ends_of(hypothesis: Hypothesis) -> list[int]:
    """Which ends it is of: -1 the low one, 1 the high one."""
    first, last = hypothesis.interval(hypothesis.trials[0])
    return [side for side, there in ((-1, first <= 0.0), (1, last >= 1.0)) if there]


def impact_sides(segments: Segments, base: BaseModel) -> NDArray[np.intp]:
    """At which end each segment has an impact: -1 low, 1 high, 0 none; shape (m,)."""
    middle = float(np.mean(base.profile.joint.range))
    told = segments.impacts & segments.long_enough
    out = np.zeros(len(told), np.intp)
    for k in np.flatnonzero(told):
        row = segments.rows[k]
        position = segments.position[row[row >= 0]] - middle
        out[k] = np.sign(position[np.argmax(np.abs(position))])
    return out


def mean_of(measured: Array) -> tuple[float, float]:
    """Mean restitution of impacts and its standard error, by their errors or their scatter."""
    ratio, error = measured.T
    weight = error**-2.0
    mean = float(weight @ ratio / weight.sum())
    free = max(len(ratio) - 1, 1)
    scatter = float(np.sqrt(weight @ (ratio - mean) ** 2 / weight.sum() / free))
    return mean, max(scatter, float(weight.sum() ** -0.5))


def speed_ratios(segments: Segments, base: BaseModel, ends: Sequence[int]) -> Array:
    """Of the first impact in each segment: speed after per speed before, and its standard error.

    The speeds are those of lines through the samples before the joint is at the end, and after it
    has left it, and what the recorded force made of them until and since the middle of the impact.

    Returns:
        shape (impacts, 2); impacts without enough samples before or after tell none.
    """
    lo, hi = base.profile.joint.range
    out = []
    sides = impact_sides(segments, base)
    for k in np.flatnonzero(np.isin(sides, ends)):
        row = segments.rows[k]
        own = row[row >= 0]
        near = (
            max(own[0] - IMPACT_SAMPLES, 0),
            min(own[-1] + 1 + 2 * IMPACT_SAMPLES, len(segments.time)),
        )
        t, y = segments.time[slice(*near)], segments.position[slice(*near)]
        pushed = segments.force[segments.step[slice(*near)]] / base.joint_model.inertia
        noise = 1 / float(segments.sharpness[k, 0])
        away = hi - y if sides[k] > 0 else y - lo
        inside = away > CLEAR * noise
        if inside.all():  # the impact is between two samples
            inside[np.argmin(away)] = False
        first = int(np.argmin(inside))  # at the end
        back = first + int(np.argmax(inside[first:]))  # off it again
        parts = slice(first - IMPACT_SAMPLES, first), slice(back, back + IMPACT_SAMPLES)
        if first < IMPACT_SAMPLES or back == first or back + IMPACT_SAMPLES > len(t):
            continue
        if not inside[parts[1]].all() or (np.diff(t[parts[0].start : parts[1].stop]) <= 0).any():
            continue  # it hops there, or another run begins
        (before, off), (after, off_after) = (_slope(t[part], y[part]) for part in parts)
        middle = (t[first - 1] + t[back]) / 2
        before, after = (
            speed + float(np.mean(pushed[part])) * (middle - float(np.mean(t[part])))
            for speed, part in zip((before, after), parts, strict=True)
        )
        if before * sides[k] > 0:
            ratio = -after / before
            out.append((ratio, noise * np.hypot(off_after, ratio * off) / abs(before)))
    return np.array(out).reshape(-1, 2)


def _slope(t: Array, y: Array) -> tuple[float, float]:
    """Of a line through samples, and its standard error for noise of 1."""
    t = t - t.mean()
    square = float(t @ t)
    return float(t @ y) / square, square**-0.5


def rebound(base: BaseModel, given: JointModel) -> float:
    """Speed after an impact, per speed before, of the model with its own ends."""
    profile = base.profile.model_copy(update={"channels": Channels()})
    lo, hi = profile.joint.range
    steps, speed = round(IMPACT_TIME / base.h), (hi - lo) / IMPACT_TIME
    start = np.array([[hi - 0.2 * (hi - lo), speed]])
    begin = np.zeros(1, np.int64)
    simulator = replace(given, weight=(0.0, 0.0), servo=None).simulator(profile, base.h)
    before, after = simulator.replay(np.zeros(steps), begin, start, np.ones(1, bool), base.h)
    return float((before[-1] - after[-1]) / base.h / speed)
