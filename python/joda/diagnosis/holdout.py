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


FEW = 6
"""Of fewer windows held out, all are in turn."""
FOLDS = 4
"""In so many parts."""


class Holdout:
    """Fits on a part of the runs, judged on the rest; where that are few windows, or none that the
    model misses, every window is held out of one of several fits (cross-validation)."""

    def __init__(self, asked: Asked, measured: Measured) -> None:
        """Holds windows out as `joda.diagnosis.split` does; of what these do not show, others."""
        self.asked = asked
        counts = asked.judge.counts
        held = held_windows(measured, asked.judge.windows)
        self.folds = [counts & held]
        own = asked.base.solo, asked.base.unknowns, asked.fit.x
        self.before = self._error(*own) if self.folds[0].any() else 0.0
        every = np.flatnonzero(counts)
        silent = self.before < measured.floor or np.count_nonzero(self.folds[0]) < FEW
        if silent and len(every) > 1:
            parts = (every[k::FOLDS] for k in range(min(FOLDS, len(every))))
            self.folds = [np.isin(np.arange(len(counts)), part) for part in parts]
            self.before = self._error(*own)

    def errors(self, found: Guess) -> tuple[float, float]:
        """RMS misfit of the windows held out, rad or m, without the effect and with it.

        Of how bouncy the ends are, all windows with knocks tell; no other is fitted to them.
        """
        base, windows = self.asked.base, self.asked.judge.windows
        make, unknowns = joined(base, found.hypothesis)
        if found.hypothesis.effect == RESTITUTION:
            knocks = windows.knocks & (windows.count > 0)
            without = _misfit(windows, base.solo, self.asked.fit.x, knocks)
            return rms(without), rms(_misfit(windows, make, found.fit.x, knocks))
        return self.before, self._error(make, unknowns, found.fit.x)

    def _error(self, make: Make, unknowns: Unknowns, x: Array) -> float:
        judge, start, missed = self.asked.judge, self.asked.fit.start, []
        for held in self.folds:
            train = replace(judge, counts=judge.counts & ~held)
            near = train.fit(make, unknowns, x, start, 6)
            missed.append(_misfit(judge.windows, make, near.x, held))
        return rms(np.concatenate(missed))


def _misfit(windows: Windows, make: Make, x: Array, counts: NDArray[np.bool_]) -> Array:
    """Misfit of some windows from their best starts, rad or m."""
    fit = Judge(windows, counts).started(make(x))
    misfit = windows.misfit(make(x), fit.start)
    rows = windows.rows[counts]
    return np.asarray(misfit[rows[rows >= 0]])
