"""How a joint behaves, found by simulating it: let go everywhere, and moved slowly by a hand."""

from collections.abc import Callable
from itertools import groupby
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from joda.component import Frozen
from joda.interaction.pulling import Pull, apart, number, pulled
from joda.interaction.surroundings import Surroundings, touching
from joda.joints.rig import rig
from joda.plain import line
from joda.profile import Profile
from joda.scenes.context import Context
from joda.scenes.motion import Motion, settle

Array = NDArray[np.float64]
End = Literal["low_end", "high_end"]
Interval = tuple[float, float]
Goes = Literal["low_end", "high_end", "stays", "settles", "blocked"]

STARTS = np.unique([*np.linspace(0, 1, 61), 0.005, 0.01, 0.99, 0.995])
"""Where the joint is let go, in normalised position."""

IN_SCENE = np.unique([*np.linspace(0, 1, 31), 0.02])
"""The same where its whole scene is simulated, which takes longer."""

PATIENCE = 15.0
"""How long (s) a joint that was let go may take to come to rest."""

AT_END = 0.01
"""How near (in normalised position) an end a joint must rest to be there."""

UNMOVED = 0.003
"""How far (in normalised position) a joint that stays may give."""


class Stretch(Frozen):
    """Where the joint goes when let go at rest anywhere on a stretch.

    Attributes:
        start: interval of normalised positions where it is let go.
        goes: what it then does; blocked where something of the scene is, or is in the way from
            the closed end, or does not let the joint be.
        end: normalised position where it comes to rest, the mean over the stretch.
    """

    start: Interval
    goes: Goes
    end: float


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
    """A joint's behaviour: by itself, or in its scene where more acts on it.

    Attributes:
        closed_end: which end counts as closed; the low end where the model does not tell.
        let_go: stretches of the range in increasing order, and where the joint goes from them.
        settles_at: normalised positions between the ends at which it comes to rest by itself after
            moving: detents, balances.
        opening, closing: moved slowly by a hand from the closed end to the other, and back.
        fastest: None where it closes from nowhere by itself.
        touched: what of the scene touches it, and where, or acts on it; empty if nothing does.
    """

    closed_end: End
    let_go: tuple[Stretch, ...]
    settles_at: tuple[float, ...]
    opening: Pull
    closing: Pull
    fastest: Closing | None
    touched: str = ""

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
        words = {closed: "closes", opened: "opens", "blocked": "blocked by the scene"}
        lines = [f"in the scene as it is: {self.touched}"] if self.touched else []
        lines += ["let go at rest (s is the normalised position):"]
        for stretch in self.let_go:
            a, b = stretch.start
            where = f"s = {a:.3g}" if a == b else f"s = {a:.3g} to {b:.3g}"
            to = f" at s = {stretch.end:.2f}" if stretch.goes == "settles" else ""
            lines.append(f"  {where}: {words.get(stretch.goes, stretch.goes)}{to}")
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
                    f"with {way.force:.3g} {unit}{arm}{_by(way)}"
                )
        if self.fastest:
            edge = self.fastest.speed * context.lever_arm
            at_edge = f" ({edge:.2g} m/s at the edge)" if hinge else ""
            lines.append(
                f"fastest closing by itself: let go at s = {self.fastest.start:.2f}, shut after "
                f"{self.fastest.seconds:.2f} s with {self.fastest.speed:.3g} {speed}{at_edge}"
            )
        return "\n".join(map(line, lines))


