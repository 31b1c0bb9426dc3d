"""Measured runs replayed in MuJoCo with the plugin: whole, and in segments.

The joint is simulated by itself (`joda.joints.rig`) under the measured force, from measured starts.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import NDArray

from joda._core import JointSimulator
from joda.joints.joint_model import JointModel
from joda.joints.rig import rig
from joda.measured import smoothing
from joda.measured.runs import CLEAR, Run, held
from joda.profile import Profile
from joda.scenes.context import Context
from joda.scenes.motion import unheard

Array = NDArray[np.float64]

SEGMENT_LENGTH = 0.4
"""Length of a segment, s."""
MAX_SEGMENTS = 1000
"""Most segments of a run that are replayed."""
AT_ONCE = 100_000
"""Steps of a whole run that are held in memory together."""
FIRST_HORIZON, LONGER, HORIZON = 30, 4, 5.0
"""How much of a whole run tells its start: at first so many samples, then so many times as much, up
to so many seconds. A start that is far off runs into an end soon, and then tells nothing."""
AT_REST = 2.0
"""How much larger the sum of squares may be from a start at rest, where a joint seems to rest."""
POOR = 2.0
"""Mean squared misfit, in noises, from which a start at rest is tried that does not seem so."""
SETTLED = 0.1
"""Change of a sum of squared residuals below which a start is no better."""
ENSEMBLE = 8
"""Replays that tell how far errors of the start and the force move a whole run."""
DENSEST = 50_000
"""Samples of a run from which on only some are looked at for that, their noise averaged."""
TRIES = 5
"""Replays, each from a better start than the best before, or nearer to it; and one from rest."""
ASTRAY = 1e9
"""Error, in noises, of a replay that is not finite."""
NEAR_BY = 3.0
"""How far a path is moved by the starts nearby that tell its slopes, in noises."""
HELD = 1e-3
"""Part of the other's effect that one number of a start must have to be told: the velocity of a
joint that friction stops at once has less."""
STUCK = 1e-9
"""Part of the motion that a force makes of a free joint, squared, below which it makes none."""
START = 3.0
"""How far a start may be from the measured one, in its standard deviations."""
WIDER, SOUGHT = 3.0, np.linspace(-START, START, 25)
"""Where a joint that impacts at an end is followed poorly from there: by how much less well the
start is known, and other velocities that are tried."""
OFF = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.0, 0.0)])
PUSHED = np.array([0.0, 0.0, 0.0, 1.0])
"""Of four paths nearby: by what their starts are off, and whether another force acts."""
FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
APPLIED = int(mujoco.mjtState.mjSTATE_QFRC_APPLIED)
COMMANDED = int(mujoco.mjtState.mjSTATE_CTRL)


def left_out(runs: Sequence[Run], shortest: float) -> list[str]:
    """A sentence for each run of which not every segment of this length (s) is replayed."""
    lasting = [(run.name, float(np.ptp(run.time))) for run in runs]
    return [
        f"{name}: {duration:.4g} s are replayed as a whole, and in at most {MAX_SEGMENTS} segments "
        "of each length, evenly spread."
        for name, duration in lasting
        if duration > MAX_SEGMENTS * shortest
    ]


@dataclass(frozen=True)
class Segment:
    """A part of a run, replayed from its measured start.

    Attributes:
        samples: indices of the run's samples, shape (n,).
        misfit: predicted minus measured positions, rad or m, shape (n,), from the start that suits
            best within its measurement's error.
        force: mean residual force (model's less the true one), N·m or N; 0 where it is unknown.
        force_error: its standard deviation from the noise of position and force; infinite where
            a force makes no motion, as the joint sticks.
        scatter: RMS by which errors of the start alone move the replay, rad or m.
        pushed: the same of errors of the recorded force.
        squares: sums of squared misfits, in noises, from the best start, and with that force too.
    """

    samples: NDArray[np.intp]
    misfit: Array
    force: float
    force_error: float
    scatter: float = 0.0
    pushed: float = 0.0
    squares: tuple[float, float] = (0.0, 0.0)

    @property
    def explained(self) -> float:
        """RMS by which errors of start and force together move the replay, rad or m."""
        return float(np.hypot(self.scatter, self.pushed))


@dataclass(frozen=True)
class Start:
    """Where a whole run begins under a model.

    Attributes:
        best: position and velocity, shape (2,).
        spread: a factor of their covariance, shape (2, 2).
    """

    best: Array
    spread: Array


@dataclass(frozen=True)
class _Beginning:
    """A run up to where its force is known, and what smoothed samples tell of its start.

    Attributes:
        time: s, from 0 on, shape (n,).
        position, force: at these times.
        command: of the servo, and its times.
        sigma: noise of the position.
        mean, deviation: of position and velocity at the start, shape (2,) each.
        exactly: whether MuJoCo itself must move the joint: without the plugin, at an end.
    """

    time: Array
    position: Array
    force: Array
    command: tuple[Array, Array] | None
    sigma: float
    mean: Array
    deviation: Array
    exactly: bool = False

    @property
    def count(self) -> int:
        """Of the samples within `HORIZON`, at least as many as can be smoothed."""
        return max(int(np.searchsorted(self.time, HORIZON, side="right")), smoothing.MIN_SAMPLES)


@dataclass(frozen=True)
class _Followed:
    """A start, and the sum of squares, in noises, of what is missed from it."""

    square: float
    start: Start


class Replayer:
    """A joint with a profile, ready to replay runs."""

    def __init__(
        self, context: Context, profile: Profile, joint_model: JointModel, timestep: float
    ) -> None:
        """Args: the joint in its scene; its whole profile (`scenes.native`); the rest; step, s."""
        alone = context.model_copy(update={"equivalent_inertia": joint_model.inertia})
        self.servo = joint_model.servo
        self.model = rig(alone, profile, joint_model.friction_row, self.servo, joint_model.second)
        self.model.opt.timestep = self.h = timestep
        if not self.model.nplugin:
            self.model.opt.integrator = joint_model.integrator
        self.simulator: JointSimulator | None = None
        if self.model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:  # whose steps it takes
            self.simulator = joint_model.simulator(profile, timestep)
        solref, solimp = joint_model.limits(profile, timestep)
        self.model.jnt_solref[0], self.model.jnt_solimp[0] = solref, solimp
        self.data = mujoco.MjData(self.model)
        self.inertia = joint_model.inertia

    def whole(self, run: Run, start: Start | None, quickly: bool = False) -> Array:
        """Predicted positions at the run's times, from its start; NaN where force is unknown on.

        Args:
            run: measured.
            start: of it; None: where no force is known.
            quickly: whether the simulator may stand for MuJoCo.
        """
        out = np.full(len(run.time), np.nan)
        if start:
            replay = self._quickly if quickly else self._replay
            time, force = _known(run)
            command = _command(run, len(time))
            out[: len(time)] = replay(time, start.best[None], force[None], command)[0]
        return out

    def scatter(self, run: Run, start: Start | None) -> float:
        """RMS by which errors of the measured start and force alone move a whole run's replay.

        An ensemble of replays: from starts within their errors, under forces with their noise. Near
        a barrier, or over minutes, it may be far more than the position's noise.
        """
        if not start:
            return 0.0
        time, force = _known(run)
        every = slice(None, None, len(time) // DENSEST + 1)
        off = run.part(slice(0, len(time))).force_error()[every] / np.sqrt(every.step)
        command = _command(run, len(time), every)
        time, force = time[every], force[every]
        rng = np.random.default_rng(0)
        starts = start.best + rng.standard_normal((ENSEMBLE, 2)) @ start.spread.T
        forces = force + off * rng.standard_normal((ENSEMBLE, len(time)))
        begins, pushes = np.vstack([start.best, starts]), np.vstack([force, forces])
        paths = self._quickly(time, begins, pushes, command)
        return float(np.sqrt(np.mean((paths[1:] - paths[0]) ** 2)))

    def followed(self, run: Run, sigma: float) -> tuple[Array, Array]:
        """Predicted minus measured positions from the start that suits the whole run best.

        Args:
            run: whose force is known throughout.
            sigma: noise of its position, rad or m.

        Returns:
            rad or m, shape (n,); and that start.
        """
        time, force = run.time - run.time[0], np.tile(run.force, (3, 1))
        command = _command(run, len(time))
        offsets = np.diag(NEAR_BY * sigma / np.array([1, time[-1]]))
        tries = np.vstack([np.zeros(2), offsets])
        start = self.start(run, sigma)
        at = start.best if start else np.array([run.position[0], 0.0])
        step, least = np.zeros(2), np.inf
        best = np.full(len(time), ASTRAY * sigma)
        for _ in range(TRIES):
            paths = self._replay(time, at + step + tries, force, command)
            misfit = paths[0] - run.position
            square = float(misfit @ misfit) if np.isfinite(paths).all() else np.inf
            gain = least - square
            if gain > 0:
                at, best, least = at + step, misfit, square
                slopes = (paths[1:] - paths[0]).T
                step = -offsets @ np.linalg.lstsq(slopes, misfit, rcond=HELD)[0]
            else:
                step = step / 4
            if abs(gain) < SETTLED * sigma**2:
                break
        return best, at

    def start(self, run: Run, sigma: float) -> Start | None:
        """Where a whole run begins; None where its force is unknown from the beginning.

        At the smoothed samples, moved within their errors to where the model follows the first
        `HORIZON` seconds best: a velocity that is a little off is a position that is far off at the
        end of a run. A joint that seems to be at rest is, unless the model follows clearly better
        from a start that moves.
        """
        time, force = _known(run)
        if not len(time):
            return None
        position = run.position[: len(time)]
        begun = smoothing.smooth(time, position, time[:1], sigma)
        at = np.array([begun.position[0], begun.velocity[0]])
        error = np.array([begun.position_error[0], begun.velocity_error[0]])
        begins = _Beginning(time, position, force, _command(run, len(time)), sigma, at, error)
        if not self.model.nplugin and self._at_an_end(position[: begins.count], sigma):
            begins = replace(begins, exactly=True)
        found = self._fitted_start(begins, np.zeros(2), FIRST_HORIZON)
        poor = POOR * min(len(time), begins.count)
        rests = not run.cut and smoothing.begins_at_rest(time, position, sigma)
        if found.square > poor and not rests and self._at_an_end(position[:FIRST_HORIZON], sigma):
            wide = replace(begins, deviation=WIDER * error)
            sought = self._fitted_start(wide, self._sought_start(wide), len(time))
            found = min(found, sought, key=lambda one: one.square)
        if rests or found.square > poor:  # a release may be too quick for the samples
            at_rest = np.array([0.0, -at[1] / error[1]])
            still = self._fitted_start(begins, at_rest, FIRST_HORIZON, moves=False)
            if still.square < (AT_REST if rests else 1.0) * found.square:
                found = still
        return found.start

    def _replay(
        self, time: Array, starts: Array, forces: Array, command: tuple[Array, Array] | None
    ) -> Array:
        """Positions at some times from starts (k, 2), under forces (k, n); shape (k, n).

        Args:
            time: s, from 0 on, shape (n,).
            starts: position and velocity.
            forces: at these times.
            command: of the servo, and its times.
        """
        out = np.empty(forces.shape)
        steps = int(np.ceil(time[-1] / self.h)) + 1
        mujoco.mj_resetData(self.model, self.data)
        states = self._placed(starts)
        for first in range(0, steps, AT_ONCE):
            at = np.array(self.h * np.arange(first, min(first + AT_ONCE, steps) + 1))
            applied = np.stack([np.interp(at[:-1], time, force) for force in forces])
            paths, states = self._roll(states, applied, self._commanded(command, at))
            own = slice(*np.searchsorted(time, (at[0], at[-1])))
            out[:, own] = np.stack([np.interp(time[own], at, path) for path in paths])
        return out

    def _quickly(
        self, time: Array, starts: Array, forces: Array, command: tuple[Array, Array] | None
    ) -> Array:
        """The same as `_replay`, without MuJoCo, whose steps the simulator takes too."""
        if self.simulator is None:
            return self._replay(time, starts, forces, command)
        at = np.array(self.h * np.arange(int(np.ceil(time[-1] / self.h)) + 2))
        own = None if self.servo is None or command is None else held(*command, at)
        out = np.empty(forces.shape)
        for path, start, force in zip(out, starts, forces, strict=True):
            applied = np.interp(at[:-1], time, force)
            before, after = self.simulator.replay(applied, [0], start[None], [True], self.h, own)
            path[:] = np.interp(time, at, np.append(before[:1], after))
        return out

    def _commanded(self, command: tuple[Array, Array] | None, edges: Array) -> Array | None:
        """The servo's command over steps between edges (m + 1,), s; shape (m,)."""
        if self.servo is None or command is None:
            return None
        return held(*command, edges - self.servo.delay)

    def _moved(self, begins: _Beginning) -> Callable[..., Array]:
        """What tells where the joint goes from starts."""
        return self._replay if begins.exactly else self._quickly

    def _at_an_end(self, position: Array, sigma: float) -> bool:
        """Whether the joint is at an end of its range, which bends what is smoothed."""
        low, high = self.model.jnt_range[0]
        inside = np.minimum(position - low, high - position)
        return bool(self.model.jnt_limited[0] and inside.min() < CLEAR * sigma)

    def _sought_start(self, begins: _Beginning) -> Array:
        """Of starts at other velocities the one from which the joint is followed best, in standard
        deviations."""
        tried = np.stack([np.zeros(len(SOUGHT)), SOUGHT], axis=1)
        used = slice(0, begins.count)
        starts = begins.mean + begins.deviation * tried
        forces = np.tile(begins.force[used], (len(tried), 1))
        found = self._moved(begins)(begins.time[used], starts, forces, begins.command)
        off = np.sum(((found - begins.position[used]) / begins.sigma) ** 2, axis=1)
        squares = off + np.sum(tried**2, axis=1)
        return np.asarray(tried[np.argmin(np.where(np.isfinite(squares), squares, np.inf))])

    def _fitted_start(
        self, begins: _Beginning, z: Array, used: int, moves: bool = True
    ) -> _Followed:
        """Gauss-Newton over longer and longer horizons; what the model fails to follow makes the
        samples tell less.

        Args:
            begins: the run.
            z: where it begins, in standard deviations of the start.
            used: samples of the first horizon.
            moves: whether the velocity is fitted.
        """
        off = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
        covariance, least = np.eye(2), np.inf
        low, high = np.full(2, -START), np.full(2, START)
        if not moves:
            low[1] = high[1] = z[1]
        while True:
            early = slice(0, min(used, begins.count))
            time, position = begins.time[early], begins.position[early] / begins.sigma
            forces = np.tile(begins.force[early], (3, 1))
            step, least = np.zeros(2), np.inf
            for _ in range(TRIES):
                tried = np.clip(z + step, low, high)
                starts = begins.mean + begins.deviation * (tried + off)
                found = self._moved(begins)(time, starts, forces, begins.command) / begins.sigma
                misfit = found[0] - position
                square = float(misfit @ misfit + tried @ tried)
                if square >= least - SETTLED or not np.isfinite(found).all():
                    if square < least + SETTLED:
                        break
                    step = step / 4
                    continue
                least, z = square, tried
                slopes = (found[1:] - found[0]).T
                precision = slopes.T @ slopes
                step = -np.linalg.solve(precision + np.eye(2), slopes.T @ misfit + tried)
                overdispersion = max(float(misfit @ misfit) / len(misfit), 1.0)
                covariance = np.linalg.inv(precision / overdispersion + np.eye(2))
            if used >= min(begins.count, len(begins.time)):
                break
            used *= LONGER
        spread = begins.deviation[:, None] * np.linalg.cholesky(covariance)
        return _Followed(least, Start(begins.mean + begins.deviation * z, spread))

    def segments(
        self,
        run: Run,
        sigma: float,
        length: float = SEGMENT_LENGTH,
        quickly: bool = False,
    ) -> list[Segment]:
        """The run in segments one after another; where the force is unknown there are none.

        Of more than `MAX_SEGMENTS` segments so many are replayed, evenly spread over the run.

        Args:
            run, sigma: measured, and the noise of its position, rad or m.
            length: of a segment, s.
            quickly: whether the simulator may stand for MuJoCo.
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
            if len(samples) >= smoothing.MIN_SAMPLES and not np.isnan(run.force[samples]).any():
                pieces.append(samples)
                kept.append(begin)
        if not kept:
            return []
        at = np.array(kept)
        begun = smoothing.smooth(run.time, run.position, at, sigma)
        starts = np.stack([begun.position, begun.velocity], axis=1)
        errors = np.stack([begun.position_error, begun.velocity_error], axis=1)
        # starts are tried so near that the path does not meet an end, or rest, because of that
        near_by = np.minimum(errors, NEAR_BY * sigma * np.array([1, 1 / length]))
        force = np.where(np.isnan(run.force), 0.0, run.force)
        forces = np.interp(at[:, None] + self.h * np.arange(steps), run.time, force)
        command, edges = _command(run, len(run.time)), at[:, None] + self.h * np.arange(steps + 1)
        own = [self._commanded(command, row - run.time[0]) for row in edges]
        push = 6 * self.inertia * sigma / length**2  # moves the joint by three times the noise
        near, step = np.zeros_like(starts), np.zeros_like(starts)
        at_rest = np.stack([np.zeros(len(kept)), -starts[:, 1] / errors[:, 1]], axis=1)
        least, best = np.full(len(kept), np.inf), dict[int, Segment]()
        simulator = self.simulator if quickly and self.servo is None else None
        for number in range(TRIES + 1):
            tried = np.clip(at_rest if number == 1 else near + step, -START, START)
            begin = starts + errors * tried
            nearby = (
                self._nearby_quickly(simulator, begin, near_by, forces, push)
                if simulator
                else self._nearby(begin, near_by, forces, own, push)
            )
            for k, (samples, paths) in enumerate(zip(pieces, nearby, strict=True)):
                place = (run.time[samples] - at[k]) / self.h
                path = np.stack([np.interp(place, np.arange(steps + 1), p) for p in paths])
                misfit = path[0] - run.position[samples]
                square = np.sum((misfit / sigma) ** 2) + np.sum(tried[k] ** 2)
                if k not in best or square < least[k]:
                    slopes = (path[1:] - path[0]).T / sigma
                    slopes[:, :2] *= errors[k] / near_by[k]
                    least[k], near[k] = square, tried[k]
                    step[k], best[k] = _fitted(samples, misfit, slopes, near[k], sigma, push)
                elif number > 1:
                    step[k] /= 4
        if not run.forced:
            return [best[k] for k in range(len(kept))]
        return [_with_force(best[k], run, self.inertia) for k in range(len(kept))]

    def _nearby(
        self,
        starts: Array,
        offsets: Array,
        forces: Array,
        commands: Sequence[Array | None],
        push: float,
    ) -> Iterator[Array]:
        """Paths from the starts, from starts nearby, and under another constant force.

        What has a memory (friction, play) keeps it from one segment to the next.

        Yields:
            of each segment, shape (4, steps + 1).
        """
        mujoco.mj_resetData(self.model, self.data)
        for start, offset, force, command in zip(starts, offsets, forces, commands, strict=True):
            states = self._placed(start + offset * OFF)
            paths, last = self._roll(states, force + push * PUSHED[:, None], command)
            mujoco.mj_setState(self.model, self.data, last[0], FULL)
            yield paths

    def _nearby_quickly(
        self, simulator: JointSimulator, starts: Array, offsets: Array, forces: Array, push: float
    ) -> Array:
        """The same as `_nearby`, without MuJoCo and commands; each path keeps its own memory."""
        count, steps = forces.shape
        at, fresh = steps * np.arange(count), np.arange(count) == 0
        paths = []
        for off, pushed in zip(OFF, PUSHED, strict=True):
            applied, begin = (forces + push * pushed).ravel(), starts + offsets * off
            before, after = simulator.replay(applied, at, begin, fresh, self.h)
            rows = after.reshape(count, steps)
            paths.append(np.hstack([before[at, None], rows]))
        return np.stack(paths, axis=1)

    def _placed(self, starts: Array) -> Array:
        """Full states at starts (k, 2), with the memory in `data`; shape (k, size)."""
        out = np.empty((len(starts), mujoco.mj_stateSize(self.model, FULL)))
        for row, (position, velocity) in zip(out, starts, strict=True):
            self.data.qpos[0], self.data.qvel[0] = position, velocity
            mujoco.mj_getState(self.model, self.data, row, FULL)
        return out

    def _roll(self, initial: Array, forces: Array, command: Array | None) -> tuple[Array, Array]:
        """Positions from full states under forces (k, steps), and a command (steps,) for all.

        Returns:
            positions, shape (k, steps + 1), and the last full states.
        """
        inputs, spec = forces[:, :, None], APPLIED
        if self.servo:
            own = np.zeros(forces.shape[1]) if command is None else command
            own = np.broadcast_to(own, forces.shape)
            inputs, spec = np.stack([own, forces], axis=2), COMMANDED | APPLIED
        with unheard():
            states, _ = rollout.rollout(self.model, self.data, initial, inputs, control_spec=spec)
        return np.hstack([initial[:, 1:2], states[:, :, 1]]), states[:, -1]


def _known(run: Run) -> tuple[Array, Array]:
    """Times from 0 on (s) and forces, to where the force is unknown; none if that is too short."""
    unknown = np.flatnonzero(np.isnan(run.force))
    end = int(unknown[0]) if len(unknown) else len(run.time)
    known = slice(0, end if end >= smoothing.MIN_SAMPLES else 0)
    return run.time[known] - run.time[0], run.force[known]


def _command(run: Run, count: int, every: slice = slice(None)) -> tuple[Array, Array] | None:
    """Times from 0 on (s) and commands of a run's first samples; None where nothing acted."""
    if run.command is None:
        return None
    return run.time[:count][every] - run.time[0], run.command[:count][every]


def _spread(count: int) -> Array:
    """At most `MAX_SEGMENTS` of the numbers below `count`, evenly."""
    return np.round(np.linspace(0, count - 1, min(count, MAX_SEGMENTS)))


def _fitted(
    samples: NDArray[np.intp],
    misfit: Array,
    slopes: Array,
    moved: Array,
    sigma: float,
    push: float,
) -> tuple[Array, Segment]:
    """The step to a better start of a segment, in prior standard deviations, and the segment.

    Args:
        samples: indices of the run's samples, shape (n,).
        misfit: predicted minus measured, from the start as it is, shape (n,).
        slopes: of the misfit in noises, by the start's standard deviations and the push, shape
            (n, 3).
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
    moves = float(np.mean(slopes[:, 2] ** 2)) > STUCK
    two, three = (rows[: len(misfit), : len(x)] @ x + misfit / sigma for x in (start, all_three))
    return start, Segment(
        samples=samples,
        misfit=misfit,
        force=float(-push * all_three[2]) if moves else 0.0,
        force_error=float(push * np.sqrt(inverse[2, 2])) if moves else np.inf,
        scatter=float(sigma * np.sqrt(np.mean(np.sum(slopes[:, :2] ** 2, axis=1)))),
        squares=(float(two @ two), float(three @ three)),
    )


def _with_force(segment: Segment, run: Run, inertia: float) -> Segment:
    """The segment, with what errors of the recorded force add to its error, and how they move it.

    White noise of acceleration moves a free joint by a random walk of its velocity: a variance of
    noise² gap t³ / 3 after a time t.
    """
    time, error = run.time[segment.samples], run.part(segment.samples).force_error()
    off = float(np.sqrt(np.mean(error**2)))
    length, count = float(np.ptp(time)), len(time)
    moved = off / inertia * float(np.sqrt(length**4 / (12 * max(count - 1, 1))))
    return replace(
        segment,
        force_error=float(np.hypot(segment.force_error, off / np.sqrt(count))),
        pushed=moved,
    )
