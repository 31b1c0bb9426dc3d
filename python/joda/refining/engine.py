"""What a fit of motions simulates with: one interface for a joint by itself and for a scene."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from joda._core import Solo
from joda.diagnosis.cutting import windows_of
from joda.diagnosis.judge import Judge
from joda.diagnosis.windows import Mover, Windows
from joda.joints.parameters import Parameters
from joda.joints.single import Single
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
    """

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

    def mover(self, parameters: Parameters, theta: Array) -> Mover:
        """It with numbers of the joint's profile."""
        ...

    def windows(self, length: float) -> Windows:
        """The runs in windows of some length, s."""
        ...

    def judge(self, windows: Windows, counts: NDArray[np.bool_], apart: bool = False) -> Judge:
        """Fits it to windows, see `Judge`."""
        ...


@dataclass(frozen=True)
class JointEngine:
    """A joint by itself in C++, all others held; slopes are differences.

    Attributes:
        single: the joint.
        range, runs, sigma, h: see `Engine`.
        whole: what makes all that acts on the joint of its profile.
    """

    single: Single
    range: tuple[float, float]
    runs: Sequence[Run]
    sigma: float
    h: float
    whole: Callable[[Profile], Profile] = lambda profile: profile
    _cut: dict[float, Windows] = field(default_factory=dict, init=False, repr=False)

    @property
    def inertia(self) -> float:
        """See `Engine`."""
        return self.single.inertia

    def body(self, parameters: Parameters, theta: Array) -> Single:
        """All of the joint but its profile, with its numbers."""
        old, ratio = self.single, float(np.exp(parameters.number(theta, "damping_ratio")))
        return replace(
            old,
            inertia=old.inertia * float(np.exp(parameters.number(theta, "inertia"))),
            solref=(old.solref[0], old.solref[1] * ratio),
        )

    def mover(self, parameters: Parameters, theta: Array) -> Solo:
        """See `Engine`."""
        profile = self.whole(parameters.written(theta, exact=True))
        # a restitution of both ends is in the solver parameters already
        kept = tuple(e for e in profile.effects if e.key != "end_stop_restitution both")
        return self.body(parameters, theta).solo(
            profile.model_copy(update={"effects": kept}), self.h
        )

    def windows(self, length: float) -> Windows:
        """See `Engine`."""
        if length not in self._cut:
            (lo, hi), own = self.range, self.single.inertia
            sigmas = [self.sigma] * len(self.runs)
            self._cut[length] = windows_of(
                self.runs, sigmas, hi - lo, lo, own, self.h, length, fine=False
            )
        return self._cut[length]

    def judge(self, windows: Windows, counts: NDArray[np.bool_], apart: bool = False) -> Judge:
        """See `Engine`."""
        return Judge(windows, counts, apart)
