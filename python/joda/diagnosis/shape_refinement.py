"""Fits all numbers of a profile, with as many control points of an effect as the data support.

First it has those of its template; then control points are added halfway between. What rises keeps
rising, what falls falling, so that a magnet stays a magnet. Segments of the runs grow longer, as
what is right in short ones is a good start for longer ones.
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise

import numpy as np
from numpy.typing import NDArray

from joda._core import JointSimulator
from joda.component import Component, Curve
from joda.diagnosis.departures import EFFECTS, ChangedPart
from joda.diagnosis.hypothesis_fits import usual
from joda.diagnosis.settings import SETTINGS
from joda.effects import EndStopRestitution
from joda.estimation.estimator import CAUCHY_SCALE, SegmentEstimator
from joda.estimation.problem import as_it_is, segments_for
from joda.estimation.profile_parameters import NARROWEST, Kind, Parameters, Slot
from joda.estimation.profile_parameters import PRIOR_STD as USUAL
from joda.estimation.segments import Segments
from joda.estimation.unknowns import Unknowns
from joda.field import evaluate
from joda.measured.measured_joint import Measured
from joda.profile import CHANNELS, Channel, Channels, Profile

ADDING = SETTINGS.adding

Array = NDArray[np.float64]

LONGER = (1 / 3, 1.0, 3.0)
"""Lengths of segments, in units of the diagnosis' own."""
LAST, LONGEST = (3.0, 9.0, 27.0), 1.5
"""Those of the last fits, of the likeliest profile; and the longest, in which profiles are compared
too, s."""
FINER = 2
"""How often control points are doubled."""
FACTORS, LEAPS = (0.5, 0.7, 1.4, 2.0), 3
"""By what one size is changed at a time, and how often at most."""
ROUNDS = 6
"""Iterations with each length, while segments that are far off count, and after."""
NUDGE = 0.004
"""Step of a number for differences, in its own unit."""
HELD = 1e-3
"""Part of a number's prior standard deviation that is left to one that is held."""
VANISHED = 1e3
"""How many times a curve its law is, from which on a fit has made next to nothing of it."""
EFFECT, NATIVE, LITTLE = 1.0, 0.2, 0.1
"""By what part of it an effect's curve may be more or less off its law at one end than at the
other, one standard deviation; the model's own off what they were given as; and what part of its
largest value counts as so much at the least."""


class Likelihood:
    """Of measured runs, as MuJoCo would move the joint at the scene's own step, or of curves."""

    def __init__(
        self, measured: Measured, with_impacts: bool = False, moved_by: Profile | None = None
    ) -> None:
        """Cuts the runs into segments.

        Args:
            measured: the joint and its runs or curves.
            with_impacts: whether segments count that tell of an end of the range alone; so they do
                where there are no others.
            moved_by: profile with which the joint can be followed to the end of each segment; None:
                its own.
        """
        followed = measured.changed(moved_by or measured.profile)
        self.joint_model = as_it_is(measured)
        self.segments = segments_for(followed, LONGEST, fine=False)
        self.estimator = SegmentEstimator(
            self.segments, _counted(self.segments, with_impacts or not self.segments.usable.any())
        )
        self.given = measured.profile
        self.own = replace(self.joint_model, friction_row=measured.joint_model.friction_row)

    def loss(self, profile: Profile) -> float:
        """Twice the negative log-likelihood, robustly: a segment that is missed altogether, as the
        joint goes over a barrier or just not, counts little."""
        joint_model = self.own if profile is self.given else self.joint_model
        return self.estimator.started(joint_model.simulator(profile, self.segments.h)).loss


@dataclass(frozen=True)
class Tried:
    """A profile that was tried.

    Attributes:
        profile: the whole one (`joda.scenes.native`).
        unseen: its loss on runs held out of the fit.
        score: its loss on all runs, and the price of its control points.
    """

    profile: Profile
    unseen: float
    score: float


