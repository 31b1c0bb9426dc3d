"""What a profile costs per step: ratios between models that are stepped in turns, in one run.

The machine's speed cancels out of a ratio and its noise mostly does: every round steps each model
once, and the median over the rounds of the ratio within a round is reported.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from joda.component import Component
from joda.effects import (
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
from joda.field import evaluate
from joda.plugin import PLUGIN
from joda.profile import CHANNELS, Channel, Channels, Joint, Profile, Resistance
from joda.scenes.engine import require, set_strength
from joda.scenes.scene import DAMPING_ROW, INERT, TRACE, open_scene, strip_plugin

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
)
"""All that act in the step; the others are attributes of the scene."""
ROUNDS = 31
SWING = 100  # steps; all joints move meanwhile
FULL = mujoco.mjtState.mjSTATE_INTEGRATION


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        what: what is compared with what.
        ratio: the ratio, median over the rounds.
        spread: half the distance between its quartiles.
        bar: the project's own requirement, as text; empty if there is none.
        microseconds: time per step of the two models, on this machine.
    """

    what: str
    ratio: float
    spread: float
    bar: str
    microseconds: tuple[float, float]


def bench(
    scene: str | Path | None = None, *, progress: Callable[[str], None] = lambda what: None
) -> list[Row]:
    """Measures the cost of profiles.

    Args:
        scene: a scene that carries profiles; without one, a hinge and rows of 10 and 200 hinges.
        progress: told what is being measured.

    Returns:
        the table's rows.

    Raises:
        JodaError: the scene cannot be loaded or carries no profile.
    """
    if scene is not None:
        return _bench_scene(Path(scene), progress)
    rows = []
    progress("one hinge")
    plain, native, ours, full = (hinges(1, kind) for kind in ("plain", "native", "joda", "effects"))
    models = (plain, native, ours, full)
    times = _measure([*((model, None) for model in models), (plain, _callback(ours))])
    rows.append(_row("hinge, three channels / native elements", times[2], times[1], "<= 1.10"))
    what = "addition of a Python callback / of the plugin"
    rows.append(_row(what, times[4] - times[0], times[2] - times[0], ">= 10"))
    rows.append(_row("hinge, all effects / three channels", times[3], times[2], "<= 1.25"))
    progress("10 and 200 hinges")
    few, many = hinges(10, "joda"), hinges(200, "joda")
    few_native, many_native = hinges(10, "native"), hinges(200, "native")
    times = _measure([(few, None), (many, None), (few_native, None), (many_native, None)])
    rows.append(
        _row("step per joint, 200 joints / 10 joints", times[1] / 200, times[0] / 10, "<= 1.2")
    )
    rows.append(_row("10 hinges, three channels / native elements", times[0], times[2], ""))
    rows.append(_row("200 hinges, three channels / native elements", times[1], times[3], ""))
    return rows


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
    profile = profile or _three_channels()
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


def _three_channels() -> Profile:
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


def _callback(model: mujoco.MjModel) -> Callable[[mujoco.MjModel, mujoco.MjData], None]:
    """The same three channels for the hinge of `model` in Python, with SciPy's PCHIP."""
    from scipy.interpolate import PchipInterpolator

    lo, hi = model.jnt_range[0]
    channels = [
        [(c.interval, PchipInterpolator(c.x, c.y)) for c in channel.components]
        for channel in (getattr(_three_channels().channels, name) for name in CHANNELS)
    ]

    def total(parts: list[Any], s: float) -> float:
        return sum(float(f((s - a) / (b - a))) for (a, b), f in parts if a <= s <= b)

    def passive(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        s, v = (data.qpos[0] - lo) / (hi - lo), data.qvel[0]
        force, friction, damping = (total(parts, s) for parts in channels)
        data.qfrc_passive[0] += force - friction * np.tanh(v / 1e-3) - damping * v

    return passive


def _bench_scene(path: Path, progress: Callable[[str], None]) -> list[Row]:
    ours, profiles = open_scene(path)
    what = f"{path.name}, {len(profiles)} profiles"
    progress(what)
    native, plain = (without_plugin(path, profiles, kind) for kind in (True, False))
    times = _measure([(plain, None), (native, None), (ours, None)])
    return [
        _row(f"{what} / native elements", times[2], times[1], "<= 1.05 for the kitchen"),
        _row(f"{what} / none", times[2], times[0], ""),
    ]


def without_plugin(path: Path, profiles: dict[str, Profile], native: bool) -> mujoco.MjModel:
    """The scene without the plugin, with native elements of the same mean strength or none."""
    require((3, 3, 4), "joda bench of a scene")  # older ones delete nothing from a spec
    spec = mujoco.MjSpec.from_file(str(path))
    strip_plugin(spec)
    for equality in list(spec.equalities):
        if equality.name.startswith(DAMPING_ROW):
            spec.delete(equality)
    grid = np.linspace(0, 1, 101)
    for name, profile in profiles.items():
        joint, channels = spec.joint(name), profile.channels
        mean = [float(np.mean(evaluate(c, grid)[0])) for c in (channels.friction, channels.damping)]
        joint.frictionloss, damping = mean if native else (0.0, 0.0)
        set_strength(joint, "damping", damping)
        set_strength(joint, "stiffness", 0.01 if native else 0.0)
    return spec.compile()


def _measure(models: list[tuple[mujoco.MjModel, Any]]) -> np.ndarray:
    """Seconds per step, shape (models, rounds): free swings from the middle of the range."""
    repeats = [_repeats(model, callback) for model, callback in models]
    times = np.empty((len(models), ROUNDS))
    for k in range(ROUNDS):
        for i, (model, callback) in enumerate(models):
            times[i, k] = seconds(model, callback, repeats[i])
    return times


def _repeats(model: mujoco.MjModel, callback: Any) -> int:
    """How many swings take about 20 ms."""
    return max(1, int(0.02 / (SWING * seconds(model, callback, 1))))


def seconds(
    model: mujoco.MjModel, callback: Any = None, repeats: int = 1, steps: int = SWING
) -> float:
    """Seconds per step of short swings through the middle of the joints' ranges."""
    data = mujoco.MjData(model)
    limited = np.asarray(model.jnt_limited, bool) & (np.asarray(model.jnt_type) >= 2)
    data.qpos[model.jnt_qposadr[limited]] = model.jnt_range[limited].mean(axis=1)
    data.qvel[:] = 0.5
    start = np.empty(mujoco.mj_stateSize(model, FULL))
    mujoco.mj_getState(model, data, start, FULL)
    mujoco.set_mjcb_passive(callback)
    total = 0.0
    try:
        for _ in range(repeats):
            mujoco.mj_setState(model, data, start, FULL)
            begin = time.perf_counter()
            mujoco.mj_step(model, data, steps)
            total += time.perf_counter() - begin
    finally:
        mujoco.set_mjcb_passive(None)
    return total / (repeats * steps)


def _row(what: str, ours: np.ndarray, other: np.ndarray, bar: str) -> Row:
    ratios = ours / other
    low, middle, high = np.percentile(ratios, (25, 50, 75))
    times = (1e6 * float(np.median(ours)), 1e6 * float(np.median(other)))
    return Row(what, float(middle), float(high - low) / 2, bar, times)
