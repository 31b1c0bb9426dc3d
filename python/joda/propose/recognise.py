"""Which kind of joint it is, as far as names, motion, gravity and words tell."""

import re

from joda._compile import reference_scales
from joda._context import Context
from joda.propose.kinds import KINDS, UNKNOWN
from joda.propose.parts import Gravity, Kind


def gravity_role(context: Context) -> Gravity:
    """What gravity does to the joint over most of its range."""
    force = context.gravity_force
    if context.gravity_scale < 0.05 * reference_scales(context)["conservative"]:
        return "level"
    towards_high = sum(force) > 0
    return "opens" if towards_high != (context.closed_end == "high_end") else "closes"


def recognise(context: Context, description: str = "") -> tuple[Kind, float]:
    """The kind of a joint, and how sure that is, 0 to 1.

    Args:
        context: the joint.
        description: what the user says of it; its words count most.
    """
    near = " ".join(context.names[:2]).lower()
    everything = " ".join((*context.names, *context.around)).lower()
    said = description.lower()
    best, most = UNKNOWN, 0
    for kind in KINDS:
        if context.joint.type not in kind.joint or gravity_role(context) not in kind.gravity:
            continue
        if not kind.suits(context):
            continue
        object_known = _in(kind.objects, everything) or _in(kind.objects, said)
        if kind.objects and not kind.alone and not object_known:
            continue
        score = 4 * _in(kind.own, near) + 3 * _in(kind.objects, everything)
        score += 10 * _in(kind.objects, said) + 5 * _in(_word(kind.own), said)
        if score > most:
            best, most = kind, score
    return best, {0: 0.2, 3: 0.4, 4: 0.5}.get(most, 0.7)


def _word(words: str) -> str:
    """As nouns: what latches, or needs a push to latch, is not a latch."""
    return rf"(?<!to )\b(?:{words})s?\b" if words else ""


def _in(words: str, text: str) -> bool:
    return bool(words and re.search(words, text))
