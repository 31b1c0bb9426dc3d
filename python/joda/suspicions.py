"""What looks wrong in a measurement, each as a sentence for a person, before anything is fitted.

A check speaks only when it is sure: what good measurements do too (knocks, latches, noise, coarse
encoders, slow pulls) is no suspicion.
"""

from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from joda import smoothing
from joda._context import Context
from joda.runs import QuasiStatic, Run
from joda.smoothing import resolution

Array = NDArray[np.float64]

Kind = Literal[
    "short",
    "still",
    "degrees",
    "millimetres",
    "sign",
    "zero",
    "outside",
    "resolution",
    "uneven_time",
    "gap",
    "stale",
    "slow_sampling",
    "velocity",
    "force_sign",
]

FATAL = {"short", "degrees", "millimetres", "sign", "zero"}

LEAST_RUN, LEAST_CURVE = 20, 5
"""Fewest samples of which anything can be told."""
STILL = 2e-3
"""Share of the range; a joint that moved less hardly moved."""
ROOM, SOFTNESS, MOST_ROOM = 0.02, 0.015, 0.1
"""How far beyond its range a joint may be: a share of the range, and as far as it goes in so many
seconds at its highest speed, for a soft stop; as a share of the range, at most."""
FEW = 0.02
"""Share of samples, beyond the range, that may be single wrong values."""
STEPS = 40
"""An encoder with fewer steps over what the joint visited is coarse."""
SIDES = 20
"""Samples on either side within which a joint must have moved, to be moving."""
HATS = 24
"""Most functions of which a force that depends on position is made up."""
TRIED = 0.2
"""Longest delay of a velocity that is looked for, s."""


@dataclass(frozen=True)
class Suspicion:
    """Something that looks wrong.

    Attributes:
        kind: in one word.
        sentence: names the file, says what is wrong, with numbers and units, and what to do.
        fatal: the data cannot be used as they are.
    """

    kind: Kind
    sentence: str
    fatal: bool


def suspicions(run: Run | QuasiStatic, context: Context) -> list[Suspicion]:
    """What looks wrong in a measurement of a joint.

    Args:
        run: a timed run or a quasi-static curve.
        context: of the joint; its range, inertia and gravity are compared with the measurement.

    Returns:
        the suspicions; none where nothing looks wrong.
    """
    timed, unit = isinstance(run, Run), context.joint.unit
    n, least = len(run.position), LEAST_RUN if timed else LEAST_CURVE
    if n < least:
        told = f"{n} samples are too few to tell anything; record at least {least}"
        return [_suspicion(run, "short", told)]
    found, position = _placed(run, context)
    step, sigma = resolution(position), _noise(run, position)
    sentences: dict[Kind, str] = {}
    if still := _still(position, context, step, sigma):
        sentences = {"still": still}
    elif isinstance(run, Run):
        sentences = {
            "resolution": _coarse(position, step, sigma, unit),
            "uneven_time": _uneven(run),
            "gap": _gaps(run),
            "stale": _stale(run, position, step),
            "slow_sampling": _slowly_sampled(run, position, step, unit),
            "velocity": _velocity(run, position, unit),
            "force_sign": _force_sign(_balance_of_run(run, position, sigma, context)),
        }
    else:
        sentences = {"force_sign": _force_sign(_balance_of_curve(run, position))}
    return found + [_suspicion(run, kind, told) for kind, told in sentences.items() if told]


def _suspicion(run: Run | QuasiStatic, kind: Kind, told: str) -> Suspicion:
    return Suspicion(kind, f"{run.name}: {told}.", kind in FATAL)


def _noise(run: Run | QuasiStatic, position: Array) -> float:
    return smoothing.noise(run.time, position) if isinstance(run, Run) else 0.0


