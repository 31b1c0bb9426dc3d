"""Types of the C++ core; see cpp/bindings.cc."""

from collections.abc import Sequence
from math import inf

import numpy as np
from numpy.typing import ArrayLike, NDArray

class PiecewiseCubic:
    """A channel of a profile, merged at load."""

    def __init__(self, text: str, combine: str = "sum", nonnegative: bool = False) -> None: ...
    def __call__(self, s: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def max_stiffness(self) -> float: ...
    @property
    def knots(self) -> NDArray[np.float64]: ...
    @property
    def cubics(self) -> NDArray[np.float64]: ...
    @property
    def descents(self) -> NDArray[np.float64]: ...

class Table:
    """The table of a learned force: resistance over position and velocity."""

    def __init__(
        self,
        interval: tuple[float, float],
        positions: Sequence[float],
        velocities: Sequence[float],
        y: Sequence[Sequence[float]],
    ) -> None: ...
    def __call__(
        self, s: ArrayLike, v: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    @property
    def cubics(self) -> NDArray[np.float64]: ...

def stop_rebound(damping: float) -> float: ...
def stop_damping(restitution: float) -> float: ...
def set_profile(
    model_address: int, data_address: int, joint: int, lo: float, hi: float, texts: Sequence[str]
) -> None: ...

class JointSimulator:
    """A joint by itself, stepped as MuJoCo does with the plugin, or more accurately."""

    def __init__(
        self,
        lo: float,
        hi: float,
        texts: Sequence[str],
        inertia: float,
        row_inertia: float,
        weight: Sequence[float] | NDArray[np.float64],
        hinge: bool,
        solref: Sequence[float] | NDArray[np.float64],
        solimp: Sequence[float] | NDArray[np.float64],
        friction_row: Sequence[float] = (0.0, 0.0),
        servo: Sequence[float] = (1.0, 0.0, 0.0, -inf, inf, 0.0),
        trapezoidal: bool = False,
        second: tuple[int, Sequence[float], Sequence[float]] = ...,
    ) -> None: ...
    def replay(
        self,
        force: ArrayLike,
        at: ArrayLike,
        start: ArrayLike,
        fresh: ArrayLike,
        h: float,
        command: ArrayLike | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
