"""Quasi-static curves: the force that slowly moves a joint, measured by hand and by the model.

Nothing moves fast, so that neither inertia nor damping matters. What both directions of travel have
in common is force by position (conservative, gravity); half of what they differ by is friction.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from joda.effects import GravityOffset, LoadDependentFriction
from joda.errors import JodaError
from joda.field import evaluate
from joda.joints.resistance import friction_bounds
from joda.joints.rig import gravity_factors
from joda.measured import smoothing
from joda.measured.runs import QuasiStatic
from joda.profile import Profile
from joda.scenes.context import Context

Array = NDArray[np.float64]

BACK = 8.0
"""So many noises a joint must come back to have turned: slow travel is full of small returns."""
MAX_BACK_SHARE = 0.25
"""And at most this share of what was visited."""
TURN = 4.0
"""Within so many noises of a turn the direction is not known."""
BLURRING_NOISE = 0.8
"""Noise of at least so many usual steps between samples blurs a turn."""
MIN_SAMPLES = 5
"""Fewest samples in one direction that tell the noise."""
SAME_PLACE = 0.1
"""Distance of two samples that are at the same place, in usual distances of one way's samples."""
SCALED, ALIKE = 4.0, 0.2
"""By which factor a measured force may be the model's, and what part of it may be left over then,
before its unit is asked for."""
OTHER_UNIT = 20.0
"""How many times the model's largest force the measured one is that may be in another unit."""
CAUTION = 2.0
"""How far the noise may be underestimated: one plus this, divided by the root of the samples."""


@dataclass(frozen=True)
class QuasiStaticComparison:
    """A measured curve and the model's; arrays of shape (n,).

    Attributes:
        curve: measured.
        direction: of travel, 1 or -1; 0 where it is not known.
        blur: noise of the measured position, rad or m.
        force: the model's in that direction, N·m or N; NaN where the direction is not known.
        sigma: noise of the measured force, N·m or N.
        error: of the difference: that noise, and what the position's noise makes of the model's.
    """

    curve: QuasiStatic
    direction: Array
    blur: float
    force: Array
    sigma: float
    error: Array

    def against(self, profile: Profile, context: Context) -> "QuasiStaticComparison":
        """The same curve beside another model's."""
        position, known = self.curve.position, self.direction != 0
        low, force, high = (
            static_force(profile, context, position + off, self.direction)
            for off in (-self.blur, 0.0, self.blur)
        )
        error = np.hypot(self.sigma, (high - low) / 2)
        return replace(self, force=np.where(known, force, np.nan), error=error)

    def noisier(self, factor: float) -> "QuasiStaticComparison":
        """The same curve, of which less is known."""
        return replace(self, sigma=factor * self.sigma, error=factor * self.error)

    def part(self, samples: NDArray[np.bool_]) -> "QuasiStaticComparison":
        """Some samples of the curve."""
        position, force = self.curve.position[samples], self.curve.force[samples]
        return replace(
            self,
            curve=QuasiStatic(self.curve.name, position, force),
            direction=self.direction[samples],
            force=self.force[samples],
            error=self.error[samples],
        )

    @property
    def excess(self) -> Array:
        """Residual force (model's less the true one) towards +q where the direction is known, N·m
        or N."""
        known = self.direction != 0
        return np.asarray(self.curve.force[known] - self.force[known])

    @property
    def times_the_model(self) -> float:
        """The largest measured force, in units of the model's; 0 where the model has none."""
        own = float(np.nanmax(np.abs(self.force)))
        return float(np.abs(self.curve.force).max()) / own if own > 0 else 0.0

    @property
    def unusual_factor(self) -> float:
        """The same where it is so much or so little that the unit is in question, else 0: also
        where the measured force is the model's times one factor, but for little."""
        times = self.times_the_model
        if not 1 / OTHER_UNIT < times < OTHER_UNIT:
            return times
        known = self.direction != 0
        own, force = self.force[known], self.curve.force[known]
        factor = float(own @ force) / max(float(own @ own), 1e-300)
        left = float(np.sum((force - factor * own) ** 2))
        alike = left < ALIKE**2 * float(np.sum(force**2))
        return factor if alike and (0 < factor < 1 / SCALED or factor > SCALED) else 0.0

    @property
    def repeated(self) -> bool:
        """Whether both ways were measured at the same places, which tells the gauge's noise from
        what the joint's force does from sample to sample."""
        curve = self.curve
        return bool(np.isfinite(_between_ways(curve.position, curve.force, self.direction)))

    @property
    def cautious(self) -> Array:
        """The standard error of each excess, where the noise is more than it was estimated."""
        error = self.error[self.direction != 0]
        return np.asarray(error * (1 + CAUTION / np.sqrt(len(error))))