# --- where the joint was
def _placed(run: Run | QuasiStatic, context: Context) -> tuple[list[Suspicion], Array]:
    """What is wrong with unit, sign, zero and range; and the positions without it."""
    glitches, position = _outside(run, run.position, context)
    if 0 < np.sum(position != run.position) <= max(FEW * len(position), 3):
        return glitches, position
    found, position = _unit(run, context)
    if _fits(run, position, context):
        return found, position
    lo, hi = context.joint.range
    unit, at = context.joint.unit, _range(context)
    visited = f"positions {_from_to(position)} {unit}"
    if _fits(run, -position, context):
        told = (
            f"{visited} lie in minus {at}; turn their sign, or if only their zero is elsewhere, "
            f"add {lo - position.min():.4g} {unit} or more"
        )
        return [*found, _suspicion(run, "sign", told)], -position
    if np.ptp(position) <= hi - lo + _room(run, position, context):
        shift = hi - position.max() if position.max() > hi else lo - position.min()
        told = (
            f"{visited} fit into {at} only if shifted by {shift:.4g} {unit} or more; measure them "
            "from the joint's zero, or correct the model's range"
        )
        return [*found, _suspicion(run, "zero", told)], position + shift
    return [*found, *_outside(run, position, context)[0]], position


def _unit(run: Run | QuasiStatic, context: Context) -> tuple[list[Suspicion], Array]:
    """Whether the unit is wrong; and the positions in the right one."""
    hinge, (lo, hi) = context.joint.type == "hinge", context.joint.range
    far, many = (3.0, 180 / np.pi) if hinge else (10.0, 1000.0)
    position = run.position / many
    fits = np.ptp(position) <= hi - lo + 2 * _room(run, position, context)
    if np.ptp(run.position) < far * (hi - lo) or not fits:
        return [], run.position
    kind: Kind = "degrees" if hinge else "millimetres"
    told = (
        f"positions {_from_to(run.position)} are far beyond {_range(context)} and look like "
        f"{kind}; {'multiply them by π/180' if hinge else 'divide them by 1000'}"
    )
    return [_suspicion(run, kind, told)], position


def _outside(
    run: Run | QuasiStatic, position: Array, context: Context
) -> tuple[list[Suspicion], Array]:
    """Whether some samples lie outside the range; and the positions with these filled in."""
    lo, hi = context.joint.range
    beyond = np.maximum(lo - position, position - hi)
    wrong = beyond > _room(run, position, context)
    if not wrong.any():
        return [], position
    told = (
        f"{run.name}: {wrong.sum()} of {len(position)} samples lie outside {_range(context)}, by "
        f"up to {beyond.max():.3g} {context.joint.unit}; remove wrong samples, or correct the "
        "model's range."
    )
    fatal = bool(beyond.max() > MOST_ROOM * (hi - lo))
    suspicion = Suspicion("outside", told, fatal)
    if wrong.all():
        return [suspicion], position
    before = position[~wrong][np.maximum(np.cumsum(~wrong) - 1, 0)]
    return [suspicion], np.where(wrong, before, position)


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
        room += 5 * _noise(run, position) + SOFTNESS * travel.max()
    return float(min(room, MOST_ROOM * span))


def _still(position: Array, context: Context, step: float, sigma: float) -> str:
    moved, (lo, hi) = float(np.ptp(position)), context.joint.range
    # What is sampled too slowly seems to be noise; hence the bound.
    if moved > max(STILL * (hi - lo), min(10 * sigma, 0.03 * (hi - lo)), 2 * step):
        return ""
    told = f"the joint hardly moved, {moved:.2g} {context.joint.unit} of {hi - lo:.3g}"
    return f"{told}; record a run in which it moves"


def _coarse(position: Array, step: float, sigma: float, unit: str) -> str:
    if step < np.ptp(position) / STEPS or step < 1.7 * sigma:
        return ""
    return (
        f"positions come in steps of {step:.2g} {unit}, only "
        f"{np.ptp(position) / step:.0f} over what the joint visited, so slow motion is hardly "
        "seen; use a finer encoder if you can"
    )


