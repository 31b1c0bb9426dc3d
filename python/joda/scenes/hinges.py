"""Rows of doors, with profiles and without: scenes for measuring what a profile costs."""

from pathlib import Path

import mujoco
import numpy as np

from joda.component import Component
from joda.effects import (
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
from joda.field import evaluate
from joda.plugin import PLUGIN
from joda.profile import Channel, Channels, Joint, Profile, Resistance
from joda.scenes.engine import delete, set_strength
from joda.scenes.scene import DAMPING_ROW, INERT, TRACE, strip_plugin

LEARNED = LearnedForce(
    memory="speed",
    time=3.0,
    gain=-0.1,
    positions=(0.0, 0.2, 0.5, 1.0),
    velocities=(-2.0, -1.0, -0.3, -0.1, 0.0, 0.1, 0.3, 1.0, 2.0),
    y=(
        (-0.2, -0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2),
        (-0.3, -0.2, -0.15, -0.1, 0.0, 0.05, 0.05, 0.1, 0.2),
        (-0.2, -0.15, -0.1, -0.05, 0.0, 0.05, 0.1, 0.15, 0.2),
        (-0.4, -0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3, 0.4),
    ),
)
"""A table of a usual size with a memory."""
ALL_EFFECTS = (
    AsymmetricFriction(direction="positive", y=(0.05, 0.05)),
    DirectionDependentDamping(direction="negative", y=(0.2, 0.2)),
    StribeckFriction(velocity=0.1, y=(0.05, 0.05)),
    QuadraticDamping(y=(0.05, 0.05)),
    PreslidingFriction(stiffness=200, damping=0.05, breakaway=0.7),
    LoadDependentFriction(coefficient=0.05),
    GravityOffset(sin=0.1, cos=0.1),
    Backlash(play=0.01, inertia=0.001),
    EndStopRestitution(restitution=0.3, end="low"),
    LEARNED,
)
"""All that act in the step; the others are attributes of the scene."""


def hinges(count: int, kind: str, profile: Profile | None = None) -> mujoco.MjModel:
    """Doors side by side: "plain", with "native" spring, damping and friction, the same with the
    damping's constraint "rows", but no plugin, with profiles ("joda"; by default of 8 components),
    or with profiles and all effects that there are ("effects")."""
    return mujoco.MjModel.from_xml_string(hinges_text(count, kind, profile))


def hinges_text(count: int, kind: str, profile: Profile | None = None) -> str:
    """The same as MJCF."""
    attributes = {
        "plain": "",
        "native": 'stiffness="0.5" damping="0.2" frictionloss="0.1"',
        "rows": 'stiffness="0.5" frictionloss="0.1"',
        "joda": f'frictionloss="{TRACE}"',
        "effects": f'frictionloss="{TRACE}"',
    }[kind]
    ours = kind in ("joda", "effects")
    profile = profile or three_channels()
    if kind == "effects":
        profile = profile.model_copy(update={"effects": ALL_EFFECTS})
    bodies, instances, rows = [], [], []
    config = "".join(f'<config key="{k}" value="{v}"/>' for k, v in profile.attributes().items())
    for k in range(count):
        reference = f'<plugin instance="p{k}"/>' if ours else ""
        bodies.append(
            f'<body pos="{k} 0 0">'
            f'<joint name="j{k}" axis="0 0 1" range="0 1.5" limited="true" {attributes}/>'
            f'<geom type="box" size=".2 .01 .2" pos=".2 0 0" mass="1"/>{reference}</body>'
        )
        instances.append(f'<instance name="p{k}">{config}</instance>')
        rows.append(f'<joint name="{DAMPING_ROW}j{k}" joint1="j{k}" {INERT}/>')
    extension = f'<extension><plugin plugin="{PLUGIN}">{"".join(instances)}</plugin></extension>'
    extra = (
        extension if ours else "",
        f"<equality>{''.join(rows)}</equality>" if ours or kind == "rows" else "",
    )
    quiet = '<option><flag contact="disable"/></option>'  # a row of doors is no collision benchmark
    return (
        f'<mujoco><compiler angle="radian"/>{quiet if count > 1 else ""}{extra[0]}'
        f"<worldbody>{''.join(bodies)}</worldbody>{extra[1]}</mujoco>"
    )


def three_channels() -> Profile:
    """A door with a latch, hinge friction and a soft end: 8 components in all."""

    def part(a: float, b: float, x: tuple[float, ...], y: tuple[float, ...]) -> Component:
        return Component(interval=(a, b), x=x, y=y)

    latch = part(0, 0.06, (0, 0.3, 0.6, 1), (-2, -2.5, 0.4, 0))
    spring = part(0, 1, (0, 1), (-0.1, -0.5))
    detent = part(0.6, 0.8, (0, 0.25, 0.5, 0.75, 1), (0, 0.5, 0, -0.5, 0))
    whole = part(0, 1, (0, 1), (0.1, 0.1))
    return Profile(
        joint=Joint(name="j", type="hinge", range=(0, 1.5), unit="rad"),
        channels=Channels(
            conservative=Channel(components=(latch, spring, detent)),
            friction=Resistance(components=(whole, part(0.4, 0.6, (0, 0.5, 1), (0, 0.2, 0)))),
            damping=Resistance(
                components=(whole, part(0.8, 1, (0, 1), (0, 2)), part(0, 0.1, (0, 1), (0.5, 0)))
            ),
        ),
    )


def without_plugin(path: Path, profiles: dict[str, Profile], native: bool) -> mujoco.MjModel:
    """The scene without the plugin, with native elements of the same mean strength or none."""
    spec = mujoco.MjSpec.from_file(str(path))
    strip_plugin(spec)
    for equality in list(spec.equalities):
        if equality.name.startswith(DAMPING_ROW):
            delete(spec, equality)
    grid = np.linspace(0, 1, 101)
    for name, profile in profiles.items():
        joint, channels = spec.joint(name), profile.channels
        mean = [float(np.mean(evaluate(c, grid)[0])) for c in (channels.friction, channels.damping)]
        joint.frictionloss, damping = mean if native else (0.0, 0.0)
        set_strength(joint, "damping", damping)
        set_strength(joint, "stiffness", 0.01 if native else 0.0)
    return spec.compile()
