"""How well an effect's size and place are known: how far what fits the runs as well may be off.

Three parts, as one number each would be too sure of itself:

- the profile likelihood (Venzon and Moolgavkar, J. R. Stat. Soc. C 37 (1988) 87): each number of
  the effect is moved off its best value, all others are fitted again, and what still fits counts;
- a block bootstrap over runs (Künsch, Ann. Stat. 17 (1989) 1217), one Gauss-Newton step from the
  best fit each: residuals are correlated within a run;
- a floor: what an approximate law of the effect leaves of the misfit may hide as large a part of
  its size, and what no run has visited is extrapolated.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.baseline import RESTITUTION, Baseline
from joda.diagnosis.hypotheses.base import everywhere
from joda.diagnosis.hypotheses.intervals import GRID
from joda.diagnosis.hypothesis_fits import FittedHypothesis, joined
from joda.diagnosis.impacts import Rebound, best_ratio, ends_of
from joda.diagnosis.settings import SETTINGS
from joda.effects.guesses import STRENGTH, TRIAL
from joda.estimation.estimator import Make, SegmentEstimator
from joda.estimation.segments import Simulator
from joda.estimation.unknowns import Unknowns
from joda.field import evaluate
from joda.profile import CHANNELS, Profile

ERRORS = SETTINGS.errors

Array = NDArray[np.float64]

STEPS = (1.0, 2.0, 4.0)
"""How far a number is moved off its best value, in its standard deviations by curvature."""
ITERATIONS = 3
"""Of the fit of all others there."""
DRAWS = 200
"""Bootstrap samples."""
MIN_RUNS = 5
"""Of fewer runs, segments are drawn instead."""
SHAPE = {
    SETTINGS.tolerances.known_law: ERRORS.known_law,
    SETTINGS.tolerances.free_curve: ERRORS.free_curve,
    SETTINGS.tolerances.known_shape: ERRORS.known_shape,
}
"""Part of its size by which an effect's law may differ from its kind, by what is known of it."""


@dataclass(frozen=True)
class Uncertainty:
    """One standard deviation each.

    Attributes:
        magnitude: of the effect's magnitude, in its unit.
        ends: of its interval's two ends, in normalised position.
    """

    magnitude: float
    ends: tuple[float, float]


@dataclass(frozen=True)
class _Fitted:
    """A fitted effect: the estimator, the numbers, and what is to be told of them."""

    estimator: SegmentEstimator
    make: Make
    unknowns: Unknowns
    found: FittedHypothesis
    x: Array

    @property
    def own(self) -> NDArray[np.intp]:
        """Numbers of the effect itself."""
        return np.arange(len(self.x) - len(self.found.x), len(self.x))

    @property
    def factors(self) -> NDArray[np.intp]:
        """Of these, factors along the way, near 1 by what is known of them."""
        return self.own[len(self.own) - self.found.hypothesis.factors :]

    def described(self, x: Array) -> Array:
        """Magnitude and ends of the interval, shape (3,)."""
        numbers = np.clip(x, self.unknowns.low, self.unknowns.high)[self.own]
        hypothesis = self.found.hypothesis
        return np.array([hypothesis.magnitude(numbers), *hypothesis.interval(numbers)])


def uncertainty(baseline: Baseline, found: FittedHypothesis, left: float) -> Uncertainty:
    """How well a fitted effect is known.

    Args:
        baseline: the model and its runs.
        found: the effect, fitted.
        left: share of the model's misfit beyond the noise that it leaves, 0 to 1.
    """
    if found.hypothesis.effect == RESTITUTION:
        return _restitution(baseline, found)
    fitted = _fitted(baseline, found)
    gain = max(baseline.fit.loss - found.fit.loss, 0.0)
    best = fitted.described(fitted.x)
    data = from_data(
        fitted,
        ERRORS.tolerated
        * gain
        * (found.hypothesis.misfit_tolerance == SETTINGS.tolerances.known_shape),
    )
    magnitude, a, b = map(float, best)
    shape = _of_its_law(found)
    left = float(np.clip(left, 0.0, 1.0))
    part = min(
        shape + ERRORS.hidden * left**0.5 / max(1.0 - left, 1 / ERRORS.farthest),
        ERRORS.farthest,
    )
    seen, visited = _seen(baseline, found)
    beyond = min(
        max(magnitude / seen, 1.0) - 1.0 if seen > 0 else ERRORS.farthest,
        ERRORS.farthest,
    )
    if from_afar := _at_bound(found) or (_pulls(found) and b - a > ERRORS.reaching):
        beyond = ERRORS.from_afar
    most = ERRORS.farthest * magnitude if _there(found) else np.inf
    size = np.linalg.norm([min(data[0], most), part * magnitude, beyond * magnitude])
    width = max(
        ERRORS.definition,
        part,
        ERRORS.stretched * min(beyond, ERRORS.farthest),
    ) * (b - a)
    free = from_afar or found.hypothesis.ends == 2
    ends = tuple(
        float(np.linalg.norm([spread, width * (free or 0.0 < end < 1.0), gap]))
        for end, spread, gap in zip((a, b), data[1:], _gaps((a, b), visited), strict=True)
    )
    return Uncertainty(float(size), (ends[0], ends[1]))