class Trials:
    """Scores profiles of a joint."""

    def __init__(
        self,
        train: Measured,
        held: Measured,
        with_impacts: bool = False,
        moved_by: Profile | None = None,
    ) -> None:
        """Args: the joint and runs to fit; the same with runs held out; see `Likelihood`."""
        self.train = train
        with_impacts = with_impacts or has_restitution(train.profile)
        self.seen, self.unseen = (Likelihood(one, with_impacts, moved_by) for one in (train, held))
        longer = LONGER if train.runs else (1.0,)  # curves' segments are all alike
        usual_length = segments_for(train).length
        self.lengths = [factor * usual_length for factor in longer]
        most = max(LONGEST, self.lengths[-1])
        self.last = sorted({min(factor * usual_length, most) for factor in LAST if train.runs})

    def tried(self, profile: Profile) -> Tried:
        """A profile, scored."""
        loss = self.unseen.loss(profile)
        price = ADDING.control_point * sum(len(part.x) for part in _parts(profile))
        return Tried(profile, loss, self.seen.loss(profile) + loss + price)

    def refined_shapes(
        self, profile: Profile, effect: str, progress: Callable[[str], None]
    ) -> list[Tried]:
        """A profile, and what fits of all its numbers make of it.

        Args:
            profile: to be fitted.
            effect: label of the components that may get more control points.
            progress: what is being done.
        """
        found = self._leaps(self.tried(profile), progress)
        profile = law = found[-1].profile
        for finer in range(FINER + 1):
            profile = resolved(profile, effect) if finer else profile
            points = sum(len(part.x) for part in _parts(profile) if part.label == effect)
            if finer and not points:
                break
            what = f"all numbers, {points} control points of the effect"
            found += self._fits(profile, self.lengths, progress, what, law=law)
            profile = found[-1].profile
        found += self._leaps(likeliest(found), progress)
        what = "all numbers once more"
        return found + self._fits(likeliest(found).profile, self.last, progress, what, law=law)

    def holding(
        self, profile: Profile, parts: Collection[ChangedPart], progress: Callable[[str], None]
    ) -> list[Tried]:
        """What fits of all other numbers make of a profile, while some parts stay as they are.

        Args:
            profile: to be fitted.
            parts: that stay.
            progress: what is being done.
        """
        return self._fits(
            profile, self.lengths, progress, "the same, nearer to what was given", parts
        )

    def _fits(
        self,
        profile: Profile,
        lengths: Sequence[float],
        progress: Callable[[str], None],
        what: str,
        parts: Collection[ChangedPart] = (),
        law: Profile | None = None,
    ) -> list[Tried]:
        """Fits in longer and longer segments, each from what the one before found."""
        found = []
        for length in lengths:
            progress(what + (f", segments of {length:.2g} s" if self.train.runs else ""))
            profile = refitted(self.train, profile, length, parts, law)
            found.append(self.tried(profile))
        return found

    def _leaps(self, best: Tried, progress: Callable[[str], None]) -> list[Tried]:
        """A profile, and better and better ones, each with one size much more or less: where runs
        go over a barrier, or up to a stop, or just not, no fit gets there step by step."""
        found = [best]
        for _ in range(LEAPS):
            progress("sizes that fits do not reach")
            leapt = likeliest([found[-1], *map(self.tried, self._resized(found[-1].profile))])
            if leapt.score > found[-1].score - ADDING.factor_gain:
                break
            found.append(leapt)
        return found

    def _resized(self, profile: Profile) -> Iterator[Profile]:
        """The profile with one size much more or less, of a curve all of it."""
        kinds: tuple[Kind, ...] = ("sizes", "effects")
        parameters = Parameters(checked(profile), kinds, inertia=self.train.joint_model.inertia)
        must = parameters.constraints
        alike = groupby(
            range(len(parameters.slots)), lambda k: replace(parameters.slots[k], index=0)
        )
        for slot, numbers in alike:
            k = list(numbers)
            for factor in FACTORS:
                theta = parameters.start.copy()
                theta[k] = np.log(factor) if slot.kind == "sizes" else factor * theta[k]
                if np.all(must.G @ theta >= must.h):
                    yield parameters.written(theta)


