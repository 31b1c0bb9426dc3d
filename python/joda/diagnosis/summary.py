"""The verdict as a sentence."""

from joda.diagnosis import phrases
from joda.diagnosis.findings import Finding
from joda.diagnosis.ranking import Ranking
from joda.diagnosis.weighing import MUCH, Weighed

MOST = 50.0
"""What of the misfit, %, an effect may leave that is said to be missing with something else."""
OFF = 0.05
"""By how much a strength must be off to be worth a word."""
SUREST = 0.99
"""Highest probability that is said."""


def strengths_off(ranking: Ranking) -> str:
    """Which of the model's own strengths are off, as a further sentence."""
    factors = [
        f"{name} \N{MULTIPLICATION SIGN} {factor:.2f}"
        for (name, _), factor in zip(ranking.asked.base.places, ranking.asked.fit.x, strict=True)
        if abs(factor - 1) > OFF
    ]
    return f" Its own numbers are somewhat off: {', '.join(factors)}." if factors else ""


def summarised(first: Finding, weighed: Weighed, one_way: bool, bouncy: bool) -> str:
    """The verdict in a sentence, where something is missing; bouncy: the ends, as in `Ranking`."""
    name = phrases.named(first.effect)
    others = " or ".join(map(phrases.named, first.indistinguishable_from))
    either = f"{name} or {others}" if others else name
    same = (
        ": the joint was moved in one direction only, where a resistance and a force over position "
        "are the same"
        if one_way and others
        else ""
    )
    if weighed.verdict == "unexplained":
        if bouncy and weighed.excess[0] < MUCH:
            return (
                "The ends of the range throw the joint back more than the model's: not explained."
            )
        share = 100 * min(weighed.share, 1.0)
        part = f"{share:.0f} %" if share > 1 else "less than 1 %"
        if share < MOST:
            return (
                f"Missing is {either if one_way else name}, but not only that{same}; it leaves "
                f"{part} of the misfit, which no known effect explains."
            )
        return (
            f"Something is missing that no known effect explains: the best of them, {name}, leaves "
            f"{part} of the misfit."
        )
    if others:
        return f"Missing is {either}{same or ': these data cannot tell which'}."
    return f"Missing is {name} (probability {100 * min(first.probability, SUREST):.0f} %)."