def behaviour(context: Context, profile: Profile, around: Surroundings | None = None) -> Behaviour:
    """Simulates the joint with a profile, alone on a rig.

    Args:
        context: the joint.
        profile: of that joint.
        around: what acts on it in its scene: then the whole scene is simulated as it is.

    Returns:
        the facts.

    Raises:
        JodaError: the scene's simulation is unstable.
    """
    model, joint = around.scene(profile) if around else (rig(context, profile), 0)
    lo, hi = context.joint.range
    closed: End = "high_end" if context.closed_end == "high_end" else "low_end"
    shut, open_ = (0.0, 1.0) if closed == "low_end" else (1.0, 0.0)

    def possible(s: float) -> bool:
        return around is None or around.allows(model, joint, s)

    begin = shut
    if around and not possible(shut) and abs(around.reference - open_) > AT_END:
        begin = around.reference
    opening, reached = pulled(model, joint, begin, open_, context)
    if possible(open_) and not (around and not opening.arrived and around.near(opening.at)):
        reached = open_
    opened = abs(reached - shut) > AT_END
    back = reached if opened else open_
    closing = pulled(model, joint, back, shut, context)[0] if opened or possible(back) else opening
    if around:

        def alone(start: float, end: float) -> Pull:
            return pulled(rig(context, profile), 0, start, end, context)[0]

        opening = _held(opening, around, lambda: alone(begin, open_))
        closing = _held(closing, around, lambda: alone(back, shut))
    far = (min(shut, reached), max(shut, reached))
    starts = STARTS if around is None else IN_SCENE
    freely = np.array([far[0] <= s <= far[1] and possible(s) for s in starts])
    motions = [
        settle(model, joint, lo + s * (hi - lo), PATIENCE) if own else None
        for s, own in zip(starts, freely, strict=True)
    ]
    rests = np.array(
        [np.clip((m.position[-1] - lo) / (hi - lo), 0, 1) if m else np.nan for m in motions]
    )
    return Behaviour(
        closed_end=closed,
        let_go=_stretches(starts, rests),
        settles_at=_settles(starts[freely], rests[freely]),
        opening=opening,
        closing=closing,
        fastest=_fastest(starts, motions, rests, closed, context),
        touched=around.words if around else "",
    )


def _held(way: Pull, around: Surroundings, alone: Callable[[], Pull]) -> Pull:
    """The same with what is in the way where the hand got stuck, if it is not the joint itself.

    Args:
        way: in the scene.
        around: the scene.
        alone: simulates the same way of the joint by itself.
    """
    if way.arrived:
        return way
    held_by = touching(around.near(way.at))
    if not held_by and around.acting and alone().arrived:
        held_by = around.acting
    return way.model_copy(update={"held_by": held_by})


def _snaps(way: Pull) -> str:
    places = ", ".join(f"{s:.2f}" for s in way.snaps_at)
    return f"; it snaps ahead of the hand at s = {places}" if places else ""


def _by(way: Pull) -> str:
    return f": {way.held_by}" if way.held_by else ""


def _goes(start: float, rest: float) -> Goes:
    if np.isnan(rest):
        return "blocked"
    if rest <= AT_END:
        return "low_end" if start > AT_END else "stays"
    if rest >= 1 - AT_END:
        return "high_end" if start < 1 - AT_END else "stays"
    return "stays" if abs(rest - start) <= UNMOVED else "settles"


def _stretches(starts: Array, rests: Array) -> tuple[Stretch, ...]:
    """Neighbouring starts with the same outcome, as one."""
    out: list[Stretch] = []
    count, last = 0, ("", 0.0)
    keys = []
    for start, rest in zip(starts, rests, strict=True):
        goes = _goes(start, rest)
        if goes != last[0] or (goes == "settles" and abs(rest - last[1]) > 0.02):
            count += 1
        last = (goes, rest)
        keys.append((count, goes))
    for (_, goes), group in groupby(range(len(starts)), key=keys.__getitem__):
        members = list(group)
        start = (number(starts[members[0]]), number(starts[members[-1]]))
        end = np.mean(start) if goes == "blocked" else rests[members].mean()
        out.append(Stretch(start=start, goes=goes, end=number(float(end))))
    return tuple(out)


def _settles(starts: Array, rests: Array) -> tuple[float, ...]:
    moved = np.abs(rests - starts) > UNMOVED
    return apart(rests[moved & (rests > AT_END) & (rests < 1 - AT_END)])


def _fastest(
    starts: Array,
    motions: list[Motion | None],
    rests: Array,
    closed: End,
    context: Context,
) -> Closing | None:
    lo, hi = context.joint.range
    best = None
    for start, motion, rest in zip(starts, motions, rests, strict=True):
        if motion is None or _goes(start, rest) != closed:
            continue
        s = (motion.position - lo) / (hi - lo)
        there = int(np.argmax(s <= AT_END if closed == "low_end" else s >= 1 - AT_END))
        end = lo + (AT_END if closed == "low_end" else 1 - AT_END) * (hi - lo)
        speed = _speed_at(motion, there, end)
        if best is None or speed > best.speed:
            best = Closing(
                start=number(start), seconds=number(motion.time[there]), speed=number(speed)
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
