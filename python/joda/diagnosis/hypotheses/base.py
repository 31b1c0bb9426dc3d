"""What a hypothesis is: an effect that may be missing, with unknown numbers, and where to begin.

The numbers are in the joint's own units: forces in its usual force, positions normalised, speeds in
its usual speed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.settings import SETTINGS
from joda.effects.guesses import AnyDirection, Number
from joda.estimation.unknowns import Unknowns
from joda.profile import Profile

Array = NDArray[np.float64]
Write = Callable[[Profile, Array], Profile]
Bounds = list[Number]
"""Of each number."""


@dataclass(frozen=True)
class Hypothesis:
    """An effect that may be missing.

    Attributes:
        effect: its name.
        direction: both, positive or negative.
        unknowns: its numbers.
        trials: values to begin with, shape (trials, k).
        write: the profile with the effect.
        interval: where it acts, in normalised position.
        magnitude: how large it is, in `unit`.
        unit: of the magnitude.
        ends: how many of the last numbers are ends of its interval.
        neg_log_prior: twice the logarithm of how much rarer it is than others.
        misfit_tolerance: part of the excess misfit that it may leave where it is the true one: more
            where only the rough shape of its curve is known.
        like_a_number: whether a number of the model or of the measurement that is off may look the
            same in runs.
        shape_error: part of its size by which the real thing may differ from its law; None: as
            others of its kind.
        wells: how many wells its force has, of which a motion may have seen some only; 0 for none.
        itself: whether it is, with these numbers, what its name says: more than a simpler effect
            would be, and of no size at which forces no longer count.
        kept: how many rough fits are fitted to the end: several where the motion jumps in a number.
        uneven: the same with a size that differs along the way: its numbers, and after them the
            logarithms of factors; None of what has no such form.
        factors: how many these are.
    """

    effect: str
    direction: AnyDirection
    unknowns: Unknowns
    trials: Array
    write: Write
    interval: Callable[[Array], tuple[float, float]]
    magnitude: Callable[[Array], float]
    unit: str
    ends: int = 0
    neg_log_prior: float = 0.0
    misfit_tolerance: float = SETTINGS.tolerances.known_law
    like_a_number: bool = False
    shape_error: float | None = None
    wells: int = 0
    itself: Callable[[Array], bool] = lambda x: True
    kept: int = 1
    uneven: "Hypothesis | None" = None
    factors: int = 0

    def placed(
        self, places: Sequence[Sequence[float]], strengths: Sequence[float] = (1.0,)
    ) -> "Hypothesis":
        """The same, to begin with at these places, in all of these units of its first strength."""
        trials = np.repeat(self.trials[:1], len(places) * len(strengths), axis=0)
        trials[:, 0] *= np.tile(strengths, len(places))
        trials[:, -self.ends :] = np.repeat(places, len(strengths), axis=0)
        return replace(self, trials=trials)


def everywhere(x: Array) -> tuple[float, float]:
    """All over the range."""
    return 0.0, 1.0


def unknowns_of(*rows: Number) -> Unknowns:
    """From what is known of each number."""
    low, high, step = np.array([row[:3] for row in rows]).T
    widest = np.array([row[3:] or (np.nan, np.nan) for row in rows]).T
    return Unknowns(low, high, step, np.zeros(len(low)), np.full(len(low), np.inf), widest=widest)


def known(unknowns: Unknowns, number: int, mean: float, prior_std: float) -> Unknowns:
    """With what one of them is before the data, and by how much that may be off."""
    at = np.arange(len(unknowns.low)) == number
    return replace(
        unknowns,
        mean=np.where(at, mean, unknowns.mean),
        prior_std=np.where(at, prior_std, unknowns.prior_std),
    )