def clearly(loss: float, than: float) -> bool:
    """Whether a loss is less by enough not to be by chance."""
    return loss < min(ADDING.max_segment_error * than, than - ADDING.likelier)


def likeliest(found: Sequence[Tried]) -> Tried:
    """The one with the least score."""
    return min(found, key=lambda one: one.score)


def _parts(profile: Profile) -> list[Component]:
    channels = (getattr(profile.channels, name) for name in CHANNELS)
    return [part for channel in channels for part in channel.components]


def resolved(profile: Profile, effect: str | None = None) -> Profile:
    """The same curves, nearly, of an effect or of all, with a control point halfway between each
    two that are not close."""
    channels = {}
    for name in CHANNELS:
        channel = getattr(profile.channels, name)
        parts = tuple(
            _finer(part) if effect in (None, part.label) else part for part in channel.components
        )
        channels[name] = channel.model_copy(update={"components": parts})
    return profile.model_copy(update={"channels": Channels(**channels)})


def _finer(part: Component) -> Component:
    """Where control points are close, as in a steep edge, runs tell none between them."""
    x, (a, b) = np.array(part.x), part.interval
    wide = np.diff(x) * (b - a) >= 2 * NARROWEST
    halves = ((x[1:] + x[:-1]) / 2)[wide]
    between = evaluate(Channel(components=(part,)), a + (b - a) * halves)[0]
    order = np.argsort(at := np.append(x, halves))
    y = np.append(part.y, between)[order]
    return part.model_copy(update={"x": tuple(map(float, at[order])), "y": tuple(map(float, y))})


def checked(profile: Profile) -> Profile:
    """The profile, validated as one from a file."""
    return Profile.model_validate(profile.model_dump(exclude={"schema_version"}))


def refitted(
    train: Measured,
    profile: Profile,
    length: float,
    parts: Collection[ChangedPart] = (),
    law: Profile | None = None,
) -> Profile:
    """All numbers of a profile fitted, near where they were.

    Args:
        train: measured.
        profile: its shapes are kept.
        length: of segments, s; shorter where the joint with this profile runs away.
        parts: whose numbers stay as they are.
        law: the same curves, of fewer numbers: where no run was they are off it as much as beside.
            None: the profile's.
    """
    segments = segments_for(train.changed(profile), length, fine=False)  # at the scene's own step
    estimator = SegmentEstimator(segments, _counted(segments, has_restitution(profile)))
    if not estimator.counts.any():
        return profile
    kinds: tuple[Kind, ...] = ("values", "intervals", "effects")
    inertia = train.joint_model.inertia
    parameters = Parameters(checked(profile), kinds, inertia=inertia)
    n = len(parameters.start)
    if not n:
        return profile
    unbounded = np.full(n, np.inf)
    mean, prior_std = _known(parameters, train.profile, law or profile)
    held = _held(parameters, parts)
    mean, prior_std = np.where(held, parameters.start, mean), np.where(held, HELD, 1.0) * prior_std
    unknowns = Unknowns(
        -unbounded,
        unbounded,
        np.full(n, NUDGE),
        mean,
        prior_std,
        parameters.constraints,
        rough=_walks(parameters, train.profile, mean),
    )
    joint_model, h = as_it_is(train), segments.h

    def make(theta: Array) -> JointSimulator:
        return joint_model.simulator(parameters.written(theta, exact=True), h)

    fit = estimator.fit(make, unknowns, parameters.start, iterations=0)
    for cauchy_scale in (CAUCHY_SCALE * usual(estimator, fit), CAUCHY_SCALE):
        fit = estimator.fit(make, unknowns, fit.x, fit.start, ROUNDS, cauchy_scale)
    return parameters.written(estimator.refit(make, unknowns, fit, ROUNDS).x)


