"""Whether a model is better than another on runs that neither was fitted to: a paired test."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.settings import SETTINGS
from joda.measured.errors import Errors

ADDING = SETTINGS.adding

Array = NDArray[np.float64]

EXACT, DRAWS = 12, 4000
"""Segments up to which all signs are gone through; else so many are drawn."""
MISSED_MORE = "the free-run error of what was held out of the fit is larger with it"


def worse(before: Errors, after: Errors) -> str | None:
    """Why a model is not better than before on runs held out, as a clause; None if it is.

    Segments are paired; whole runs, or blocks of them, must not be missed by more. What is weak, as
    a drag, shows in whole runs only: then each of these must be missed by much less, and segments
    not by clearly more.
    """
    pairs = [
        np.array([one.multiple for one in found.missed if (one.time is None) == whole])
        for whole in (False, True)
        for found in (before, after)
    ]
    shows_late = len(pairs[2]) and all(
        risen(*one) < ADDING.whole_run_fall
        for one in zip(pairs[2][:, None], pairs[3][:, None], strict=True)
    )
    if not improves(pairs[0], pairs[1]) and not (shows_late and not improves(pairs[1], pairs[0])):
        return "with it the held-out segment error is not clearly smaller (paired test)"
    if risen(pairs[2], pairs[3]) > ADDING.max_rise:
        return MISSED_MORE
    return None


def improves(before: Array, after: Array) -> bool:
    """Whether segments are missed by less, beyond chance.

    A sign-flip test (Fisher 1935) of the mean change of log(1 + error²), in units of the noise, so
    that no single segment decides.

    Args:
        before, after: errors of the same segments in units of the noise, shape (n,).
    """
    finite = np.isfinite(before) | np.isfinite(after)
    before, after = (np.minimum(x[finite], 1e6) for x in (before, after))
    every = np.log1p(before**2) - np.log1p(after**2)
    gain = every[np.abs(before - after) > ADDING.changed]
    if len(gain) < ADDING.min_segments:
        return bool(every.sum() > 0 and (gain > 0).all())
    if len(gain) <= EXACT:
        signs = np.array(list(product((-1.0, 1.0), repeat=len(gain))))
    else:
        signs = np.random.default_rng(0).choice((-1.0, 1.0), (DRAWS, len(gain)))
    return bool(np.mean(signs @ gain >= gain.sum() - 1e-12) < ADDING.chance)


def risen(before: Array, after: Array) -> float:
    """Geometric mean of the ratios of errors, those below the noise counting as the noise."""
    if not len(before):
        return 1.0
    ratios = [np.log(np.clip(x, 1.0, 1e6)) for x in (after, before)]
    return float(np.exp(np.mean(ratios[0] - ratios[1])))