def compared(times: float) -> str:
    """How many times the model's force the measured one is, a clause."""
    if times < 1:
        return f"the model's force is up to {1 / times:.0f} times the measured one"
    return f"the measured force is up to {times:.0f} times the model's"


def static_force(
    profile: Profile, context: Context, position: Array, direction: Array | float
) -> Array:
    """The force from outside that slowly moves the joint, N·m or N.

    Against all that depends on the position, and the friction at the lowest speed (Stribeck's
    included); where friction grows with the load, this force is itself part of the load.

    Args:
        profile: all that acts on the joint but gravity (`joda.scenes.native`).
        context: the joint, with its gravity.
        position: rad or m, shape (n,).
        direction: of travel, 1 or -1, shape (n,) or one for all.

    Returns:
        shape (n,).

    Raises:
        JodaError: friction grows with the load as fast as the load or faster.
    """
    return held_force(profile, gravity(context, position), position, direction)


def held_force(profile: Profile, weight: Array, position: Array, direction: Array | float) -> Array:
    """The same where gravity's force (N·m or N, shape (n,)) is known: for many profiles."""
    lo, hi = profile.joint.range
    s, growth = (position - lo) / (hi - lo), 0.0
    own = exerted(profile, s, position)
    for effect in profile.effects:
        if isinstance(effect, LoadDependentFriction):
            growth = effect.coefficient
    if growth >= 1:
        raise JodaError(
            f"joint '{profile.joint.name}': load_dependent_friction with coefficient {growth:g} "
            "holds against any force; give one below 1."
        )
    up, down = friction_bounds(profile, s)
    unloaded = np.where(np.asarray(direction) > 0, up, -down) - own
    # The load is `unloaded` + direction * growth * |load|, of the same sign.
    load = unloaded / (1 - growth * np.sign(unloaded) * direction)
    return np.asarray(load - weight)


def exerted(profile: Profile, s: Array, position: Array) -> Array:
    """A profile's force over normalised position s, and position (rad or m), N·m or N."""
    out = evaluate(profile.channels.conservative, s)[0]
    for effect in profile.effects:
        if isinstance(effect, GravityOffset):
            out = out + effect.sin * np.sin(position) + effect.cos * np.cos(position) + effect.force
    return np.asarray(out)


def gravity(context: Context, position: Array) -> Array:
    """Gravity's force at positions (rad or m), as on the rig; N·m or N, shape (n,)."""
    if context.joint.type == "slide":
        return np.full(len(position), context.gravity_force[0])
    cos, sin = gravity_factors(context)
    return np.asarray(cos * np.cos(position) + sin * np.sin(position))


# --- what a curve tells of itself
def position_noise(position: Array) -> float:
    """Noise of positions in the order measured, rad or m; uneven steps count as noise too."""
    return smoothing.noise(np.arange(float(len(position))), position)


def force_noise(position: Array, force: Array, direction: Array) -> float:
    """Noise of the force, N·m or N, from its differences over position.

    The smallest one that second and fourth differences tell: of the force in either direction, as
    curves' corners are in more fourth differences, and what bends all along is in second ones; and
    of the way there minus and plus the way back, at the same places, where a force by position or
    friction cancels however much it changes from sample to sample.

    Args:
        position: rad or m, shape (n,).
        force: N·m or N, shape (n,).
        direction: of travel, 1 or -1, shape (n,).

    Returns:
        its standard deviation, of a gauge with coarse steps at least theirs; else 0 for fewer than
        5 samples in either direction.
    """
    squares, samples = np.zeros(2), 0
    apart = 1e-9 * float(np.ptp(position))  # what was measured twice at a place still differs
    for way in (1, -1):
        there = np.flatnonzero(direction == way)
        there = there[np.argsort(position[there], kind="stable")]
        if len(there) >= MIN_SAMPLES:
            x, y = position[there] + apart * np.arange(len(there)), force[there]
            noises = np.array([_second_differences(x, y), smoothing.noise(x, y)])
            squares, samples = squares + len(there) * noises**2, samples + len(there)
    white = float(np.sqrt(squares.min() / max(samples, 1)))
    white = min(white, _between_ways(position, force, direction))
    return max(white, smoothing.resolution(force) / 12**0.5)