# --- when it was measured
def _uneven(run: Run) -> str:
    intervals = np.diff(run.time)
    intervals = intervals[intervals <= _longest(intervals)]
    usual = np.median(intervals)
    share = np.mean(np.abs(intervals - usual) > 0.5 * usual)
    if share < 0.05:
        return ""
    low, high = 1e3 * np.quantile(intervals, (0.05, 0.95))
    return (
        f"time is uneven, {100 * share:.0f} % of the intervals differ from the usual "
        f"{1e3 * usual:.3g} ms by more than half (mostly {low:.3g} to {high:.3g} ms); it can be "
        "used, but check that the times are those of the measurement"
    )


def _longest(intervals: Array) -> float:
    """Intervals longer than this are gaps; s."""
    return 5 * float(np.quantile(intervals, 0.9))


def _gaps(run: Run) -> str:
    intervals = np.diff(run.time)
    gaps = np.flatnonzero(intervals > _longest(intervals))
    if not len(gaps):
        return ""
    worst = gaps[np.argmax(intervals[gaps])]
    count = "a gap" if len(gaps) == 1 else f"{len(gaps)} gaps, the longest"
    return (
        f"{count} of {intervals[worst]:.3g} s after {run.time[worst]:.4g} s, where "
        f"{1e3 * np.median(intervals):.3g} ms is usual; cut the file there into two"
    )


def _stale(run: Run, position: Array, step: float) -> str:
    """Repeats of a moving joint's position beyond those that steps and noise make."""
    n = len(position)
    first = np.append(0, np.flatnonzero(np.diff(position)) + 1)  # of samples that are the same
    value, length = position[first], np.diff(np.append(first, n))
    if len(first) < 10:
        return ""
    step = max(step, float(np.abs(np.diff(value)).min()))
    sigma = smoothing.noise(run.time[first], value)
    analogue = np.sqrt(max(sigma**2 - step**2 / 4, 0.0))
    before = value - position[np.maximum(first - SIDES, 0)]
    after = position[np.minimum(first + length - 1 + SIDES, n - 1)] - value
    moving = _least(before, after) > 6 * (sigma + step)
    chance = step / np.hypot(step, 3.5 * analogue)
    chance *= np.maximum(1 - _pace(first, value) / (step + 2.5 * analogue), 0.0)
    surplus = float((length - 1 - length * chance)[moving].sum())
    share = surplus / max(length[moving].sum(), 1)
    if surplus < 8 or share < 0.15:
        return ""
    return (
        f"while the joint moves, {100 * share:.0f} % of the positions repeat the one "
        "before, as of a logger faster than its sensor; record each measured value once"
    )


def _pace(first: NDArray[np.intp], value: Array) -> Array:
    """Speed per sample over three different values before and after; 0 where it turns."""
    k = np.arange(len(first))
    a, b = np.maximum(k - 3, 0), np.minimum(k + 3, len(first) - 1)
    with np.errstate(invalid="ignore"):
        before = (value - value[a]) / (first - first[a])
        after = (value[b] - value) / (first[b] - first)
    return np.nan_to_num(_least(before, after))


def _least(before: Array, after: Array) -> Array:
    """The lesser magnitude of two motions, 0 where they have different directions."""
    return np.where(before * after > 0, np.minimum(np.abs(before), np.abs(after)), 0.0)


def _slowly_sampled(run: Run, position: Array, step: float, unit: str) -> str:
    intervals, moves, visited = np.diff(run.time), np.diff(position), float(np.ptp(position))
    usual = np.median(intervals)
    farthest = float(np.abs(moves[intervals < 1.5 * usual]).max())
    turns = np.flatnonzero(moves[:-1] * moves[1:] < 0) + 1
    swings = (np.diff(turns) <= 3) & (np.abs(np.diff(position[turns])) > 0.2 * visited)
    shakes = bool(np.any(swings[:-1] & swings[1:]))
    if not shakes and (farthest < 0.1 * visited or farthest < 1.5 * step):
        return ""
    what = (
        "turns every few samples"
        if shakes
        else f"moves up to {farthest:.3g} {unit} between two samples, "
        f"{100 * farthest / visited:.0f} % of all it visited"
    )
    faster = max(20 * farthest / visited, 5.0)
    return f"the joint {what}; record at {faster / usual:.0f} Hz or more"


