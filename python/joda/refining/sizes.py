"""Fits how large each component of a profile is, and where, before its shape is fitted.

A component that is five times too large, or off by a tenth of the range, leads a fit of its control
points astray: they are held near where they were, in units of what the component was. Sizes are few
and show in short segments; from several starts the fit finds them where one start would get stuck.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from joda.estimation.estimator import SegmentEstimator
from joda.estimation.profile_parameters import Kind, Parameters
from joda.refining.shooting import Shooting

Array = NDArray[np.float64]

WEAKER = float(np.log(4))
"""How much smaller, as a logarithm, what resists or what drives is at the other starts."""
BY = 0.06
SHIFTS = ((0, 0), (BY, BY), (-BY, -BY), (-BY, BY), (BY, -BY))
"""How far the lower and the upper ends of all intervals are moved at the starts, in normalised
position."""
MOST = 6
"""From how many starts, those with the least loss, numbers are fitted."""
EDGE = 0.001
"""How near the ends of the range an end of an interval comes: one that is there stays there."""
NOISE = 1.1
"""Segments that are missed by less than so many times the noise leave nothing to look for."""


def sized(
    shooting: Shooting,
    estimator: SegmentEstimator,
    iterations: int,
    report: Callable[[Parameters, float], None],
) -> None:
    """Fits sizes, then sizes and intervals together, each from several starts.

    Args:
        shooting: the joint and its runs; intervals are fitted if they are among its numbers.
        estimator: of short segments.
        iterations: at most so many from each start.
        report: after each start, the parameters about the best profile so far, and its RMS misfit
            in those segments, rad or m.
    """
    parameters, found = shooting.parameters, shooting.parameters.profile
    stages: list[tuple[Kind, ...]] = [("sizes",)]
    if any(slot.kind == "intervals" for slot in parameters.slots):
        stages += [("sizes", "places"), ("sizes", "intervals")]
    for kinds in stages:
        bases = [found]
        if "places" in kinds:  # sizes that were fitted elsewhere may lead nowhere
            own = parameters.about(parameters.profile, stages[0])
            bases += [own.written(own.start - by, exact=True) for by in (0.0, WEAKER)]
        starts = _starts(shooting, estimator, [parameters.about(base, kinds) for base in bases])
        least = np.inf
        for other, start in starts:
            x = other.fit_windows(estimator, start, other.parameters.prior_std, iterations)
            x = _inside(other.parameters, x)
            loss = estimator.started(other.mover(x)).loss
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
    if len(trials) > MOST:
        trials.sort(key=lambda trial: estimator.started(trial[0].mover(trial[1])).loss)
    return trials[:MOST]


def _trials(parameters: Parameters) -> list[Array]:
    """The numbers as they are, and with some of it weaker or with the places elsewhere."""
    slots, must = parameters.slots, parameters.constraints
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
    return [start for start in inside if np.all(must.G @ start >= must.h - 1e-9)]


def _inside(parameters: Parameters, x: Array) -> Array:
    places = np.array([slot.kind in ("places", "intervals") for slot in parameters.slots])
    return np.where(places, np.clip(x, EDGE, 1 - EDGE), x)
