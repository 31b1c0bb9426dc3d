"""Fits how large each component of a profile is, and where, before its shape is fitted.

A component that is five times too large, or off by a tenth of the range, leads a fit of its control
points astray: they are held near where they were, in units of what the component was. Sizes are few
and show in short segments; from several starts the fit finds them where one start would get stuck.
"""

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from joda.estimation.estimator import SegmentEstimator
from joda.estimation.profile_parameters import Kind, Parameters
from joda.profile import Profile
from joda.refining.shooting import Shooting

Array = NDArray[np.float64]

WEAKER = float(np.log(4))
"""How much smaller, as a logarithm, what resists or what drives is at the other starts."""
BY = 0.06
SHIFTS = ((0, 0), (BY, BY), (-BY, -BY), (-BY, BY), (BY, -BY))
"""How far the lower and the upper ends of all intervals are moved at the starts, in normalised
position."""
FAR = tuple(float(by) for by in np.linspace(-0.1, 0.1, 9))
"""How far either end is moved where it is sought from many places."""
ITERATIONS = 3
"""Iterations of sizes at each of these."""
MAX_STARTS = 6
"""From how many starts, those with the least loss, numbers are fitted."""
EDGE = 0.001
"""How near the ends of the range an end of an interval comes: one that is there stays there."""
NOISE = 1.1
"""Segments that are missed by less than so many times the noise leave nothing to look for."""


SIZES: tuple[Kind, ...] = ("sizes",)
PLACES: tuple[Kind, ...] = ("places",)
INTERVALS: tuple[Kind, ...] = ("intervals",)


def sized(
    shooting: Shooting,
    estimator: SegmentEstimator,
    iterations: int,
    report: Callable[[Parameters, float], None],
    wide: bool = False,
) -> None:
    """Fits sizes, then sizes and intervals together, each from several starts.

    Args:
        shooting: the joint and its runs; intervals are fitted if they are among its numbers.
        estimator: of short segments.
        iterations: at most so many from each start.
        report: after each start, the parameters about the best profile so far, and its RMS misfit
            in those segments, rad or m.
        wide: whether intervals are sought from many places around, all components weaker at first.
    """
    parameters, found = shooting.parameters, shooting.parameters.profile
    stages: list[tuple[Kind, ...]] = [] if wide else [SIZES]
    if any(slot.kind == "intervals" for slot in parameters.slots):
        stages += [SIZES + PLACES, SIZES + INTERVALS]
    own = parameters.about(parameters.profile, SIZES)
    begun, weak = (own.written(own.start - by, exact=True) for by in (0.0, WEAKER))
    for kinds in stages:
        if wide and kinds == SIZES + PLACES:
            far = [parameters.about(one, kinds) for one in _farther(shooting, estimator, weak)]
            starts = [(shooting.about(one), one.start) for one in far]
        else:  # sizes that were fitted elsewhere may lead nowhere
            bases = [found, begun, weak] if "places" in kinds else [found]
            starts = _starts(shooting, estimator, [parameters.about(one, kinds) for one in bases])
        least = np.inf
        for other, start in starts:
            x = other.fit_segments(estimator, start, other.parameters.prior_std, iterations)
            x = _inside(other.parameters, x)
            loss = _loss(estimator, other, x)
            if loss < least:
                least, misfit = loss, other.rms(estimator, x)
                found = other.parameters.written(x, exact=True)
            report(parameters.about(found), misfit)
            if misfit < NOISE * shooting.engine.sigma:
                return


def _starts(
    shooting: Shooting, estimator: SegmentEstimator, bases: Sequence[Parameters]
) -> list[tuple[Shooting, Array]]:
    """Where to begin: of what `_trials` has of each, the ones with the least loss."""
    trials = [(shooting.about(one), x) for one in bases for x in _trials(one)]
    if len(trials) > MAX_STARTS:
        trials.sort(key=lambda trial: _loss(estimator, *trial))
    return trials[:MAX_STARTS]


def _farther(shooting: Shooting, estimator: SegmentEstimator, weak: Profile) -> list[Profile]:
    """The profile with intervals elsewhere, a few iterations of its sizes at each place; those with
    the least loss."""
    placed = shooting.parameters.about(weak, PLACES)
    upper = np.array([slot.index == 1 for slot in placed.slots])
    found: list[tuple[float, Profile]] = []
    for low, high in product(FAR, FAR):
        place = _inside(placed, placed.start + np.where(upper, high, low))
        if _feasible(placed, place):
            own = placed.about(placed.written(place, exact=True), SIZES)
            sizes = shooting.about(own)
            x = sizes.fit_segments(estimator, own.start, own.prior_std, ITERATIONS)
            found.append((_loss(estimator, sizes, x), own.written(x, exact=True)))
    found.sort(key=lambda one: one[0])
    return [profile for _, profile in found[:MAX_STARTS]]


def _loss(estimator: SegmentEstimator, shooting: Shooting, x: Array) -> float:
    return estimator.started(shooting.simulator(x)).loss


def _feasible(parameters: Parameters, x: Array) -> bool:
    must = parameters.constraints
    return bool(np.all(must.G @ x >= must.h - 1e-9))


def _trials(parameters: Parameters) -> list[Array]:
    """The numbers as they are, and with some of it weaker or with the places elsewhere."""
    slots = parameters.slots
    if "intervals" in parameters.kinds:
        return [parameters.start]
    places = np.array([slot.kind == "places" for slot in slots])
    upper = np.array([slot.index == 1 for slot in slots])
    resists = np.array([slot.channel != "conservative" for slot in slots])
    if not places.any():
        every = np.ones(len(slots), bool)
        weaker = [~every, resists, ~resists, every]
        if not 0 < resists.sum() < len(slots):
            weaker = [~every, every]
        return [parameters.start - WEAKER * some for some in weaker]
    moved = [parameters.start + places * np.where(upper, high, low) for low, high in SHIFTS]
    inside = [_inside(parameters, start) for start in moved]
    return [start for start in inside if _feasible(parameters, start)]


def _inside(parameters: Parameters, x: Array) -> Array:
    places = np.array([slot.kind in ("places", "intervals") for slot in parameters.slots])
    return np.where(places, np.clip(x, EDGE, 1 - EDGE), x)
