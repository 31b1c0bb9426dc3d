"""What people say of a joint, and whether a simulated joint does it.

A wish is a behaviour with a sentence that states it. Sentences are read out of descriptions, the
user's or a proposer's, and checked against the facts. Positions are shares of the way from the
closed end (0) to the other end (1).
"""

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from joda._context import Context
from joda.behaviour import Behaviour, Stretch

Check = Callable[["Seen"], str]

SOFT = 0.5
"""Speed (m/s) at the end of the lever arm up to which closing is soft."""


@dataclass(frozen=True)
class Seen:
    """A behaviour looked at from the closed end.

    Attributes:
        behaviour: the facts.
        context: the joint.
        number: the number that the wish names, 0 where it names none.
    """

    behaviour: Behaviour
    context: Context
    number: int = 0

    def after(self, way: float) -> Stretch:
        """What becomes of the joint let go at this share of the way."""
        low = self.behaviour.closed_end == "low_end"
        return self.behaviour.after(way if low else 1 - way)

    def goes(self, way: float) -> str:
        """closes, opens, stays or settles."""
        goes = self.after(way).goes
        if goes in ("stays", "settles"):
            return goes
        return "closes" if goes == self.behaviour.closed_end else "opens"


def _unless(good: bool, otherwise: str) -> str:
    return "" if good else otherwise


def _closes_near(seen: Seen) -> str:
    return _each(seen, (0.018, 0.034), "closes")


def _each(seen: Seen, ways: Iterable[float], wanted: str) -> str:
    """Whether the joint, let go at each of these shares of the way, does what is wanted."""
    lost = [way for way in ways if seen.goes(way) != wanted]
    if not lost:
        return ""
    low, high = min(lost) * 100, max(lost) * 100
    where = f"{low:.0f} %" if high - low < 1 else f"{low:.0f} to {high:.0f} %"
    return f"let go at {where} of the way it {seen.goes(lost[0])}"


def _closes_anywhere(seen: Seen) -> str:
    return _each(seen, np.linspace(0.05, 0.98, 32), "closes")


def _left_open(seen: Seen) -> str:
    closes = [way for way in np.linspace(0.05, 0.98, 32) if seen.goes(way) == "closes"]
    return _unless(
        not closes, f"let go at {max(closes, default=0) * 100:.0f} % of the way it closes"
    )


def _opens_past(seen: Seen) -> str:
    return _each(seen, (0.5, 0.6, 0.7, 0.8, 0.9), "opens")


def _held_shut(seen: Seen) -> str:
    if seen.goes(0.0) != "stays":
        return "let go closed it moves away"
    force = seen.behaviour.opening.first / seen.context.lever_arm
    return _unless(force >= 0.5, f"opening it takes only {max(force, 0):.2g} N at first")


def _latched(seen: Seen) -> str:
    way = seen.behaviour
    if held := _held_shut(seen):
        return held
    if way.opening.first < 1.5 * max(way.opening.middle, 0):
        return "breaking out of the latch takes hardly more than moving on"
    if seen.goes(0.15) == "closes":
        return "let go at 15 % of the way it closes without a push"
    barrier = way.closing.last > 1.2 * max(way.closing.middle, 0)
    return _unless(barrier, "closing the last part takes no push")


def _stays_put(seen: Seen) -> str:
    return _each(seen, np.linspace(0.15, 0.95, 33), "stays")


def _stays_half(seen: Seen) -> str:
    return _each(seen, np.linspace(0.4, 0.6, 13), "stays")


def _stays_open(seen: Seen) -> str:
    return _each(seen, (1.0,), "stays")


def _clicks(seen: Seen) -> str:
    reached = {stretch.goes for stretch in seen.behaviour.let_go}
    ends = [place for place, end in ((0.0, "low_end"), (1.0, "high_end")) if end in reached]
    rests = np.sort([*seen.behaviour.settles_at, *ends])
    apart = 0.5 / max(seen.number - 1, 1)
    groups = np.split(rests, np.flatnonzero(np.diff(rests) > apart) + 1) if len(rests) else []
    if len(groups) != seen.number and (seen.number or not groups):
        return f"it rests by itself at {len(groups)} positions, not {max(seen.number, 1)}"
    loose = max(groups, key=np.ptp)
    return _unless(
        np.ptp(loose) <= 0.5 * apart,
        f"it comes to rest loosely, at s = {loose[0]:.2f} to {loose[-1]:.2f}",
    )


