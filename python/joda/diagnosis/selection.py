"""From what fits leave to a verdict: is anything missing, how likely is each effect, is one enough.

What the fits leave is the `Evidence`, every number that decides on it is one of the `Settings`, and
`decide` is a function of these two alone.
"""

from dataclasses import dataclass, replace

import numpy as np

from joda.diagnosis.findings import Verdict
from joda.diagnosis.hypotheses.base import KNOWN_LAW


@dataclass(frozen=True)
class Settings:
    """Every number that decides on evidence; excesses are per sample, beyond what noise makes.

    Calibrated on simulated joints that hide an effect, and judged on families of these that were
    left out (tests/benchmarks/calibrate.py; docs/diagnose.md).

    Attributes:
        sharpness: how fast an effect's probability falls with the excess that it leaves.
        least_gain: least gain in loss of an effect that is more than chance.
        noticeable: the same, per sample.
        crude: part of the model's excess that any true effect may leave where more than noise is
            left of all.
        weak: part of the model's excess that any true effect may leave, up to `left`.
        left: see `weak`; noise is not known better.
        apart: part of what the next best effect leaves that a true one may leave, if that is less:
            where two are nearly as good, and neither leaves only noise, both only resemble what is
            missing.
        little: excess that is never worth a word.
        telling: difference in loss below which two effects are as good as one another: of few
            samples that is more than `little`.
        chance: so many standard deviations the noise may be more than it was taken for, or any
            amount less.
        hardly: probability of the first effect below which a small excess is nothing that an effect
            explains.
        much: excess that is, even if no effect lowers it.
        strictly: factor of what a true effect may leave in a second look.
        noticed: excess of the model in a second look from which that tells of effects.
        hope: probability of the best few effects together from which on all are fitted to the end:
            in longer segments where usual ones are unexplained, and where numbers may be off beside
            an effect.
        closer: how many times as much as the look before a closer one is believed that contradicts
            it: errors add up in longer segments.
        many: segments; of so many, all of which leave no more than noise, the gain of the one that
            gains most does not count.
    """

    sharpness: float = 3.0
    least_gain: float = 60.0
    noticeable: float = 0.02
    crude: float = 0.1
    weak: float = 0.12
    left: float = 0.12
    apart: float = 0.5
    little: float = 0.05
    telling: float = 6.0
    chance: float = 2.0
    hardly: float = 0.1
    much: float = 0.5
    strictly: float = 0.7
    noticed: float = 0.1
    hope: float = 0.1
    closer: float = 2.0
    many: float = 8


SETTINGS = Settings()
EVEN, SURE = 0.5, 0.9
"""Probabilities above which an answer is more likely than not, and sure: then neither a closer look
is taken nor a further experiment proposed."""
LITTLE, LEFT, MUCH = SETTINGS.little, SETTINGS.left, SETTINGS.much


@dataclass(frozen=True)
class Evidence:
    """What the fits of a ranking leave; excesses are per sample, beyond what noise makes.

    Attributes:
        samples: how many there are.
        n_effective: how many count.
        noisy: whether more than noise is left of all.
        restitution: whether impacts tell of bouncier ends than the model's, and that is not tried.
        model: excess of the model with its own strengths as fitted.
        tolerant: the same, where noise may be as much as the best of all leaves, within bounds.
        own: the same, where noise is as much as the best of all leaves.
        gain: in loss, by the first effect, less the price of its numbers; where the model leaves no
            more than noise, without the segment that gains most.
        misfit_tolerance: part of the model's excess that the first effect may leave if it is the
            true one.
        effects: names, the likeliest first.
        left: excess that each leaves, with its price, where noise is as for `own`.
    """

    samples: float
    n_effective: float
    noisy: bool
    restitution: bool
    model: float
    tolerant: float
    own: float
    gain: float
    misfit_tolerance: float
    effects: tuple[str, ...]
    left: tuple[float, ...]