def has_restitution(profile: Profile) -> bool:
    """Whether it says the restitution of an end."""
    return any(isinstance(effect, EndStopRestitution) for effect in profile.effects)


def _counted(segments: Segments, with_impacts: bool) -> NDArray[np.bool_]:
    """Which segments count: without impacts and rests at the ends, unless `with_impacts`."""
    return segments.long_enough if with_impacts else segments.usable


def _known(parameters: Parameters, given: Profile, law: Profile) -> tuple[Array, Array]:
    """What is known of the numbers before the data, and how well.

    Control points of the model as it was given are near what they are there, however often all is
    fitted: else its friction and damping stand in for what is still missing. Those of an effect are
    near its law. One of which a fit has made next to nothing stays so.
    """
    mean, prior_std = parameters.start.copy(), parameters.prior_std.copy()
    for k, (slot, scale) in enumerate(zip(parameters.slots, parameters.scales, strict=True)):
        if (own := _curve(parameters.profile, slot)) is None:
            continue
        there = _curve(given, slot)
        before = there or _curve(law, slot) or own
        size = np.abs(before.y).max() / scale
        if there is None and 0 < size < VANISHED:
            mean[k] = _value(before, own.x[slot.index]) / scale
            prior_std[k] *= size * np.sqrt(len(own.x))  # all together as well known as one number
        elif there is not None and any(there.y) and len(there.y) == len(own.y):
            mean[k] = there.y[slot.index] / scale
            prior_std[k] *= ADDING.model_error * size / USUAL["values"]
    return mean, prior_std


def _walks(parameters: Parameters, given: Profile, law: Array) -> Array:
    """How alike neighbouring control points of a curve are off what is known of them, shape (r, n):
    differences in standard deviations of a random walk along it (Brownian motion, whose most likely
    path is a spline: Wahba 1978). So where no run was a curve is as much off its law as beside."""
    rows = []
    usual = np.maximum(np.abs(law), LITTLE)
    for k, (slot, after) in enumerate(pairwise(parameters.slots)):
        own = _curve(parameters.profile, slot)
        if own is None or replace(slot, index=after.index) != after:
            continue
        far = abs(own.x[after.index] - own.x[slot.index])
        std = (EFFECT if _curve(given, slot) is None else NATIVE) * np.sqrt(far)
        row = np.zeros(len(parameters.slots))
        row[[k, k + 1]] = np.array((-1, 1)) / (std * usual[[k, k + 1]])
        rows.append(row)
    return np.array(rows).reshape(-1, len(parameters.slots))


def _curve(profile: Profile, slot: Slot) -> Curve | None:
    """The curve that a number is a control point of; None if it is of none, or there is no such."""
    if slot.kind == "values":
        curves: Sequence[object] = getattr(profile.channels, slot.channel).components
    else:
        curves = profile.effects if slot.key == "y" else ()
    own = curves[slot.component] if slot.component < len(curves) else None
    return own if isinstance(own, Curve) else None


def _value(curve: Curve, x: float) -> float:
    """Of a curve in its own coordinate."""
    part = Component(interval=(0.0, 1.0), x=curve.x, y=curve.y)
    return float(evaluate(Channel(components=(part,)), np.array([x]))[0][0])


def _held(parameters: Parameters, parts: Collection[ChangedPart]) -> NDArray[np.bool_]:
    """Which numbers are of some parts of the profile, shape (n,)."""
    there = {(part.where, part.what) for part in parts}
    keys = [one.key for one in parameters.profile.effects]
    own = [
        (EFFECTS, keys[slot.component])
        if slot.kind == "effects"
        else (slot.channel, slot.component)
        for slot in parameters.slots
    ]
    return np.array([one in there for one in own], bool)
