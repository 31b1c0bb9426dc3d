"""How sure a learned law is: what it would be from other segments of the same runs.

Each draw takes segments with replacement (Efron and Tibshirani, An Introduction to the Bootstrap
(1993)), and draws what was known before the data too (randomised priors: Osband, Aslanides and
Cassirer, NeurIPS 2018), so that where no data are the draws differ by all that a law may be. The
model is linear about the fit.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from joda._core import JointSimulator
from joda.diagnosis.learning.fitting import Learned, Learner
from joda.diagnosis.learning.law import Law

Array = NDArray[np.float64]

DRAWS = 32
"""Laws of an ensemble."""
COARSE = 2.0
"""Part of a memory's numbers that steps make wrong, in steps per time of the memory."""


@dataclass(frozen=True)
class Band:
    """A curve of the law, and one standard deviation of it over the ensemble; n numbers each.

    Attributes:
        at: normalised positions, or velocities in rad/s or m/s.
        force: there, N·m or N.
        error: one standard deviation.
    """

    at: tuple[float, ...]
    force: tuple[float, ...]
    error: tuple[float, ...]

    @property
    def largest(self) -> tuple[float, float, float]:
        """The largest force, its standard deviation, and where it is."""
        k = int(np.argmax(np.abs(self.force)))
        return abs(self.force[k]), self.error[k], abs(self.at[k])


@dataclass(frozen=True)
class Number:
    """A number, and one standard deviation of it over the ensemble."""

    value: float
    error: float

    def __str__(self) -> str:
        """For a person."""
        return f"{self.value:.3g} ± {one_digit(self.error)}"


def one_digit(error: float) -> str:
    """An error for a person."""
    return f"{float(f'{error:.1g}'):g}"


def drawn(learner: Learner, learned: Learned, seed: int = 0) -> Array:
    """Numbers of the law as other segments would have told them, shape (DRAWS, k).

    Args:
        learner: of the joint.
        learned: the fitted law.
        seed: of the draws.
    """
    law, estimator, fit = learned.law, learned.estimator, learned.fit
    unknowns = learner.unknowns(law)

    def make(x: Array) -> JointSimulator:
        return learner.simulator(law, x, estimator.segments.h)

    H, slopes = estimator.linear(make, unknowns, fit.x, fit.start).normals()
    rng = np.random.default_rng(seed)
    counted = np.flatnonzero(estimator.counts)
    prior = unknowns.prior_std**-2.0
    out = []
    for _ in range(DRAWS):
        times = np.bincount(rng.choice(counted, len(counted)), minlength=len(H))
        known = unknowns.mean + unknowns.prior_std * rng.standard_normal(len(fit.x))
        A = np.tensordot(times, H, 1) + np.diag(prior)
        b = times @ slopes + prior * (fit.x - known)
        out.append(fit.x - np.linalg.solve(A, b))
    return np.array(out)[:, learner.base.count :]


def over_position(law: Law, x: Array, draws: Array) -> Band | None:
    """The force over position; None if it has none."""
    if not law.terms.position:
        return None
    return _band(law.places, law.force_at(x), [law.force_at(one) for one in draws])


def over_speed(law: Law, x: Array, draws: Array) -> Band | None:
    """What resists the motion over the speed, in the mean along the way; None if nothing does."""
    if not law.terms.speed:
        return None
    return _band(law.speeds, law.resistance(x), [law.resistance(one) for one in draws])


def of_memory(law: Law, x: Array, draws: Array, h: float) -> tuple[Number, Number]:
    """The memory's gain in its effect's unit, and its time, s.

    Their errors count that a simulation in steps of `h` (s) remembers in steps too: a spring whose
    far end follows was found `COARSE` h / time too stiff.
    """

    def number(of: Callable[[Array], float]) -> Number:
        stepped = COARSE * h / law.time(x) * of(x)
        return Number(of(x), float(np.hypot(np.std([of(one) for one in draws]), stepped)))

    return number(law.gain), number(law.time)


def _band(at: Array, force: Array, others: Sequence[Array]) -> Band:
    error = np.std(others, axis=0)
    return Band(*(tuple(map(float, values)) for values in (at, force, error)))
