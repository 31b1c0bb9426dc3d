"""Common complaints about a joint, in words: which effects they mean, and which way to change them.

Only what was complained about changes; everything else of the proposal stays as it is.
"""

import re
from dataclasses import dataclass
from typing import Literal

from joda._context import Context
from joda.errors import JodaError
from joda.profile import CHANNELS
from joda.proposal import EffectProposal, Proposal, Strength
from joda.propose.mend import rescale

Channel = Literal["conservative", "friction", "damping"]
Side = Literal["closing", "opening", "any"]
Region = tuple[float, float]

CLOSED: Region = (0.0, 0.2)
MIDDLE: Region = (0.3, 0.7)
OPEN: Region = (0.8, 1.0)
ALL: Region = (0.0, 1.0)

MORE = (
    r"too (?:weak|little|light|loose|low|soft|small|easy)|stronger|more|better|firmer|harder|"
    r"\bnot (?:strong )?enough|n't (?:hold|stay|pull|close|click)|raise|increase|strengthen"
)
LESS = (
    r"too (?:strong|much|hard|high|firm|stiff|powerful|heavy|big|tight)|weaker|less|softer|"
    r"lighter|looser|reduce|decrease|lower|weaken|easier"
)
FAST = r"slams?|slamming|too fast|too quick\w*|bounc\w*|bang\w*|too (?:violent|hard)ly|slower"
SLOW = r"too slow\w*|sluggish|creep\w*|faster|quicker"


@dataclass(frozen=True)
class Subject:
    """What a complaint can be about.

    Attributes:
        words: how it is named.
        channel, side: what of the profile it is; the side a conservative force drives to.
        region: shares of the way from the closed end where it is, unless the complaint says where.
        effect: words in the names of the effects that it means, empty for all.
    """

    words: str
    channel: Channel
    side: Side = "any"
    region: Region = ALL
    effect: str = ""


SUBJECTS = (
    Subject(r"detent|click|notch", "conservative", effect="detent_internal"),
    Subject(r"latch|snap|catch(?:es)?\b", "conservative", region=CLOSED, effect="snap|magnetic"),
    Subject(
        r"clos\w+ (?:\w+ )?(?:pull|force|attraction|tendency)|magnet\w*|seal|"
        r"(?:pull|attract)\w*[^.;]*(?:shut|closed|in\b)|pull\b",
        "conservative",
        "closing",
        CLOSED,
    ),
    Subject(r"open\w* (?:\w+ )?(?:push|force|assist|tendency)|assist", "conservative", "opening"),
    Subject(r"spring|return|rebound", "conservative", effect="spring_return"),
    Subject(r"switch|flip|toggle|bistable|bi-stable", "conservative", effect="bistable"),
    Subject(r"damp\w*|soft-?clos\w*", "damping"),
    Subject(r"friction|hold\w*|stay\w*|drag|stiff\w*|loose\w*|drift\w*|move|grip", "friction"),
)


def revise(proposal: Proposal, context: Context, complaint: str) -> Proposal:
    """The proposal with what was complained about changed.

    Args:
        proposal: what was proposed.
        context: the joint.
        complaint: in English, one or several sentences.

    Raises:
        JodaError: it was not understood, or there is no such effect to change.
    """
    effects = list(proposal.effect_proposals)
    for clause in filter(str.strip, re.split(r"[.!](?:\s|$)|[;\n]|,? and ", complaint.lower())):
        subject, factor = _read(clause, complaint)
        region = _region(clause) or subject.region
        within, beyond = _meant(effects, subject, region, context)
        chosen = within or (beyond if factor < 1 or subject.channel == "conservative" else [])
        if not chosen and (factor < 1 or subject.channel == "conservative"):
            raise JodaError(
                f"'{clause.strip()}': the profile has no {subject.channel} effect there; "
                f"it has: {', '.join(effect.effect_name for effect in effects)}."
            )
        for number in chosen:
            effects[number] = rescale(effects[number], subject.channel, factor)
        if not chosen:
            effects.append(_local(subject, region, context, clause))
    return proposal.model_copy(update={"effect_proposals": tuple(effects)})


