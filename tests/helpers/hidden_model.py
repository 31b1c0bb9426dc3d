"""joda.hidden's true joint as a profile of joda: in MuJoCo, no fit can be better than this."""

import numpy as np

from joda.component import Component
from joda.effects import (
    AddedInertia,
    AsymmetricFriction,
    Backlash,
    DirectionDependentDamping,
    EndStopRestitution,
    GravityOffset,
    LoadDependentFriction,
    PreslidingFriction,
    QuadraticDamping,
    StribeckFriction,
)
from joda.hidden import friction_laws, laws, masses, truth
from joda.hidden.cases import Case
from joda.profile import Channels, Profile, Resistance

POINTS = 401


def true_profile(case: Case, base: Profile) -> Profile:
    """The joint of a case that hides nothing, or effects of the catalogue.

    Args:
        case: drawn.
        base: the profile of its base model.
    """
    true = case.truth
    flat = {"friction": true.friction, "damping": true.damping}
    if any(isinstance(law, truth.Bristle) for law in true.hidden):
        flat["friction"] = next(x.friction for x in true.hidden if isinstance(x, truth.Bristle))
    profile = Profile(
        joint=base.joint,
        channels=Channels(
            conservative=base.channels.conservative,
            **{
                name: Resistance(components=(_curve((0, 1), np.array([0.0, 1.0]), np.array(size)),))
                for name, size in flat.items()
                if size
            },
        ),
    )
    for law in true.hidden:
        profile = _with(profile, law)
    return profile


def _with(profile: Profile, law: laws.Law) -> Profile:
    zero = np.zeros(1)
    match law:
        case laws.Tilt():
            return profile.with_effect(GravityOffset(sin=law.sin, cos=law.cos, force=law.constant))
        case laws.Viscous() if law.direction:
            effect = DirectionDependentDamping(
                direction=_way(law.direction), y=(law.size, law.size)
            )
            return profile.with_effect(effect)
        case friction_laws.IntervalFriction() if law.direction:
            effect = AsymmetricFriction(direction=_way(law.direction), y=(law.size, law.size))
            return profile.with_effect(effect)
        case laws.Drag():
            return profile.with_effect(QuadraticDamping(direction="both", y=(law.size, law.size)))
        case friction_laws.Stribeck():
            effect = StribeckFriction(velocity=law.velocity, exponent=2.0, y=(law.size, law.size))
            return profile.with_effect(effect)
        case friction_laws.LoadFriction():
            return profile.with_effect(LoadDependentFriction(coefficient=law.coefficient))
        case truth.Bristle():
            effect = PreslidingFriction(stiffness=law.stiffness, damping=law.damping, breakaway=0.0)
            return profile.with_effect(effect)
        case truth.Inertia():
            return profile.with_effect(AddedInertia(inertia=law.size))
        case truth.Play():
            return profile.with_effect(Backlash(play=law.width, inertia=law.inertia))
        case masses.Behind():
            share = law.friction / profile.channels.friction.components[0].y[0]
            effect = Backlash(play=law.width, inertia=law.inertia, side="motor", share=share)
            return profile.with_effect(effect)
        case truth.Bounce():
            return profile.with_effect(EndStopRestitution(restitution=law.restitution))
    a, b = _interval(law)
    x = np.linspace(0, 1, POINTS)
    s = np.clip(a + (b - a) * x, a, b)
    if isinstance(law, laws.Viscous | laws.ViscousAlong):
        channel, y = "damping", -law.force(s, s, np.ones_like(s), zero)
    elif isinstance(law, laws.Force):
        channel, y = "conservative", law.force(s, s, np.zeros_like(s), zero)
    elif isinstance(law, friction_laws.IntervalFriction | friction_laws.PositionFriction):
        channel, y = "friction", law.limit(s, zero, zero, zero, zero)
    else:
        raise NotImplementedError(type(law).__name__)
    return profile.with_component(channel, _curve((a, b), x, y))


def _way(direction: int) -> str:
    return "positive" if direction > 0 else "negative"


def _interval(law: laws.Law) -> tuple[float, float]:
    """Where a law acts; beyond the ends it is zero."""
    a, b = 0.0, 1.0
    if getattr(law, "edge", None) == 0:
        a, b = law.a, law.b
    elif isinstance(law, laws.Spring):
        a, b = (1 - law.reach, 1.0) if law.high else (0.0, law.reach)
    return max(a, 0.0), min(b, 1.0)


def _curve(interval: tuple[float, float], x: np.ndarray, y: np.ndarray) -> Component:
    y = np.broadcast_to(y, x.shape)
    return Component(interval=interval, x=tuple(map(float, x)), y=tuple(map(float, y)))
