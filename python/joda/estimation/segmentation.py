"""Cuts measured runs into segments, and weighs their samples by what noise they have."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from joda.estimation.segments import GRID, LOOSE, Array, Integers, Segments, rows_of
from joda.joints.divergence import Linearized, bearable, undisturbed
from joda.measured import smoothing
from joda.measured.runs import STOP, Run, held, known

SHORTEST, LONGEST = 0.1, 0.5
"""Of segments, s, unless the joint goes through its range in less than `QUICK` of the shortest."""
QUICK = 2.0
SPEEDS = 10_000
"""Most speeds of a run that are looked at."""
TRAVEL = 0.15
"""What part of the range a segment goes through at the usual speed."""
MIN_SAMPLES = 12
"""Samples that a segment has at least."""
MAX_SAMPLES, MAX_REST_SAMPLES, REST_STRIDE = 160, 4, 8
"""Samples of a stretch of usual length that count at most; of more, every second or third does. Of
one in which the joint rests so few do, of a longer rest only in every so many stretches: they are
all the same sample."""
STILL, CREEPS = 6.0, 3.0
"""Range of the positions in a segment, in noises, up to which the joint may rest there; and how
much its two halves may differ, in standard errors."""
STEPS, DRIVEN_STEPS = 150, 200
"""Steps that a segment has at least; and where an actuator acts, whose commands come in their
own steps."""
HOP = 0.25
"""How far a joint must fall back to an end to impact there, in units of that."""
APPROACH = 8
"""Samples before an impact that belong to it."""
SURE = 0.1
"""Of the error of a velocity at first, where the joint rests."""
JOLTED = 0.03
"""Part of the range by which errors of the force, alone, may move the joint within a segment; where
they would more, as where a hand pulls up between two samples, a segment begins after them."""
JUMPED, JUMPS = 10.0, 3
"""Noises by which a single one may, where it is more than all others together: one that sticks soon
after stays where it was moved to, and a free one goes on. Where a force or damping acts, so that
how it goes on is less well known, so many of the largest may be no more than all others."""
SHARED = 1e-2
"""Variance, in units of a sample's own, above which a segment's samples share it."""
OUTSIDE_NOISES = 4.0
"""Noises outside its range at which a joint is beyond it."""
CLEAR = 1.5
"""How much larger the noise of fast samples must be to count as such."""


def segments_of(
    runs: Sequence[Run],
    sigmas: Sequence[float],
    span: float,
    lo: float,
    inertia: float,
    timestep: float,
    length: float | None = None,
    fine: bool = True,
    nearby: Callable[[Array], Linearized] = undisturbed,
    limit_rate: float = 0.0,
    thinned: bool = True,
    cut_at_ends: bool = True,
) -> Segments:
    """Cuts runs into segments; parts where the force is not known are left out.

    Args:
        runs: measured.
        sigmas: noise of each run's position, rad or m.
        span, lo: of the joint's range, rad or m.
        inertia: kg·m² or kg: how far the force's noise moves the joint.
        timestep: the scene's, s.
        length: of the segments, s; None: by the joint's pace.
        fine: whether steps are as short as the segments ask for, so that the laws act and not their
            steps; else they are the scene's.
        nearby: how errors of the joint's motion go on from positions (rad or m).
        limit_rate: natural frequency of the joint at an end of its range, 1/s: how fast the end,
            pressed as deep as the noise hides, may throw it back.
        thinned: whether of many samples, or where the joint rests, only some count.
        cut_at_ends: whether segments begin where the joint comes to an end of its range and where
            it leaves that, so that the others tell of the joint alone, whatever the end does; else
            all are alike.
    """
    usual = _length(runs, sigmas, span)
    length = length or usual
    driven = any(run.command is not None for run in runs)
    h = _step(timestep, length, usual, DRIVEN_STEPS if driven else STEPS) if fine else timestep
    chunk = max(round(usual / h), 1)
    parts: list[tuple[NDArray[Any], ...]] = []
    samples: list[tuple[NDArray[Any], ...]] = []
    apart: list[int] = []
    step, count = 0, 0
    for number, (run, sigma) in enumerate(zip(runs, sigmas, strict=True)):
        for piece in known(run):
            time, position = run.time[piece], run.position[piece]
            steps = int(np.ceil((time[-1] - time[0]) / h - 1e-9)) + 1
            steps = GRID * -(-steps // GRID)
            each = max(round(length / h), 1)
            many = max(round(steps / each), 1)
            begins = GRID * np.round(np.arange(many) * steps / many / GRID).astype(int)
            apart.extend(np.diff(begins, append=steps))
            place = (time - time[0]) / h
            index = np.minimum(np.floor(place + 1e-9).astype(int), steps - 1)
            spread, push = _spread(time, position, sigma), run.part(piece).force_error()
            far = JOLTED * span, JUMPED * float(np.median(spread))
            here, grows = nearby(position), bearable(span, float(np.median(spread)))
            begins = _after_jolts(begins, index, time, push / inertia, here.acts, *far)
            begins = _while_followed(begins, index, time, here.rate, grows)
            place_noise = (position - lo) / span, spread / span
            hits = np.zeros(len(time), bool)
            if cut_at_ends:
                begins, hits = _before_impacts(begins, index, *place_noise)
                begins = _after_pressing(begins, index, *place_noise)
                if thinned and each > chunk:
                    begins = _where_it_stays(begins, index, chunk, *place_noise)
                for left in _leaves(begins, index, *place_noise):  # in one of these gaps
                    gaps = np.diff(time[left.start : left.stop + 1])
                    thrown = limit_rate * spread[left] / gaps / np.sqrt(len(gaps))
                    push[left] = np.hypot(push[left], inertia * thrown)
            many = len(begins)
            segment = np.searchsorted(begins, index, side="right") - 1
            enough = np.bincount(segment, minlength=many) >= smoothing.MIN_SAMPLES
            start, prior_std = starts(
                time, position, time[0] + h * begins, sigma, may_rest=not run.cut
            )
            seen = np.minimum(np.searchsorted(index, begins), len(index) - 1)
            # not beyond the end that threw it back
            clear = _inside(*place_noise)[seen] > OUTSIDE_NOISES
            start[clear, 0] = np.clip(start[clear, 0], lo, lo + span)
            force = np.interp(time[0] + h * np.arange(steps), time, run.force[piece])
            fresh = np.arange(many) == 0
            same = np.full(many, number)
            edges = time[0] + h * np.arange(steps + 1)
            given = np.zeros(len(time)) if run.command is None else run.command[piece]
            command = held(time, given, edges)
            parts.append((force, command, step + begins, fresh, start, prior_std, same))
            counts = enough[segment]
            if thinned:
                acted = run.command is not None or bool(np.any(run.force[piece]))
                counts &= _thinned(index // chunk, position / spread, not acted)
            segment = np.where(counts, segment + count, -1)
            own = position, time, segment, hits, spread, push
            samples.append((step + index, place - index, *own))
            step, count = step + steps, count + many
    force, command, at, fresh, start, prior_stds, run_of = (
        np.concatenate(x) for x in zip(*parts, strict=True)
    )
    index, share, position, time, segment, hits, spread, push = (
        np.concatenate(x) for x in zip(*samples, strict=True)
    )
    rows = rows_of(segment, count)
    place, noise = (position - lo) / span, spread / span
    return Segments(
        h=h,
        length=float(h * np.median(apart)),
        force=force,
        at=at,
        fresh=fresh,
        start=start,
        prior_std=prior_stds,
        step=index,
        share=share,
        position=position,
        time=time,
        run=run_of,
        rows=rows,
        sharpness=np.where(rows >= 0, 1 / spread[rows], 0.0),
        shared=_shared(rows, time, spread, push / inertia, nearby(position).rate),
        impacts=_with_impact(rows, place, noise, hits) if cut_at_ends else np.zeros(count, bool),
        rests=_rests(rows, place, noise) if cut_at_ends else np.zeros(count, bool),
        stays=_stays(rows, place, noise) * np.array([run.forced for run in runs])[run_of[segment]],
        command=command if driven else None,
    )


def starts(
    time: Array, position: Array, at: Array, sigma: float, may_rest: bool = True
) -> tuple[Array, Array]:
    """States from which segments begin, and how far the true ones may be from them.

    Args:
        time, position: of a run's samples, s and rad or m; shape (n,).
        at: when the segments begin, s, the first with the run; shape (m,).
        sigma: noise of the position, rad or m.
        may_rest: whether the joint is at rest at first where that is how it looks; one that has
            just begun to move, before its first sample here, looks so too.

    Returns:
        positions and velocities, and their standard deviations; shape (m, 2) each.
    """
    begun = smoothing.smooth(time, position, at, sigma)
    start = np.stack([begun.position, begun.velocity], axis=1)
    prior_std = LOOSE * np.stack([begun.position_error, begun.velocity_error], axis=1)
    if may_rest and smoothing.begins_at_rest(time, position, sigma):
        start[0, 1], prior_std[0, 1] = 0.0, SURE * begun.velocity_error[0]
    return start, prior_std


def _step(timestep: float, length: float, usual: float, steps: int) -> float:
    """A part or a multiple of the scene's timestep (s) that is short for segments of some length.

    Args:
        timestep: the scene's, s.
        length: of the segments, s.
        usual: length of segments by the joint's pace, s; only for its sake are steps longer.
        steps: that a segment has at least.
    """
    wanted = min(length / steps, max(timestep, usual / steps))
    if wanted < timestep:
        return float(timestep / np.ceil(timestep / wanted))
    return float(timestep * np.floor(wanted / timestep + 1e-9))


def _length(runs: Sequence[Run], sigmas: Sequence[float], span: float) -> float:
    """Of the segments, by the joint's usual speed and the sampling, s."""
    pairs = list(zip(runs, sigmas, strict=True))
    speeds = np.concatenate([_speeds(run, sigma, SHORTEST / 2) for run, sigma in pairs])
    quickest = SHORTEST
    fastest = min(smoothing.pace(run.time, run.position, sigma) for run, sigma in pairs)
    if fastest < QUICK * SHORTEST:
        quickest = fastest / QUICK
        speeds = np.concatenate([_speeds(run, sigma, quickest / 2) for run, sigma in pairs])
    usual = float(np.median(speeds)) if len(speeds) else 0.0
    length = TRAVEL * span / usual if usual else LONGEST
    return max(min(max(length, quickest), LONGEST), shortest(runs))


