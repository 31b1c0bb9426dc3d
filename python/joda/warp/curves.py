"""Merged channels on the device: evaluation, and the steepest descent near a place."""

import warp as wp

from joda.warp.numbers import Curve

BUCKETS = wp.constant(32)
"""Parts of [0, 1] whose first pieces are listed; a power of two, so that which one is exact."""
CURVES = wp.constant(len(Curve))

Values = wp.types.vector(length=len(Curve), dtype=float)
"""One number of each curve, by `Curve`."""


@wp.struct
class Curves:
    """Piecewise cubics of all joints; all curves of a joint have the same knots, from 0 to 1.

    Attributes:
        where: of a joint in a variant: where its knots begin in their list, how many pieces there
            are between them, where its buckets begin and where its curves do; shape (variants,
            joints).
        slots: place of each of its curves, -1: there is none, it is zero everywhere; and how many
            it has; shape (variants, joints, curves + 1).
        steepest: the largest descent anywhere of the conservative force, shape (variants, joints).
        knots: normalised positions.
        descents: the largest descent -dF/ds of the conservative force on the piece that begins at
            each knot, or 0.
        starts: the knot at or before each bucket's beginning.
        at: values at a joint's first knot of all its curves, at its second knot, ..., as closed
            intervals may meet there; the list begins with a zero.
        cubics: coefficients about the knot, likewise.
    """

    where: wp.array2d[wp.vec4i]
    slots: wp.array3d[int]
    steepest: wp.array2d[float]
    knots: wp.array[float]
    descents: wp.array[float]
    starts: wp.array[int]
    at: wp.array[float]
    cubics: wp.array[wp.vec4]


@wp.func
def knot_before(curves: Curves, where: wp.vec4i, s: float) -> int:
    """Which of a joint's knots is the last at or before s, for s in [0, 1]."""
    bucket = wp.clamp(int(s * float(BUCKETS)), 0, BUCKETS - 1)  # also where s is not a number
    k = int(curves.starts[where[2] + bucket])
    while k < where[1] and curves.knots[where[0] + k + 1] <= s:
        k += 1
    return k


@wp.func
def values(curves: Curves, variant: int, joint: int, position: float) -> Values:
    """A joint's curves at a normalised position; beyond [0, 1] the values at that end."""
    where = curves.where[variant, joint]
    count = curves.slots[variant, joint, CURVES]
    s = wp.clamp(position, 0.0, 1.0)
    k = knot_before(curves, where, s)
    t = s - curves.knots[where[0] + k]
    first = where[3] + k * count
    out = Values()
    for curve in range(wp.static(len(Curve))):
        slot = curves.slots[variant, joint, curve]
        place = wp.where(
            slot < 0, 0, first + slot
        )  # without a branch, so that all are read at once
        if t == 0.0:
            out[curve] = curves.at[place]
        else:
            c = curves.cubics[place]
            out[curve] = ((c[3] * t + c[2]) * t + c[1]) * t + c[0]
    return out


@wp.func
def max_stiffness(curves: Curves, variant: int, joint: int, lo: float, hi: float) -> float:
    """The largest descent of the conservative force over the pieces that touch [lo, hi]."""
    where = curves.where[variant, joint]
    out = float(0.0)
    k = int(knot_before(curves, where, wp.clamp(lo, 0.0, 1.0)))
    while k < where[1] and curves.knots[where[0] + k] <= hi:
        out = wp.max(out, curves.descents[where[0] + k])
        k += 1
    return out