def _between_ways(position: Array, force: Array, direction: Array) -> float:
    """Noise by the difference or the sum of both ways at the same places, which friction or a force
    by position are not in; infinite for fewer than 5 places, or half of those of one way.

    Places are the same within a part of the usual distance of one way's samples.
    """
    up, down = (
        there[np.argsort(position[there], kind="stable")]
        for there in (np.flatnonzero(direction == way) for way in (1, -1))
    )
    if min(len(up), len(down)) < MIN_SAMPLES:
        return np.inf
    usual = float(np.median(np.diff(position[up])))
    at = np.clip(np.searchsorted(position[down], position[up]), 1, len(down) - 1)
    at -= position[up] - position[down[at - 1]] < position[down[at]] - position[up]
    same = np.abs(position[down[at]] - position[up]) <= SAME_PLACE * usual
    x = position[up[same]] + 1e-9 * usual * np.arange(same.sum())
    if 2 * len(x) < len(up) or len(x) < MIN_SAMPLES or not usual > 0:
        return np.inf
    there, back = force[up[same]], force[down[at[same]]]
    return min(_second_differences(x, y) for y in (there - back, there + back)) / 2**0.5


def _second_differences(x: Array, y: Array) -> float:
    """As `smoothing.noise`, which takes fourth ones."""
    a, b = x[1:-1] - x[:-2], x[2:] - x[1:-1]
    weights = np.stack([b, -a - b, a])
    weights /= np.sqrt((weights**2).sum(axis=0))
    bent = (weights * np.stack([y[:-2], y[1:-1], y[2:]])).sum(axis=0)
    return smoothing.deviation(bent)


def directions(position: Array, noise: float) -> Array:
    """Directions of travel, from the order measured.

    Args:
        position: rad or m, shape (n,).
        noise: of it, rad or m. The joint turns only where it comes back by several noises.

    Returns:
        1 or -1, shape (n,); 0 where it is not known: at a turn, within the noise of it, and where
        the joint never moved.
    """
    heading, turns = _turns(position, min(BACK * noise, MAX_BACK_SHARE * float(np.ptp(position))))
    begins, ends = [0, *(last for _, last in turns)], [*(first for first, _ in turns), -1]
    usual = float(np.median(np.abs(np.diff(position))))
    blurred = TURN * noise if noise > BLURRING_NOISE * usual else 0.0
    out = np.zeros(len(position))
    for k, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        stroke = slice(begin, end + 1 or None)
        out[stroke] = heading * (-1) ** k
        for turn, _ in turns[max(k - 1, 0) : k + 1]:
            out[stroke][np.abs(position[stroke] - position[turn]) < blurred] = 0
    out[[first for first, last in turns if first == last]] = 0
    return out


def _turns(position: Array, back: float) -> tuple[int, list[tuple[int, int]]]:
    """The first direction, and where it turns: the first and the last sample at that place."""
    first, heading, low, high = 0, 0, 0, 0
    turns: list[int] = []
    for k, here in enumerate(position):
        low = k if here < position[low] else low
        high = k if here > position[high] else high
        if heading >= 0 and position[high] - here > back:
            turns += [high] if heading else []
            heading, low = -1, k
        elif heading <= 0 and here - position[low] > back:
            turns += [low] if heading else []
            heading, high = 1, k
        first = first or heading
    return first, [(turn, _last_there(position, turn)) for turn in turns]


def _last_there(position: Array, first: int) -> int:
    moved = np.flatnonzero(position[first:] != position[first])
    return first + int(moved[0]) - 1


# --- against a model
def beside_model(
    curve: QuasiStatic, profile: Profile, context: Context
) -> tuple[QuasiStaticComparison, list[str]]:
    """A curve beside the model's, and notes on what it cannot tell.

    Raises:
        JodaError: the curve tells nothing.
    """
    unit = context.joint.force_unit
    if not curve.force.any():
        raise JodaError(
            f"{curve.name}: the force is zero everywhere; record the force ({unit}) that slowly "
            "moves the joint."
        )
    position, blur = curve.position, position_noise(curve.position)
    direction = directions(position, blur)
    up, down = int((direction > 0).sum()), int((direction < 0).sum())
    if max(up, down) < MIN_SAMPLES:
        raise JodaError(
            f"{curve.name}: {up} samples towards +q and {down} towards \N{MINUS SIGN}q are too few "
            f"to tell anything; record at least {MIN_SAMPLES} in one direction, better 20 in both."
        )
    notes = []
    if not up or not down:
        way = "+q" if up else "\N{MINUS SIGN}q"
        notes.append(
            f"{curve.name}: the joint travels towards {way} only, so friction and forces by "
            "position cannot be told apart; measure the way back too."
        )
    noise = force_noise(position, curve.force, direction)
    sigma = max(noise, 1e-6 * float(np.abs(curve.force).max()))
    empty = np.zeros(len(position))
    found = QuasiStaticComparison(curve, direction, blur, empty, sigma, empty).against(
        profile, context
    )
    if times := found.unusual_factor:
        arm = ", times the gauge's lever arm" if unit == "N·m" else ""
        notes.append(
            f"{curve.name}: {compared(times)}; is it in another unit (grams, m{unit}, k{unit})? It "
            f"must be in {unit}{arm}."
        )
    return found, notes