def _read(clause: str, complaint: str) -> tuple[Subject, float]:
    """What a clause is about, and by how much it should change."""
    amount = 1.6
    if re.search(r"\b(?:much|far|way|a lot|very)\b(?! enough)", clause):
        amount = 2.5
    elif re.search(r"slight|\ba bit|\ba little|somewhat", clause):
        amount = 1.25
    if re.search(FAST, clause):
        return Subject("", "damping"), amount
    if re.search(SLOW, clause):
        return Subject("", "damping"), 1 / amount
    subject = next((s for s in SUBJECTS if re.search(s.words, clause)), None)
    more, less = re.search(MORE, clause), re.search(LESS, clause)
    if subject is None or bool(more) == bool(less):
        raise JodaError(
            f"the offline proposer does not understand '{complaint.strip()}'; it knows complaints "
            "such as 'the final closing pull is too strong', 'the middle should hold better', 'it "
            "slams', 'the clicks are too weak'; for free text use --proposer anthropic."
        )
    eased = subject.channel == "friction" and re.search(r"easier|easily", clause)
    return subject, 1 / amount if less or eased else amount


def _region(clause: str) -> Region | None:
    if match := re.search(r"(\d+(?:\.\d+)?) ?%", clause):
        at = float(match[1]) / 100
        return max(at - 0.1, 0.0), min(at + 0.1, 1.0)
    if re.search(r"middle|half|mid-", clause):
        return MIDDLE
    if re.search(r"(?:fully|nearly|wide|near) open|open end|when open|far end", clause):
        return OPEN
    if re.search(r"final|near(?:ly)? closed|closed end|almost closed|last part|shut\b", clause):
        return CLOSED
    return None


def _meant(
    effects: list[EffectProposal], subject: Subject, region: Region, context: Context
) -> tuple[list[int], list[int]]:
    """Numbers of the effects that a complaint means: within the region, and reaching beyond it."""
    within, beyond = [], []
    for number, effect in enumerate(effects):
        if getattr(effect.strength, subject.channel) == "none":
            continue
        if subject.effect and not re.search(subject.effect, effect.effect_name):
            continue
        if subject.side != "any" and subject.side not in _sides(effect, context):
            continue
        low, high = _ways(effect, context)
        common = min(high, region[1]) - max(low, region[0])
        if common >= 0.5 * (high - low):
            within.append(number)
        elif common > 0:
            beyond.append(number)
    return within, beyond


def _ways(effect: EffectProposal, context: Context) -> Region:
    """The effect's interval from the closed end."""
    a, b = effect.start_ratio, effect.end_ratio
    return (1 - b, 1 - a) if context.closed_end == "high_end" else (a, b)


def _sides(effect: EffectProposal, context: Context) -> set[Side]:
    """Where an effect's conservative force drives, by its name; both where that does not tell."""
    name = effect.effect_name
    low = "closing" if context.closed_end != "high_end" else "opening"
    high = "opening" if low == "closing" else "closing"
    if "low_end" in name or "negative" in name:
        return {low}  # type: ignore[arg-type]
    if "high_end" in name or "positive" in name:
        return {high}  # type: ignore[arg-type]
    return {"closing", "opening"}


def _local(subject: Subject, region: Region, context: Context, reason: str) -> EffectProposal:
    """More friction or damping in a region that has none of its own."""
    a, b = region if context.closed_end != "high_end" else (1 - region[1], 1 - region[0])
    strengths = {name: "medium" if name == subject.channel else "none" for name in CHANNELS}
    return EffectProposal(
        effect_name=f"constant_{subject.channel}_hinge",
        start_ratio=round(a, 4),
        end_ratio=round(b, 4),
        strength=Strength.model_validate(strengths),
        reason=reason.strip(),
    )
