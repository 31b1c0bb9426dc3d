"""Merged channels on the device: evaluation, and the steepest descent near a place."""

import warp as wp


@wp.struct
class Curves:
    """Piecewise cubics of all joints, in one table; shapes (variants, joints, curves).

    Attributes:
        first: where a curve's knots begin in the table.
        pieces: how many cubics it has, one less than knots; 0: it is zero everywhere.
        steepest: its largest descent anywhere.
        knots: normalised positions.
        at: value at each knot, where closed intervals may meet.
        cubics: coefficients about the knot, of the piece that begins there.
        descents: the largest descent -dF/ds on that piece, or 0.
    """

    first: wp.array3d[int]
    pieces: wp.array3d[int]
    steepest: wp.array3d[float]
    knots: wp.array[float]
    at: wp.array[float]
    cubics: wp.array[wp.vec4]
    descents: wp.array[float]


@wp.func
def piece(curves: Curves, first: int, pieces: int, s: float) -> int:
    """The last knot at or before s, for s within the knots."""
    lo, hi = int(0), int(pieces)
    while hi - lo > 1:
        middle = (lo + hi) // 2
        if curves.knots[first + middle] <= s:
            lo = middle
        else:
            hi = middle
    return lo


@wp.func
def value(curves: Curves, variant: int, joint: int, curve: int, position: float) -> float:
    """The curve at a normalised position; beyond [0, 1] the value at that end."""
    pieces = curves.pieces[variant, joint, curve]
    if pieces == 0:
        return 0.0
    first = curves.first[variant, joint, curve]
    last = first + pieces
    s = wp.clamp(position, 0.0, 1.0)
    if s < curves.knots[first] or s > curves.knots[last]:
        return 0.0
    if s == curves.knots[last]:
        return curves.at[last]
    k = first + piece(curves, first, pieces, s)
    t = s - curves.knots[k]
    if t == 0.0:
        return curves.at[k]
    c = curves.cubics[k]
    return ((c[3] * t + c[2]) * t + c[1]) * t + c[0]


@wp.func
def descent(curves: Curves, variant: int, joint: int, curve: int, lo: float, hi: float) -> float:
    """The largest descent over the pieces that touch [lo, hi]."""
    pieces = curves.pieces[variant, joint, curve]
    out = float(0.0)
    if pieces == 0:
        return out
    first = curves.first[variant, joint, curve]
    last = first + pieces
    if hi < curves.knots[first] or lo > curves.knots[last]:
        return out
    k = first
    if lo > curves.knots[first]:
        k = first + piece(curves, first, pieces, lo)
    while k < last and curves.knots[k] <= hi:
        out = wp.max(out, curves.descents[k])
        k += 1
    return out