def _two_sides(seen: Seen) -> str:
    low, high = (0.1, 0.2, 0.3, 0.4), (0.6, 0.7, 0.8, 0.9)
    return _each(seen, low, "closes") or _each(seen, high, "opens")


def _returns_to_middle(seen: Seen) -> str:
    rests = [seen.after(way) for way in (0.1, 0.3, 0.7, 0.9)]
    lost = [rest for rest in rests if abs(rest.end - 0.5) > 0.1]
    return _unless(not lost, "let go beside the middle it does not come back to it")


def _snaps(seen: Seen) -> str:
    snaps = [s for s in seen.behaviour.opening.snaps_at if 0.1 < s < 0.9]
    return _unless(bool(snaps), "moved slowly by hand it nowhere runs ahead")


def _soft(seen: Seen) -> str:
    fastest = seen.behaviour.fastest
    if fastest is None:
        return "it does not close by itself"
    speed = fastest.speed * seen.context.lever_arm
    return _unless(speed <= SOFT, f"it arrives with {speed:.2g} m/s at the edge")


def _moves(seen: Seen) -> str:
    """What every joint must: be opened and closed by a hand."""
    for name, way in (("opened", seen.behaviour.opening), ("closed", seen.behaviour.closing)):
        if not way.arrived:
            force = way.force / seen.context.lever_arm
            return f"a hand cannot get it {name}, stuck at s = {way.at:.2f} with {force:.3g} N"
    return ""


