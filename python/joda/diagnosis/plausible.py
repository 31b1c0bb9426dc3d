"""What an added effect may be: no more force than the runs can need, and where runs have been."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.overlap import divided
from joda.diagnosis.settings import SETTINGS
from joda.effects.base import Motion
from joda.estimation.problem import segments_for
from joda.field import evaluate
from joda.joints.resistance import damping, friction_bounds
from joda.measured import smoothing
from joda.measured.measured_joint import Measured
from joda.measured.runs import QuasiStatic, Run
from joda.measured.visited import unvisited_part, visited_share
from joda.profile import CHANNELS, NOUNS, Profile

Array = NDArray[np.float64]
Interval = tuple[float, float]

GRID = 201
"""Positions at which a curve's largest value is looked for."""


def implausible(needs: "Needs", profile: Profile, effect: str | None = None) -> str | None:
    """Why a fitted profile cannot be meant, as a clause; None if it can.

    Args:
        needs: what the measurements can need of the joint.
        profile: the fitted one.
        effect: name of what was added; None: all of the profile counts.
    """
    if needs.unresisted(profile):
        return (
            "it works only in a joint with next to no friction and damping, much less than the "
            "model has, and no force is recorded: something may have moved the joint"
        )
    force = needs.exerted(profile, effect)
    if not needs.exceeded(force):
        return None
    unit = profile.joint.force_unit
    return (
        f"it would exert up to {force:.2g} {unit}, {force / needs.force:.0f} times the "
        f"{needs.force:.2g} {unit} that the runs' accelerations, the inertia, gravity, the "
        "recorded forces and the model's own can need together"
    )


def unvisited_interval(measured: Measured, interval: Interval | None) -> str | None:
    """Why nothing can be added at an interval, as a clause; None if runs have been there.

    What acts all over the range is a law, and no run needs to have been everywhere for it.
    """
    a, b = interval or (0.0, 1.0)
    if (a <= 0.0 and b >= 1.0) or visited_share(
        measured, (a, b)
    ) >= SETTINGS.naming.visited_interval:
        return None
    return f"hardly any run visited s = {a:.2f} to {b:.2f}, where it acts"


def unvisited_shape(
    parts: Sequence[Measured], profile: Profile, effect: str, given: Profile
) -> str | None:
    """Why what is added cannot be told from the runs, as a clause: where none was it turns, or is
    much more than where they were; None if neither.

    Args:
        parts: the measurements, in parts.
        profile: with the effect.
        effect: its name.
        given: the profile before.
    """
    away = [(0.0, 1.0)]
    for part in parts:
        away = [(c, d) for one in away for c, d in unvisited_part(part, one)]
    s, own = np.linspace(0, 1, GRID), divided(profile, effect, given)[0]
    inside = [(s >= c) & (s <= d) for c, d in away]
    seen = ~np.any(inside, axis=0) if inside else np.ones(GRID, bool)
    for name in CHANNELS:
        channel = getattr(own.channels, name)
        if not channel.components or not seen.any():
            continue
        y = evaluate(channel, s)[0]
        for there in inside:
            edges = y[seen & (np.roll(there, 1) | np.roll(there, -1))]
            other = (
                there
                & (np.abs(y) > SETTINGS.naming.no_force * np.abs(y).max())
                & ~np.isin(np.sign(y), np.sign(edges))
            )
            if other.any():
                return (
                    f"its {NOUNS[name]} turns or begins at s = {s[other][0]:.2f}, where no run was"
                )
        most, beyond = (float(np.abs(y[some]).max(initial=0.0)) for some in (seen, ~seen))
        if beyond > SETTINGS.naming.unseen_times * most:
            at = s[~seen][np.argmax(np.abs(y[~seen]))]
            return (
                f"its {NOUNS[name]} would be {beyond / most:.2g} times as much at s = {at:.2f}, "
                "where no run was, as anywhere that runs were"
            )
    return None


