"""A model against quasi-static curves: its errors against the noise, and where it fails."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from joda.measured.adequacy import CHANCE, Adequate, runs_test, sign_test
from joda.measured.quasi_static import QuasiStaticComparison
from joda.measured.significant_bins import BINS, significant, significant_intervals
from joda.profile import Joint

MIN_SHARE = 0.1
"""What is less than this share of the larger one is not said."""
MAX_INTERVALS = 6
"""Most places that are told."""
MIN_MEAN_SHARE = 0.5
"""Least mean error of a direction, in units of its RMS, that is the direction's: what changes its
sign is the place's."""
LOUD, ALONE = 0.15, 0.05
"""Noise, in units of the measured force's RMS, from which a curve gives no all-clear; and where no
place was measured both ways, or one period stands out of it, so that it may be the joint's own."""
LINE = 0.01
"""Chance that one period stands out of noise as it does, below which it is none."""
OUTLIER_NOISES = 6.0
"""Error of a single sample, in units of the noise, that no noise makes."""
MIN_SAMPLES = 15
"""Fewest samples of a curve that give one."""
TOO_LOUD = (
    "what the force does from sample to sample is much of all that it does, whether that is noise "
    "or the joint's own; measure at places nearer together."
)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CurveError:
    """Errors of one curve.

    Attributes:
        file: its name.
        rmse_force: RMS difference of the model's force from the measured one.
        noise_floor_force: noise of the measured force: no model gets below it.
        unit: of both, N·m or N.
    """

    file: str
    rmse_force: float
    noise_floor_force: float
    unit: str


@dataclass(frozen=True)
class FailingForce:
    """Where the model's quasi-static force is wrong; N·m or N.

    Attributes:
        by: what is told apart.
        interval: normalised position; or -1 to 0, 0 to 1 (direction).
        error: RMS error there.
        force: mean residual force towards +q (model's less the true one); of the means of both
            directions, where both were measured.
        friction: that it has too much there; None where one direction was measured.
        share: of the sum of squared errors beyond the noise, 0 to 1.
        significant: whether noise alone would hardly ever make such an error.
    """

    by: Literal["position", "direction"]
    interval: tuple[float, float]
    error: float
    force: float
    friction: float | None
    share: float
    significant: bool


def curve_error(found: QuasiStaticComparison, joint: Joint) -> CurveError:
    """The errors of a curve."""
    return CurveError(
        file=found.curve.name,
        rmse_force=float(np.sqrt(np.mean(found.excess**2))),
        noise_floor_force=found.sigma,
        unit=joint.force_unit,
    )


def failing_force(curves: Sequence[QuasiStaticComparison], joint: Joint) -> list[FailingForce]:
    """Where the model's force is wrong by more than noise, the largest share first."""
    if not curves:
        return []
    lo, hi = joint.range
    place = np.concatenate([c.curve.position[c.direction != 0] for c in curves])
    way = np.concatenate([c.direction[c.direction != 0] for c in curves])
    excess = np.concatenate([c.excess for c in curves])
    squares = (excess / np.concatenate([c.cautious for c in curves])) ** 2
    found = np.stack([np.abs(excess), np.ones_like(excess), squares], axis=1)
    beyond = np.maximum(found[:, 2] - 1, 0.0)
    out = []
    for by, edges, values in (
        ("position", np.linspace(0, 1, BINS + 1), (place - lo) / (hi - lo)),
        ("direction", np.array([-1.0, 0.0, 1.0]), way / 2),
    ):
        for interval, inside in significant_intervals(
            edges, values, found, apart=by == "direction"
        ):
            means = [excess[inside & (way == d)].mean() for d in (1, -1) if d in way[inside]]
            error = float(np.sqrt(np.mean(excess[inside] ** 2)))
            if by == "direction" and max(map(abs, means)) < MIN_MEAN_SHARE * error:
                continue
            out.append(
                FailingForce(
                    by=by,  # type: ignore[arg-type]
                    interval=interval,
                    error=error,
                    force=float(np.mean(means)),
                    friction=float(means[1] - means[0]) / 2 if len(means) == 2 else None,
                    share=float(beyond[inside].sum() / beyond.sum()),
                    significant=True,
                )
            )
    return sorted(out, key=lambda place: -place.share)


