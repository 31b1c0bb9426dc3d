"""Whether what a replay misses of a free run is noise: the means of its blocks.

Windows with starts of their own, and their errors' size, tell little of a fault that adds up slowly
over many samples, each of which is missed by less than the noise. Means over blocks of a run do:
noise makes them small, and no start that suits the whole run best does away with a drift. How much
noise makes of them is told by the differences within the blocks (a long-run variance with
Bartlett's weights, Newey and West, Econometrica 55 (1987) 703), so that filtered and quantised
positions have more.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from joda.measured.measured_joint import Measured
from joda.measured.replay import Start
from joda.measured.runs import CLEAR, Run, until_end
from joda.measured.smoothing import resolution

Array = NDArray[np.float64]

BLOCKS, LEAST, FEW = 16, 10, 5
"""Blocks of a run, at most; samples of each, at least; and fewest blocks that tell anything."""
SPIKE = 4.0
"""Errors beyond so many noises count as so many: single wrong samples."""
DITHER = 2
"""Levels of an encoder between which one that rests may dither, which averages nothing out."""
TOLERATED = 0.1
"""Part of the noise by which a block's mean may be off: two solvers differ by as much."""


def free_parts(measured: Measured) -> list[tuple[Run, float]]:
    """Of the runs without a force, what comes before an end of the range, and each one's noise.

    With a recorded force its errors add up as a fault does; and at an end the stop decides too.
    """
    return _parts(measured, forced=False)


def _parts(measured: Measured, forced: bool) -> list[tuple[Run, float]]:
    """The same, or of the runs with a force that is known throughout."""
    span = measured.profile.joint.range
    parts = [
        (until_end(run, span, CLEAR * sigma), sigma)
        for run, sigma in zip(measured.runs, measured.sigma, strict=True)
        if run.forced == forced and not np.isnan(run.force).any()
    ]
    return [(run, sigma) for run, sigma in parts if len(run.time) >= FEW * LEAST]


def strays(measured: Measured) -> float:
    """Probability that noise of position and force make as large means of what is missed of a
    forced run; 1 where there is none."""
    parts, replayer = _parts(measured, forced=True), measured.replayer
    left, moved = [], []
    for run, sigma in parts:
        path, start = replayer.followed(run, sigma)
        left.append(path / sigma)
        moved.append(replayer.scatter(run, Start(start, np.zeros((2, 2)))) / sigma)
    return drifts(parts, left, moved)


def drifts(
    parts: Sequence[tuple[Run, float]], left: Sequence[Array], moved: Sequence[float] = ()
) -> float:
    """Probability that noise makes as large means of what is missed of any run.

    Args:
        parts: of `free_parts`, or such of forced runs.
        left: what is missed of each, in noises.
        moved: RMS by which errors of the force move each one's replay, in noises.

    Returns:
        1 where no run is free.
    """
    each = [
        drift(own, run.position, resolution(run.position) / sigma, *by)
        for (run, sigma), own, *by in zip(parts, left, *([moved] if moved else []), strict=True)
    ]
    return min(1.0, len(each) * min(each)) if each else 1.0


def drift(residual: Array, position: Array, step: float, moved: float = 0.0) -> float:
    """Probability that noise makes as large means of blocks of a residual.

    Args:
        residual: in noises, of a start that was fitted to it, shape (n,).
        position: measured, shape (n,).
        step: of a quantised position, in noises; 0: none.
        moved: RMS by which something else that is known moves it, in noises.

    Returns:
        1 where nothing can be told.
    """
    count = min(BLOCKS, len(residual) // LEAST)
    if count < FEW:
        return 1.0
    blocks = np.array_split(np.clip(residual, -SPIKE, SPIKE), count)
    levels = np.array([len(np.unique(own)) for own in np.array_split(position, count)])
    told = levels > DITHER if step else np.ones(count, bool)
    if told.sum() < FEW:
        return 1.0
    means, sizes = np.array([(own.mean(), len(own)) for own in blocks])[told].T
    variance = max(long_run_variance(blocks), 1.0) / sizes + TOLERATED**2 + moved**2
    variance += step**2 / 12 / levels[told]
    return float(chdtrc(told.sum() - 2, np.sum(means**2 / variance)))


def long_run_variance(blocks: list[Array]) -> float:
    """Of a mean of many samples, times their number: by what is left of each block's own line."""
    length = min(map(len, blocks))
    place = np.linspace(-1, 1, length)
    line = np.stack([np.ones(length), place]).T
    rows = np.stack([own[:length] for own in blocks])
    left = rows - rows @ line @ np.linalg.pinv(line)
    most = length // 4
    lags = [np.sum(left[:, k:] * left[:, : length - k]) for k in range(most + 1)]
    weights = 1 - np.arange(most + 1) / (most + 1)
    total = lags[0] + 2 * float(weights[1:] @ np.array(lags[1:]))
    # a line through each block takes 2 / length of the whole from each lag
    unbiased = max(total / (1 - 2 * (most + 1) / length), lags[0] * length / (length - 2))
    return float(unbiased / rows.size)
