"""How a joint behaves, found by simulating it: let go everywhere, and moved slowly by a hand."""

from itertools import groupby
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda._context import Context
from joda.component import Frozen
from joda.interaction.hand import finest, pull
from joda.joints.rig import TIMESTEP, rig
from joda.profile import Profile
from joda.scenes.motion import FAST, Motion, settle

Array = NDArray[np.float64]
End = Literal["low_end", "high_end"]
Interval = tuple[float, float]

STARTS = np.unique([*np.linspace(0, 1, 61), 0.005, 0.01, 0.99, 0.995])
"""Where the joint is let go, in normalised position."""

PATIENCE = 15.0
"""How long (s) a joint that was let go may take to come to rest."""

GRIP = 60.0
"""What a hand can do at the end of the lever arm, N, if gravity does not ask for more."""

FIRMNESS = 1000.0
"""Stiffness of a hand at the end of the lever arm, N/m."""

SLOW = 3.0
"""How long (s) a hand takes from one end to the other."""

AT_END = 0.01
"""How near (in normalised position) an end a joint must rest to be there."""

UNMOVED = 0.003
"""How far (in normalised position) a joint that stays may give."""


class Stretch(Frozen):
    """Where the joint goes when let go at rest anywhere on a stretch.

    Attributes:
        start: interval of normalised positions where it is let go.
        goes: what it then does.
        end: normalised position where it comes to rest, the mean over the stretch.
    """

    start: Interval
    goes: Literal["low_end", "high_end", "stays", "settles"]
    end: float


class Pull(Frozen):
    """What a slow hand needs to move the joint from one end to the other.

    Attributes:
        arrived: whether a hand, of at most `grip`, can do it at all.
        force: the most that it took, N·m or N.
        at: normalised position where it took that.
        first, middle, last: the most within the first 15 % of the way, the median between 30 % and
            70 %, the most within the last 15 %; N·m or N, negative where the hand holds back.
        snaps_at: normalised positions on the way where the joint ran ahead of the hand.
    """

    arrived: bool
    force: float
    at: float
    first: float
    middle: float
    last: float
    snaps_at: tuple[float, ...]


class Closing(Frozen):
    """The fastest closing of a joint that was let go.

    Attributes:
        start: normalised position where it was let go.
        seconds: until it was closed.
        speed: at which it arrived, rad/s or m/s.
    """

    start: float
    seconds: float
    speed: float


class Behaviour(Frozen):
    """A joint's behaviour, all other joints held.

    Attributes:
        closed_end: which end counts as closed; the low end where the model does not tell.
        let_go: stretches of the range in increasing order, and where the joint goes from them.
        settles_at: normalised positions between the ends at which it comes to rest by itself after
            moving: detents, balances.
        opening, closing: moved slowly by a hand from the closed end to the other, and back.
        fastest: None where it closes from nowhere by itself.
    """

    closed_end: End
    let_go: tuple[Stretch, ...]
    settles_at: tuple[float, ...]
    opening: Pull
    closing: Pull
    fastest: Closing | None

    def after(self, position: float) -> Stretch:
        """The stretch that a normalised position belongs to, or is nearest to."""
        return min(
            self.let_go,
            key=lambda stretch: max(stretch.start[0] - position, position - stretch.start[1], 0.0),
        )

    def describe(self, context: Context) -> str:
        """The facts in a few lines, for people and for models."""
        hinge = context.joint.type == "hinge"
        unit, speed = ("N·m", "rad/s") if hinge else ("N", "m/s")
        closed = self.closed_end
        opened = "high_end" if closed == "low_end" else "low_end"
        words = {closed: "closes", opened: "opens", "stays": "stays", "settles": "settles"}
        lines = ["let go at rest (s is the normalised position):"]
        for stretch in self.let_go:
            a, b = stretch.start
            where = f"s = {a:.3g}" if a == b else f"s = {a:.3g} to {b:.3g}"
            to = f" at s = {stretch.end:.2f}" if stretch.goes == "settles" else ""
            lines.append(f"  {where}: {words[stretch.goes]}{to}")
        for name, way in (("opening", self.opening), ("closing", self.closing)):
            arm = f" ({way.force / context.lever_arm:.3g} N at the edge)" if hinge else ""
            if way.arrived:
                lines.append(
                    f"{name} it slowly by hand: at most {way.force:.3g} {unit}{arm}, at "
                    f"s = {way.at:.2f}; first {way.first:.3g}, middle {way.middle:.3g}, "
                    f"last {way.last:.3g} {unit}{_snaps(way)}"
                )
            else:
                lines.append(
                    f"{name} it slowly by hand: impossible, stuck at s = {way.at:.2f} "
                    f"with {way.force:.3g} {unit}{arm}"
                )
        if self.fastest:
            edge = self.fastest.speed * context.lever_arm
            at_edge = f" ({edge:.2g} m/s at the edge)" if hinge else ""
            lines.append(
                f"fastest closing by itself: let go at s = {self.fastest.start:.2f}, shut after "
                f"{self.fastest.seconds:.2f} s with {self.fastest.speed:.3g} {speed}{at_edge}"
            )
        return "\n".join(lines)


