"""Quasi-static curves as segments: what a model misses is force, and nothing moves."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.estimation.segments import Array, Segments, rows_of
from joda.joints.joint_model import JointModel
from joda.measured.quasi_static import QuasiStaticComparison, gravity, held_force
from joda.profile import Profile
from joda.scenes.context import Context

SAMPLES = 12
"""Of a segment."""


@dataclass(frozen=True)
class CurveSegments(Segments):
    """Pieces of curves; `position` is the measured force, N·m or N.

    Attributes:
        model: the force that slowly moves a joint with a profile, at each sample.
    """

    model: Callable[[Profile], Array]

    @property
    def separable(self) -> bool:
        """Not needed: nothing begins anywhere."""
        return False

    def coarser(self) -> "CurveSegments":
        """Themselves: nothing moves."""
        return self

    def misfit(self, simulator: Any, start: Array) -> Array:
        """The model's minus the measured force; `simulator` is the profile."""
        return np.asarray(self.model(simulator) - self.position)


@dataclass(frozen=True)
class QuasiStaticJoint(JointModel):
    """A joint that is not simulated: its profile says all."""

    def simulator(self, profile: Profile, h: float) -> Any:
        """The profile."""
        return profile


def curve_segments(
    curves: Sequence[QuasiStaticComparison], found: Context, timestep: float
) -> CurveSegments:
    """Curves of a joint in pieces; samples whose direction of travel is not known are left out.

    Args:
        curves: at least one.
        found: the joint.
        timestep: of its scene, s.
    """
    parts: list[tuple[NDArray[Any], ...]] = []
    count = 0
    for number, gauged in enumerate(curves):
        known = np.flatnonzero(gauged.direction)
        pieces = max(len(known) // SAMPLES, 1)
        segment = np.minimum(np.arange(len(known)) // SAMPLES, pieces - 1) + count
        curve = gauged.curve.position[known], gauged.curve.force[known]
        own = np.full(len(known), number)
        parts.append((*curve, gauged.direction[known], gauged.cautious, segment, own))
        count += pieces
    at, force, direction, prior_std, segment, run = (
        np.concatenate(x) for x in zip(*parts, strict=True)
    )
    rows = rows_of(segment, count)
    n = len(force)
    weight = gravity(found, at)

    def model(profile: Profile) -> Array:
        """The force that slowly moves the joint; NaN where friction holds against any force."""
        try:
            return held_force(profile, weight, at, direction)
        except JodaError:
            return np.full(n, np.nan)

    spread = np.where(rows >= 0, prior_std[rows], np.inf)
    return CurveSegments(
        h=timestep,
        length=timestep,
        force=force,
        at=np.arange(count),
        fresh=np.ones(count, bool),
        start=np.zeros((count, 2)),
        prior_std=np.ones((count, 2)),
        step=np.arange(n),
        share=np.zeros(n),
        position=force,
        time=np.arange(float(n)),
        run=run[rows[:, 0]],
        rows=rows,
        sharpness=1 / spread,
        shared=np.zeros((*rows.shape, 0)),
        impacts=np.zeros(count, bool),
        rests=np.zeros(count, bool),
        stays=np.zeros(n, int),
        model=model,
    )
