"""Long measurements cut down to what a fit can use: evenly, and never silently."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from joda.measured.runs import Run

SAMPLES, DURATION = 40_000, 240.0
"""Most samples, and most time (s), of all runs together that are fitted to."""
DRIVEN = 120.0
"""Most time, s, where an actuator acts: nothing moves without it, so that all of it tells."""
FINEST = 1e-3
"""Samples closer than this are thinned first, s."""
STRETCH = 5.0
"""Length of the stretches that are kept of a long run, s."""


def excerpts(runs: Sequence[Run]) -> tuple[tuple[Run, ...], tuple[int, ...], list[str]]:
    """Parts of runs, evenly spread over them; the runs themselves where they are not too long.

    Args:
        runs: measured.

    Returns:
        the parts; of each the number of its run; and a sentence for each run that was cut down.
    """
    if _share(runs) >= 1:
        return tuple(runs), tuple(range(len(runs))), []
    thinned = [run.part(slice(None, None, _every(run))) for run in runs]
    share = _share(thinned)
    parts: list[Run] = []
    of: list[int] = []
    notes = []
    for number, (run, thin) in enumerate(zip(runs, thinned, strict=True)):
        kept = [thin] if share >= 1 else _stretches(thin, share)
        parts += kept
        of += [number] * len(kept)
        count = sum(len(part.time) for part in kept)
        if count < len(run.time):
            notes.append(
                f"{run.name}: of {len(run.time)} samples {count} are fitted to, in {len(kept)} "
                f"stretch{'es' if len(kept) > 1 else ''} evenly spread over {np.ptp(run.time):.4g} "
                "s; give shorter files to choose them yourself."
            )
    return tuple(parts), tuple(of), notes


def _share(runs: Sequence[Run]) -> float:
    """What part of these runs may be used."""
    samples = sum(len(run.time) for run in runs)
    duration = sum(float(np.ptp(run.time)) for run in runs)
    most = DRIVEN if any(run.command is not None for run in runs) else DURATION
    return min(SAMPLES / max(samples, 1), most / max(duration, 1e-9))


def _every(run: Run) -> int:
    return max(round(FINEST / float(np.median(np.diff(run.time)))), 1)


def _stretches(run: Run, share: float) -> list[Run]:
    """Stretches of a run that make up a share of it."""
    duration = float(np.ptp(run.time))
    count = max(round(share * duration / STRETCH), 1)
    length = share * duration / count
    out = []
    for begin in run.time[0] + np.linspace(0, duration - length, count):
        samples = np.flatnonzero((run.time >= begin) & (run.time <= begin + length))
        if len(samples) > 1:
            name = f"{run.name} from {run.time[samples[0]]:.4g} s"
            out.append(replace(run.part(samples), name=name))
    return out
