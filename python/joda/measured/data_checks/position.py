"""Where the joint was: unit, sign, zero and range of its positions, and how fine they are."""

import numpy as np
from numpy.typing import NDArray

from joda.measured import smoothing
from joda.measured.data_checks.base import DataCheck, Kind, suspect
from joda.measured.runs import QuasiStatic, Run
from joda.scenes.context import Context

Array = NDArray[np.float64]

STILL = 2e-3
"""Share of the range; a joint that moved less hardly moved."""
ROOM, SOFTNESS, MOST_ROOM = 0.02, 0.015, 0.1
"""How far beyond its range a joint may be: a share of the range, and as far as it goes in so many
seconds at its highest speed, for a soft stop; as a share of the range, at most."""
OFF = 0.06
"""Part of the range up to which a zero may be off and the runs be used: three times what it usually
is, see `joda.estimation.nuisance`."""
MAX_OUTLIER_SHARE = 0.02
"""Share of samples, beyond the range, that may be single wrong values."""
OUTLIER_MOVES, OUTLIER_NOISES, OUTLIER_TRAVEL = 5.0, 20.0, 0.02
"""How much farther than usual moves a stray sample lies from both its neighbours; from them, in
noises, and as a share of what was visited, at least."""
MIN_BEYOND_SHARE = 0.3
"""Share of samples beyond the range from which on they are no single wrong values."""
TURNS = {"rad": 2 * np.pi, "degrees": 360.0}
"""A full turn, by the unit of the positions."""
WRAP, SMOOTH = 0.85, 0.25
"""Least part of a turn that an angle jumps where it is wrapped; most that it moves elsewhere."""
STEPS = 40
"""An encoder with fewer steps over what the joint visited is coarse."""


def noise(run: Run | QuasiStatic, position: Array) -> float:
    """Noise of the positions, rad or m; of a curve none is known."""
    return smoothing.noise(run.time, position) if isinstance(run, Run) else 0.0


def placed(run: Run | QuasiStatic, context: Context) -> tuple[list[DataCheck], Array]:
    """What is wrong with unit, sign, zero and range; and the positions without it."""
    if told := _wrapped(run, context):
        return [suspect(run, "wrapped", told)], run.position
    glitches, position = _outside(run, run.position, context)
    if 0 < np.sum(position != run.position) <= max(MAX_OUTLIER_SHARE * len(position), 3):
        return glitches, position
    found, position = _unit(run, context)
    if any(one.kind == "ticks" for one in found):
        return found, position
    if _fits(run, position, context):
        return found, position
    lo, hi = context.joint.range
    unit, at = context.joint.unit, _range(context)
    visited = f"positions {_from_to(position)} {unit}"
    shift = hi - position.max() if position.max() > hi else lo - position.min()
    fits = np.ptp(position) <= hi - lo + _room(run, position, context)
    if fits and abs(shift) <= OFF * (hi - lo):
        told = (
            f"{run.name}: {visited} fit into {at} only if shifted by {shift:.4g} {unit} or more; "
            "their zero may be off, which joda diagnose tells, or the model's range"
        )
        return [*found, DataCheck("zero", f"{told}.", fatal=False)], position + shift
    if _fits(run, -position, context):
        told = (
            f"{visited} lie in minus {at}; turn their sign, or if only their zero is elsewhere, "
            f"add {lo - position.min():.4g} {unit} or more, or if the joint does go so far, "
            "correct the model's range"
        )
        return [*found, suspect(run, "sign", told)], -position
    if fits:
        told = (
            f"{visited} fit into {at} only if shifted by {shift:.4g} {unit} or more; measure them "
            "from the joint's zero, or correct the model's range"
        )
        return [*found, suspect(run, "zero", told)], position + shift
    return [*found, *_outside(run, position, context)[0]], position


def strays(run: Run, position: Array, sigma: float, unit: str) -> tuple[str, Array]:
    """Speaks where a single sample lies far from both its neighbours, which are close together;
    and the positions with such samples between these.

    Args:
        run: whose samples they are.
        position: rad or m, shape (n,), n at least 5.
        sigma: its noise, rad or m.
        unit: of the positions.
    """
    move = np.diff(position)
    out, back = move[1:-2], -move[2:-1]  # of the samples 2 to n - 3: from before, and to behind
    jump = np.where(out * back > 0, np.minimum(np.abs(out), np.abs(back)), 0.0)
    usual = np.max(np.abs([move[:-3], move[3:], out - back]), axis=0)
    least = max(OUTLIER_NOISES * sigma, OUTLIER_TRAVEL * float(np.ptp(position)))
    stray = 2 + np.flatnonzero(jump > np.maximum(least, OUTLIER_MOVES * usual))
    if not 0 < len(stray) <= max(MAX_OUTLIER_SHARE * len(position), 3):
        return "", position
    worst = stray[np.argmax(jump[stray - 2])]
    cleaned = position.copy()
    cleaned[stray] = (position[stray - 1] + position[stray + 1]) / 2
    told = (
        f"{len(stray)} of {len(position)} samples {'lie' if len(stray) > 1 else 'lies'} far from "
        f"both neighbours, by {jump[worst - 2]:.3g} {unit} at {run.time[worst]:.4g} s; take such "
        "single wrong values out"
    )
    return told, cleaned


