"""joda.warp beside the plugin: random profiles, each in a world of its own.

    python tests/benchmarks warp_parity [COUNT [SEED [jumps]]]

A hinged arm that hits the floor and a drawer that pushes a ball get random profiles: components of
all three channels, summed or the largest, and any of the effects. Printed is how far joda.warp
(float32) is from the plugin (float64) after a second of being pushed to and fro, as a share of the
range. COUNT is of worlds, each with two profiles. Curves that end within the range end at zero;
with `jumps`, anywhere.
"""

import sys
from functools import partial

import mujoco
import mujoco_warp
import numpy as np
from tables import random_memory, random_table

import joda.warp
from joda import effects
from joda.profile import CHANNELS, Profile
from joda.scenes.scene import INERT

RANGES = {"arm": (-0.2, 1.3), "drawer": (0.0, 0.3)}
SPANS = np.array([hi - lo for lo, hi in RANGES.values()])
KINDS = {"arm": ("hinge", "rad"), "drawer": ("slide", "m")}
SIZES = {
    "arm": {"conservative": 0.6, "friction": 0.2, "damping": 0.06},
    "drawer": {"conservative": 4.0, "friction": 2.0, "damping": 3.0},
}
"""About the largest value of a component, N·m or N, and of its damping."""
PUSHES = np.array([0.9, 6.0])
WIND = np.array([0.1, 0.0, -0.2, 0.0, 0.01, 0.0])
"""On a body, N and N·m."""
CONFIGURATIONS = [(i, c) for i in ("Euler", "implicitfast") for c in ("pyramidal", "elliptic")]
SECONDS, TIMESTEP = 1.0, 0.002
CLOSE = 1e-4
"""Of the range."""


def scene(
    profiles: dict[str, Profile],
    integrator="Euler",
    cone="pyramidal",
    option="",
    gravity="0 0 -9.81",
) -> str:
    """MJCF of the arm and the drawer with these profiles."""
    instances, rows = [], []
    for name, profile in profiles.items():
        config = "".join(
            f'<config key="{k}" value="{v}"/>' for k, v in profile.attributes().items()
        )
        instances.append(f'<instance name="{name}">{config}</instance>')
        rows.append(f'<joint name="joda_damping_{name}" joint1="{name}" {INERT}/>')
    return f"""
    <mujoco>
      <compiler angle="radian"/>
      <option timestep="{TIMESTEP}" integrator="{integrator}" cone="{cone}" 
              iterations="50" ls_iterations="50" {option}/>
      <extension><plugin plugin="joda.joint_dynamics">{"".join(instances)}</plugin></extension>
      <default><geom contype="0" conaffinity="1"/>
        <joint frictionloss="1e-12" armature="0.002"/></default>
      <worldbody>
        <geom name="floor" type="plane" size="2 2 .1" pos="0 0 -0.45" contype="1" conaffinity="1"/>
        <body name="arm"><joint name="arm" axis="0 1 0" range="-0.2 1.3"/>
          <geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.03" mass="0.1"/>
          <plugin instance="arm"/></body>
        <body name="drawer" pos="0 1 -0.3" euler="0 0.1 0">
          <joint name="drawer" type="slide" axis="1 0 0" range="0 0.3"/>
          <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03" mass="0.5"/>
          <plugin instance="drawer"/></body>
        <body name="ball" pos="0.72 1 -0.3501"><freejoint/>
          <geom type="sphere" size="0.1" mass="0.2" contype="1" conaffinity="1"/></body>
      </worldbody>
      <equality>{"".join(rows)}</equality>
      <actuator>{"".join(f'<motor joint="{name}"/>' for name in profiles)}</actuator>
    </mujoco>"""


