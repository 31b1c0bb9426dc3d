"""What people say of a joint, and whether a simulated joint does it.

A requirement is a behaviour with a sentence that states it. Sentences are read out of descriptions,
the user's or a proposer's, and checked against the facts. Positions are shares of the way from the
closed end (0) to the other end (1).
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from joda.interaction.behaviour import Behaviour
from joda.propose import checks
from joda.propose.checks import Seen
from joda.scenes.context import Context

Check = Callable[[Seen], str]


@dataclass(frozen=True)
class RequiredBehaviour:
    """A behaviour that can be wished for.

    Attributes:
        says: the sentence that states it; {number} and {most} where it needs them.
        phrases: regular expression of the ways to say it; groups `number` and `most`, or `about`
            or `limit` alone, where it needs them.
        check: empty if the joint does it, else what it does instead.
        denies: whether it is said with a "not", which the phrases leave out.
    """

    says: str
    phrases: str
    check: Check
    denies: bool = False


_CLOSE = r"(?:clos|shut)\w*"
_SELF = r"\b(?:itself|its own|automatically)"
_NEAR = r"\b(?:when|once|if|from|for|over|in|within|near\w*|almost|last|final)\b"
_MIDDLE = r"(?:to|towards|into) (?:the |its )?(?:middle|cent\w+|neutral)"
_COUNTS = (
    *("", "", "two", "three", "four", "five", "six"),
    *("seven", "eight", "nine", "ten", "eleven", "twelve"),
)
_REAL, _NEWTON = r"\d+(?:\.\d+)?", r"(?:n\b|newtons?\b)"
_ROUND = 0.25
"""How far off a force may be that somebody gives as "about", as a share of it."""
_COUNT = rf"\d+|{'|'.join(_COUNTS[2:])}"
REQUIREMENTS: dict[str, RequiredBehaviour] = {
    "moves": RequiredBehaviour("can be opened and closed by hand", r"(?!)", checks.moves),
    "closes_near": RequiredBehaviour(
        "closes by itself when nearly closed",
        rf"(?:{_CLOSE}|pull\w* (?:itself |it |the \w+ )?(?:in|shut|closed)|self-?clos\w*|"
        r"snaps? (?:in|shut))[^.;]*\b(?:when|once|from|if|for|over|in|within)"
        r"[^.;]*\b(?:near|almost|last|few|final|slightly|little)",
        checks.closes_near,
    ),
    "closes_from": RequiredBehaviour(
        "closes by itself from {number} degrees on",
        rf"(?:{_CLOSE}|pull\w* (?:itself |it |the \w+ )?(?:in|shut|closed)|self-?clos\w*)[^.;]*?"
        rf"\b(?:from|within|over|below|under)\b[^.;]*?\b(?P<number>\d+) ?(?:degrees|deg\b|°)",
        checks.closes_from,
    ),
    "closes_anywhere": RequiredBehaviour(
        "goes back by itself from anywhere",
        rf"^(?!.*\b{_MIDDLE}).*(?:"
        r"(?:go(?:es)?|spring\w*|return\w*|com(?:es?|ing)|swing\w*|clos\w*|shuts?|fall\w*|pull\w*)"
        r"[^.;]*\bfrom (?:any\w*|every\w*)|spring\w* back|"
        rf"(?:clos\w*|shuts?)(?![^.;]*{_NEAR})[^.;]*{_SELF}|self[- ]?clos\w*(?![^.;]*{_NEAR})|"
        rf"automatically clos\w*(?![^.;]*{_NEAR}))",
        checks.closes_anywhere,
    ),
    "left_open": RequiredBehaviour(
        "does not close by itself",
        rf"(?:clos|shut|swing|fall)(?![^.;]*\bfrom\b)[^.;]*{_SELF}|self[- ]?clos\w*",
        checks.left_open,
        denies=True,
    ),
    "opens_past": RequiredBehaviour(
        "opens by itself from half-way on",
        r"(?:falls?|opens?|swings?|drops?)\b[^.;]*\b(?:itself|own|open)\b[^.;]*"
        r"\b(?:half|past|beyond|middle)|falls open",
        checks.opens_past,
    ),
    "held_shut": RequiredBehaviour(
        "stays shut until it is pulled",
        r"(?:stays?|held|holds?|kept|keeps?|remains?)\b[^.;]*\b(?:shut|closed)\b",
        checks.held_shut,
    ),
    "caught": RequiredBehaviour(
        "is caught shut and gives way to a pull",
        r"\bcaught (?:shut|closed)|"
        r"^(?!.*magnet)(?=.*\b(?:shut|closed|gives? way)\b).*\bcatch(?:es)?\b",
        checks.caught,
    ),
    "latched": RequiredBehaviour(
        "latches shut and needs a push to latch",
        r"\blatch(?:es|ing)\b|\b(?:not|n't|to|must|should|never) latch\b|"
        r"needs? (?:a|an extra) push to",
        checks.latched,
    ),
    "falls_shut": RequiredBehaviour(
        "falls shut from half-way open", r"falls? (?:back |down )?shut", checks.falls_shut
    ),
    "takes": RequiredBehaviour(
        "takes {number} to {most} newtons at the handle to open",
        rf"(?P<number>{_REAL}) ?(?:to|-|–) ?(?P<most>{_REAL}) ?{_NEWTON}|"
        rf"(?:at most|no more than|less than|under|below|up to) (?P<limit>{_REAL}) ?{_NEWTON}|"
        rf"(?P<about>{_REAL}) ?{_NEWTON}",
        checks.takes,
    ),
    "arrives": RequiredBehaviour(
        "shuts with at most {most} m/s at the handle",
        rf"(?:{_CLOSE}|arriv\w*)[^.;]*?(?:at most|no more than|less than|under|below|up to) "
        rf"(?P<limit>{_REAL}) ?m/s",
        checks.arrives,
    ),
    "holds_between": RequiredBehaviour(
        "holds between {number} and {most} degrees",
        rf"(?:stays?|holds?|held|rests?|remains?)\b[^.;]*?\b(?:between|from) (?P<number>{_REAL}) "
        rf"(?:and|to) (?P<most>{_REAL}) ?(?:degrees|deg\b|°)",
        checks.holds_between,
    ),
    "stays_put": RequiredBehaviour(
        "stays wherever it is left",
        r"^(?!.*\b(?:beyond|past|farther|further)\b).*"
        r"(?:stays?|holds?|remains?|rests?)\b[^.;]*\b(?:wherever|anywhere|any (?:angle|position|"
        r"place)|where (?:it is|it was|you|left))|free-?stop",
        checks.stays_put,
    ),
    "stays_half": RequiredBehaviour(
        "holds half-way open",
        r"(?:stays?|holds?|held|rests?|remains?)\b[^.;]*\b(?:half|middle|mid-|intermediate)",
        checks.stays_half,
    ),
    "stays_open": RequiredBehaviour(
        "stays fully open",
        r"(?:stays?|holds?|held|rests?|remains?)\b[^.;]*\b(?:fully|wide|completely) open|"
        r"stays? open(?![^.;]*\b(?:half|middle|mid-|intermediate))",
        checks.stays_open,
    ),
    "clicks": RequiredBehaviour(
        "clicks into {number} positions",
        rf"(?:clicks?|detents?|snaps?|settles?|indexes)\b[^.;]*?\b(?P<number>{_COUNT})\s+"
        rf"(?:\w+\s+)?(?:positions?|places|detents|stops|steps)|"
        rf"\b(?P<number2>{_COUNT})\s+(?:detents|clicks?|notches|positions|settings)\b|"
        r"\b(?:has|have|with|no|without) (?:any |many |distinct )?(?:detents|notches|clicks)\b|"
        r"(?:not|n't|never) click\b",
        checks.clicks,
    ),
    "two_sides": RequiredBehaviour(
        "has two stable sides and flips over between them",
        r"(?<!from )either side|bi-?stable|flips? over|two stable",
        checks.two_sides,
    ),
    "returns_to_middle": RequiredBehaviour(
        "returns to the middle when let go",
        rf"(?:returns?|springs?|comes?|goes)\b[^.;]*\b{_MIDDLE}",
        checks.returns_to_middle,
    ),
    "snaps": RequiredBehaviour(
        "snaps through on the way in",
        r"snaps? through|snap-?through|pops? (?:in|back)|over-?cent\w+",
        checks.snaps,
    ),
    "free": RequiredBehaviour(
        "moves on with hardly any resistance",
        r"\b(?:moves?|turns?|slides?|swings?|opens?|goes)\b[^.;]*\b"
        r"(?:(?:hardly|barely|scarcely) any|(?:very )?little) (?:resistance|friction)|"
        r"\b(?:moves?|turns?|slides?|swings?) (?:on )?(?:freely|lightly|easily)\b",
        checks.free,
    ),
    "soft": RequiredBehaviour(
        "closes softly",
        r"(?:clos|shut)\w*\b[^.;]*\b(?:soft|gentl|quiet|slow)\w*|soft[- ]?clos\w*|"
        r"(?:soft|gentl|quiet|slow)ly\b[^.;]*\b(?:clos|shut)",
        checks.soft,
    ),
}

_VERBS = r"stays|holds|closes|shuts|returns|springs|clicks|latches|snaps|goes|falls|opens|remains"
_AND = re.compile(
    r"[.!](?:\s|$)|[;\n]|, (?:and|but)\b|\bbut\b|"
    rf"\band (?=(?:it |then |otherwise )?(?:{_VERBS})\b)"
)
_SLAM = re.compile(r"(?:without|never|not|n't) (?:\w+ )?slam\w*")
LONGEST_CLAUSE = 500
"""Letters of a clause that are read: the time it takes grows with their third power."""
NOT = re.compile(r"\b(?:not|never|no|without|cannot|nor|neither)\b|n't\b")


@dataclass(frozen=True)
class Requirement:
    """A requirement, with its number, or its least and its most, if it has them."""

    name: str
    number: float = 0
    most: float = 0

    @property
    def sentence(self) -> str:
        """What it says."""
        return REQUIREMENTS[self.name].says.format(number=f"{self.number:g}", most=f"{self.most:g}")

    def instead(self, behaviour: Behaviour, context: Context) -> str:
        """What the joint does instead; empty if it does what it says."""
        return REQUIREMENTS[self.name].check(Seen(behaviour, context, self.number, self.most))


def read_requirements(text: str, *, refused: bool = False) -> list[Requirement]:
    """The requirements that a description states.

    Args:
        text: in English.
        refused: those that it denies instead ("does not close by itself").
    """
    found: dict[str, Requirement] = {}
    for part in _AND.split(_SLAM.sub("closes softly", text.lower())):
        clause = part[:LONGEST_CLAUSE]
        denied = bool(NOT.search(clause))
        for name, requirement in REQUIREMENTS.items():
            if denied != (refused or requirement.denies) or (refused and requirement.denies):
                continue
            if match := re.search(requirement.phrases, clause):
                found.setdefault(name, Requirement(name, *_numbers(match.groupdict())))
    return list(found.values())


def _numbers(groups: dict[str, str | None]) -> tuple[float, float]:
    """The number of a requirement, or its least and its most."""
    number = groups.get("number") or groups.get("number2") or "0"
    if about := groups.get("about"):
        return float(about) * (1 - _ROUND), float(about) * (1 + _ROUND)
    most = float(groups.get("most") or groups.get("limit") or 0)
    return float(_COUNTS.index(number) if number in _COUNTS else number), most


def state(wanted: Sequence[Requirement]) -> str:
    """A description that states these requirements, and is read back as them."""
    return (
        "; ".join(f"it {requirement.sentence}" for requirement in wanted).capitalize() + "."
        if wanted
        else ""
    )


def unmet(wanted: Sequence[Requirement], behaviour: Behaviour, context: Context) -> dict[str, str]:
    """The requirements that the joint does not fulfil, and that it can be moved at all.

    Args:
        wanted: the requirements.
        behaviour: what it does.
        context: the joint.

    Returns:
        requirement name to a sentence that says what it does instead.
    """
    out = {}
    for requirement in (Requirement("moves"), *wanted):
        if instead := requirement.instead(behaviour, context):
            out[requirement.name] = f"It {requirement.sentence}: no, {instead}."
    return out
