"""Learned forces on the device: their tables, and the law, as in cpp/table.h and cpp/effects.h."""

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any

import numpy as np
import warp as wp

from joda.effects import LearnedForce
from joda.effects.learned_force import EDGE as FADES
from joda.field.table import cubics
from joda.profile import Profile
from joda.warp.laws import STILL

EDGE = wp.constant(FADES)


class Part(IntEnum):
    """Place of an integer among those that say where a joint's table is."""

    ROWS = 0
    """How many; 0: there is no table."""
    COLUMNS = 1
    POSITIONS = 2
    """Where these begin in their list, and so on."""
    VELOCITIES = 3
    CUBICS = 4


@wp.struct
class Tables:
    """The tables of all joints; beside the lists shapes are (variants, joints, ...).

    Attributes:
        parts: where a joint's table is, by `Part`.
        intervals: its interval.
        positions, velocities: lists of all of them.
        cubics: coefficients about the velocities, of the first row, of the second, ...
    """

    parts: wp.array3d[int]
    intervals: wp.array2d[wp.vec2]
    positions: wp.array[float]
    velocities: wp.array[float]
    cubics: wp.array[wp.vec4]


@wp.func
def below(knots: wp.array[float], first: int, count: int, x: float) -> int:
    """Of so many knots the last at or below x, or the first one, counted from the first."""
    k = int(0)
    while k + 1 < count and knots[first + k + 1] <= x:
        k += 1
    return k


@wp.func
def fade(whole: bool, inside: float, width: float) -> float:
    """Cubic step beside an end of the interval, `whole` where that is the range's."""
    t = wp.clamp(inside / wp.min(EDGE, 0.5 * width), 0.0, 1.0)
    return wp.where(whole, 1.0, t * t * (3.0 - 2.0 * t))


@wp.func
def resistance(tables: Tables, variant: int, joint: int, position: float, v: float) -> wp.vec2:
    """A table's resistance and its slope over velocity."""
    rows = tables.parts[variant, joint, int(Part.ROWS)]
    if rows == 0:
        return wp.vec2(0.0, 0.0)
    columns = tables.parts[variant, joint, int(Part.COLUMNS)]
    place = tables.parts[variant, joint, int(Part.POSITIONS)]
    speed = tables.parts[variant, joint, int(Part.VELOCITIES)]
    s = wp.clamp(position, 0.0, 1.0)
    ends = tables.intervals[variant, joint]
    width = ends[1] - ends[0]
    weight = fade(ends[0] == 0.0, s - ends[0], width) * fade(ends[1] == 1.0, ends[1] - s, width)
    k = below(tables.positions, place, rows, s)
    part = float(0.0)
    if k + 1 < rows:
        left, right = tables.positions[place + k], tables.positions[place + k + 1]
        part = wp.clamp((s - left) / (right - left), 0.0, 1.0)
    inside = wp.clamp(v, tables.velocities[speed], tables.velocities[speed + columns - 1])
    i = wp.min(below(tables.velocities, speed, columns, inside), columns - 2)
    t = inside - tables.velocities[speed + i]
    first = tables.parts[variant, joint, int(Part.CUBICS)] + k * (columns - 1) + i
    c = tables.cubics[first]
    if part > 0.0:
        c = (1.0 - part) * c + part * tables.cubics[first + columns - 1]
    value = ((c[3] * t + c[2]) * t + c[1]) * t + c[0]
    slope = (3.0 * c[3] * t + 2.0 * c[2]) * t + c[1]
    return weight * wp.vec2(value, wp.where(inside == v, slope, 0.0))


@wp.func
def gone(h: float, time: float) -> float:
    """What is forgotten in a step, 1 - exp(-h / time); short steps by the series, as float32 has
    no more digits of the difference."""
    x = h / time
    return wp.where(x < 0.01, x * (1.0 - 0.5 * x * (1.0 - x / 3.0)), 1.0 - wp.exp(-x))


@wp.func
def learned_force(
    table: wp.vec2, stiffness: float, change: float, time: float, h: float, v: float, held: float
) -> wp.vec2:
    """A learned force in a step: a force, and a drag on the velocity after it.

    Args:
        table: resistance and slope.
        stiffness, change: gain of a memory of position, and of one of speed; one of them is 0.
        time: of the memory, s.
        h: timestep, s.
        v: velocity before the step.
        held: what is remembered.
    """
    r = wp.max(0.0, 1.0 + change * held) * table
    chord = wp.where(wp.abs(v) < STILL, r[1], r[0] / wp.where(v == 0.0, 1.0, v))
    drag = wp.max(0.0, wp.max(chord, r[1]))
    lost = gone(h, time)
    return wp.vec2(
        drag * v - r[0] - stiffness * (1.0 - lost) * held, drag + stiffness * lost * time
    )


@wp.func
def remember(change: float, time: float, h: float, v: float, held: float) -> float:
    """What is remembered after a step, at whose end the joint moves at v."""
    toward = wp.where(change == 0.0, time * v, wp.abs(v))
    return held + gone(h, time) * (toward - held)


def make_tables(variants: Sequence[Mapping[str, Profile]], device: Any) -> Tables:
    """The tables of all profiles on the device."""
    shape = (len(variants), len(variants[0]))
    parts = np.zeros((*shape, len(Part)), np.int32)
    intervals = np.zeros((*shape, 2))
    lists: tuple[list[Any], ...] = ([0.0], [0.0], [np.zeros(4)])
    for k, profiles in enumerate(variants):
        for j, profile in enumerate(profiles.values()):
            for effect in profile.effects:
                if not isinstance(effect, LearnedForce):
                    continue
                size = (len(effect.positions), len(effect.velocities))
                parts[k, j] = (*size, *map(len, lists))
                intervals[k, j] = effect.interval
                own = (effect.positions, effect.velocities, cubics(effect).reshape(-1, 4))
                for whole, more in zip(lists, own, strict=True):
                    whole.extend(more)
    out = Tables()
    out.parts = wp.array(parts, dtype=int, device=device)
    out.intervals = wp.array(intervals, dtype=wp.vec2, device=device)
    out.positions = wp.array(np.array(lists[0]), dtype=float, device=device)
    out.velocities = wp.array(np.array(lists[1]), dtype=float, device=device)
    out.cubics = wp.array(np.array(lists[2]), dtype=wp.vec4, device=device)
    return out