def random_profile(name: str, rng: np.random.Generator, jumps=False) -> Profile:
    """A profile with one to four components in each channel, and any of the effects."""
    size, (kind, unit) = SIZES[name], KINDS[name]

    def curve(scale: float, least: float) -> dict:
        a, b = np.sort(rng.uniform(0, 1, 2))
        a, b = (a if a > 0.2 else 0.0), (b if b < 0.8 else 1.0)
        a, b = (min(a, 0.9), min(a, 0.9) + 0.1) if b - a < 0.1 else (a, b)
        knots = int(rng.integers(2, 7))
        inner = np.sort(rng.uniform(0.1, 0.9, knots - 2)) if knots > 2 else []
        x = np.unique(np.round([0, *inner, 1], 3))
        y = scale * rng.uniform(least, 1, len(x))
        if not jumps:
            y[0], y[-1] = y[0] * (a == 0), y[-1] * (b == 1)
        return {"interval": (round(float(a), 4), round(float(b), 4)), "x": tuple(x), "y": tuple(y)}

    channels = {
        channel: {
            "combine": str(rng.choice(["sum", "max"])),
            "components": [
                curve(size[channel], -1 if channel == "conservative" else 0)
                for _ in range(rng.integers(1, 5))
            ],
        }
        for channel in CHANNELS
    }
    way = partial(rng.choice, ["positive", "negative"])
    friction, damping = size["friction"], size["damping"]
    inertia = {"arm": 0.008, "drawer": 0.5}[name]
    gravity = {"sin": 0.2, "cos": 0.1} if kind == "hinge" else {"force": 0.5}
    play = {"play": 0.02 * (RANGES[name][1] - RANGES[name][0]), "inertia": 0.1 * inertia}
    possible = [
        {"effect": "direction_dependent_damping", "direction": way(), **curve(damping, 0)},
        {"effect": "quadratic_damping", "direction": way(), **curve(damping, 0)},
        {"effect": "asymmetric_friction", "direction": way(), **curve(0.5 * friction, 0)},
        {"effect": "stribeck_friction", "velocity": 0.2, "exponent": rng.choice([1.0, 2.0, 1.4]),
         **curve(0.5 * friction, 0)},
        {"effect": "load_dependent_friction", "coefficient": 0.1},
        {"effect": "presliding_friction", "stiffness": 500 * friction,
         "damping": 0.1 * damping, "breakaway": rng.choice([0.0, 0.6, 1.0])},
        {"effect": "gravity_offset", **gravity},
        {"effect": "added_inertia", "inertia": 0.001},
        {"effect": "end_stop_restitution", "restitution": 0.4, "end": rng.choice(["low", "high"])},
        {"effect": "backlash", **play, "side": "load"},
        {"effect": "backlash", **play, "side": "motor", "share": 0.5},
    ]  # fmt: skip
    chosen = [own for own in possible if rng.uniform() < 0.25]
    if sum(own["effect"] == "backlash" for own in chosen) > 1:
        chosen.pop()
    (own,) = rng.spawn(1)
    if own.uniform() < 0.25:
        chosen.append(random_table(own, friction, **random_memory(own, friction)).model_dump())
    return Profile.model_validate(
        {
            "joint": {"name": name, "type": kind, "range": RANGES[name], "unit": unit},
            "channels": channels,
            "effects": chosen,
        }
    )


def draw(count: int, seed: int, jumps=False) -> list[dict[str, Profile]]:
    """Random profiles of both joints, so many times."""
    rng = np.random.default_rng(seed)
    assert set(effects.EFFECTS) == NAMES, "an effect is not drawn"
    return [{name: random_profile(name, rng, jumps) for name in RANGES} for _ in range(count)]


NAMES = {
    *("direction_dependent_damping", "quadratic_damping", "asymmetric_friction"),
    *("stribeck_friction", "load_dependent_friction", "presliding_friction", "gravity_offset"),
    *("added_inertia", "end_stop_restitution", "backlash", "learned_force"),
}


def forces(seconds=SECONDS) -> np.ndarray:
    """Pushes to and fro on both joints, shape (steps, 2)."""
    t = np.arange(round(seconds / TIMESTEP)) * TIMESTEP
    return np.sin(2 * np.pi * t / 0.45)[:, None] * PUSHES