def shortest(runs: Sequence[Run]) -> float:
    """How long segments of runs are at least for their samples to tell of the joint, s."""
    return MIN_SAMPLES * float(np.median(np.concatenate([np.diff(run.time) for run in runs])))


def _speeds(run: Run, sigma: float, apart: float) -> Array:
    """Over times that are so far apart (s), where they are clearly more than the noise makes."""
    count = min(int(np.ptp(run.time) / apart) + 1, SPEEDS)
    path = np.interp(run.time[0] + apart * np.arange(count), run.time, run.position)
    speed = np.abs(np.diff(path)) / apart
    return np.asarray(speed[speed > 4 * sigma / apart])


def _thinned(chunk: Integers, noises: Array, free: bool) -> NDArray[np.bool_]:
    """Which samples are kept: at most `MAX_SAMPLES` of a chunk of usual length, evenly; where the
    joint rests, few, and of few chunks, if no force tells how much holds it.

    Args:
        chunk: of each sample, increasing.
        noises: positions in units of their noise.
        free: whether no force acts.
    """
    _, first, count = np.unique(chunk, return_index=True, return_counts=True)
    kept = np.zeros(len(chunk), bool)
    rested = 0
    for begin, many in zip(first, count, strict=True):
        own = slice(begin, begin + many)
        rested = rested + 1 if free and _rest(noises[own]) else 0
        if rested == 0 or rested % REST_STRIDE == 1:
            kept[
                begin : begin + many : -(-many // (MAX_REST_SAMPLES if rested else MAX_SAMPLES))
            ] = True
    return kept


def _rest(noises: Array) -> bool:
    """Whether a joint rests, by its positions in units of their noise."""
    half = len(noises) // 2
    if not half or np.ptp(noises) > STILL:
        return False
    return bool(abs(noises[:half].mean() - noises[half:].mean()) < CREEPS * 2 / len(noises) ** 0.5)


def _spread(time: Array, position: Array, sigma: float) -> Array:
    """Standard deviations of the samples: the encoder's, and what uneven clocks make at speed."""
    slope = np.abs(np.gradient(position, time))
    smooth = np.convolve(slope, np.full(9, 1 / 9), mode="same")
    fast = smooth > np.quantile(smooth, 0.7)
    fast[[0, 1, -2, -1]] = False
    if len(time) < 5 or fast.sum() < MIN_SAMPLES:
        return np.full(len(time), sigma)
    own = smoothing.deviation(smoothing.departures(time, position)[fast[2:-2]])
    late = np.sqrt(max(own**2 - (CLEAR * sigma) ** 2, 0.0)) / np.median(smooth[fast])
    return np.asarray(np.hypot(sigma, late * smooth))


def _shared(rows: Integers, time: Array, sigma: Array, push: Array, rate: Array) -> Array:
    """What of the noise a segment's samples share, see `Segments`.

    Besides the position's noise there is that of the force: an error of acceleration `push`, from
    one sample to the next, moves a free joint by that time, and on at the speed that it got; one
    that runs away at a `rate` further, see `_responses`. In units of the position's noise the
    covariance is 1 + sum of l u uᵀ over few directions u, and its inverse root 1 - sum of
    (1 - 1 / sqrt(1 + l)) u uᵀ.
    """
    found = []
    given = np.cumsum(np.append(0.0, (push[:-1] * np.maximum(np.diff(time), 0.0)) ** 2))
    for row in rows:
        own = row[row >= 0]
        if not push[own].any():
            found.append(np.zeros((len(own), 0)))
            continue
        t = time[own] - time[own[0]]
        gaps = np.diff(t, append=t[-1])
        between = np.sqrt(np.diff(given[own], append=given[own[-1:]]))  # in samples left out, too
        speeds = np.maximum(gaps * push[own], between)
        moved = _responses(t, gaps, rate[own]) * speeds / sigma[own][:, None]
        size, way = np.linalg.eigh(moved @ moved.T)
        much = size > SHARED
        found.append(way[:, much] * np.sqrt(1 - 1 / np.sqrt(1 + size[much])))
    out = np.zeros((*rows.shape, max((one.shape[1] for one in found), default=0)))
    for ways, one in zip(out, found, strict=True):
        ways[: len(one), : one.shape[1]] = one
    return out


def _responses(t: Array, gaps: Array, rate: Array) -> Array:
    """Where a joint is at each time that was given a speed of 1 in the midst of each gap before.

    It moves by x'' = rate² x, with the rate of each gap; a free one, of rate 0, by the time since.
    Shape (n, n): times, gaps.
    """
    if not rate.any():
        return np.maximum(t[:, None] - t - 0.5 * gaps, 0.0)
    out = np.zeros((len(t), len(t)))
    x, v = np.zeros(len(t)), np.zeros(len(t))
    for i in range(1, len(t)):
        r, gap = rate[i - 1], gaps[i - 1]
        growing, going = np.cosh(r * gap), np.sinh(r * gap) / r if r else gap
        x, v = growing * x + going * v, r**2 * going * x + growing * v
        x[i - 1], v[i - 1] = 0.5 * gap, 1.0
        out[i] = x
    return out


def _after_jolts(
    begins: Integers,
    index: Integers,
    time: Array,
    push: Array,
    acts: NDArray[np.bool_],
    far: float,
    alone: float,
) -> Integers:
    """Where segments begin, also after errors `push` (of an acceleration, from each sample to the
    next) that would move a free joint further than `far` until the segment ends, or one of them
    further than `alone`, and than all others together; those but for the `JUMPS` largest where
    anything else `acts`."""
    jolts = np.diff(time, append=time[-1]) * push

    def after(first: int, end: int) -> int:
        moved = jolts[first : end - 1] * (time[end - 1] - time[first : end - 1])
        if not len(moved):
            return end
        squares = np.sort(moved**2)
        others = squares[: -JUMPS if acts[first:end].any() else -1].sum()
        jumps = moved.max() > max(alone, np.sqrt(others))
        return first + int(np.argmax(moved)) + 1 if jumps or squares.sum() > far**2 else end

    return _cut_more(begins, index, after)


def _while_followed(
    begins: Integers, index: Integers, time: Array, rate: Array, most: float
) -> Integers:
    """Where segments begin, also where an error at a segment's begin, in a joint that runs away at
    a `rate`, has grown by more than the exponential of `most`."""
    grown = cumulative_trapezoid(rate, time, initial=0.0)

    def after(first: int, end: int) -> int:
        return first + int(np.searchsorted(grown[first:end], grown[first] + most, side="right"))

    return _cut_more(begins, index, after)


def _cut_more(begins: Integers, index: Integers, after: Callable[[int, int], int]) -> Integers:
    """Where segments begin, also at the sample that `after` tells of the first one of a segment and
    that of the next; there none more begins where it tells that one."""
    at, out = 0, list(begins)
    while at < len(out):
        first = int(np.searchsorted(index, out[at]))
        end = int(np.searchsorted(index, out[at + 1])) if at + 1 < len(out) else len(index)
        sample = after(first, end) if first < end else end
        begin = index[sample] // GRID * GRID if sample < end else out[at]
        if begin > out[at]:
            out.insert(at + 1, begin)
        else:
            at += 1
    return np.array(out)


def _before_impacts(
    begins: Integers, index: Integers, s: Array, noise: Array
) -> tuple[Integers, NDArray[np.bool_]]:
    """Where segments begin, also just before an impact: what is before it tells of the joint; and
    which samples are impacts."""
    rows = rows_of(np.searchsorted(begins, index, side="right") - 1, len(begins))
    impacts = _impact_of_each(rows, s, noise)
    many = (rows >= 0).sum(axis=1)
    more, fewer, hits = [], [], np.zeros(len(s), bool)
    for k, impact in enumerate(impacts):
        if impact is None:
            continue
        hit = rows[k][impact]
        hits[hit] = True
        before = impact - APPROACH
        joined = k > 0 and impacts[k - 1] is None and many[k - 1] + before >= 2 * MIN_SAMPLES
        if before >= MIN_SAMPLES:
            more.append(hit - APPROACH)
        elif joined:  # the segment before ends there
            more.append(hit - APPROACH)
            fewer.append(begins[k])
        elif impact >= smoothing.MIN_SAMPLES:  # a short stroke: up to the impact itself
            more.append(hit)
    kept = np.setdiff1d(begins, np.array(fewer, int))
    return np.union1d(kept, index[np.array(more, int)] // GRID * GRID), hits


def _inside(s: Array, noise: Array) -> Array:
    """How far from the ends of the range, in noises; negative beyond them."""
    return np.asarray(np.minimum(s, 1 - s) / noise)


def _after_pressing(begins: Integers, index: Integers, s: Array, noise: Array) -> Integers:
    """Where segments begin, also where one that began beyond the range comes back into it: what an
    end that yields does to the joint is not known."""
    beyond = _inside(s, noise) < -OUTSIDE_NOISES
    more = []
    for row in rows_of(np.searchsorted(begins, index, side="right") - 1, len(begins)):
        own = beyond[row[row >= 0]]
        if own[:1].any() and not own.all():
            more.append(index[row[np.argmin(own)]])
    return _begun_at(begins, index, more)


def _where_it_stays(
    begins: Integers, index: Integers, chunk: int, s: Array, noise: Array
) -> Integers:
    """Where long segments begin, also within a stay at an end of `chunk` steps or more: what is
    after half of these tells of the joint, whatever the end did to it before."""
    at_end = np.abs(np.minimum(s, 1 - s)) < OUTSIDE_NOISES * noise
    rows = rows_of(np.searchsorted(begins, index, side="right") - 1, len(begins))
    more = []
    for row, impact in zip(rows, _impact_of_each(rows, s, noise), strict=True):
        own = row[row >= 0]
        if impact is None:
            continue
        moves = np.append(np.flatnonzero(~at_end[own]), len(own))
        first = np.append(0, moves[:-1] + 1)  # of each stretch at the end, and how long it is
        last = np.minimum(moves, len(own) - 1)
        long = (first > impact) & (index[own[last]] - index[own[np.minimum(first, last)]] >= chunk)
        more.extend(index[own[first[long]]] + chunk // 2)
    return _begun_at(begins, index, more)


def _begun_at(begins: Integers, index: Integers, more: Sequence[int]) -> Integers:
    """Where segments begin, also at more steps or just after, while samples follow."""
    rounded = -(-np.array(more, int) // GRID) * GRID
    return np.union1d(begins, rounded[rounded <= index[-1]])


def _leaves(begins: Integers, index: Integers, s: Array, noise: Array) -> list[slice]:
    """Of each segment that begins at an end of the range and leaves it, the samples at which it may
    do so: from the last one that is there as far as noise tells, until one that is clearly not."""
    inside = _inside(s, noise)
    found = []
    for row in rows_of(np.searchsorted(begins, index, side="right") - 1, len(begins)):
        own = inside[row[row >= 0]]
        clear = int(np.argmax(own >= OUTSIDE_NOISES)) if len(own) else 0
        if clear:
            there = int(np.flatnonzero(np.append(0.0, own[1:clear]) <= 1)[-1])
            found.append(slice(row[there], row[clear]))
    return found


def _with_impact(
    rows: Integers, s: Array, noise: Array, hits: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Whether the joint comes to an end of its range in a segment, at some speed: as segments show
    it, or these cut anew before an impact, where what is before it is no longer in the same one."""
    found = _impact_of_each(rows, s, noise)
    return np.array(
        [
            hits[row[row >= 0]].any() or impact is not None
            for row, impact in zip(rows, found, strict=True)
        ],
        bool,
    )


def _rests(rows: Integers, s: Array, noise: Array) -> NDArray[np.bool_]:
    """Whether all of a segment's samples are at an end of the range."""
    reach = STOP + 3 * noise
    low, high = s < reach, s > 1 - reach
    return np.array([low[own].all() or high[own].all() for own in (r[r >= 0] for r in rows)], bool)


def _stays(rows: Integers, s: Array, noise: Array) -> Integers:
    """At which end the joint stays, see `Segments`: where all of a segment is still and at that end
    itself, not pressed into it, nor just thrown back by it."""
    stays = np.zeros(len(s), int)
    for row in rows:
        own = row[row >= 0]
        if not len(own) or np.ptp(s[own] / noise[own]) > STILL:
            continue
        for side, away in ((-1, s[own]), (1, 1 - s[own])):
            if np.abs(away.mean()) < OUTSIDE_NOISES * noise[own].mean():
                stays[own] = side
    return stays


def _impact_of_each(rows: Integers, s: Array, noise: Array) -> list[int | None]:
    """Of each segment, see `_impact`."""
    return [_impact(s[own], noise[own]) for own in (row[row >= 0] for row in rows)]


def _impact(s: Array, noise: Array) -> int | None:
    """The first of a segment's samples at which the joint is at an end that it came to."""
    if len(s) < 3:
        return None
    travel = np.abs(np.diff(s))
    travel = np.maximum(np.append(travel, 0.0), np.append(0.0, travel))
    near = STOP + 3 * noise
    reach = near + np.where(travel > near, travel, 0.0)  # an impact may be between two samples
    touches = (s < reach) | (s > 1 - reach)
    if touches[0] and 2 * travel[0] > near[0] and np.ptp(s) > STOP + 6 * noise[0]:
        return 0  # thrown back
    away = np.minimum(s, 1 - s)
    fall = np.maximum.accumulate(away) - away  # hops at an end stay within `reach`
    back = np.flatnonzero(touches & (fall > HOP * STOP + 6 * noise))
    return int(back[0]) if len(back) else None
