"""Effects fitted on a part of the runs and judged on the rest."""

import numpy as np
from numpy.typing import NDArray

from joda.baseline import joined
from joda.comparison import rms
from joda.guessing import Guess
from joda.judge import NOTHING, Judge, Make, Unknowns
from joda.ranking import Ranking
from joda.windows import Windows

Array = NDArray[np.float64]


class Holdout:
    """Fits on a part of the runs, judged on the rest."""

    def __init__(self, ranking: Ranking) -> None:
        """Holds out a quarter of the runs; of fewer than four, a quarter of the windows."""
        self.ranking = ranking
        windows = ranking.judge.windows
        runs = np.unique(windows.run)
        if len(runs) >= 4:
            self.held = windows.of_runs(list(runs[3::4]))
        else:
            self.held = np.arange(len(windows.at)) % 4 == 3
        counts = ranking.judge.counts
        if not (counts & self.held).any():
            self.held = counts
        self.train = Judge(windows, counts & ~self.held)
        self.before = self._error(ranking.base.solo, ranking.base.unknowns, ranking.fit.x)

    def error(self, found: Guess) -> float:
        """RMS misfit of the windows held out, rad or m, with the effect."""
        if found.hypothesis.effect == "end_stop_restitution":
            return self._knocking(found)
        make, unknowns = joined(self.ranking.base, found.hypothesis)
        return self._error(make, unknowns, found.fit.x)

    def _error(self, make: Make, unknowns: Unknowns, x: Array) -> float:
        judge = self.ranking.judge
        near = self.train.fit(make, unknowns, x, self.ranking.fit.start, 6)
        return _misfit(judge.windows, make, near.x, judge.counts & self.held)

    def _knocking(self, found: Guess) -> float:
        make, _ = joined(self.ranking.base, found.hypothesis)
        windows = self.ranking.judge.windows
        knocks = windows.knocks & (windows.count > 0)
        base = self.ranking.base
        self.before = _misfit(windows, base.solo, self.ranking.fit.x, knocks)
        return _misfit(windows, make, found.fit.x, knocks)


def _misfit(windows: Windows, make: Make, x: Array, counts: NDArray[np.bool_]) -> float:
    """RMS misfit of some windows from their best starts, rad or m."""
    own = Judge(windows, counts)
    fit = own.fit(lambda _: make(x), NOTHING, np.zeros(0), windows.start, 5)
    misfit = windows.misfit(make(x), fit.start)
    rows = windows.rows[counts]
    return rms(misfit[rows[rows >= 0]])