def curves_verdict(
    curves: Sequence[QuasiStaticComparison], failing: Sequence[FailingForce]
) -> Adequate:
    """Whether the model's quasi-static force is within the noise: in size, and without a pattern.

    Noise that is a good part of the force may be what changes from sample to sample instead: then
    nothing is cleared.
    """
    rows = [np.stack([np.ones(len(z)), np.ones(len(z)), z**2], axis=1) for z in map(_z, curves)]
    beyond = failing or any(significant(row) or row[:, 2].max() > OUTLIER_NOISES**2 for row in rows)
    if beyond or any(_pattern(curve) < CHANCE for curve in curves):
        return "beyond_noise"
    few = any(len(curve.excess) < MIN_SAMPLES for curve in curves)
    return "not_enough_data" if few or any(map(too_loud, curves)) else "within_noise"


def too_loud(curve: QuasiStaticComparison) -> bool:
    """Whether a curve's noise, or what changes from sample to sample, is much of its force."""
    loud = LOUD if curve.repeated and not _periodic(curve) else ALONE
    return curve.sigma > loud * float(np.sqrt(np.mean(curve.curve.force**2)))


def _periodic(curve: QuasiStaticComparison) -> bool:
    """Whether one period stands out of the error along either way: Fisher's test of the largest
    ordinate of the periodogram (1929), by its bound."""
    known = curve.direction != 0
    position, way = curve.curve.position[known], curve.direction[known]
    for one in (1, -1):
        there = np.flatnonzero(way == one)
        error = curve.excess[there[np.argsort(position[there], kind="stable")]]
        if len(error) < MIN_SAMPLES or not np.ptp(error) > 0:
            continue
        power = np.abs(np.fft.rfft(error - error.mean())[1:]) ** 2
        count = len(power)
        if count * (1 - power.max() / power.sum()) ** (count - 1) < LINE:
            return True
    return False


def _z(curve: QuasiStaticComparison) -> Array:
    return curve.excess / curve.cautious


def _pattern(curve: QuasiStaticComparison) -> float:
    """Probability of signs of the excess along the way as uneven as these, were the model true."""
    known = curve.direction != 0
    position, way = curve.curve.position[known], curve.direction[known]
    excess = curve.excess
    tests: list[float] = []
    for one in (1, -1):
        there = np.flatnonzero((way == one) & (excess != 0.0))
        sign = excess[there[np.argsort(position[there], kind="stable")]] > 0
        tests += [runs_test(sign), sign_test(sign)]
    return min(1.0, len(tests) * min(tests))


def curves_described(
    errors: Sequence[CurveError], failing: Sequence[FailingForce], verdict: Adequate | None
) -> list[str]:
    """The curves for a person: how far off the model's force is, where most."""
    if not errors:
        return []
    unit = errors[0].unit
    out = [
        f"{error.file}: the model's quasi-static force is {error.rmse_force:.3g} {unit} RMS from "
        f"the measured one, whose noise is {error.noise_floor_force:.2g} {unit}."
        for error in errors
    ]
    if verdict == "within_noise":
        out.append(
            "No force beyond the noise: where and as densely as they were measured, the curves "
            "show no fault of the model that is larger."
        )
    elif verdict == "not_enough_data":
        why = f"a curve has fewer than {MIN_SAMPLES} samples, or {TOO_LOUD}"
        out.append(f"Not enough to tell whether the model is right: {why}")
    elif not failing:
        out.append(
            "Small, but not noise: the force's error is larger than noise makes it, or its signs "
            "have a pattern that noise makes in fewer than 1 of 200 cases."
        )
    return out + [_failing_described(place, unit) for place in failing[:MAX_INTERVALS]]


def _failing_described(place: FailingForce, unit: str) -> str:
    (a, b), friction = place.interval, place.friction or 0.0
    where = f"at s = {a:.2f} to {b:.2f}"
    if place.by == "direction":
        where = "while moving towards " + ("+q" if b > 0 else "\N{MINUS SIGN}q")
    least = MIN_SHARE * max(abs(place.force), abs(friction))
    share = f"By {place.by}: {100 * place.share:.0f} % of the force's error is {where}, where"
    if max(abs(place.force), abs(friction)) < MIN_MEAN_SHARE * place.error:
        return f"{share} the residual force is {place.error:.2g} {unit} RMS, with either sign."
    what = []
    if abs(place.force) >= least:
        much = "much" if place.force > 0 else "little"
        what.append(
            f"the mean residual force is {abs(place.force):.2g} {unit} (the model pushes too "
            f"{much} towards +q)"
        )
    if place.friction is not None and abs(friction) >= least:
        much = "much" if friction > 0 else "little"
        what.append(f"the model's friction is {abs(friction):.2g} {unit} too {much}")
    return f"{share} {' and '.join(what)}."
