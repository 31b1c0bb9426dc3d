"""Learned forces with random tables, and a table's resistance by SciPy."""

from collections.abc import Callable

import numpy as np
from scipy.interpolate import PchipInterpolator

from joda.effects import LearnedForce


def random_table(rng: np.random.Generator, size: float, rows=4, sides=4, **how) -> LearnedForce:
    """One that only resists.

    Args:
        rng: draws it.
        size: of its largest values, N·m or N.
        rows: most positions.
        sides: most velocities of either sign.
        how: its memory, or another interval.
    """
    low, high = rng.integers(1, sides + 1, 2)
    v = np.concatenate((-np.cumsum(rng.uniform(0.02, 0.8, low))[::-1], [0.0],
                        np.cumsum(rng.uniform(0.02, 0.8, high))))  # fmt: skip
    n = int(rng.integers(1, rows + 1))
    y = size * rng.uniform(0, 1, (n, len(v))) * np.sign(v)
    places = {
        "interval": (float(rng.choice([0.0, rng.uniform(0.05, 0.3)])), 1.0),
        "positions": tuple(np.sort(rng.uniform(0, 1, n)).tolist()),
    }
    return LearnedForce(
        velocities=tuple(v.tolist()), y=tuple(map(tuple, y.tolist())), **(places | how)
    )


def scipys_resistance(table: LearnedForce) -> Callable:
    """Resistance of a table that reaches over the whole range, by s and v of one shape (n,)."""
    rows = PchipInterpolator(table.velocities, table.y, axis=1)
    slopes = rows.derivative()

    def resistance(s, v) -> tuple[np.ndarray, np.ndarray]:
        """It, and its slope dR/dv."""
        inside = np.clip(v, table.velocities[0], table.velocities[-1])
        value, slope = (
            [np.interp(at, table.positions, row) for at, row in zip(s, of(inside).T, strict=True)]
            for of in (rows, slopes)
        )
        return np.array(value), np.where(inside == v, slope, 0)

    return resistance


def random_memory(rng: np.random.Generator, size: float) -> dict:
    """Whether and how it remembers; a memory of position is as stiff as `size` per unit."""
    memory = str(rng.choice(["none", "position", "speed"]))
    gains = {"none": 0.0, "position": size * rng.uniform(0.2, 5), "speed": rng.uniform(-0.8, 1)}
    return {"memory": memory, "gain": float(gains[memory]), "time": float(rng.uniform(0.02, 2))}
