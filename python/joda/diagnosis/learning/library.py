"""Readable terms of which a formula is made, with their units.

Of position q: constant, linear, sine and cosine of n q. Of velocity v, all against it: dry
friction, root, linear, square, and what begins with the motion and is full beyond a speed v0.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DRY = "sign(v)"
"""Dry friction."""
SPEED_SCALES = (0.05, 0.15, 0.4)
"""Speeds v0, in units of the fastest."""


@dataclass(frozen=True)
class Term:
    """A term of a formula: a factor, to be found, times a function.

    Attributes:
        of: what of: position, or speed, against which the force is.
        text: the function as it is written.
        unit: of the factor, after the force's; {x} stands for the position's.
        function: of the position (rad or m), or of the speed (rad/s or m/s).
    """

    of: Literal["position", "speed"]
    text: str
    unit: str
    function: Callable[[Array], Array]


def of_speed(fastest: float) -> tuple[Term, ...]:
    """Terms of the speed; a dry friction is the first.

    Args:
        fastest: speed of the runs, rad/s or m/s.
    """
    terms = [
        Term("speed", DRY, "", np.ones_like),
        Term("speed", "sign(v) √|v|", "·(s/{x})^½", np.sqrt),
        Term("speed", "v", "·s/{x}", lambda v: v),
        Term("speed", "|v| v", "·s²/{x}²", np.square),
    ]
    for part in SPEED_SCALES:
        v0 = float(f"{part * fastest:.2g}")
        terms.append(Term("speed", f"sign(v) (1 − exp(−|v|/{v0:g}))", "", _saturating(v0)))
    return tuple(terms)


def _saturating(v0: float) -> Callable[[Array], Array]:
    return lambda v: 1 - np.exp(-v / v0)


def of_position(periods: tuple[float, ...] = ()) -> tuple[tuple[Term, ...], ...]:
    """Terms of the position, in groups that go together.

    Args:
        periods: n of sin(n q), 1/rad or 1/m.
    """
    groups: list[tuple[Term, ...]] = [
        (Term("position", "1", "", np.ones_like),),
        (Term("position", "q", "/{x}", lambda q: q),),
    ]
    for n in periods:
        own = float(f"{n:.4g}")
        groups.append(
            (
                Term("position", f"sin({own:g} q)", "", _wave(np.sin, own)),
                Term("position", f"cos({own:g} q)", "", _wave(np.cos, own)),
            )
        )
    return tuple(groups)


def _wave(of: Callable[[Array], Array], n: float) -> Callable[[Array], Array]:
    return lambda q: of(n * q)
