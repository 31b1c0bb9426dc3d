"""Measured runs replayed in MuJoCo with the plugin: whole, and in windows.

The joint is simulated by itself (`joda.joints.rig`) under the measured force, from measured starts.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from joda._context import Context
from joda.joints.rig import rig
from joda.joints.single import Single
from joda.measured import smoothing
from joda.measured.runs import Run
from joda.profile import Profile

Array = NDArray[np.float64]

WINDOW = 0.4
"""Length of a window, s."""
MOST = 1000
"""Most windows of a run that are replayed."""
AT_ONCE = 100_000
"""Steps of a whole run that are held in memory together."""
TRIES = 5
"""Replays, each from a better start than the best before, or nearer to it."""
START = 3.0
"""How far a start may be from the measured one, in its standard deviations."""
FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
APPLIED = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)


def left_out(runs: Sequence[Run], shortest: float) -> list[str]:
    """A sentence for each run of which not every window of this length (s) is replayed."""
    lasting = [(run.name, float(np.ptp(run.time))) for run in runs]
    return [
        f"{name}: {duration:.4g} s are replayed as a whole, and in at most {MOST} windows of each "
        "length, evenly spread."
        for name, duration in lasting
        if duration > MOST * shortest
    ]


@dataclass(frozen=True)
class Window:
    """A stretch of a run, replayed from its measured start.

    Attributes:
        samples: indices of the run's samples, shape (n,).
        misfit: predicted minus measured positions, rad or m, shape (n,), from the start that suits
            best within its measurement's error.
        force: how much force the model has too much on the whole, N·m or N.
        doubt: its standard deviation from the position's noise.
    """

    samples: NDArray[np.intp]
    misfit: Array
    force: float
    doubt: float


class Replayer:
    """A joint with a profile, ready to replay runs."""

    def __init__(self, context: Context, profile: Profile, single: Single, timestep: float) -> None:
        """Args: the joint in its scene; its whole profile (`scenes.native`); the rest; step, s."""
        self.model = rig(context.model_copy(update={"equivalent_inertia": single.inertia}), profile)
        self.model.opt.timestep = self.h = timestep
        solref, solimp = single.limits(profile, timestep)
        self.model.jnt_solref[0], self.model.jnt_solimp[0] = solref, solimp
        self.data = mujoco.MjData(self.model)
        self.inertia = single.inertia

    def whole(self, run: Run, sigma: float) -> Array:
        """Predicted positions at the run's times, from its start; NaN where force is unknown on."""
        unknown = np.flatnonzero(np.isnan(run.force))
        end = int(unknown[0]) if len(unknown) else len(run.time)
        out = np.full(len(run.time), np.nan)
        if end < smoothing.LEAST:
            return out
        known = slice(0, end)
        begun = smoothing.smooth(run.time[known], run.position[known], run.time[:1], sigma)
        rests = smoothing.begins_at_rest(run.time[known], run.position[known], sigma)
        start = np.array([[begun.position[0], 0.0 if rests else begun.velocity[0]]])
        time, force = run.time[known] - run.time[0], run.force[known]
        steps = int(np.ceil(time[-1] / self.h)) + 1
        mujoco.mj_resetData(self.model, self.data)
        for first in range(0, steps, AT_ONCE):
            at = self.h * np.arange(first, min(first + AT_ONCE, steps) + 1)
            paths, last = self._roll(start, np.interp(at[:-1], time, force)[None])
            mujoco.mj_setState(self.model, self.data, last[0], FULL)
            start = np.array([[self.data.qpos[0], self.data.qvel[0]]])
            own = slice(*np.searchsorted(time, (at[0], at[-1])))
            out[own] = np.interp(time[own], at, paths[0])
        return out

    def windows(self, run: Run, sigma: float, length: float = WINDOW) -> list[Window]:
        """The run in windows one after another; where the force is unknown there are none.

        Of more than `MOST` windows so many are replayed, evenly spread over the run.
        """
        steps = max(round(length / self.h), 2)
        length = steps * self.h
        count = int((run.time[-1] - run.time[0]) / length + 1e-9)
        begins = run.time[0] + length * _spread(max(count, 1))
        pieces, kept = [], []
        first = np.searchsorted(run.time, begins - 1e-9)
        last = np.searchsorted(run.time, begins + length + 1e-9, side="right")
        for begin, a, b in zip(begins, first, last, strict=True):
            samples = np.arange(a, b)
            if len(samples) >= smoothing.LEAST and not np.isnan(run.force[samples]).any():
                pieces.append(samples)
                kept.append(begin)
        if not kept:
            return []
        at = np.array(kept)
        begun = smoothing.smooth(run.time, run.position, at, sigma)
        starts = np.stack([begun.position, begun.velocity], axis=1)
        doubts = np.stack([begun.position_error, begun.velocity_error], axis=1)
        force = np.where(np.isnan(run.force), 0.0, run.force)
        forces = np.interp(at[:, None] + self.h * np.arange(steps), run.time, force)
        push = 6 * self.inertia * sigma / length**2  # moves the joint by three times the noise
        near, step = np.zeros_like(starts), np.zeros_like(starts)
        least, best = np.full(len(kept), np.inf), dict[int, Window]()
        for _ in range(TRIES):
            tried = np.clip(near + step, -START, START)
            nearby = self._nearby(starts + doubts * tried, doubts, forces, push)
            for k, (samples, paths) in enumerate(zip(pieces, nearby, strict=True)):
                place = (run.time[samples] - at[k]) / self.h
                path = np.stack([np.interp(place, np.arange(steps + 1), p) for p in paths])
                misfit = path[0] - run.position[samples]
                square = np.sum((misfit / sigma) ** 2) + np.sum(tried[k] ** 2)
                if k not in best or square < least[k]:
                    slopes = (path[1:] - path[0]).T / sigma
                    least[k], near[k] = square, tried[k]
                    step[k], best[k] = _fitted(samples, misfit, slopes, near[k], sigma, push)
                else:
                    step[k] /= 4
        return [best[k] for k in range(len(kept))]

    def _nearby(self, starts: Array, doubts: Array, forces: Array, push: float) -> Iterator[Array]:
        """Paths from the starts, from starts one doubt off, and under another constant force.

        What has a memory (friction, play) keeps it from one window to the next.

        Yields:
            of each window, shape (4, steps + 1).
        """
        off = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.0, 0.0)])
        pushed = np.array([0.0, 0.0, 0.0, push])
        mujoco.mj_resetData(self.model, self.data)
        for start, doubt, force in zip(starts, doubts, forces, strict=True):
            paths, last = self._roll(start + doubt * off, force + pushed[:, None])
            mujoco.mj_setState(self.model, self.data, last[0], FULL)
            yield paths

    def _roll(self, starts: Array, forces: Array) -> tuple[Array, Array]:
        """Positions from starts (k, 2) under forces (k, steps), with the memory in `data`.

        Returns:
            positions, shape (k, steps + 1), and the last full states.
        """
        initial = np.empty((len(starts), mujoco.mj_stateSize(self.model, FULL)))
        for row, (position, velocity) in zip(initial, starts, strict=True):
            self.data.qpos[0], self.data.qvel[0] = position, velocity
            mujoco.mj_getState(self.model, self.data, row, FULL)
        states, _ = rollout.rollout(
            self.model, self.data, initial, forces[:, :, None], control_spec=APPLIED
        )
        return np.hstack([starts[:, :1], states[:, :, 1]]), states[:, -1]


