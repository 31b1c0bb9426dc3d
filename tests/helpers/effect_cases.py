"""Joints with templates and with every effect, and forces that move them."""

from pathlib import Path

import numpy as np

from joda import context, templates
from joda.component import Component
from joda.effects import (
    AddedInertia,
    AsymmetricFriction,
    Backlash,
    DirectionDependentDamping,
    EndStopRestitution,
    GravityOffset,
    LearnedForce,
    LoadDependentFriction,
    PreslidingFriction,
    QuadraticDamping,
    StribeckFriction,
)
from joda.joints.rig import rig
from joda.profile import CHANNELS, Channel, Channels, Profile, Resistance

FOLDER = Path(__file__).parents[2] / "models"
MODELS = sorted(FOLDER.glob("*.xml"))
KINDS = {"hinge": "cabinet.xml", "slide": "drawer.xml"}


def cases(kind, force, inertia, play):
    """Each effect at a size that matters beside a force and an inertia, and all of them.

    Args:
        kind: hinge or slide.
        force: N·m or N.
        inertia: of the joint.
        play: of backlash, rad or m.
    """
    offset = {"sin": 0.3, "cos": -0.2} if kind == "hinge" else {"force": 0.3}
    curve = {"interval": (0.0, 1.0), "x": (0.0, 0.3, 1.0)}

    def y(*values):
        return {"y": tuple(value * force for value in values)}

    out = {
        "direction_dependent_damping": (
            DirectionDependentDamping(direction="positive", **curve, **y(0.1, 0.4, 0.2)),
            DirectionDependentDamping(direction="negative", **curve, **y(0.3, 0.1, 0.05)),
        ),
        "quadratic_damping": (QuadraticDamping(**curve, **y(0.1, 0.3, 0.2)),),
        "quadratic_damping down": (
            QuadraticDamping(direction="negative", **curve, **y(0.1, 0.3, 0.2)),
        ),
        "asymmetric_friction": (
            AsymmetricFriction(direction="positive", **curve, **y(0.2, 0.5, 0.3)),
            AsymmetricFriction(direction="negative", **curve, **y(0.1, 0.15, 0.05)),
        ),
        "stribeck_friction": (
            StribeckFriction(velocity=0.4, exponent=1.3, **curve, **y(0.3, 0.6, 0.4)),
        ),
        "load_dependent_friction": (LoadDependentFriction(coefficient=0.2),),
        "presliding_friction": (
            PreslidingFriction(stiffness=8 * force, damping=0.05 * force, breakaway=0.6),
        ),
        "dahl": (PreslidingFriction(stiffness=20 * force, breakaway=0.0),),
        "prandtl": (PreslidingFriction(stiffness=12 * force),),
        "gravity_offset": (GravityOffset(**{k: x * force for k, x in offset.items()}),),
        "backlash": (Backlash(play=play, inertia=0.2 * inertia),),
        "backlash behind": (Backlash(play=play, inertia=0.6 * inertia, side="motor", share=0.7),),
        "learned_force": (_learned(0.2 * force, memory="position", time=0.2, gain=0.3 * force),),
        "learned_force speed": (_learned(force, memory="speed", time=0.5, gain=-0.3),),
        "learned_force active": (_learned(-0.2 * force, power="active"),),
        "added_inertia": (AddedInertia(inertia=0.4 * inertia),),
        "end_stop_restitution": (EndStopRestitution(restitution=0.4),),
        "end_stop_restitution low": (EndStopRestitution(restitution=0.7, end="low"),),
        "end_stop_restitution each": (
            EndStopRestitution(restitution=0.2, end="low"),
            EndStopRestitution(restitution=0.8, end="high"),
        ),
    }
    left_out = ("quadratic_damping down", "dahl", "prandtl", "backlash behind")
    left_out += ("learned_force speed", "learned_force active")
    left_out += ("end_stop_restitution low", "end_stop_restitution each")
    every = tuple(e for name, own in out.items() if name not in left_out for e in own)
    return {**out, "all": every}


def _learned(force, **how):
    """A table with uneven places, of which each row and each direction is another."""
    rows = ((-0.3, -0.25, 0, 0.1, 0.2, 0.5), (-0.4, -0.1, 0, 0.2, 0.25, 0.35))
    y = tuple(tuple(force * value for value in row) for row in (*rows, rows[0]))
    velocities = (-3.0, -0.6, 0.0, 0.2, 1.0, 4.0)
    return LearnedForce(positions=(0.1, 0.5, 0.8), velocities=velocities, y=y, **how)


def profile_of(joint, effects, force):
    """A spring, friction and damping besides the effects."""
    parts = {"conservative": (0.3, -0.2), "friction": (0.15, 0.25), "damping": (0.05, 0.05)}
    channels = {
        name: {"components": [{"interval": (0, 1), "x": (0, 1), "y": [y * force for y in ys]}]}
        for name, ys in parts.items()
    }
    return Profile.model_validate({"joint": joint, "channels": channels, "effects": effects})


def pushes(force, seconds, h, seed=0):
    """Random forces, each for a twentieth of a second per second, with reversals."""
    n = round(seconds / h)
    values = np.random.default_rng(seed).normal(0, 2 * force, 20)
    return np.repeat(values, n // 20)


def found_of(kind):
    """The context of a joint, and what is a strong force on it."""
    found = context(FOLDER / KINDS[kind], "#0")
    lo, hi = found.joint.range
    return found, max(found.gravity_scale, 20 * found.equivalent_inertia * (hi - lo))


def profile_for(found, number):
    """A template in the middle, besides constant friction and damping, as large as gravity is."""
    library = templates()
    name = sorted(library)[number % len(library)]
    inertia, (lo, hi) = found.equivalent_inertia, found.joint.range
    force = max(found.gravity_scale, 20 * inertia * (hi - lo))
    size = {"conservative": force, "friction": 0.1 * force, "damping": 2 * inertia}
    parts = {}
    for channel in CHANNELS:
        y = (0.0, 0.0) if channel == "conservative" else (0.5 * size[channel],) * 2
        part = [Component(interval=(0, 1), x=(0, 1), y=y)]
        if curve := getattr(library[name].channels, channel):
            y = tuple(size[channel] * np.array(curve.y))
            part.append(Component(label=name, interval=(0.25, 0.75), x=curve.x, y=y))
        parts[channel] = (Channel if channel == "conservative" else Resistance)(components=part)
    return Profile(joint=found.joint, channels=Channels(**parts)), force


def quiet(found, profile, step):
    model = rig(found, profile)
    model.opt.timestep, model.opt.tolerance = step, 1e-14
    return model
