"""All measured runs replayed, whole and in windows: how far a model is off."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from joda.measured.comparison import RunError, joined, rms
from joda.measured.reading import Measured

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Errors:
    """What came of the replays; errors in rad or m, NaN where there is nothing to tell.

    Attributes:
        paths: the model's positions at each run's times, rad or m.
        runs: by run.
        whole, window, noise: of all runs together, as those of a `RunError`.
    """

    paths: tuple[Array, ...]
    runs: tuple[RunError, ...]
    whole: float
    window: float
    noise: float


def errors(
    measured: Measured,
    *,
    windows: bool = True,
    begin: Callable[[str], None] = lambda name: None,
) -> Errors:
    """Replays all runs in MuJoCo with the plugin.

    Args:
        measured: the runs, and the model.
        windows: whether the errors of windows, which take longer, are wanted.
        begin: told the name of each run before its replay.
    """
    paths, rows = [], []
    missed, left = [np.zeros(0)], [np.zeros(0)]
    for run, sigma in zip(measured.runs, measured.sigma, strict=True):
        begin(run.name)
        paths.append(measured.replayer.whole(run, sigma))
        off = paths[-1] - run.position
        missed.append(off[~np.isnan(off)])
        left.append(joined(measured.replayer.windows(run, sigma) if windows else ()))
        rows.append(RunError(run.name, rms(missed[-1]), rms(left[-1]), sigma))
    return Errors(
        paths=tuple(paths),
        runs=tuple(rows),
        whole=rms(np.concatenate(missed)),
        window=rms(np.concatenate(left)),
        noise=rms(np.array(measured.sigma)),
    )
