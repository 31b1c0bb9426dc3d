"""Whole runs of a model with its own strengths fitted: how much they are missed by, and why."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.asking import Asked
from joda.diagnosis.knocks import CLEAR
from joda.measured.misfit import rms
from joda.measured.reading import Measured
from joda.measured.replay import Replayer
from joda.measured.runs import Run

Array = NDArray[np.float64]

BEYOND = 5.0
"""How many times what errors explain of it a model that is adequate may miss a whole run by."""
TRAVELLED = 0.3
"""Part of a run's travel that must lie before it meets an end, for that to tell of the joint."""
DRAWS = 8
"""Strengths that are drawn, to tell how far their errors move a run."""


@dataclass(frozen=True)
class Worst:
    """By how many times what errors explain of it the worst whole run is missed.

    Errors of positions, of the start, of the recorded force and of the fitted strengths. A run that
    is missed by no more than `BEYOND` noises is told in those.

    Attributes:
        free: of runs up to where the joint meets an end of its range: after that the stop decides
            too, not only a law of the joint. Of all of them if it meets one soon in every run.
        whole: of all of the runs.
    """

    free: float
    whole: float


def worst(measured: Measured, asked: Asked) -> Worst:
    """How far a model is off the whole runs.

    Args:
        measured: the joint and its runs.
        asked: the model fitted to them.
    """

    row = asked.base.single.friction_row
    single = replace(measured.single, friction_row=row)

    def with_(strengths: Array) -> Replayer:
        return measured.changed(asked.base.written(strengths), single=single).replayer

    @cache  # only a run that is missed by much asks for them
    def others() -> list[Replayer]:
        return list(map(with_, _drawn(asked)))

    replayer = with_(asked.fit.x)

    def times(part: Run, sigma: float) -> float:
        if not (start := replayer.start(part, sigma)):
            return 0.0
        path = replayer.whole(part, start)
        there = ~np.isnan(path)
        missed = rms(path[there] - part.position[there]) / sigma
        if missed <= BEYOND:
            return missed
        moved = [other.whole(part, start)[there] - path[there] for other in others()]
        apart = rms(np.concatenate(moved)) if moved else 0.0
        spread = [sigma, replayer.scatter(part, start), apart]
        return missed * sigma / float(np.linalg.norm(spread))

    told, whole = [], 0.0
    for run, sigma in zip(measured.runs, measured.sigma, strict=True):
        part = _free(run, sigma, measured.profile.joint.range)
        found = times(part, sigma)
        if np.ptp(part.position) >= TRAVELLED * np.ptp(run.position):
            told.append(found)
        whole = max(whole, found if len(part.time) == len(run.time) else times(run, sigma))
    return Worst(max(told, default=whole), whole)


def _drawn(asked: Asked) -> Array:
    """Strengths within the errors of the fitted ones, shape (draws, k)."""
    base, x = asked.base, asked.fit.x
    if not len(x):
        return np.zeros((0, 0))
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(x, asked.covariance, DRAWS, method="svd")
    return np.clip(drawn, base.unknowns.low, base.unknowns.high)


def _free(run: Run, sigma: float, span: tuple[float, float]) -> Run:
    """A run up to where the joint comes to an end of its range from elsewhere."""
    lo, hi = span
    away = np.minimum(run.position - lo, hi - run.position) > CLEAR * sigma
    left = int(np.argmax(away)) if away.any() else len(away)
    back = np.flatnonzero(~away[left:])
    return run.part(slice(0, left + int(back[0]) if len(back) else len(away)))
