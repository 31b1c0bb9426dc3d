"""The nearest spring, damping and dry friction to a profile, and the error that they make."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from joda.component import Component
from joda.effects import (
    AddedInertia,
    AsymmetricFriction,
    CurveEffect,
    DirectionDependentDamping,
    EndStopRestitution,
    GravityOffset,
    LearnedForce,
    QuadraticDamping,
    StribeckFriction,
)
from joda.field import evaluate
from joda.field.table import resistance
from joda.profile import Channel, Profile
from joda.scenes.engine import HAS_POLYNOMIALS

Array = NDArray[np.float64]
Format = Literal["native", "urdf", "sdf", "usd"]

SPRING = {"native": 3 if HAS_POLYNOMIALS else 1, "urdf": 0, "sdf": 1, "usd": 1}
"""Degree of the spring that a format has."""
SLACK = 0.01
"""Change over the range of a force that stands for a constant one, as a part of it."""
FARTHEST = 2 * np.pi
"""Largest angle, rad, to which PhysX drives a hinge: it refuses a target beyond."""
POINTS = 501
SPEEDS = (0.25, 0.5, 1.0)
"""At which damping is compared, in ranges per second."""


@dataclass(frozen=True)
class Error:
    """How far the constants are from the profile.

    Attributes:
        what: "conservative force", "friction" or "damping" (its force at up to `speed`).
        unit: N·m or N.
        rms: root mean square over the range and both directions.
        largest: the largest there.
        size: the profile's largest value there.
    """

    what: str
    unit: str
    rms: float
    largest: float
    size: float


@dataclass(frozen=True)
class Nearest:
    """Constants of one joint in place of its profile.

    Attributes:
        joint: its name.
        stiffness: k0, k1, k2 of the force -(k0 x + k1 x² + k2 x³), N·m/rad and so on, or N/m.
        reference: where x is zero, rad or m.
        damping: b0, b1 of the force -(b0 + b1 |v|) v, N·m·s/rad and N·m·s²/rad², or of a slide's.
        friction: in motion, N·m or N.
        static_friction: at rest.
        speed: up to which damping is compared, rad/s or m/s.
        errors: of force, friction and damping.
        lost: effects that the format cannot express, with their numbers.
    """

    joint: str
    stiffness: tuple[float, float, float]
    reference: float
    damping: tuple[float, float]
    friction: float
    static_friction: float
    speed: float
    errors: tuple[Error, ...]
    lost: tuple[str, ...]


def nearest(profile: Profile, to: Format) -> Nearest:
    """The constants of a format that come nearest to a profile, by least squares over the range.

    Args:
        profile: with all that acts on the joint.
        to: the format.
    """
    lo, hi = profile.joint.range
    unit = profile.joint.force_unit
    s = np.linspace(0, 1, POINTS)
    q = lo + s * (hi - lo)

    force = _force(profile, s, q)
    farthest = FARTHEST if to == "usd" and profile.joint.type == "hinge" else np.inf
    stiffness, reference = _spring(q, force, SPRING[to], farthest)
    x = q - reference
    sprung = -x * (stiffness[0] + x * (stiffness[1] + x * stiffness[2]))

    rubbing = _friction(profile, s)
    friction = float(rubbing.mean())
    excess = [_value(e, s) for e in profile.effects if isinstance(e, StribeckFriction)]
    at_rest = friction + float(np.mean(sum(excess))) if excess else friction

    speed = hi - lo
    v = speed * np.array([-1.0, *(-k for k in SPEEDS[:-1]), *SPEEDS])[:, None]
    drag = _drag(profile, s, v)
    damping = _damping(v, drag, squares=to == "native" and HAS_POLYNOMIALS)
    damped = (damping[0] + damping[1] * np.abs(v)) * v
    errors = (
        _error("conservative force", unit, force - sprung, force),
        _error("friction", unit, rubbing - friction, rubbing),
        _error("damping", unit, drag - damped, drag),
    )
    return Nearest(
        profile.joint.name,
        stiffness,
        reference,
        damping,
        friction,
        at_rest,
        speed,
        errors,
        tuple(effect.described() for effect in profile.effects if not _is_kept(effect, to)),
    )


def _is_kept(effect: object, to: Format) -> bool:
    """Whether the effect is in the constants, as far as their errors tell, or in the scene."""
    if isinstance(effect, (AsymmetricFriction, DirectionDependentDamping, QuadraticDamping)):
        return True
    if isinstance(effect, LearnedForce):
        return effect.memory == "none"
    if isinstance(effect, GravityOffset):
        return SPRING[to] > 0
    if isinstance(effect, AddedInertia):
        return to in ("native", "usd")
    if isinstance(effect, EndStopRestitution):
        return to == "native" and effect.end == "both"
    return isinstance(effect, StribeckFriction) and to == "usd"


def _value(effect: CurveEffect, s: Array) -> Array:
    part = Component(interval=effect.interval, x=effect.x, y=effect.y)
    return evaluate(Channel(components=(part,)), s)[0]


def _force(profile: Profile, s: Array, q: Array) -> Array:
    out = evaluate(profile.channels.conservative, s)[0]
    for effect in profile.effects:
        if isinstance(effect, GravityOffset):
            out = out + effect.sin * np.sin(q) + effect.cos * np.cos(q) + effect.force
    return out


def _friction(profile: Profile, s: Array) -> Array:
    """In motion, shape (2, positions): in positive and in negative motion."""
    both = evaluate(profile.channels.friction, s)[0]
    out = np.stack((both, both))
    for effect in profile.effects:
        if isinstance(effect, AsymmetricFriction):
            out[0 if effect.direction == "positive" else 1] += _value(effect, s)
    return out


def _drag(profile: Profile, s: Array, v: Array) -> Array:
    """The force that damping makes at speeds v, against the motion; shape (speeds, positions)."""
    rate = evaluate(profile.channels.damping, s)[0] + 0 * v
    beside = np.zeros_like(rate)
    for effect in profile.effects:
        if isinstance(effect, (DirectionDependentDamping, QuadraticDamping)):
            ways = {"both": v != 0, "positive": v > 0, "negative": v < 0}
            speed = np.abs(v) if isinstance(effect, QuadraticDamping) else 1.0
            rate = rate + ways[effect.direction] * speed * _value(effect, s)
        elif isinstance(effect, LearnedForce):
            beside = beside + resistance(effect, s, v)[0]
    return rate * v + beside


def _spring(
    q: Array, force: Array, degree: int, farthest: float
) -> tuple[tuple[float, float, float], float]:
    """Coefficients and zero of the nearest spring, which of a line is no farther than that."""
    middle, width = float(q[0] + q[-1]) / 2, float(q[-1] - q[0])
    if degree == 0 or not force.any():
        return (0.0, 0.0, 0.0), middle
    line = _line(q, force, middle, width, farthest)
    if degree == 1:
        return line
    u = (q - middle) / width
    cubic = np.polynomial.Polynomial.fit(u, force, 3, domain=(-0.5, 0.5), window=(-0.5, 0.5))
    roots = cubic.roots()
    real = roots.real[np.abs(roots.imag) < 1e-9 * (1 + np.abs(roots.real))]
    best, misfit = line, _misfit(q, force, line)
    for root in real:
        zero = middle + width * float(root)
        c = [float(cubic.deriv(n)(root)) / (-1.0 * np.prod(range(1, n + 1))) for n in (1, 2, 3)]
        one = ((c[0] / width, c[1] / width**2, c[2] / width**3), zero)
        if _misfit(q, force, one) < misfit:
            best, misfit = one, _misfit(q, force, one)
    return best


def _line(
    q: Array, force: Array, middle: float, width: float, farthest: float
) -> tuple[tuple[float, float, float], float]:
    """A linear spring, which must not push away; a constant force is a weak one from afar."""
    slope, _ = np.polyfit(q - middle, force, 1)
    mean = float(force.mean())
    away = max(farthest - float(np.sign(mean)) * middle, width)
    least = max(SLACK / width, 1 / away) * abs(mean)
    k = max(-float(slope), least)
    return (k, 0.0, 0.0), middle + mean / k if k else middle


def _misfit(q: Array, force: Array, spring: tuple[tuple[float, float, float], float]) -> float:
    (k0, k1, k2), zero = spring
    x = q - zero
    return float(np.square(force + x * (k0 + x * (k1 + x * k2))).mean())


def _damping(v: Array, drag: Array, squares: bool) -> tuple[float, float]:
    """The nearest damping; with `squares` also what grows with speed. Neither is negative."""
    from scipy.optimize import nnls

    columns = [np.broadcast_to(v, drag.shape).ravel()]
    if squares:
        columns.append(np.broadcast_to(v * np.abs(v), drag.shape).ravel())
    found, _ = nnls(np.stack(columns, axis=1), drag.ravel())
    return float(found[0]), float(found[1]) if squares else 0.0


def _error(what: str, unit: str, difference: Array, of: Array) -> Error:
    rms = float(np.sqrt(np.square(difference).mean()))
    return Error(what, unit, rms, float(np.abs(difference).max()), float(np.abs(of).max()))