def _spread(count: int) -> Array:
    """At most `MOST` of the numbers below `count`, evenly."""
    return np.round(np.linspace(0, count - 1, min(count, MOST)))


def _fitted(
    samples: NDArray[np.intp],
    misfit: Array,
    slopes: Array,
    moved: Array,
    sigma: float,
    push: float,
) -> tuple[Array, Window]:
    """The step to a better start of a window, in units of its doubt, and the window.

    Args:
        samples: indices of the run's samples, shape (n,).
        misfit: predicted minus measured, from the start as it is, shape (n,).
        slopes: of the misfit in noises, by the start's doubts and the push, shape (n, 3).
        moved: how far the start is from the measured one.
        sigma: noise of the position.
        push: the force to which the last slope belongs.
    """
    prior = np.diag([1.0, 1.0, 0.0])
    wanted = np.concatenate([misfit / sigma, moved, [0.0]])
    rows = np.vstack([slopes, prior])
    start = np.linalg.lstsq(rows[:, :2], -wanted, rcond=None)[0]
    inverse = np.linalg.pinv(rows.T @ rows)
    all_three = -inverse @ rows.T @ wanted
    return start, Window(
        samples=samples,
        misfit=misfit,
        force=float(-push * all_three[2]),
        doubt=float(push * np.sqrt(inverse[2, 2])),
    )
