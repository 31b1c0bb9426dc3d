"""Whether a simulated joint does what is said of it, one function per behaviour.

Each is given a behaviour looked at from the closed end, and answers what the joint does instead;
nothing where it does it. Positions are shares of the way from the closed end (0) to the other (1).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from joda.interaction.behaviour import Behaviour, Stretch
from joda.scenes.context import Context

SOFT = 0.5
"""Speed (m/s) at the end of the lever arm up to which closing is soft."""

FELT = 0.5
"""Force (N) at the end of the lever arm from which a hand feels a resistance."""

ABOUT = 0.15
"""How far off an angle may be that somebody gives by eye, as a share of it."""

GIVES = 3.0
"""How many times more than moving on getting out of a catch takes."""


def share(context: Context, degrees: float) -> float:
    """The share of a hinge's way that an angle from the closed end is, at most 1."""
    lo, hi = context.joint.range
    return min(float(np.radians(degrees)) / (hi - lo), 1.0)


@dataclass(frozen=True)
class Seen:
    """A behaviour looked at from the closed end.

    Attributes:
        behaviour: the facts.
        context: the joint.
        number, most: the numbers that the requirement names, 0 where it names none.
    """

    behaviour: Behaviour
    context: Context
    number: float = 0
    most: float = 0

    def after(self, way: float) -> Stretch:
        """What becomes of the joint let go at this share of the way."""
        low = self.behaviour.closed_end == "low_end"
        return self.behaviour.after(way if low else 1 - way)

    def goes(self, way: float) -> str:
        """closes, opens, stays, settles or is blocked."""
        goes = self.after(way).goes
        if goes == "blocked":
            return "is blocked"
        if goes in ("stays", "settles"):
            return goes
        return "closes" if goes == self.behaviour.closed_end else "opens"


def _unless(good: bool, otherwise: str) -> str:
    return "" if good else otherwise


def closes_near(seen: Seen) -> str:
    """Nearly closed, it closes."""
    return _each(seen, (0.018, 0.034), "closes")


def _each(seen: Seen, ways: Iterable[float], wanted: str) -> str:
    """Whether the joint, let go at each of these shares of the way, does what is wanted."""
    lost = [way for way in ways if seen.goes(way) != wanted]
    if not lost:
        return ""
    low, high = min(lost) * 100, max(lost) * 100
    where = f"{low:.0f} %" if high - low < 1 else f"{low:.0f} to {high:.0f} %"
    return f"let go at {where} of the way it {seen.goes(lost[0])}"


def closes_from(seen: Seen) -> str:
    """From about there, and not from beyond."""
    if seen.context.joint.type != "hinge":
        return "it slides, which has no degrees"
    way = share(seen.context, seen.number)
    if lost := _each(seen, np.linspace(0.02, (1 - ABOUT) * way, 17), "closes"):
        return lost
    beyond = [far for far in np.linspace((1 + ABOUT) * way, 1, 17) if far <= 1]
    closes = [far for far in beyond if seen.goes(far) == "closes"]
    return _unless(
        not closes, f"let go at {max(closes, default=0) * 100:.0f} % of the way it closes too"
    )


def closes_anywhere(seen: Seen) -> str:
    """From everywhere it closes."""
    return _each(seen, np.linspace(0.05, 0.98, 32), "closes")


def left_open(seen: Seen) -> str:
    """From nowhere it closes."""
    closes = [way for way in np.linspace(0.05, 0.98, 32) if seen.goes(way) == "closes"]
    return _unless(
        not closes, f"let go at {max(closes, default=0) * 100:.0f} % of the way it closes"
    )


def opens_past(seen: Seen) -> str:
    """From half-way on it opens."""
    return _each(seen, (0.5, 0.6, 0.7, 0.8, 0.9), "opens")


def held_shut(seen: Seen) -> str:
    """Closed it stays, and a hand feels that it does."""
    if seen.goes(0.0) != "stays":
        return "let go closed it moves away"
    force = seen.behaviour.opening.first / seen.context.lever_arm
    return _unless(force >= FELT, f"opening it takes only {max(force, 0):.2g} N at first")


def caught(seen: Seen) -> str:
    """Held shut, and much easier to move once it is out."""
    if held := held_shut(seen):
        return held
    way = seen.behaviour.opening
    gives = way.first >= GIVES * max(way.middle, 0)
    return _unless(gives, "getting out of the catch takes hardly more than moving on")


def latched(seen: Seen) -> str:
    """Held shut, and a push is needed to get there."""
    way = seen.behaviour
    if held := held_shut(seen):
        return held
    if way.opening.first < 1.5 * max(way.opening.middle, 0):
        return "breaking out of the latch takes hardly more than moving on"
    if seen.goes(0.15) == "closes":
        return "let go at 15 % of the way it closes without a push"
    barrier = way.closing.last > 1.2 * max(way.closing.middle, 0)
    return _unless(barrier, "closing the last part takes no push")


