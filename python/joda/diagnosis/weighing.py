"""From a ranking to a verdict: is anything missing, how likely is each effect, is one enough."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from joda.diagnosis.asking import Asked
from joda.diagnosis.hypotheses.base import KNOWN_LAW
from joda.diagnosis.judge import BEND
from joda.diagnosis.ranking import WORST, Ranking, levelled

Verdict = Literal["missing_effect", "adequate", "unexplained", "insufficient_data"]

SHARPNESS = 3.0
"""How fast an effect's probability falls with the misfit that it leaves; calibrated on simulated
joints with a hidden effect (docs/diagnose.md)."""
LEAST_GAIN = 60.0
"""Least gain in loss of an effect that is more than chance."""
NOTICEABLE = 0.02
"""The same, per sample."""
CRUDE = 0.1
"""Part of its excess that any true effect may leave where more than noise is left of all."""
WEAK, LEFT = 0.12, 0.12
"""Part of its excess that any true effect may leave, up to so much per sample: noise is not known
better."""
APART = 0.5
"""Part of what the next best effect leaves that a true one may leave, if that is less: where two
are nearly as good, and neither leaves only noise, both only resemble what is missing."""
LITTLE = 0.05
"""Excess per sample that is never worth a word."""
CHANCE = 2.0
"""So many standard deviations the noise may be more than it was taken for, or any amount less."""
HARDLY = 0.1
"""Probability of the first effect below which a small excess is nothing that an effect explains."""
MUCH = 0.5
"""Excess per sample that is, even if no effect lowers it."""


@dataclass(frozen=True)
class Weighed:
    """A ranking with its probabilities.

    Attributes:
        verdict: on the model.
        probabilities: of the guesses, in their order.
        excess: per sample, of the model as it is and of each guess.
        effects: the guesses' names.
    """

    verdict: Verdict
    probabilities: tuple[float, ...]
    excess: tuple[float, tuple[float, ...]]
    effects: tuple[str, ...] = ()

    @property
    def named(self) -> tuple[tuple[str, float], ...]:
        """Effects and their probabilities."""
        return tuple(zip(self.effects, self.probabilities, strict=True))

    @property
    def share(self) -> float:
        """Part of the model's excess that the first guess leaves; all where that is too little to
        be told from what every guess leaves."""
        own, left = self.excess
        return left[0] / own if left and own > LITTLE else 1.0


def excess_of(asked: Asked) -> float:
    """Of the model as it is, per sample, beyond what noise makes."""
    return _excess(asked.fit.loss, max(asked.judge.samples, 1.0))


def _excess(loss: float, count: float) -> float:
    return loss / count - BEND * float(np.log1p(1 / BEND))


def weigh(ranking: Ranking, strictness: float = 1.0, wholly: bool = False) -> Weighed:
    """The verdict on a ranking, and how likely each effect is the missing one.

    Args:
        ranking: of what may be missing.
        strictness: factor of what the true effect may leave.
        wholly: whether it is unexplained where more than noise is left of all.
    """
    judge, guesses = ranking.asked.judge, ranking.guesses
    samples = judge.samples
    if not samples:
        return Weighed("adequate", (), (0.0, ()))
    loss = judge.loss(ranking.asked.fit.squares, level=min(ranking.level, WORST))
    calm = _excess(loss, samples) < MUCH and not ranking.bouncy
    without: Verdict = "adequate" if calm else "unexplained"
    if not guesses:
        return Weighed(without, (), (excess_of(ranking.asked), ()))
    first = guesses[0]

    own = _excess(levelled(judge, ranking.asked.fit, ranking.level), samples)
    left = np.array([_excess(guess.score, ranking.told) for guess in guesses])
    noise = min(left.min(), CHANCE * float(np.sqrt(2 / ranking.told)))  # not known better
    own, left = max(own - noise, 0.0), left - noise
    noisy = ranking.level > WORST  # more than noise is left of all
    part = CRUDE if noisy else first.hypothesis.remains
    least = max(KNOWN_LAW * own, min(WEAK * own, LEFT))
    unknown = strictness * max(min(part * own, APART * left[1:].min(initial=np.inf)), least)
    if wholly and noisy:  # then an unknown one is as likely as the first
        unknown = min(unknown, float(left[0]))
    weights = (left + LITTLE) ** -SHARPNESS
    strange = (unknown + LITTLE) ** -SHARPNESS
    likely = weights / (weights.sum() + strange)
    gain = ranking.asked.fit.loss - first.fit.loss - first.cost
    doubtful = likely[0] < HARDLY or ranking.bouncy
    if gain < max(LEAST_GAIN, NOTICEABLE * samples) or (own < MUCH and doubtful):
        said = without
    elif weights[0] <= strange:
        said = "unexplained"
    else:
        said = "missing_effect"
    names = tuple(guess.hypothesis.effect for guess in guesses)
    return Weighed(said, tuple(map(float, likely)), (own, tuple(map(float, left))), names)