def behaviour(context: Context, profile: Profile) -> Behaviour:
    """Simulates the joint with a profile, alone on a rig.

    Args:
        context: the joint.
        profile: of that joint.

    Returns:
        the facts.
    """
    model = rig(context, profile)
    lo, hi = context.joint.range
    closed: End = "high_end" if context.closed_end == "high_end" else "low_end"
    motions = [settle(model, 0, lo + s * (hi - lo), PATIENCE) for s in STARTS]
    rests = np.array([np.clip((m.position[-1] - lo) / (hi - lo), 0, 1) for m in motions])
    ends = (lo, hi) if closed == "low_end" else (hi, lo)
    opening, closing = (_pull(model, *way, context) for way in (ends, ends[::-1]))
    return Behaviour(
        closed_end=closed,
        let_go=_stretches(rests),
        settles_at=_settles(rests),
        opening=opening,
        closing=closing,
        fastest=_fastest(motions, rests, closed, context),
    )


def _snaps(way: Pull) -> str:
    places = ", ".join(f"{s:.2f}" for s in way.snaps_at)
    return f"; it snaps ahead of the hand at s = {places}" if places else ""


def grip(context: Context) -> float:
    """The largest generalised force of a hand, N·m or N."""
    return max(GRIP * context.lever_arm, 2 * context.gravity_scale)


def _goes(start: float, rest: float) -> Literal["low_end", "high_end", "stays", "settles"]:
    if rest <= AT_END:
        return "low_end" if start > AT_END else "stays"
    if rest >= 1 - AT_END:
        return "high_end" if start < 1 - AT_END else "stays"
    return "stays" if abs(rest - start) <= UNMOVED else "settles"


def _stretches(rests: Array) -> tuple[Stretch, ...]:
    """Neighbouring starts with the same outcome, as one."""
    out: list[Stretch] = []
    number, last = 0, ("", 0.0)
    keys = []
    for start, rest in zip(STARTS, rests, strict=True):
        goes = _goes(start, rest)
        if goes != last[0] or (goes == "settles" and abs(rest - last[1]) > 0.02):
            number += 1
        last = (goes, rest)
        keys.append((number, goes))
    for (_, goes), group in groupby(range(len(STARTS)), key=keys.__getitem__):
        members = list(group)
        start = (_number(STARTS[members[0]]), _number(STARTS[members[-1]]))
        out.append(Stretch(start=start, goes=goes, end=_number(rests[members].mean())))
    return tuple(out)


def _settles(rests: Array) -> tuple[float, ...]:
    moved = np.abs(rests - STARTS) > UNMOVED
    return _apart(rests[moved & (rests > AT_END) & (rests < 1 - AT_END)])


def _pull(model: mujoco.MjModel, start: float, end: float, context: Context) -> Pull:
    arm, (lo, hi) = context.lever_arm, context.joint.range
    stiffness = FIRMNESS * arm**2
    model.opt.timestep = min(TIMESTEP, finest(context.equivalent_inertia, stiffness))
    motion = pull(model, 0, start, end, grip(context), stiffness, SLOW)
    sign = np.sign(end - start)
    way = (motion.position - start) / (end - start)
    force = motion.force * sign
    most = int(np.argmax(force))
    middle = force[(way >= 0.3) & (way <= 0.7)]
    last = force[way >= 0.85]
    ahead = motion.velocity * sign > FAST * abs(end - start) / SLOW
    begins = np.flatnonzero(ahead[1:] & ~ahead[:-1])
    return Pull(
        arrived=bool(way[-1] >= 0.99),
        force=_number(force[most]),
        at=_number(np.clip((motion.position[most] - lo) / (hi - lo), 0, 1)),
        first=_number(force[way <= 0.15].max()),
        middle=_number(np.median(middle)) if len(middle) else 0.0,
        last=_number(last.max()) if len(last) else 0.0,
        snaps_at=_apart((motion.position[begins] - lo) / (hi - lo)),
    )


def _apart(positions: Array) -> tuple[float, ...]:
    """Groups of normalised positions, each by its mean."""
    if not len(positions):
        return ()
    inside = np.sort(positions)
    groups = np.split(inside, np.flatnonzero(np.diff(inside) > 0.02) + 1)
    return tuple(_number(group.mean()) for group in groups)


def _fastest(motions: list[Motion], rests: Array, closed: End, context: Context) -> Closing | None:
    lo, hi = context.joint.range
    best = None
    for start, motion, rest in zip(STARTS, motions, rests, strict=True):
        if _goes(start, rest) != closed:
            continue
        s = (motion.position - lo) / (hi - lo)
        there = int(np.argmax(s <= AT_END if closed == "low_end" else s >= 1 - AT_END))
        end = lo + (AT_END if closed == "low_end" else 1 - AT_END) * (hi - lo)
        speed = _speed_at(motion, there, end)
        if best is None or speed > best.speed:
            best = Closing(
                start=_number(start), seconds=_number(motion.time[there]), speed=_number(speed)
            )
    return best


def _speed_at(motion: Motion, sample: int, position: float) -> float:
    """Speed at a position, from the two samples before this one, which may have hit the stop.

    The square of the speed is taken as linear in position, as it is under a constant force.
    """
    if sample < 2:
        return float(abs(motion.velocity[sample]))
    (a, b), (u, v) = motion.position[sample - 2 : sample], motion.velocity[sample - 2 : sample]
    slope = (v * v - u * u) / (b - a) if b != a else 0.0
    return float(np.sqrt(max(v * v + slope * (position - b), 0.0)))


def _number(value: float) -> float:
    """Four significant digits and no finer than 1e-9: facts, not noise."""
    return float(f"{value:.4g}") + 0.0 if abs(value) > 1e-9 else 0.0
