"""A model against quasi-static curves: its errors against the noise, and where it fails."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from joda.measured.gauge import Gauged
from joda.measured.places import BINS, places
from joda.profile import Joint

SAID = 0.1
"""What is less than this share of the larger one is not said."""
MOST = 6
"""Most places that are told."""


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
        force: mean force towards +q that the model has too much there; of the means of both
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


def curve_error(found: Gauged, joint: Joint) -> CurveError:
    """The errors of a curve."""
    return CurveError(
        file=found.curve.name,
        rmse_force=float(np.sqrt(np.mean(found.excess**2))),
        noise_floor_force=found.sigma,
        unit=joint.force_unit,
    )


def failing_force(curves: Sequence[Gauged], joint: Joint) -> list[FailingForce]:
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
        for interval, inside in places(edges, values, found, apart=by == "direction"):
            means = [excess[inside & (way == d)].mean() for d in (1, -1) if d in way[inside]]
            out.append(
                FailingForce(
                    by=by,  # type: ignore[arg-type]
                    interval=interval,
                    error=float(np.sqrt(np.mean(excess[inside] ** 2))),
                    force=float(np.mean(means)),
                    friction=float(means[1] - means[0]) / 2 if len(means) == 2 else None,
                    share=float(beyond[inside].sum() / beyond.sum()),
                    significant=True,
                )
            )
    return sorted(out, key=lambda place: -place.share)


def told(errors: Sequence[CurveError], failing: Sequence[FailingForce]) -> list[str]:
    """The curves for a person: how far off the model's force is, where most."""
    if not errors:
        return []
    unit = errors[0].unit
    out = [
        f"{error.file}: the model's quasi-static force is {error.rmse_force:.3g} {unit} RMS from "
        f"the measured one, whose noise is {error.noise_floor_force:.2g} {unit}."
        for error in errors
    ]
    if not failing:
        out.append("No force beyond the noise: the curves show no fault of the model.")
    return out + [_told(place, unit) for place in failing[:MOST]]


def _told(place: FailingForce, unit: str) -> str:
    (a, b), friction = place.interval, place.friction or 0.0
    where = f"at s = {a:.2f} to {b:.2f}"
    if place.by == "direction":
        where = "while moving towards " + ("+q" if b > 0 else "\N{MINUS SIGN}q")
    least = SAID * max(abs(place.force), abs(friction))
    what = []
    if abs(place.force) >= least:
        much = "much" if place.force > 0 else "little"
        what.append(f"pushes {abs(place.force):.2g} {unit} too {much} towards +q in the mean")
    if place.friction is not None and abs(friction) >= least:
        much = "much" if friction > 0 else "little"
        what.append(f"has {abs(friction):.2g} {unit} too {much} friction")
    return (
        f"By {place.by}: {100 * place.share:.0f} % of the force's error is {where}, where the "
        f"model {' and '.join(what)}."
    )
