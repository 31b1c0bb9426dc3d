"""How fast a joint runs away from where it is: where its force pushes it on, errors of a start, or
of a number, soon are as large as the range."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from joda.joints.divergence import bearable, linearized
from joda.measured.measured_joint import Measured
from joda.measured.runs import Run

Array = NDArray[np.float64]

NEARLY_ALL = 0.9
"""Part of all segments in which they grow by no more."""
SHORTER = 0.8
"""Factor by which segments become shorter until that holds."""


def longest_followed(measured: Measured, most: float) -> float:
    """How long segments may be (s) for a model to follow them; at most `most`."""
    if not measured.runs:
        return most
    growths = [(run.time, _growth(measured, run)) for run in measured.runs]
    length, by = most, bearable(_span(measured), float(np.median(measured.sigma)))
    while _grown(growths, length) > by:
        length *= SHORTER
    return length


def followed(measured: Measured, run: Run, sigma: float) -> Run:
    """A run as far as a model can follow it from its begin, which its noise of `sigma` tells."""
    end = np.searchsorted(_growth(measured, run), bearable(_span(measured), sigma), side="right")
    return run.part(slice(0, int(end)))


def _span(measured: Measured) -> float:
    return float(np.ptp(measured.profile.joint.range))


def _growth(measured: Measured, run: Run) -> Array:
    """Logarithm of the factor by which errors have grown since the run began, shape (n,)."""
    rates = linearized(measured.profile, measured.joint_model, run.position).rate
    return np.asarray(cumulative_trapezoid(rates, run.time, initial=0.0))


def _grown(growths: Sequence[tuple[Array, Array]], length: float) -> float:
    """The same over nearly all stretches of such a length (s), by each run's times and growth."""
    found = []
    for time, grown in growths:
        begins = time[: max(int(np.searchsorted(time, time[-1] - length)), 1)]
        found.append(np.interp(begins + length, time, grown) - grown[: len(begins)])
    return float(np.quantile(np.concatenate(found), NEARLY_ALL))