class Needs:
    """The largest motion and force of measured runs, or of curves, in which nothing moves.

    Attributes:
        speed: rad/s or m/s.
        acceleration: rad/s² or m/s².
        force: what the runs can need: inertia times acceleration, the recorded force, gravity, and
            what the model has already; N·m or N.
        travel: from the lowest position to the highest, rad or m.
        visited: from where to where runs have been, in normalised position.
        resistance: of the model, at half the speed; N·m or N.
        forced: whether a force is recorded in any run.
    """

    def __init__(self, measured: Measured) -> None:
        """Looks through all of them."""
        lo, hi = measured.profile.joint.range
        logs: list[Run | QuasiStatic] = [*measured.runs]
        logs = logs or [curve.curve for curve in measured.curves]
        position = np.concatenate([log.position for log in logs])
        first, last = np.clip((np.array([position.min(), position.max()]) - lo) / (hi - lo), 0, 1)
        self.visited = float(first), float(last)
        self.travel = float(np.ptp(position))
        self.speed = max((_speed(run.time, run.position) for run in measured.runs), default=0.0)
        self.acceleration = _acceleration(measured, self.speed) if measured.runs else 0.0
        applied = max(float(np.nanmax(np.abs(log.force), initial=0.0)) for log in logs)
        for run in measured.runs:
            applied = max(applied, float(np.abs(measured.exerted(run)).max()))
        gravity = max(map(abs, measured.context.gravity_force))
        inertia = measured.joint_model.inertia * self.acceleration
        self.force = inertia + applied + gravity
        self.force += self.exerted(measured.profile)
        self.resistance = self._resisted(measured.profile)
        self.forced = measured.pushed

    def exerted(self, profile: Profile, effect: str | None = None) -> float:
        """Largest force of a profile, or of one effect of it, where and as fast as runs went; N·m
        or N."""
        if effect:
            profile = divided(profile, effect)[0]
        grid = np.linspace(*self.visited, GRID)
        total = 0.0
        for name in CHANNELS:
            channel = getattr(profile.channels, name)
            if channel.components:
                most = float(np.abs(evaluate(channel, grid)[0]).max())
                total += most * (self.speed if name == "damping" else 1.0)
        motion = Motion(self.speed, self.acceleration, self.force, self.travel)
        return total + sum(one.largest_force(motion) for one in profile.effects)

    def exceeded(self, force: float) -> bool:
        """Whether a force (N·m or N) is far more than the runs can need."""
        return force > SETTINGS.naming.force_times * self.force

    def allow(self, profile: Profile, effect: str) -> bool:
        """Whether an effect of a profile exerts no more than the runs can need."""
        return not self.exceeded(self.exerted(profile, effect))

    def unresisted(self, profile: Profile) -> bool:
        """Whether a fit has taken nearly all resistance from a joint that moves by itself."""
        return (
            not self.forced
            and self._resisted(profile) < SETTINGS.naming.resistance_left * self.resistance
        )

    def _resisted(self, profile: Profile) -> float:
        """Friction and damping where runs went, at half their speed, in the mean; N·m or N."""
        s, v = np.linspace(*self.visited, GRID), self.speed / 2
        friction = np.concatenate(friction_bounds(profile, s, v))
        drag = np.concatenate([damping(profile, s, v), damping(profile, s, -v)])
        return float(friction.mean() + v * drag.mean())


def _speed(time: Array, position: Array) -> float:
    """Largest over a few samples, so that noise hardly counts."""
    n = min(smoothing.MIN_SAMPLES, len(time) - 1)
    return float(np.max(np.abs(position[n:] - position[:-n]) / (time[n:] - time[:-n])))


def _acceleration(measured: Measured, speed: float) -> float:
    """Largest from one segment of the runs to the next, or to reach the largest speed."""
    segments = segments_for(measured)
    same = ~segments.fresh[1:]
    change = np.abs(np.diff(segments.start[:, 1]))[same] / (np.diff(segments.at)[same] * segments.h)
    travel = max(float(np.ptp(run.position)) for run in measured.runs)
    return max(float(change.max(initial=0.0)), speed**2 / (2 * travel) if travel else 0.0)
