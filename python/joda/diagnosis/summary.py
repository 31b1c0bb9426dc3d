"""The verdict as a sentence."""

from joda.diagnosis import phrases
from joda.diagnosis.findings import Finding
from joda.diagnosis.ranking import Ranking
from joda.diagnosis.weighing import MUCH, Weighed

MOST = 50.0
"""What of the misfit, %, an effect may leave that is said to be missing with something else."""
OFF = 0.05
"""By how much a strength must be off to be worth a word."""
EVEN = 0.5
"""Probability above which an answer is more likely than not."""
SAME = (
    ": the joint was moved in one direction only, where a resistance and a force over position are "
    "the same"
)
BOUNCY = "The ends of the range throw the joint back more than the model's: not explained."
SUREST = 0.99
"""Highest probability that is said."""


def strengths_off(ranking: Ranking) -> str:
    """Which of the model's own strengths are off, as a further sentence."""
    factors = [
        f"{name} \N{MULTIPLICATION SIGN} {factor:.2f}"
        for (name, _), factor in zip(ranking.asked.base.places, ranking.asked.fit.x, strict=True)
        if abs(factor - 1) > OFF
    ]
    return f" Its own numbers are off: {', '.join(factors)}." if factors else ""


def summarised(first: Finding, weighed: Weighed, one_way: bool, bouncy: bool) -> str:
    """The verdict in a sentence, where something is missing; bouncy: the ends, as in `Ranking`.

    "Missing is" is said only of an answer that is more likely than not, and with which the error on
    windows held out of the fit falls.
    """
    name = phrases.named(first.effect)
    others = " or ".join(map(phrases.named, first.indistinguishable_from))
    either = f"{name} or {others}" if others else name
    helps = first.held_out_error_after < first.held_out_error_before
    if weighed.verdict == "unexplained":
        return _unexplained(either if one_way else name, weighed, one_way, bouncy)
    likely = f"probability {100 * min(first.probability, SUREST):.0f} %"
    if not helps:
        return (
            f"Something is missing that no known effect explains. Best guess: {name} ({likely}); "
            "but with it windows held out of the fit are missed as much."
        )
    if others:
        why = SAME if one_way else ": these data cannot tell which"
        return f"{_head(_sum(first, weighed))} {either}{why}."
    return f"{_head(first.probability)} {name} ({likely})."


def _head(probability: float) -> str:
    return "Missing is" if probability > EVEN else "Best guess:"


def _sum(first: Finding, weighed: Weighed) -> float:
    """Probability that it is the first or one that these data cannot tell from it."""
    alike = (first.effect, *first.indistinguishable_from)
    return sum(p for name, p in weighed.named if name in alike)


def _unexplained(what: str, weighed: Weighed, one_way: bool, bouncy: bool) -> str:
    if bouncy and weighed.excess[0] < MUCH:
        return BOUNCY
    share = 100 * min(weighed.share, 1.0)
    same = SAME if one_way and " or " in what else ""
    if share <= 1:
        return (
            f"Best guess: {what}{same}; it leaves less than 1 % of the misfit, as others may too."
        )
    part = f"{share:.0f} %"
    if share < MOST:
        return (
            f"Best guess: {what}, but not only that{same}; it leaves {part} of the misfit, which "
            "no known effect explains."
        )
    return (
        f"Something is missing that no known effect explains: the best of them, {what}, leaves "
        f"{part} of the misfit."
    )
