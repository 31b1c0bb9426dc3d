"""Whether what is said of an effect is as sure as it claims: coverage, reliability, Brier score."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

Figure = tuple[str, str, str, int]

SIGMAS = 2.0
"""Standard deviations of a 95 % interval."""
EDGES = (0.0, 0.3, 0.5, 0.7, 0.9, 0.97, 1.0 + 1e-9)
"""Of the bins of a reliability diagram."""


def pulls(row: dict) -> np.ndarray:
    """How far the true magnitude and interval's ends lie off, in the standard deviations said."""
    one, seal = row["named"][0], row["seal"]
    said = np.array([one["magnitude"], *one["interval"]])
    true = np.array([seal["magnitude"], *seal["interval"]])
    doubt = np.array([one["magnitude_error"], *one["interval_error"]])
    off = np.abs(said - true)
    off[1:] = np.where(off[1:] < 1e-9, 0.0, off[1:])
    return off / np.maximum(doubt, 1e-12)


def coverage(rows: list[dict]) -> Iterator[Figure]:
    """Of all effects and of each, cases whose first answer has the right name."""
    if not rows:
        return
    yield from _covered("all", rows)
    for name in sorted({row["effect"] for row in rows}):
        yield from _covered(name, [row for row in rows if row["effect"] == name])


def _covered(name: str, rows: list[dict]) -> Iterator[Figure]:
    off = np.array([pulls(row) for row in rows])
    first = [row["named"][0] for row in rows]
    width = np.median([one["magnitude_error"] / max(one["magnitude"], 1e-12) for one in first])
    size = (
        f"{100 * np.mean(off[:, 0] <= SIGMAS):.0f} % (one: {100 * np.mean(off[:, 0] <= 1):.0f} %)"
    )
    text = f"size {size}, at most {off[:, 0].max():.1f}, median width {100 * width:.1f} %"
    ends = 100 * np.mean(off[:, 1:] <= SIGMAS)
    place = np.median([np.mean(one["interval_error"]) for one in first])
    text += f"; ends {ends:.0f} %, at most {off[:, 1:].max():.1f}, median width {place:.3f}"
    yield f"cover: {name}", "≥ 90 %; ends ≥ 85 %; < 10", text, len(rows)


def reliability(rows: list[dict]) -> Iterator[Figure]:
    """How often answers of each probability are right, and the Brier score."""
    if not rows:
        return
    said = np.array([row["named"][0]["probability"] for row in rows])
    right = np.array([row["named"][0]["effect"] == row["effect"] for row in rows])
    left = np.array([row["named"][0]["held_out_error_after"] / row["noise"] for row in rows])
    for a, b in pairwise(EDGES):
        inside = (said >= a) & (said < b)
        if inside.any():
            text = f"{100 * right[inside].mean():.0f} %, said {100 * said[inside].mean():.0f} %"
            yield f"reliability: p {a:g} to {min(b, 1):g}", "", text, int(inside.sum())
    yield "reliability: Brier score", "", f"{np.mean((said - right) ** 2):.4f}", len(rows)
    worst = (said >= 0.9) & (left >= np.quantile(left, 2 / 3))
    if worst.any():
        text = f"{100 * right[worst].mean():.0f} %"
        yield "reliability: p ≥ 0.9, worst third by error left", "≥ 85 %", text, int(worst.sum())