@dataclass(frozen=True)
class Wish:
    """A behaviour that can be wished for.

    Attributes:
        says: the sentence that states it; {number} where it needs one.
        phrases: regular expression of the ways to say it; a group `number` where it needs one.
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
_COUNT = rf"\d+|{'|'.join(_COUNTS[2:])}"
WISHES: dict[str, Wish] = {
    "moves": Wish("can be opened and closed by hand", r"(?!)", _moves),
    "closes_near": Wish(
        "closes by itself when nearly closed",
        rf"(?:{_CLOSE}|pull\w* (?:itself |it |the \w+ )?(?:in|shut|closed)|self-?clos\w*|"
        r"snaps? (?:in|shut))[^.;]*\b(?:when|once|from|if|for|over|in|within)"
        r"[^.;]*\b(?:near|almost|last|few|final|slightly|little)",
        _closes_near,
    ),
    "closes_anywhere": Wish(
        "goes back by itself from anywhere",
        rf"^(?!.*\b{_MIDDLE}).*(?:"
        r"(?:go(?:es)?|spring\w*|return\w*|com(?:es?|ing)|swing\w*|clos\w*|shuts?|fall\w*|pull\w*)"
        r"[^.;]*\bfrom (?:any\w*|every\w*)|spring\w* back|"
        rf"(?:clos\w*|shuts?)(?![^.;]*{_NEAR})[^.;]*{_SELF}|self[- ]?clos\w*(?![^.;]*{_NEAR})|"
        rf"automatically clos\w*(?![^.;]*{_NEAR}))",
        _closes_anywhere,
    ),
    "left_open": Wish(
        "does not close by itself",
        rf"(?:clos|shut|swing|fall)(?![^.;]*\bfrom\b)[^.;]*{_SELF}|self[- ]?clos\w*",
        _left_open,
        denies=True,
    ),
    "opens_past": Wish(
        "opens by itself from half-way on",
        r"(?:falls?|opens?|swings?|drops?)\b[^.;]*\b(?:itself|own|open)\b[^.;]*"
        r"\b(?:half|past|beyond|middle)|falls open",
        _opens_past,
    ),
    "held_shut": Wish(
        "stays shut until it is pulled",
        r"(?:stays?|held|holds?|kept|keeps?|remains?)\b[^.;]*\b(?:shut|closed)\b",
        _held_shut,
    ),
    "latched": Wish(
        "latches shut and needs a push to latch",
        r"\blatch(?:es|ing)\b|\b(?:not|n't|to|must|should|never) latch\b|"
        r"needs? (?:a|an extra) push to",
        _latched,
    ),
    "stays_put": Wish(
        "stays wherever it is left",
        r"(?:stays?|holds?|remains?|rests?)\b[^.;]*\b(?:wherever|anywhere|any (?:angle|position|"
        r"place)|where (?:it is|it was|you|left))|free-?stop",
        _stays_put,
    ),
    "stays_half": Wish(
        "holds half-way open",
        r"(?:stays?|holds?|held|rests?|remains?)\b[^.;]*\b(?:half|middle|mid-|intermediate)",
        _stays_half,
    ),
    "stays_open": Wish(
        "stays fully open",
        r"(?:stays?|holds?|held|rests?|remains?)\b[^.;]*\b(?:fully|wide|completely) open|"
        r"stays? open(?![^.;]*\b(?:half|middle|mid-|intermediate))",
        _stays_open,
    ),
    "clicks": Wish(
        "clicks into {number} positions",
        rf"(?:clicks?|detents?|snaps?|settles?|indexes)\b[^.;]*?\b(?P<number>{_COUNT})\s+"
        rf"(?:\w+\s+)?(?:positions?|places|detents|stops|steps)|"
        rf"\b(?P<number2>{_COUNT})\s+(?:detents|clicks?|notches|positions|settings)\b|"
        r"\b(?:has|have|with|no|without) (?:any |many |distinct )?(?:detents|notches|clicks)\b|"
        r"(?:not|n't|never) click\b",
        _clicks,
    ),
    "two_sides": Wish(
        "has two stable sides and flips over between them",
        r"(?<!from )either side|bi-?stable|flips? over|two stable",
        _two_sides,
    ),
    "returns_to_middle": Wish(
        "returns to the middle when let go",
        rf"(?:returns?|springs?|comes?|goes)\b[^.;]*\b{_MIDDLE}",
        _returns_to_middle,
    ),
    "snaps": Wish(
        "snaps through on the way in",
        r"snaps? through|snap-?through|pops? (?:in|back)|over-?cent\w+",
        _snaps,
    ),
    "soft": Wish(
        "closes softly",
        r"(?:clos|shut)\w*\b[^.;]*\b(?:soft|gentl|quiet|slow)\w*|soft[- ]?clos\w*|"
        r"(?:soft|gentl|quiet|slow)ly\b[^.;]*\b(?:clos|shut)",
        _soft,
    ),
}

_VERBS = r"stays|holds|closes|shuts|returns|springs|clicks|latches|snaps|goes|falls|opens|remains"
_AND = re.compile(
    r"[.!](?:\s|$)|[;\n]|, (?:and|but)\b|\bbut\b|"
    rf"\band (?=(?:it |then |otherwise )?(?:{_VERBS})\b)"
)
_SLAM = re.compile(r"(?:without|never|not|n't) (?:\w+ )?slam\w*")
NOT = re.compile(r"\b(?:not|never|no|without|cannot|nor|neither)\b|n't\b")


@dataclass(frozen=True)
class Wanted:
    """A wish, with its number if it has one."""

    name: str
    number: int = 0

    @property
    def sentence(self) -> str:
        """What it says."""
        return WISHES[self.name].says.format(number=self.number)


def read_wishes(text: str, *, refused: bool = False) -> list[Wanted]:
    """The wishes that a description states.

    Args:
        text: in English.
        refused: those that it denies instead ("does not close by itself").
    """
    found: dict[str, Wanted] = {}
    for clause in _AND.split(_SLAM.sub("closes softly", text.lower())):
        denied = bool(NOT.search(clause))
        for name, wish in WISHES.items():
            if denied != (refused or wish.denies) or (refused and wish.denies):
                continue
            if match := re.search(wish.phrases, clause):
                groups = match.groupdict()
                number = groups.get("number") or groups.get("number2") or "0"
                count = _COUNTS.index(number) if number in _COUNTS else int(number)
                found.setdefault(name, Wanted(name, count))
    return list(found.values())


def state(wanted: Sequence[Wanted]) -> str:
    """A description that states these wishes, and is read back as them."""
    return "; ".join(f"it {wish.sentence}" for wish in wanted).capitalize() + "." if wanted else ""


def unmet(wanted: Sequence[Wanted], behaviour: Behaviour, context: Context) -> dict[str, str]:
    """The wishes that the joint does not fulfil, and that it can be moved at all.

    Args:
        wanted: the wishes.
        behaviour: what it does.
        context: the joint.

    Returns:
        wish name to a sentence that says what it does instead.
    """
    out = {}
    for wish in (Wanted("moves"), *wanted):
        if instead := WISHES[wish.name].check(Seen(behaviour, context, wish.number)):
            out[wish.name] = f"It {wish.sentence}: no, {instead}."
    return out
