"""What a fit of motions simulates with: one interface for a joint by itself and for a scene."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from joda._core import JointSimulator
from joda.estimation.estimator import SegmentEstimator
from joda.estimation.profile_parameters import Parameters
from joda.estimation.segmentation import segments_of
from joda.estimation.segments import Segments, Simulator
from joda.joints.joint_model import JointModel
from joda.measured import smoothing
from joda.measured.runs import Run
from joda.profile import Profile

Array = NDArray[np.float64]

FINEST = 2e-5
"""Least noise that is believed, in units of the range."""


def noise(runs: Sequence[Run], span: float) -> float:
    """Of the position of runs of a joint whose range is that wide, rad or m; where there are none,
    the least that is believed."""
    usual = [smoothing.noise(run.time, run.position) for run in runs]
    return max(float(np.median(usual or 0.0)), FINEST * span)


class Engine(Protocol):
    """A joint with its measured runs, and what simulates it.

    Attributes:
        runs: measured.
        sigma: noise of the joint's position, rad or m.
        h: timestep, s.
        inertia: of the joint, kg·m² or kg.
        range: of its position, rad or m.
        quick: whether it simulates so quickly that fits may begin from many places.
    """

    @property
    def quick(self) -> bool: ...  # noqa: D102

    @property
    def runs(self) -> Sequence[Run]: ...  # noqa: D102

    @property
    def sigma(self) -> float: ...  # noqa: D102

    @property
    def h(self) -> float: ...  # noqa: D102

    @property
    def inertia(self) -> float: ...  # noqa: D102

    @property
    def range(self) -> tuple[float, float]: ...  # noqa: D102

    def simulator(self, parameters: Parameters, theta: Array) -> Simulator:
        """It with numbers of the joint's profile."""
        ...

    def segments(self, length: float) -> Segments:
        """The runs in segments of some length, s."""
        ...

    def estimator(self, segments: Segments, counts: NDArray[np.bool_]) -> SegmentEstimator:
        """Fits it to segments, see `SegmentEstimator`."""
        ...


@dataclass(frozen=True)
class JointEngine:
    """A joint by itself in C++, all others held; slopes are differences.

    Attributes:
        joint_model: the joint.
        range, runs, sigma, h, quick: see `Engine`.
        whole: what makes all that acts on the joint of its profile.
    """

    joint_model: JointModel
    range: tuple[float, float]
    runs: Sequence[Run]
    sigma: float
    h: float
    whole: Callable[[Profile], Profile] = lambda profile: profile
    quick: bool = field(default=True, init=False)
    _cut: dict[float, Segments] = field(default_factory=dict, init=False, repr=False)

    @property
    def inertia(self) -> float:
        """See `Engine`."""
        return self.joint_model.inertia

    def body(self, parameters: Parameters, theta: Array) -> JointModel:
        """All of the joint but its profile, with its numbers."""
        old, ratio = self.joint_model, float(np.exp(parameters.number(theta, "damping_ratio")))
        return replace(
            old,
            inertia=old.inertia * float(np.exp(parameters.number(theta, "inertia"))),
            solref=(old.solref[0], old.solref[1] * ratio),
        )

    def simulator(self, parameters: Parameters, theta: Array) -> JointSimulator:
        """See `Engine`."""
        profile = self.whole(parameters.written(theta, exact=True))
        # a restitution of both ends is in the solver parameters already
        kept = tuple(e for e in profile.effects if e.key != "end_stop_restitution both")
        return self.body(parameters, theta).simulator(
            profile.model_copy(update={"effects": kept}), self.h
        )

    def segments(self, length: float) -> Segments:
        """See `Engine`."""
        if length not in self._cut:
            (lo, hi), own = self.range, self.joint_model.inertia
            sigmas = [self.sigma] * len(self.runs)
            self._cut[length] = segments_of(
                self.runs, sigmas, hi - lo, lo, own, self.h, length, fine=False
            )
        return self._cut[length]

    def estimator(self, segments: Segments, counts: NDArray[np.bool_]) -> SegmentEstimator:
        """See `Engine`."""
        return SegmentEstimator(segments, counts)