def from_data(fitted: _Fitted, tolerance: float = 0.0) -> Array:
    """Standard deviations of magnitude and ends as the runs alone tell them, shape (3,).

    Args:
        fitted: the effect.
        tolerance: by how much its loss may rise besides, as its law is known by its shape only.
    """
    estimator, unknowns, x = fitted.estimator, fitted.unknowns, fitted.x
    about = estimator.linear(fitted.make, unknowns, x, fitted.found.fit.start)
    H, slopes = about.normals()
    prior = _prior(fitted)
    worse = estimator.overdispersion(fitted.found.fit.squares)
    covariance = worse * np.linalg.pinv(H.sum(axis=0) + prior)
    rng = np.random.default_rng(0)
    normal = rng.multivariate_normal(x, covariance, DRAWS, "ignore", method="svd")
    drawn = _bootstrap(fitted, H, slopes, prior, rng)
    profiled = _profiled(fitted, (1 + tolerance / worse) * covariance, worse + tolerance)
    factors = fitted.factors  # the largest of many that vary would be larger than the largest
    normal[:, factors] = drawn[:, factors] = x[factors]
    parts = np.stack([_spread(fitted, normal), _spread(fitted, drawn), profiled])
    out = np.asarray(parts.max(axis=0))
    if len(factors):
        largest = factors[int(np.argmax(x[factors]))]
        out[0] = np.hypot(out[0], fitted.described(x)[0] * covariance[largest, largest] ** 0.5)
    return out


def _prior(fitted: _Fitted) -> Array:
    """Precision of what is known of the numbers before the data, shape (k, k)."""
    unknowns, own = fitted.unknowns, fitted.own
    wide = np.full(len(fitted.x), np.inf)
    wide[own] = (unknowns.high - unknowns.low)[own] / np.sqrt(12)
    strengths = own[unknowns.high[own] == STRENGTH[1]]
    wide[strengths] = ERRORS.plausible * max(np.abs(fitted.x[strengths]).max(initial=0.0), TRIAL)
    return unknowns.known + np.diag(wide**-2.0)


def _seen(baseline: Baseline, found: FittedHypothesis) -> tuple[float, tuple[float, float]]:
    """The effect's size where runs were, and where that is, in normalised position."""
    segments, joint = baseline.estimator.segments, baseline.base.profile.joint
    lo, hi = joint.range
    rows = segments.rows[baseline.estimator.counts]
    s = (segments.position[rows[rows >= 0]] - lo) / (hi - lo)
    low, high = (
        np.clip(
            np.quantile(s, (ERRORS.unvisited_samples, 1 - ERRORS.unvisited_samples)),
            0.0,
            1.0,
        )
        if len(s)
        else (0.0, 1.0)
    )
    bare = found.hypothesis.write(Profile(joint=joint), found.x)
    magnitude = found.hypothesis.magnitude(found.x)
    drawn = (getattr(bare.channels, name) for name in CHANNELS)
    if first := next((one for one in drawn if one.components), None):
        here, all_over = (
            float(np.abs(evaluate(first, np.linspace(a, b, GRID))[0]).max())
            for a, b in ((low, high), (0.0, 1.0))
        )
        magnitude *= here / all_over if all_over > 0 else 1.0
    return magnitude, (float(low), float(high))


def _of_its_law(found: FittedHypothesis) -> float:
    """Part of its size by which the real thing may differ from its law: its own, or its kind's."""
    own = found.hypothesis.shape_error
    return SHAPE[found.hypothesis.misfit_tolerance] if own is None else own


def _there(found: FittedHypothesis) -> bool:
    """Whether it is more than nothing, however large."""
    first = found.hypothesis.unknowns
    return bool(found.x[0] > first.low[0] + first.step[0])


def _at_bound(found: FittedHypothesis) -> bool:
    """Whether the scale of a law that is known by its shape is as large as it may be: what is seen
    may then be the far end of something much larger."""
    high, step = found.hypothesis.unknowns.high[-1], found.hypothesis.unknowns.step[-1]
    return _shaped(found) and bool(found.x[-1] > high - step)


def _shaped(found: FittedHypothesis) -> bool:
    """Whether the law is known by its shape, and has a scale but no ends."""
    return (
        found.hypothesis.misfit_tolerance == SETTINGS.tolerances.known_shape
        and found.hypothesis.ends == 0
    )