def falls_shut(seen: Seen) -> str:
    """From half-way on it closes."""
    return _each(seen, np.linspace(0.1, 0.5, 17), "closes")


def takes(seen: Seen) -> str:
    """The most that a slow hand needs to open it, but for its inertia, lies within these forces."""
    way = seen.behaviour.opening
    force = (way.force if way.steady is None else way.steady) / seen.context.lever_arm
    return _unless(
        way.arrived and seen.number <= force <= seen.most, f"opening it takes {force:.3g} N"
    )


def arrives(seen: Seen) -> str:
    """Where it closes by itself it arrives no faster than this."""
    fastest = seen.behaviour.fastest
    speed = fastest.speed * seen.context.lever_arm if fastest else 0.0
    return _unless(speed <= seen.most, f"it arrives with {speed:.2g} m/s")


def holds_between(seen: Seen) -> str:
    """Between these angles it stays, as far as it goes."""
    if seen.context.joint.type != "hinge":
        return "it slides, which has no degrees"
    low, high = (min(share(seen.context, angle), 0.98) for angle in (seen.number, seen.most))
    return _each(seen, np.linspace(low, high, 17), "stays")


def stays_put(seen: Seen) -> str:
    """Beyond the first part of the way it stays."""
    return _each(seen, np.linspace(0.15, 0.95, 33), "stays")


def stays_half(seen: Seen) -> str:
    """About the middle it stays."""
    return _each(seen, np.linspace(0.4, 0.6, 13), "stays")


def stays_open(seen: Seen) -> str:
    """Fully open it stays."""
    return _each(seen, (1.0,), "stays")


def clicks(seen: Seen) -> str:
    """It rests by itself at so many positions, the ends included."""
    reached = {stretch.goes for stretch in seen.behaviour.let_go}
    ends = [place for place, end in ((0.0, "low_end"), (1.0, "high_end")) if end in reached]
    rests = np.sort([*seen.behaviour.settles_at, *ends])
    apart = 0.5 / max(seen.number - 1, 1)
    groups = np.split(rests, np.flatnonzero(np.diff(rests) > apart) + 1) if len(rests) else []
    if len(groups) != seen.number and (seen.number or not groups):
        return f"it rests by itself at {len(groups)} positions, not {max(seen.number, 1):g}"
    loose = max(groups, key=np.ptp)
    return _unless(
        np.ptp(loose) <= 0.5 * apart,
        f"it comes to rest loosely, at s = {loose[0]:.2f} to {loose[-1]:.2f}",
    )


def two_sides(seen: Seen) -> str:
    """Below the middle it closes, above it opens."""
    low, high = (0.1, 0.2, 0.3, 0.4), (0.6, 0.7, 0.8, 0.9)
    return _each(seen, low, "closes") or _each(seen, high, "opens")


def returns_to_middle(seen: Seen) -> str:
    """From both sides it comes back to the middle."""
    rests = [seen.after(way) for way in (0.1, 0.3, 0.7, 0.9)]
    lost = [rest for rest in rests if abs(rest.end - 0.5) > 0.1]
    return _unless(not lost, "let go beside the middle it does not come back to it")


def snaps(seen: Seen) -> str:
    """Moved slowly it somewhere runs ahead of the hand."""
    snaps = [s for s in seen.behaviour.opening.snaps_at if 0.1 < s < 0.9]
    return _unless(bool(snaps), "moved slowly by hand it nowhere runs ahead")


def free(seen: Seen) -> str:
    """Half-way a slow hand feels next to nothing."""
    ways = seen.behaviour.opening, seen.behaviour.closing
    force = max(abs(way.middle) for way in ways) / seen.context.lever_arm
    return _unless(force <= FELT, f"moving it takes {force:.2g} N half-way")


def soft(seen: Seen) -> str:
    """It arrives slowly."""
    fastest = seen.behaviour.fastest
    if fastest is None:
        return "it does not close by itself"
    speed = fastest.speed * seen.context.lever_arm
    return _unless(speed <= SOFT, f"it arrives with {speed:.2g} m/s at the edge")


def moves(seen: Seen) -> str:
    """What every joint must: be opened and closed by a hand."""
    for name, way in (("opened", seen.behaviour.opening), ("closed", seen.behaviour.closing)):
        if not way.arrived:
            force = way.force / seen.context.lever_arm
            why = f", where {way.held_by}" if way.held_by else ""
            return f"a hand cannot get it {name}, stuck at s = {way.at:.2f} with {force:.3g} N{why}"
    return ""