@dataclass(frozen=True)
class Selection:
    """A ranking with its probabilities.

    Attributes:
        verdict: on the model.
        probabilities: of the candidates, in their order.
        excess: per sample, of the model as it is and of each candidate.
        effects: the candidates' names.
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
    def unknown(self) -> float | None:
        """Probability that it is none of these; None where nothing was weighed."""
        return max(1.0 - sum(self.probabilities), 0.0) if self.probabilities else None

    @property
    def likely(self) -> bool:
        """Whether an effect is missing, and one of those named is more likely than not."""
        return self.verdict == "missing_effect" and sum(self.probabilities) > EVEN

    @property
    def share(self) -> float:
        """Part of the model's excess that the first candidate leaves; all where that is too little
        to be told from what every candidate leaves."""
        own, left = self.excess
        return left[0] / own if left and own > LITTLE else 1.0


def decide(
    found: Evidence,
    strictness: float = 1.0,
    wholly: bool = False,
    settings: Settings = SETTINGS,
) -> Selection:
    """The verdict, and how likely each effect is the missing one.

    Args:
        found: what the fits leave.
        strictness: factor of what the true effect may leave.
        wholly: whether it is unexplained where more than noise is left of all.
        settings: every number that decides.
    """
    if not found.samples:
        return Selection("adequate", (), (0.0, ()))
    tolerant = found.tolerant < settings.much and not found.restitution
    without: Verdict = "adequate" if tolerant else "unexplained"
    if not found.left:
        return Selection(without, (), (found.model, ()))
    left = np.array(found.left)
    noise = min(
        left.min(), settings.chance * float(np.sqrt(2 / found.n_effective))
    )  # not known better
    own, left = max(found.own - noise, 0.0), left - noise
    part = settings.crude if found.noisy else found.misfit_tolerance
    least = max(KNOWN_LAW * own, min(settings.weak * own, settings.left))
    beside = settings.apart * left[1:].min(initial=np.inf)
    unknown = strictness * max(min(part * own, beside), least)
    if wholly and found.noisy:  # then an unknown one is as likely as the first
        unknown = min(unknown, float(left[0]))
    little = max(settings.little, settings.telling / found.n_effective)
    weights = (left + little) ** -settings.sharpness
    novelty_weight = (unknown + little) ** -settings.sharpness
    likely = weights / (weights.sum() + novelty_weight)
    doubtful = likely[0] < settings.hardly or found.restitution
    chance = max(settings.least_gain, settings.noticeable * found.samples)
    if found.gain < chance or (own < settings.much and doubtful):
        verdict = without
    elif weights[0] <= novelty_weight:
        verdict = "unexplained"
    else:
        verdict = "missing_effect"
    excess = own, tuple(map(float, left))
    return Selection(verdict, tuple(map(float, likely)), excess, found.effects)


def closer_counts(before: Selection, closer: Selection) -> bool:
    """Whether a look at the best effects in longer segments tells more: one is still missing, and
    the first is likelier, or what it leaves no larger a part."""
    surer = closer.probabilities[:1] > before.probabilities[:1]
    return closer.verdict == "missing_effect" and (surer or closer.share <= before.share)


def doubted(before: Selection, closer: Selection, settings: Settings = SETTINGS) -> Selection:
    """A look after a closer one that does not count: where that one finds that none of the effects
    explains the runs, it is believed more (a linear opinion pool), and an effect is named only if
    it is more likely than not all the same."""
    if closer.verdict != "unexplained":
        return before
    other, more = dict(closer.named), settings.closer
    likely = tuple((p + more * other.get(name, 0.0)) / (1 + more) for name, p in before.named)
    verdict: Verdict = "missing_effect" if likely[0] > EVEN else "unexplained"
    return replace(before, verdict=verdict, probabilities=likely)


def second_counts(first: Selection, second: Selection, settings: Settings = SETTINGS) -> bool:
    """Whether a second look, at longer segments, tells more than the first that left a question."""
    if second.excess[0] <= settings.noticed:  # nothing shows there to be explained
        return False
    if first.verdict == "adequate":
        return second.verdict != "adequate"
    return second.verdict == "missing_effect" or second.share < first.share
