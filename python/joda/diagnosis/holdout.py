"""Effects fitted on a part of the runs and judged on the rest."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.asking import RESTITUTION, Asked
from joda.diagnosis.baseline import joined
from joda.diagnosis.guessing import Guess
from joda.diagnosis.judge import Judge, Make, Unknowns
from joda.diagnosis.split import held_windows
from joda.diagnosis.windows import Windows
from joda.measured.misfit import rms
from joda.measured.reading import Measured

Array = NDArray[np.float64]


class Holdout:
    """Fits on a part of the runs, judged on the rest."""

    def __init__(self, asked: Asked, measured: Measured) -> None:
        """Holds windows out as `joda.diagnosis.split` does; of what these do not show, others."""
        self.asked = asked
        counts = asked.judge.counts
        self.held = held_windows(measured, asked.judge.windows)
        if not (counts & self.held).any():
            self.held = np.isin(np.arange(len(counts)), np.flatnonzero(counts)[1::4])
        if not self.held.any():
            self.held = counts
        self.train = replace(asked.judge, counts=counts & ~self.held)
        self.before = self._error(asked.base.solo, asked.base.unknowns, asked.fit.x)

    def errors(self, found: Guess) -> tuple[float, float]:
        """RMS misfit of the windows held out, rad or m, without the effect and with it.

        Of how bouncy the ends are, all windows with knocks tell; no other is fitted to them.
        """
        base, windows = self.asked.base, self.asked.judge.windows
        make, unknowns = joined(base, found.hypothesis)
        if found.hypothesis.effect == RESTITUTION:
            knocks = windows.knocks & (windows.count > 0)
            without = _misfit(windows, base.solo, self.asked.fit.x, knocks)
            return without, _misfit(windows, make, found.fit.x, knocks)
        return self.before, self._error(make, unknowns, found.fit.x)

    def _error(self, make: Make, unknowns: Unknowns, x: Array) -> float:
        judge = self.asked.judge
        near = self.train.fit(make, unknowns, x, self.asked.fit.start, 6)
        return _misfit(judge.windows, make, near.x, judge.counts & self.held)


def _misfit(windows: Windows, make: Make, x: Array, counts: NDArray[np.bool_]) -> float:
    """RMS misfit of some windows from their best starts, rad or m."""
    fit = Judge(windows, counts).started(make(x))
    misfit = windows.misfit(make(x), fit.start)
    rows = windows.rows[counts]
    return rms(misfit[rows[rows >= 0]])