def _unit(run: Run | QuasiStatic, context: Context) -> tuple[list[DataCheck], Array]:
    """Whether the unit is wrong; and the positions in the right one."""
    hinge, (lo, hi) = context.joint.type == "hinge", context.joint.range
    far, many = (3.0, 180 / np.pi) if hinge else (10.0, 1000.0)
    position = run.position / many
    fits = np.ptp(position) <= hi - lo + 2 * _room(run, position, context)
    if np.ptp(run.position) < far * (hi - lo):
        return [], run.position
    if not fits:
        return _ticks(run, context), run.position
    kind: Kind = "degrees" if hinge else "millimetres"
    remedy = "multiply them by π/180" if hinge else "divide them by 1000 (centimetres: by 100)"
    told = (
        f"positions {_from_to(run.position)} are far beyond {_range(context)} and look like "
        f"{kind}; {remedy}"
    )
    return [suspect(run, kind, told)], position


def _wrapped(run: Run | QuasiStatic, context: Context) -> str:
    """Speaks where an angle jumps by a full turn from one sample to the next."""
    move = np.abs(np.diff(run.position))
    if context.joint.type != "hinge" or np.ptp(context.joint.range) >= TURNS["rad"]:
        return ""
    for unit, turn in TURNS.items():
        jumps = move > WRAP * turn
        if not jumps.any() or np.ptp(run.position) > 1.001 * turn:
            continue
        if move[~jumps].max(initial=0.0) < SMOOTH * turn:
            return (
                f"positions jump by a full turn ({turn:.4g} {unit}) {jumps.sum()} times: they are "
                f"wrapped; unwrap them (numpy.unwrap with period={turn:.6g})"
            )
    return ""


def _ticks(run: Run | QuasiStatic, context: Context) -> list[DataCheck]:
    """Whether the positions are counts of an encoder."""
    if np.any(run.position != np.round(run.position)):
        return []
    full = "2π" if context.joint.type == "hinge" else "the way of one turn in m"
    told = (
        f"positions {_from_to(run.position)} are whole numbers far beyond {_range(context)} and "
        f"look like an encoder's ticks; multiply them by {full} and divide by its ticks per turn"
    )
    return [suspect(run, "ticks", told)]


def _outside(
    run: Run | QuasiStatic, position: Array, context: Context
) -> tuple[list[DataCheck], Array]:
    """Whether some samples lie outside the range; and the positions with these filled in."""
    lo, hi = context.joint.range
    beyond = np.maximum(lo - position, position - hi)
    wrong = beyond > _room(run, position, context)
    if not wrong.any():
        return [], position
    unit = context.joint.unit
    first = f", the first at {run.time[wrong][0]:.6g} s," if isinstance(run, Run) else ","
    few = (
        "remove wrong samples"
        if wrong.mean() < MIN_BEYOND_SHARE
        else f"check their unit ({unit}) and zero"
    )
    told = (
        f"{run.name}: {wrong.sum()} of {len(position)} samples lie outside {_range(context)}"
        f"{first} by up to {beyond.max():.3g} {unit}; {few}, or correct the model's range."
    )
    fatal = bool(beyond.max() > MOST_ROOM * (hi - lo))
    check = DataCheck("outside", told, fatal)
    if wrong.all():
        return [check], position
    before = position[~wrong][np.maximum(np.cumsum(~wrong) - 1, 0)]
    return [check], np.where(wrong, before, position)


def _fits(run: Run | QuasiStatic, position: Array, context: Context) -> bool:
    (lo, hi), room = context.joint.range, _room(run, position, context)
    return bool(position.min() >= lo - room and position.max() <= hi + room)


def _room(run: Run | QuasiStatic, position: Array, context: Context) -> float:
    """How far beyond its range the joint may seem to be; rad or m."""
    span = context.joint.range[1] - context.joint.range[0]
    room = ROOM * span
    if isinstance(run, Run):
        m = min(max(round(0.02 / np.median(np.diff(run.time))), 1), len(position) - 1)
        travel = np.abs(position[m:] - position[:-m]) / (run.time[m:] - run.time[:-m])
        room += 5 * noise(run, position) + SOFTNESS * travel.max()
    return float(min(room, MOST_ROOM * span))


def hardly_moved(position: Array, context: Context, step: float, sigma: float) -> str:
    """Speaks where the joint hardly moved."""
    moved, (lo, hi) = float(np.ptp(position)), context.joint.range
    # What is sampled too slowly seems to be noise; hence the bound.
    if moved > max(STILL * (hi - lo), min(10 * sigma, 0.03 * (hi - lo)), 2 * step):
        return ""
    told = f"the joint hardly moved, {moved:.2g} {context.joint.unit} of {hi - lo:.3g}"
    return f"{told}; record a run in which it moves"


def coarse(position: Array, step: float, sigma: float, unit: str) -> str:
    """Speaks where the encoder is coarse."""
    if step < np.ptp(position) / STEPS or step < 1.7 * sigma:
        return ""
    return (
        f"positions come in steps of {step:.2g} {unit}, only "
        f"{np.ptp(position) / step:.0f} over what the joint visited, so slow motion is hardly "
        "seen; use a finer encoder if you can"
    )


def _range(context: Context) -> str:
    lo, hi = context.joint.range
    return f"the range {lo:.4g} to {hi:.4g} {context.joint.unit}"


def _from_to(position: Array) -> str:
    return f"{position.min():.4g} to {position.max():.4g}"
