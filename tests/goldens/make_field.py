"""Golden vectors of a channel, computed by SciPy alone: run this file to write field.txt again.

The file is lines of words; a case is five lines, the floats exact:

    case NAME COMBINE
    text LABEL: A B | X ... | Y ... ; ...
    s ...
    value ...
    slope ...
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator

PATH = Path(__file__).with_name("field.txt")


class Curve(NamedTuple):
    """A component: its interval, and its control points in its own coordinate."""

    a: float
    b: float
    x: list
    y: list


class Case(NamedTuple):
    """A channel as text, and its values and slopes at s."""

    name: str
    combine: str
    text: str
    s: np.ndarray
    value: np.ndarray
    slope: np.ndarray


def cases():
    """All cases, computed now."""
    rng = np.random.default_rng(20240607)
    wave = Curve(0, 1, [0, 0.2, 0.5, 0.7, 1], [1, -2, 0.5, 3, -1])
    left, right = Curve(0, 0.5, [0, 0.4, 1], [1, 3, 2]), Curve(0.5, 1, [0, 0.3, 1], [-1, 2, 1.5])
    curves = {
        "two_knots": [Curve(0, 1, [0, 1], [1, 3])],
        "flat": [Curve(0, 1, [0, 0.3, 1], [2, 2, 2])],
        "partly_flat": [Curve(0, 1, [0, 0.25, 0.5, 0.75, 1], [0, 1, 1, 1, 4])],
        "sign_change": [Curve(0, 1, [0, 0.5, 1], [-1, 0.25, 2])],
        "uneven_knots": [Curve(0, 1, [0, 0.01, 0.02, 0.7, 0.95, 1], [0, 3, 3.5, 4, -1, 2])],
        "partial_interval": [Curve(0.2, 0.7, [0, 0.5, 1], [1, -1, 4])],
        "end_slope_zero": [Curve(0, 1, [0, 0.5, 1], [0, 0.1, 5])],
        "end_slope_limited": [Curve(0, 1, [0, 0.7, 1], [0, 1, -9])],
        "extrema": [wave],
        "touching_sum": [left, right],
        "touching_max": [left, right],
        "gap": [Curve(0.1, 0.3, [0, 1], [1, 2]), Curve(0.6, 0.9, [0, 0.5, 1], [-2, -1, -3])],
        "crossings_max": [wave, Curve(0.1, 0.95, [0, 0.6, 1], [-1, 1, 0.5])],
        "negative_max": [Curve(0.2, 0.8, [0, 1], [-3, -1]), Curve(0.4, 1, [0, 1], [-1, -2])],
        "narrow": [Curve(0.5, 0.501, [0, 0.5, 1], [0, 7, 0]), Curve(0, 1, [0, 1], [1, 2])],
        "narrow_max": [Curve(0.5, 0.501, [0, 0.5, 1], [0, 7, 0]), Curve(0, 1, [0, 1], [1, 2])],
        "large": [Curve(0, 0.9, [0, 0.2, 1], [1e12, -3e12, 2e12])],
        "tiny": [Curve(0, 0.9, [0, 0.2, 1], [1e-12, -3e-12, 2e-12])],
        "many_sum": [_random_curve(rng) for _ in range(20)],
        "many_max": [_random_curve(rng) for _ in range(20)],
    }
    for k in range(4):
        curves[f"random_{k}_sum"] = [_random_curve(rng) for _ in range(k + 1)]
        curves[f"random_{k}_max"] = [_random_curve(rng) for _ in range(k + 2)]
    curves["none"] = []
    return [
        _case(name, "max" if name.endswith("_max") else "sum", components, rng)
        for name, components in curves.items()
    ]


def evaluate(curves, s, combine):
    """Value, slope, and whether s is within 1e-9 of a crossing, where the slope is either's."""
    s, beyond = np.clip(s, 0, 1), (s < 0) | (s > 1)
    values, slopes = np.full((len(curves) + 2, s.size), np.nan), np.zeros((len(curves) + 2, s.size))
    for k, (a, b, x, y) in enumerate(curves):
        curve = PchipInterpolator(x, y, extrapolate=False)
        covers = (a <= s) & (s <= b)
        u = (s[covers] - a) / (b - a)
        values[k, covers], slopes[k, covers] = curve(u), curve.derivative()(u) / (b - a)
    covered = ~np.isnan(values)
    if combine == "sum":
        value, slope = np.where(covered, values, 0).sum(0), np.where(covered, slopes, 0).sum(0)
        return value, np.where(beyond, 0, slope), np.zeros(s.size, dtype=bool)
    ranked = np.where(covered, values, -np.inf)
    top, columns = ranked.argmax(0), np.arange(s.size)
    second, first = np.sort(ranked, axis=0)[-2:]
    any_cover = covered.any(0)
    value = np.where(any_cover, ranked[top, columns], 0)
    slope = np.where(any_cover & ~beyond, slopes[top, columns], 0)
    with np.errstate(invalid="ignore"):
        return value, slope, any_cover & (first - second < 1e-4)  # slopes here are below 1e5


def read(path=PATH):
    """All cases of the file."""
    out = []
    for line in path.read_text(encoding="utf-8").splitlines():
        key, _, rest = line.partition(" ")
        if key == "case":
            out.append(rest.split())
        else:
            out[-1].append(rest if key == "text" else np.array(rest.split(), dtype=float))
    return [Case(*fields) for fields in out]


def write(path=PATH):
    """Computes all cases and writes the file."""
    lines = []
    for case in cases():
        lines += [f"case {case.name} {case.combine}", f"text {case.text}".strip()]
        for key in ("s", "value", "slope"):
            lines.append(f"{key} {_words(getattr(case, key))}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _random_curve(rng):
    n = rng.integers(2, 7)
    a, b = np.round(np.sort(rng.choice(np.arange(0, 1.0001, 0.05), 2, replace=False)), 2)
    gaps = rng.uniform(0.2, 1, n - 1)
    x = np.concatenate(([0], np.cumsum(gaps[:-1]) / gaps.sum(), [1]))
    return Curve(a, b, np.round(x, 3), np.round(rng.normal(0, 3, n), 3))


def _case(name, combine, curves, rng):
    text = "; ".join(
        f"c{k}: {curve.a} {curve.b} | {_words(curve.x)} | {_words(curve.y)}"
        for k, curve in enumerate(curves)
    )
    knots = [curve.a + (curve.b - curve.a) * np.asarray(curve.x) for curve in curves[:4]]
    inside = [[a, a + 0.3 * (b - a), a + 0.8 * (b - a), b] for a, b, _, _ in curves]
    anywhere = np.round(rng.uniform(0, 1, 20), 4)
    s = np.unique(np.concatenate([[-2, -0.01, 0, 1, 1.01, 3], *knots, *inside, anywhere]))
    value, slope, unclear = evaluate(curves, s, combine)
    return Case(name, combine, text, s[~unclear], value[~unclear], slope[~unclear])


def _words(numbers):
    return " ".join(repr(float(number)) for number in numbers)


if __name__ == "__main__":
    write()