# --- what else was measured
def _velocity(run: Run, position: Array, unit: str) -> str:
    """Compares the position with the velocity's integral, as nothing is differentiated then."""
    if run.velocity is None:
        return ""
    time, velocity = run.time, run.velocity
    intervals = np.diff(time)
    moves = (velocity[1:] + velocity[:-1]) / 2 * intervals
    moves = np.where(intervals > _longest(intervals), np.diff(position), moves)
    path = np.append(0, np.cumsum(moves))
    most = min(TRIED, (time[-1] - time[0]) / 5)
    some = np.flatnonzero((time >= time[0] + most) & (time <= time[-1] - most))
    if len(some) < 10 or np.ptp(position[some]) < 0.5 * np.ptp(position):
        some = np.arange(len(time))  # it moved at the very beginning or end
    some = some[:: max(len(some) // 1000, 1)]
    delays = np.linspace(-most, most, 81)
    paths = np.interp(time[some] + delays[:, None], time, path)
    paths -= paths.mean(axis=1, keepdims=True)
    q = position[some] - position[some].mean()
    factors = paths @ q / np.maximum((paths**2).sum(axis=1), 1e-300)
    errors = np.sqrt(((q - factors[:, None] * paths) ** 2).mean(axis=1))
    best, none = int(np.argmin(errors)), len(delays) // 2
    clear = errors[none] > max(3 * errors[best], 5e-3 * np.ptp(position))
    late = clear and abs(delays[best]) > max(0.01, 2.5 * np.median(intervals))
    k = best if late else none
    if errors[k] > 0.25 * q.std():
        what = "is not the derivative of the position"
    elif abs(factors[k] - 1) > 0.15:
        what = f"is {1 / factors[k]:.3g} times the derivative of the position, in {unit}/s"
    elif late:
        what = f"is {'late' if delays[k] > 0 else 'early'} by {1e3 * abs(delays[k]):.0f} ms"
    else:
        return ""
    return f"the velocity {what}; correct it, or leave the column out"


@dataclass(frozen=True)
class _Balance:
    """Forces, or their impulses, as rows of a least-squares problem.

    Attributes:
        applied: measured, shape (n,).
        opposing: what an applied force does with positive coefficients (it accelerates against
            inertia and gravity, and overcomes friction and damping), shape (n, 3 or 1).
        free: what a force that depends on position can be, either sign; shape (n, m).
    """

    applied: Array
    opposing: Array
    free: Array


def _balance_of_run(run: Run, position: Array, sigma: float, context: Context) -> _Balance | None:
    """Impulses between times at which the velocity is estimated; None without a force."""
    time, known = run.time, ~np.isnan(run.force)
    if not run.forced or not np.any(run.force[known]) or _one_way(position):
        return None
    spacing = max(0.05, 5 * np.median(np.diff(time)), (time[-1] - time[0]) / 200)
    edge = np.unique(np.searchsorted(time[:-1], np.arange(time[0], time[-1], spacing)))
    place, velocity, doubt = _smooth(time, position, edge, sigma)
    slow = 3 * np.median(doubt) + 0.01 * np.abs(velocity).max()
    middle, steps = (position[1:] + position[:-1]) / 2, np.diff(time)

    def impulses(values: Array) -> Array:
        """Integrals between the edges; shape (edges - 1, ...)."""
        halves = (values[1:] + values[:-1]) / 2 if len(values) == len(time) else values
        total = np.cumsum((halves.T * steps).T, axis=0)
        return np.asarray(np.diff(np.insert(total, 0, 0, axis=0)[edge], axis=0))

    gravity = np.interp(position, context.positions, context.gravity_force)
    friction = np.tanh(np.interp(time, time[edge], velocity) / max(slow, 1e-12))
    momentum = context.equivalent_inertia * np.diff(velocity)
    opposing = [momentum - impulses(gravity), impulses(friction), np.diff(place)]
    use = impulses((~known).astype(float)) == 0
    return _Balance(
        impulses(np.nan_to_num(run.force))[use],
        np.stack(opposing, axis=1)[use],
        impulses(_hats(middle, min(HATS, len(edge) // 4)))[use],
    )


def _smooth(time: Array, position: Array, edge: NDArray[np.intp], sigma: float) -> Array:
    """Position, velocity and its error at some samples, each from those near it."""
    wide, out = smoothing.WINDOWS[-1], []
    for t in time[edge]:
        low, high = np.searchsorted(time, (t - wide, t + wide))
        near = slice(max(low - smoothing.LEAST, 0), high + smoothing.LEAST)
        one = smoothing.smooth(time[near], position[near], np.array([t]), sigma)
        out.append((one.position[0], one.velocity[0], one.velocity_error[0]))
    return np.array(out).T


def _one_way(position: Array) -> bool:
    """Whether the joint hardly travelled back; any force may then depend on the position."""
    some = position[:: max(len(position) // 200, 1)]
    back = np.clip(np.diff(some), 0, None).sum(), np.clip(-np.diff(some), 0, None).sum()
    return bool(min(back) < 0.5 * np.ptp(position))


def _balance_of_curve(run: QuasiStatic, position: Array) -> _Balance | None:
    """Friction opposes the direction of travel; all else depends on the position."""
    if _one_way(position):
        return None
    m = max(len(position) // 50, 1)
    k = np.arange(len(position))
    ahead, behind = np.minimum(k + m, k[-1]), np.maximum(k - m, 0)
    travel = np.sign(position[ahead] - position[behind])[:, None]
    return _Balance(run.force, travel, _hats(position, min(HATS, len(position) // 4)))


def _hats(position: Array, count: int) -> Array:
    """Piecewise linear functions that add up to one over what was visited; shape (n, count)."""
    nodes = np.linspace(position.min(), position.max(), max(count, 2))
    away = np.abs(position[:, None] - nodes) / (nodes[1] - nodes[0])
    return np.asarray(np.maximum(1 - away, 0.0))


def _force_sign(balance: _Balance | None) -> str:
    """Speaks where the force explains the motion much better with its sign turned."""
    if balance is None or len(balance.applied) < balance.free.shape[1] + 15:
        return ""
    base, kept = np.linalg.qr(balance.free)
    base = base[:, np.abs(np.diag(kept)) > 1e-9 * np.abs(kept).max()]
    applied = balance.applied - base @ (base.T @ balance.applied)
    opposing = balance.opposing - base @ (base.T @ balance.opposing)
    right, wrong = _unexplained(applied, opposing), _unexplained(-applied, opposing)
    alone, spare = float(balance.applied @ balance.applied), len(applied) - balance.free.shape[1]
    if right <= 1e-4 * alone or right < max(1.5, 1 + 25 / spare) * wrong:
        return ""
    return (
        "the force looks like the reaction to what was applied to the joint: inertia, "
        f"friction and damping explain {100 * (1 - wrong / right):.0f} % of what position does not "
        "explain, but only if its sign is turned; turn it, or that of the position"
    )


def _unexplained(applied: Array, opposing: Array) -> float:
    """Least sum of squares that nonnegative coefficients leave: the best of all their subsets."""
    least = float(applied @ applied)
    for chosen in product((False, True), repeat=opposing.shape[1]):
        columns = opposing[:, np.array(chosen)]
        factors = np.linalg.lstsq(columns, applied, rcond=None)[0]
        if np.all(factors >= 0):
            least = min(least, float(((applied - columns @ factors) ** 2).sum()))
    return least


def _range(context: Context) -> str:
    lo, hi = context.joint.range
    return f"the range {lo:.4g} to {hi:.4g} {context.joint.unit}"


def _from_to(position: Array) -> str:
    return f"{position.min():.4g} to {position.max():.4g}"