def by_plugin(variants, pushes, rounded=False, motors=False, **options) -> np.ndarray:
    """Positions of both joints in each world, by the plugin; shape (steps, worlds, 2).

    `rounded`: what a step leaves behind is rounded to single precision, all else is double.
    `motors`: they push, while a steady WIND blows on all bodies.
    """
    out = np.empty((len(pushes), len(variants), 2))
    for k, profiles in enumerate(variants):
        model = mujoco.MjModel.from_xml_string(scene(profiles, **options))
        data = mujoco.MjData(model)
        data.qpos[:2] = start()
        data.xfrc_applied[1:] = WIND * motors
        for i, push in enumerate(pushes):
            (data.ctrl if motors else data.qfrc_applied)[:2] = push
            mujoco.mj_step(model, data)
            if rounded:
                for kept in (data.qpos, data.qvel, data.qacc_warmstart, data.plugin_state):
                    kept[:] = kept.astype(np.float32)
            out[i, k] = data.qpos[:2]
    return out


def start() -> list[float]:
    return [lo + 0.4 * (hi - lo) for lo, hi in RANGES.values()]


def prepared(variants, nworld=None, **options):
    """Model and data of mujoco_warp with the profiles acting, and the fields."""
    spec = mujoco.MjSpec.from_string(scene(variants[0], **options))
    joda.warp.take_profiles(spec)
    model = spec.compile()
    nworld = nworld or len(variants)
    m = mujoco_warp.put_model(model)
    d = mujoco_warp.make_data(model, nworld=nworld, nconmax=16, njmax=64)
    fields = joda.warp.put_fields(model, variants, nworld)
    joda.warp.attach(m, d, fields)
    place(d)
    return m, d, fields


def place(d) -> None:
    """Puts both joints where they start."""
    qpos = d.qpos.numpy()
    qpos[:, :2] = start()
    d.qpos.assign(qpos)


def by_warp(m, d, pushes, motors=False) -> np.ndarray:
    """The same as `by_plugin`, by mujoco_warp."""
    out = np.empty((len(pushes), d.nworld, 2))
    pushed = d.ctrl if motors else d.qfrc_applied
    applied = np.zeros(pushed.shape, np.float32)
    d.xfrc_applied.assign(np.tile(WIND * motors, (d.nworld, m.nbody, 1)))
    for i, push in enumerate(pushes):
        applied[:, :2] = push
        pushed.assign(applied)
        mujoco_warp.step(m, d)
        out[i] = d.qpos.numpy()[:, :2]
    return out


def errors(variants, **options) -> tuple[np.ndarray, np.ndarray]:
    """Distance from the plugin at the end, as a share of the range, by joint; (worlds, 2).

    The second is the plugin's own distance where its state is rounded to single precision: where
    that is large already, the motion and not the law is what single precision loses.
    """
    pushes = forces()
    m, d, _ = prepared(variants, **options)
    exact = by_plugin(variants, pushes, **options)[-1]
    ends = by_warp(m, d, pushes)[-1], by_plugin(variants, pushes, rounded=True, **options)[-1]
    ours, rounded = (np.abs(end - exact) / SPANS for end in ends)
    return ours, rounded


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 150
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    variants = draw(count, seed, "jumps" in sys.argv)
    for integrator, cone in CONFIGURATIONS:
        error, rounded = errors(variants, integrator=integrator, cone=cone)
        close, kept, missed = error < CLOSE, rounded < CLOSE, (error >= CLOSE).sum(0)
        print(
            f"{integrator}, {cone}: {100 * close.mean():.1f} % of {error.size} profiles within "
            f"{CLOSE:g} of the range, all but {missed[0]} on the arm and {missed[1]} on the "
            f"drawer; median {np.median(error):.1e}, 99 % within {np.quantile(error, 0.99):.1e}; "
            f"the plugin with its state rounded to single precision: {100 * kept.mean():.1f} %, "
            f"and of these joda.warp {100 * close[kept].mean():.1f} %"
        )