def _pulls(found: FittedHypothesis) -> bool:
    """Whether it is a pull to one end that runs out: felt over most of the range it may be the far
    end of a stronger one with a shorter reach, as 1 / distance² looks alike from afar."""
    return _shaped(found) and found.hypothesis.interval is not everywhere


def _gaps(interval: tuple[float, float], visited: tuple[float, float]) -> list[float]:
    """How far the ends may be off where no run was: one that is not clearly within what was visited
    may be anywhere from there to the end of the range, uniformly."""
    low, high = visited
    lows, highs = (
        low * np.less(interval, low + ERRORS.clearly_visited),
        (1 - high) * np.greater(interval, high - ERRORS.clearly_visited),
    )
    return [float(gap) / 3**0.5 for gap in lows + highs]


def _fitted(baseline: Baseline, found: FittedHypothesis) -> _Fitted:
    estimator, base, hypothesis = baseline.estimator, baseline.base, found.hypothesis
    return _Fitted(estimator, *joined(base, hypothesis), found, found.fit.x)


def _restitution(baseline: Baseline, found: FittedHypothesis) -> Uncertainty:
    """By the impacts' likelihood, and by how far their speeds tell of another one.

    An end is where it is, but the other one may throw back too where no impacts deny it.
    """
    segments, base, sides = baseline.estimator.segments, baseline.base, ends_of(found.hypothesis)
    size = found.hypothesis.magnitude(found.x)
    told = baseline.rebounds
    whole = Rebound.together([told[side] for side in sides if side in told])
    law = _of_its_law(found) * size
    error = float(np.hypot(best_ratio(whole, segments, base, sides)[1], law))
    known = (side in sides or (side in told and not told[side].may_be(size)) for side in (-1, 1))
    low, high = (ERRORS.at_end if there else ERRORS.unknown_end for there in known)
    return Uncertainty(error, (low, high))


def _bootstrap(
    fitted: _Fitted, H: Array, g: Array, prior: Array, rng: np.random.Generator
) -> Array:
    """Numbers that samples of runs, drawn with replacement, would have given; shape (draws, k)."""
    estimator = fitted.estimator
    run = estimator.segments.run
    runs = np.unique(run[estimator.counts])
    block = run if len(runs) >= MIN_RUNS else np.arange(len(run))
    blocks = np.unique(block[estimator.counts])
    Hb = np.stack([H[block == b].sum(axis=0) for b in blocks])
    gb = np.stack([g[block == b].sum(axis=0) for b in blocks])
    drawn = rng.multinomial(len(blocks), np.full(len(blocks), 1 / len(blocks)), DRAWS)
    normal = np.tensordot(drawn, Hb, 1) + prior
    slope = (drawn - 1) @ gb  # at the best fit the slopes of all, and of what is known, cancel
    return np.asarray(fitted.x - np.linalg.solve(normal, slope[:, :, None])[:, :, 0])


def _spread(fitted: _Fitted, draws: Array) -> Array:
    """Standard deviations of what is told, robustly, shape (3,)."""
    told = np.stack([fitted.described(x) for x in draws])
    low, high = np.quantile(told, (0.16, 0.84), axis=0)
    best = fitted.described(fitted.x)
    return np.asarray(np.maximum(high - best, best - low))


def _profiled(fitted: _Fitted, covariance: Array, overdispersion: float) -> Array:
    """Standard deviations by the profile likelihood of each of the effect's numbers, shape (3,)."""
    estimator, unknowns, start = fitted.estimator, fitted.unknowns, fitted.found.fit.start
    best, x = fitted.described(fitted.x), fitted.x
    least = estimator.loss(fitted.found.fit.squares) + unknowns.penalty(x)
    out = np.zeros(3)
    for k in np.setdiff1d(fitted.own, fitted.factors):
        rest = np.arange(len(x)) != k
        others = unknowns.some(rest)
        step = max(float(np.sqrt(covariance[k, k])), float(unknowns.step[k]))
        for way in (-1.0, 1.0):
            y, near = x[rest], start
            for far in STEPS:
                value = float(np.clip(x[k] + way * far * step, unknowns.low[k], unknowns.high[k]))

                def make(y: Array, value: float = value, k: int = int(k)) -> Simulator:
                    return fitted.make(np.insert(y, k, value))

                fit = estimator.fit(make, others, y, near, ITERATIONS, updated=False)
                y, near = fit.x, fit.start
                rise = max(fit.loss - least, 0.0) / overdispersion
                moved = np.abs(fitted.described(np.insert(y, k, value)) - best)
                out = np.maximum(out, moved / np.sqrt(max(rise, 1.0)))
                if rise > ERRORS.rise or value in (unknowns.low[k], unknowns.high[k]):
                    break
    return out
