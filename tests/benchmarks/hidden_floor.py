"""What the true joint of a case misses of its own measurements: no model can do better."""

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace
from unittest import mock

import numpy as np
from hidden_cases import missed
from hidden_model import true_profile
from scipy.interpolate import CubicSpline

from joda.hidden import Case, simulator
from joda.hidden.handle import Handle
from joda.hidden.laws import State
from joda.hidden.truth import Play, Truth
from joda.measured import smoothing
from joda.measured.measured_joint import Measured
from joda.measured.replay import SEGMENT_LENGTH, START, TRIES

H = 2e-4
"""Step of the true model's replay, s."""


def true_error(case: Case) -> float:
    """RMS error (rad or m) of the true joint on the held-out runs in segments of 0.4 s.

    As `Replayer.windows` does it, and as easily misled by a knock: from starts that are fitted
    within their measurement's error, under the measured force, linear between samples. What has a
    memory starts each window as along the clean run. For a case that hides nothing, or EFFECTS: a
    delay's memory and a disturbance's clock are left out.
    """
    pieces = [piece for k, run in enumerate(case.held_out) for piece in _pieces(k, run)]
    starts, spread = (np.array([getattr(p, key) for p in pieces]) for key in ("start", "prior_std"))
    forces = np.repeat(np.array([p.force for p in pieces]).T, 3, axis=1)
    memory = {}
    if any(isinstance(law, State | Play) for law in case.truth.hidden):
        at = np.repeat([round(p.begin / H) for p in pieces], 3)
        memory = {name: x[at, np.repeat([p.run for p in pieces], 3)] for name, x in _kept(case)}
    off = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
    best, move = np.zeros_like(starts), np.zeros_like(starts)
    least, misfits = np.full(len(pieces), np.inf), [np.zeros(0)] * len(pieces)
    for _ in range(TRIES):
        moved = np.clip(best + move, -START, START)
        q, v = np.reshape((starts + spread * moved)[:, None] + spread[:, None] * off, (-1, 2)).T
        path = _replayed(case.truth, forces, q, v, memory).reshape(len(forces), -1, 3)
        for k, p in enumerate(pieces):
            near = np.stack([np.interp(p.time, H * np.arange(len(path)), x) for x in path[:, k].T])
            misfit = near[0] - p.position
            wanted = np.concatenate([misfit / p.sigma, moved[k]])
            if (square := float(wanted @ wanted)) < least[k]:
                rows = np.vstack([(near[1:] - near[0]).T / p.sigma, np.eye(2)])
                least[k], best[k], misfits[k] = square, moved[k], misfit
                move[k] = -np.linalg.lstsq(rows, wanted, rcond=None)[0]
            else:
                move[k] /= 4
    return float(np.sqrt(np.mean(np.concatenate(misfits) ** 2)))


@dataclass(frozen=True)
class Piece:
    """A segment of a run: its samples, their times from its begin, measured start, force."""

    run: int
    begin: float
    time: np.ndarray
    position: np.ndarray
    start: tuple[float, float]
    prior_std: tuple[float, float]
    force: np.ndarray
    sigma: float


def _pieces(number: int, run) -> Iterator[Piece]:
    sigma = smoothing.noise(run.time, run.position)
    count = max(int((run.time[-1] - run.time[0]) / SEGMENT_LENGTH + 1e-9), 1)
    for begin in run.time[0] + SEGMENT_LENGTH * np.arange(count):
        inside = (run.time >= begin - 1e-9) & (run.time <= begin + SEGMENT_LENGTH + 1e-9)
        if np.count_nonzero(inside) < smoothing.MIN_SAMPLES:
            continue
        x = smoothing.smooth(run.time, run.position, np.array([begin]), sigma)
        yield Piece(
            number,
            begin,
            run.time[inside] - begin,
            run.position[inside],
            (x.position[0], x.velocity[0]),
            (x.position_error[0], x.velocity_error[0]),
            np.interp(begin + H * np.arange(round(SEGMENT_LENGTH / H) + 1), run.time, run.force),
            sigma,
        )


def _kept(case: Case) -> Iterator[tuple[str | int, np.ndarray]]:
    """What the joint remembers along the clean runs: states of laws (by number), handle (by name).

    Arrays have shape (steps, runs).
    """
    runs, truth = case.held_out_clean, case.truth
    t = H * np.arange(round(max(run.time[-1] for run in runs) / H) + 1)
    paths = [CubicSpline(run.time, run.position) for run in runs]
    known = [np.clip(t, run.time[0], run.time[-1]) for run in runs]
    q = np.array([path(x) for path, x in zip(paths, known, strict=True)]).T
    v = np.array([path(x, 1) for path, x in zip(paths, known, strict=True)]).T
    pushes = [np.interp(x, run.time, run.force) for run, x in zip(runs, known, strict=True)]
    push, s = np.array(pushes).T, (q - truth.joint.lo) / truth.joint.span
    for number, law in enumerate(truth.hidden):
        if isinstance(law, State):
            z = [law.start(s[0], v[0])]
            for k in range(len(t) - 1):
                z.append(law.advance(z[-1], s[k], v[k], H))
            yield number, np.array(z)
    handle = Handle(truth, q[0], v[0], H)
    if handle.loose:
        out = []
        for k in range(len(t)):
            out.append((handle.offset, handle.velocity, handle.side))
            if k + 1 < len(t):
                handle.step((q[k], v[k]), (q[k + 1], v[k + 1]), push[k])
        yield from zip(("offset", "velocity", "side"), np.moveaxis(out, 1, 0), strict=True)


def _replayed(truth: Truth, forces, q, v, memory) -> np.ndarray:
    """Positions under forces (steps + 1, lanes) from starts (lanes,) with a memory."""

    def started(law, z):
        law = copy(law)
        object.__setattr__(law, "start", lambda s, v: z)
        return law

    def handle(*args):
        one = Handle(*args)
        if "side" in memory:
            one.offset, one.side = memory["offset"], memory["side"]
            one.velocity = np.where(one.side != 0, v, memory["velocity"])
        return one

    laws = [started(law, memory[k]) if k in memory else law for k, law in enumerate(truth.hidden)]
    own = replace(truth, hidden=tuple(laws))
    with mock.patch.object(simulator, "Handle", handle):
        steps = len(forces) - 1
        return simulator.simulate(own, simulator.Tape(forces), q, v, steps, H).position


def floor_of(case: Case, held_out: Measured) -> float:
    """The true model's error (rad or m): by itself, or in MuJoCo where that is more, as MuJoCo's
    steps and soft ends of the range are in every model's."""
    own = missed(held_out, true_profile(case, held_out.profile)).window
    return max(true_error(case), own)
