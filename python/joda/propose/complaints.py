"""Common complaints about a joint, in words: which effects they mean, and which way to change them.

Only what was complained about changes; everything else of the proposal stays as it is.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from joda.compiling import contributions
from joda.errors import JodaError
from joda.field import evaluate
from joda.profile import CHANNELS
from joda.profile import Channel as Curves
from joda.proposal import EffectProposal, Proposal, Strength
from joda.propose.adjustment import rescale
from joda.propose.requirements import LONGEST_CLAUSE
from joda.scenes.context import Context
from joda.template import Template

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


PULL, FRICTION = SUBJECTS[2], SUBJECTS[-1]
SYMPTOMS: tuple[tuple[str, tuple[Subject, ...], bool], ...] = (
    (FAST, (Subject("", "damping"),), True),
    (SLOW, (Subject("", "damping"),), False),
    (r"(?:hard|difficult|heavy) to (?:open|pull)|force to open", (PULL, FRICTION), False),
    (r"(?:hard|difficult|heavy) to (?:move|turn|slide|close)", (FRICTION,), False),
    (r"drifts?\b|too easily|too freely", (FRICTION,), True),
)
"""What a complaint describes instead of naming it: which subject (the first that the profile has)
should get stronger or weaker."""


def revise(
    proposal: Proposal,
    context: Context,
    templates: Mapping[str, Template],
    complaint: str,
    key: str = "",
) -> Proposal:
    """The proposal with what was complained about changed.

    An effect within the region that is meant gets weaker or stronger as a whole. Of one that
    reaches beyond it the rest stays: it is weakened by an opposite force there, or helped by
    friction or damping there.

    Args:
        proposal: what was proposed.
        context: the joint.
        templates: by name.
        complaint: in English, one or several sentences.
        key: as for `joda.compile`.

    Raises:
        JodaError: it was not understood, or there is no such effect to change.
    """
    parts = re.split(r"[.!](?:\s|$)|[;\n]|,? and ", complaint.lower())
    for clause in (part[:LONGEST_CLAUSE] for part in parts if part.strip()):
        subjects, factor = _read(clause, complaint)
        effects = list(proposal.effect_proposals)
        for subject in subjects:
            region = _region(clause) or subject.region
            within, beyond = _meant(effects, subject, region, context)
            if within or beyond:
                break
        force = subject.channel == "conservative"
        if not within and not beyond and (factor < 1 or force):
            raise JodaError(
                f"'{clause.strip()}': the profile has no {subject.channel} effect there; "
                f"it has: {', '.join(effect.effect_name for effect in effects)}."
            )
        size, sign = _strength(proposal, context, templates, beyond, subject.channel, region, key)
        for number in within or ([] if force or factor > 1 else beyond):
            effects[number] = rescale(effects[number], subject.channel, factor)
        if within or (factor < 1 and not force):
            proposal = _put(proposal, effects)
            continue
        name = f"constant_{subject.channel}_hinge"
        if force:
            towards = sign if factor > 1 else -sign
            name = f"constant_{'positive' if towards > 0 else 'negative'}_conservative_hinge"
        effects.append(_local(name, subject.channel, region, context, clause))
        proposal = _put(proposal, effects)
        wanted = abs(factor - 1) * size
        if wanted > 0:
            proposal = _sized(proposal, context, templates, subject.channel, wanted, key)
    return proposal


def _put(proposal: Proposal, effects: Sequence[EffectProposal]) -> Proposal:
    return proposal.model_copy(update={"effect_proposals": tuple(effects)})


def _strength(
    proposal: Proposal,
    context: Context,
    templates: Mapping[str, Template],
    numbers: Sequence[int],
    channel: Channel,
    region: Region,
    key: str,
) -> tuple[float, float]:
    """Magnitude and sign of what these effects do together in the middle of a region."""
    parts = contributions(proposal, context, templates, key)
    components = tuple(parts[number][channel] for number in numbers if channel in parts[number])
    way = sum(region) / 2
    s = 1 - way if context.closed_end == "high_end" else way
    value = float(evaluate(Curves(components=components), np.array([s]))[0][0])
    return abs(value), 1.0 if value >= 0 else -1.0


def _sized(
    proposal: Proposal,
    context: Context,
    templates: Mapping[str, Template],
    channel: Channel,
    peak: float,
    key: str,
) -> Proposal:
    """The proposal with the last effect's refine factor such that it compiles to this peak."""
    *effects, last = proposal.effect_proposals
    component = contributions(proposal, context, templates, key)[-1][channel]
    now = max(map(abs, component.y))
    return _put(proposal, [*effects, rescale(last, channel, peak / now)])


def _read(clause: str, complaint: str) -> tuple[tuple[Subject, ...], float]:
    """What a clause is about, and the factor by which it should change."""
    amount = 1.6
    if re.search(r"\b(?:much|far|way|a lot|very)\b(?! enough)", clause):
        amount = 2.5
    elif re.search(r"slight|\ba bit|\ba little|somewhat", clause):
        amount = 1.25
    for words, subjects, stronger in SYMPTOMS:
        if re.search(words, clause):
            return subjects, amount if stronger else 1 / amount
    subject = next((s for s in SUBJECTS if re.search(s.words, clause)), None)
    more, less = re.search(MORE, clause), re.search(LESS, clause)
    if subject is None or bool(more) == bool(less):
        raise JodaError(
            f"the offline proposer does not understand '{complaint.strip()}'; it knows complaints "
            "such as 'the final closing pull is too strong', 'the middle should hold better', 'it "
            "slams', 'the clicks are too weak'; for free text use --proposer anthropic."
        )
    eased = subject.channel == "friction" and re.search(r"easier|easily", clause)
    return (subject,), 1 / amount if less or eased else amount


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


def _local(
    name: str, channel: Channel, region: Region, context: Context, reason: str
) -> EffectProposal:
    """An effect of one channel in a region."""
    a, b = region if context.closed_end != "high_end" else (1 - region[1], 1 - region[0])
    strengths = {each: "medium" if each == channel else "none" for each in CHANNELS}
    return EffectProposal(
        effect_name=name,
        start_ratio=round(a, 4),
        end_ratio=round(b, 4),
        strength=Strength.model_validate(strengths),
        reason=reason.strip(),
    )
