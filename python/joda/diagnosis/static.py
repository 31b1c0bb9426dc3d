"""Quasi-static curves as windows: what a model misses is force, and nothing moves."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.windows import Array, Windows, rows_of
from joda.errors import JodaError
from joda.joints.single import Single
from joda.measured.gauge import gravity, held_force
from joda.measured.reading import Measured
from joda.profile import Profile

SAMPLES = 12
"""Of a window."""


@dataclass(frozen=True)
class CurveWindows(Windows):
    """Pieces of curves; `position` is the measured force, N·m or N.

    Attributes:
        model: the force that slowly moves a joint with a profile, at each sample.
    """

    model: Callable[[Profile], Array]

    def coarser(self) -> "CurveWindows":
        """Themselves: nothing moves."""
        return self

    def misfit(self, solo: Any, start: Array) -> Array:
        """The model's minus the measured force; `solo` is the profile."""
        return np.asarray(self.model(solo) - self.position)


@dataclass(frozen=True)
class Still(Single):
    """A joint that is not simulated: its profile says all."""

    def solo(self, profile: Profile, h: float) -> Any:
        """The profile."""
        return profile


def curve_windows(measured: Measured) -> CurveWindows:
    """The curves in pieces; samples whose direction of travel is not known are left out."""
    parts: list[tuple[NDArray[Any], ...]] = []
    count = 0
    for number, gauged in enumerate(measured.curves):
        known = np.flatnonzero(gauged.direction)
        pieces = max(len(known) // SAMPLES, 1)
        window = np.minimum(np.arange(len(known)) // SAMPLES, pieces - 1) + count
        curve = gauged.curve.position[known], gauged.curve.force[known]
        own = np.full(len(known), number)
        parts.append((*curve, gauged.direction[known], gauged.cautious, window, own))
        count += pieces
    at, force, direction, doubt, window, run = (np.concatenate(x) for x in zip(*parts, strict=True))
    rows = rows_of(window, count)
    n = len(force)
    weight = gravity(measured.context, at)

    def model(profile: Profile) -> Array:
        """The force that slowly moves the joint; NaN where friction holds against any force."""
        try:
            return held_force(profile, weight, at, direction)
        except JodaError:
            return np.full(n, np.nan)

    spread = np.where(rows >= 0, doubt[rows], np.inf)
    return CurveWindows(
        h=measured.timestep,
        force=force,
        at=np.arange(count),
        fresh=np.ones(count, bool),
        start=np.zeros((count, 2)),
        doubt=np.ones((count, 2)),
        step=np.arange(n),
        share=np.zeros(n),
        position=force,
        time=np.arange(float(n)),
        run=run[rows[:, 0]],
        rows=rows,
        sharpness=1 / spread,
        shared=np.zeros((*rows.shape, 0)),
        knocks=np.zeros(count, bool),
        rests=np.zeros(count, bool),
        model=model,
    )
