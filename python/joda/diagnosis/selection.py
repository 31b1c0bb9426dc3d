"""From what fits leave to a verdict: is anything missing, how likely is each effect, is one enough.

What the fits leave is the `Evidence`, every number that decides on it is one of the `Settings`, and
`decide` is a function of these two alone.
"""

from dataclasses import dataclass, replace

import numpy as np

from joda.diagnosis.findings import Verdict
from joda.diagnosis.settings import SETTINGS, SelectionSettings


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
        settings: that decided.
    """

    verdict: Verdict
    probabilities: tuple[float, ...]
    excess: tuple[float, tuple[float, ...]]
    effects: tuple[str, ...] = ()
    settings: SelectionSettings = SETTINGS.selection

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
        return self.verdict == "missing_effect" and sum(self.probabilities) > self.settings.likely

    @property
    def share(self) -> float:
        """Part of the model's excess that the first candidate leaves; all where that is too little
        to be told from what every candidate leaves."""
        own, left = self.excess
        return left[0] / own if left and own > self.settings.negligible_excess else 1.0


def decide(
    found: Evidence,
    strictness: float = 1.0,
    wholly: bool = False,
    settings: SelectionSettings = SETTINGS.selection,
) -> Selection:
    """The verdict, and how likely each effect is the missing one.

    Args:
        found: what the fits leave.
        strictness: factor of what the true effect may leave.
        wholly: whether it is unexplained where more than noise is left of all.
        settings: every number that decides.
    """
    if not found.samples:
        return Selection("adequate", (), (0.0, ()), settings=settings)
    tolerant = found.tolerant < settings.unexplained_excess and not found.restitution
    without: Verdict = "adequate" if tolerant else "unexplained"
    if not found.left:
        return Selection(without, (), (found.model, ()), settings=settings)
    left = np.array(found.left)
    noise = min(
        left.min(), settings.noise_stds * float(np.sqrt(2 / found.n_effective))
    )  # not known better
    own, left = max(found.own - noise, 0.0), left - noise
    part = settings.share_in_noise if found.noisy else found.misfit_tolerance
    least = max(
        settings.min_share * own,
        min(settings.unknown_share * own, settings.unknown_excess),
    )
    beside = settings.rival_share * left[1:].min(initial=np.inf)
    unknown = strictness * max(min(part * own, beside), least)
    if wholly and found.noisy:  # then an unknown one is as likely as the first
        unknown = min(unknown, float(left[0]))
    little = max(settings.negligible_excess, settings.same_loss / found.n_effective)
    weights = (left + little) ** -settings.exponent
    novelty_weight = (unknown + little) ** -settings.exponent
    likely = weights / (weights.sum() + novelty_weight)
    hardly = likely[0] < settings.min_probability or found.restitution
    chance = max(settings.min_gain, settings.min_gain_per_sample * found.samples)
    if found.gain < chance or (own < settings.unexplained_excess and hardly):
        verdict = without
    elif weights[0] <= novelty_weight:
        verdict = "unexplained"
    else:
        verdict = "missing_effect"
    excess = own, tuple(map(float, left))
    return Selection(verdict, tuple(map(float, likely)), excess, found.effects, settings)


def closer_counts(before: Selection, closer: Selection) -> bool:
    """Whether a look at the best effects in longer segments tells more: one is still missing, and
    the first is likelier, or what it leaves no larger a part."""
    surer = closer.probabilities[:1] > before.probabilities[:1]
    return closer.verdict == "missing_effect" and (surer or closer.share <= before.share)


def pooled(before: Selection, closer: Selection) -> Selection:
    """A look after a closer one that does not count: where that one finds that none of the effects
    explains the runs, it is believed more (a linear opinion pool), and an effect is named only if
    it is more likely than not all the same."""
    if closer.verdict != "unexplained":
        return before
    other, more = dict(closer.named), before.settings.closer_weight
    likely = tuple((p + more * other.get(name, 0.0)) / (1 + more) for name, p in before.named)
    verdict: Verdict = "missing_effect" if likely[0] > before.settings.likely else "unexplained"
    return replace(before, verdict=verdict, probabilities=likely)


def second_counts(first: Selection, second: Selection) -> bool:
    """Whether a second look, at longer segments, tells more than the first that left a question."""
    if second.excess[0] <= first.settings.longer_excess:  # nothing shows there to be explained
        return False
    if first.verdict == "adequate":
        return second.verdict != "adequate"
    return second.verdict == "missing_effect" or second.share < first.share
