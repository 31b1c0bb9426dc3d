"""Profiles in MJX: the plugin's trajectories, and derivatives that central differences confirm."""

import os
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import joints
import mujoco
import numpy as np
import pytest
from mujoco import mjx
from slopes import FAST, check_slopes

import joda.mjx
from joda.profile import CHANNELS, Channels, Joint, Profile
from joda.scenes.scene import INERT, profiles_of, set_profile
from joda.template import read_templates

jax.config.update("jax_enable_x64", True)


TEMPLATES = read_templates()
SECONDS = 2.0
RANGES = {"arm": (-0.2, 1.3), "drawer": (0.0, 0.3)}
KINDS = {"arm": "hinge", "drawer": "slide"}
SCALES = {
    "arm": {"conservative": 1.2, "friction": 0.5, "damping": 0.12},
    "drawer": {"conservative": 6.0, "friction": 3.0, "damping": 4.0},
}
CONTACTS = """
  <geom name="floor" type="plane" size="2 2 .1" pos="0 0 -0.45" contype="1" conaffinity="1"/>
  <body name="ball" pos="0.62 1 -0.3501"><freejoint/>
    <geom type="sphere" size="0.1" mass="0.2" contype="1" conaffinity="1"/>
  </body>"""


def scene(integrator="Euler", contacts=False, option="") -> mujoco.MjModel:
    """A hinged arm that gravity pulls down, and a drawer on a slope; each carries a profile.

    With contacts, the arm hits the floor within its range and the drawer pushes a ball.
    """
    instances = "".join(
        f'<instance name="{name}"><config key="range" value="{lo} {hi}"/></instance>'
        for name, (lo, hi) in RANGES.items()
    )
    rows = "".join(f'<joint name="joda_damping_{n}" joint1="{n}" {INERT}/>' for n in RANGES)
    touch = 'contype="0" conaffinity="1"' if contacts else 'contype="0" conaffinity="0"'
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco>
      <compiler angle="radian"/>
      <option timestep="0.002" integrator="{integrator}" iterations="50" ls_iterations="50"
              tolerance="1e-14" {option}/>
      <extension><plugin plugin="joda.joint_dynamics">{instances}</plugin></extension>
      <worldbody>
        <body name="arm"><joint name="arm" axis="0 1 0" range="-0.2 1.3" frictionloss="1e-12"/>
          <geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.03" mass="0.1" {touch}/>
          <plugin instance="arm"/></body>
        <body name="drawer" pos="0 1 -0.3" euler="0 0.1 0">
          <joint name="drawer" type="slide" axis="1 0 0" range="0 0.3" frictionloss="1e-12"/>
          <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03" mass="0.5" {touch}/>
          <plugin instance="drawer"/></body>
        {CONTACTS if contacts else ""}
      </worldbody>
      <equality>{rows}</equality>
    </mujoco>""")


def profile_of(template: str, joint: str, scale=1.0) -> Profile:
    """A template's curves on the middle 80 % of the joint, at a strength that makes it act."""
    curves = TEMPLATES[template].channels
    channels = {}
    for name in CHANNELS:
        curve = getattr(curves, name)
        if curve:
            y = [scale * SCALES[joint][name] * value for value in curve.y]
            channels[name] = {"components": [{"interval": (0.1, 0.9), "x": curve.x, "y": y}]}
    kind = KINDS[joint]
    place = Joint(
        name=joint, type=kind, range=RANGES[joint], unit="rad" if kind == "hinge" else "m"
    )
    return Profile(joint=place, channels=Channels.model_validate(channels))


def inputs(model: mujoco.MjModel, seconds=SECONDS) -> np.ndarray:
    """Forces that push to and fro, and let go at the end."""
    t = np.arange(round(seconds / model.opt.timestep)) * model.opt.timestep
    out = np.zeros((len(t), model.nv))
    swing = np.sin(2 * np.pi * t / 0.9) * (t < 0.8 * seconds)
    out[:, 0], out[:, 1] = 1.8 * swing, 9.0 * swing
    return out


def run_plugin(model, profiles, forces, start=(0.3, 0.5), rows=True):
    """Positions of the two joints, shape (steps, 2), by the plugin; `rows`: of the damping."""
    d = mujoco.MjData(model)
    d.eq_active[:] = rows
    for name, profile in profiles.items():
        set_profile(model, d, name, profile)
    for k, (lo, hi) in enumerate(RANGES.values()):
        d.qpos[k] = lo + start[k] * (hi - lo)
    positions = []
    for force in forces:
        d.qfrc_applied[:] = force
        mujoco.mj_step(model, d)
        positions.append(d.qpos[:2].copy())
    return np.array(positions)


def start_data(model, m, start=(0.3, 0.5)):
    d = mjx.make_data(model)
    places = [lo + p * (hi - lo) for p, (lo, hi) in zip(start, RANGES.values(), strict=True)]
    return d.replace(qpos=d.qpos.at[:2].set(jnp.array(places)))


POSITIONS = partial(joda.mjx.rollout, read=lambda d: d.qpos[:2])
positions_of = jax.jit(POSITIONS, compiler_options=FAST)


def run_mjx(model, profiles, forces, start=(0.3, 0.5), rows=True):
    """The same by MJX."""
    m = mjx.put_model(model)
    fields = joda.mjx.put_fields(model, profiles, components=1, knots=11)
    d = start_data(model, m, start)
    d = d.replace(eq_active=jnp.full_like(d.eq_active, rows))
    return np.asarray(positions_of(m, d, fields, jnp.asarray(forces))[1])


SPANS = np.array([hi - lo for lo, hi in RANGES.values()])


@pytest.mark.sweep(1, "motions in mjx")
@pytest.mark.parametrize(
    ("integrator", "contacts"), [("Euler", True), ("implicitfast", False)], ids="{}".format
)
def test_trajectories_are_the_plugins(integrator, contacts):
    """All templates side by side, from different starts: a batch of environments."""
    model = scene(integrator, contacts)
    profiles = [{name: profile_of(template, name) for name in RANGES} for template in TEMPLATES]
    starts = [(0.3 + 0.02 * k, 0.5 - 0.02 * k) for k in range(len(TEMPLATES))]
    forces = inputs(model)
    expected = [
        run_plugin(model, own, forces, start) for own, start in zip(profiles, starts, strict=True)
    ]
    m, stack = mjx.put_model(model), partial(jax.tree.map, lambda *leaves: jnp.stack(leaves))
    fields = [joda.mjx.put_fields(model, one, components=1, knots=11) for one in profiles]
    data = [start_data(model, m, start) for start in starts]
    batched = jax.jit(jax.vmap(POSITIONS, in_axes=(None, 0, 0, None)))
    actual = np.asarray(batched(m, stack(*data), stack(*fields), jnp.asarray(forces))[1])
    assert np.isfinite(actual).all()
    error = np.abs(actual - np.array(expected)).max(1) / SPANS
    # 1e-6 is what is promised; a friction row ten times too soft would pass that
    assert (error < 2e-8).all(), dict(zip(TEMPLATES, error.tolist(), strict=True))


def test_friction_holds_and_lets_go_where_the_plugin_does():
    """What the matrix compares is not two joints that fly freely."""
    model = scene()
    profiles = {name: profile_of("constant_friction_hinge", name) for name in RANGES}
    positions = run_plugin(model, profiles, inputs(model))
    still = np.abs(np.diff(positions, axis=0)).max(1) < 1e-9
    assert np.ptp(positions, axis=0).min() > 0.1 * SPANS.min() and still[-50:].all()


@pytest.mark.slow
@pytest.mark.parametrize("template", ["constant_damping_hinge", "detent_internal"])
def test_a_damping_row_that_is_switched_off_leaves_the_limited_force(template):
    model = scene()
    profiles = {name: profile_of(template, name) for name in RANGES}
    forces = inputs(model, 2.0)
    with_row = run_mjx(model, profiles, forces)
    expected = run_plugin(model, profiles, forces, rows=False)
    actual = run_mjx(model, profiles, forces, rows=False)
    assert (np.abs(actual - expected).max(0) < 1e-6 * SPANS).all()
    assert np.abs(actual - with_row).max() > 1e-5


# --- many small stiff joints

KNOBS = {"k0": "sum", "k1": "max", "k2": "max", "k3": "sum"}


def knobs() -> mujoco.MjModel:
    """Four knobs of little inertia, one of them on a body with another, with a loop's equality."""
    instances = "".join(
        f'<instance name="{n}"><config key="range" value="0 2"/></instance>' for n in KNOBS
    )
    bodies = "".join(
        f'<body pos="0 {k} 0"><inertial pos="0 0 0" mass="0.02" diaginertia="1e-6 1e-6 1e-6"/>'
        f'<joint name="{n}" axis="0 0 1" range="0 2" frictionloss="1e-12"/>'
        f'<plugin instance="{n}"/></body>'
        for k, n in enumerate(KNOBS)
    )
    rows = "".join(f'<joint name="joda_damping_{n}" joint1="{n}" {INERT}/>' for n in KNOBS)
    return mujoco.MjModel.from_xml_string(f"""
    <mujoco><compiler angle="radian" boundmass="0" boundinertia="0"/>
      <option timestep="0.002" tolerance="1e-14" iterations="50"/>
      <extension><plugin plugin="joda.joint_dynamics">{instances}</plugin></extension>
      <worldbody>
        <body name="other" pos="0 0 1">
          <joint name="free_one" type="slide" frictionloss="0.1" armature="1"/><geom size="0.1"/>
          <body pos="0 0 1"><joint name="free_two"/><geom size="0.1" contype="0"/></body>
        </body>
        {bodies}
      </worldbody>
      <equality>
        <joint name="gear" joint1="free_two" joint2="free_one" polycoef="0 2 0 0 0"/>{rows}
        <connect body1="other" anchor="0 0 0" active="false"/>
      </equality>
    </mujoco>""")


def knob_profile(name: str, rng: np.random.Generator) -> Profile:
    def channel(scale, combine, low):
        parts = []
        for a, b in ((0.0, 0.6), (0.3, 0.8), (0.5, 1.0)):
            y = (scale * np.round(rng.uniform(low, 1, 5), 3)).tolist()
            parts.append({"interval": (a, b), "x": (0, 0.2, 0.5, 0.8, 1), "y": y})
        return {"combine": combine, "components": parts}

    other = {"sum": "max", "max": "sum"}[KNOBS[name]]
    channels = {
        "conservative": channel(0.05, KNOBS[name], -1),
        "friction": channel(0.01, other, 0),
        "damping": channel(2e-3, KNOBS[name], 0),
    }
    joint = Joint(name=name, type="hinge", range=(0, 2), unit="rad")
    return Profile(joint=joint, channels=Channels.model_validate(channels))


@pytest.mark.slow
@pytest.mark.sweep(1, "motions in mjx")
def test_stiff_springs_on_four_knobs_are_the_plugins():
    """Springs far beyond explicit stability, sums and maxima mixed, other rows around them."""
    model = knobs()
    rng = np.random.default_rng(0)
    profiles = {name: knob_profile(name, rng) for name in KNOBS}
    dofs = [model.joint(name).dofadr[0] for name in KNOBS]
    t = np.arange(500) * 0.002
    forces = np.zeros((500, model.nv))
    forces[:, dofs] = 0.08 * np.sin(2 * np.pi * t / 0.5)[:, None]
    forces[:, 0] = 1
    d = mujoco.MjData(model)
    for name, profile in profiles.items():
        set_profile(model, d, name, profile)
    d.qpos[dofs] = 1
    expected = []
    for force in forces:
        d.qfrc_applied[:] = force
        mujoco.mj_step(model, d)
        expected.append(d.qpos.copy())
    expected = np.array(expected)
    m, start = mjx.put_model(model), mjx.make_data(model)
    start = start.replace(qpos=start.qpos.at[np.array(dofs)].set(1.0))
    fields = joda.mjx.put_fields(model, profiles)
    run = jax.jit(partial(joda.mjx.rollout, read=lambda d: d.qpos), compiler_options=FAST)
    actual = np.asarray(run(m, start, fields, jnp.asarray(forces))[1])
    assert np.ptp(expected[:, dofs], axis=0).min() > 0.5
    np.testing.assert_allclose(actual, expected, rtol=0, atol=2e-6)


# --- derivatives

STEPS = 300


def gradient_profile(name: str) -> Profile:
    """Two components per channel; the second ones begin and end at zero, so that nothing jumps."""
    x, scales = (0, 0.23, 0.52, 0.8, 1), SCALES[name]
    ys = {
        "conservative": ((0.3, 0.8, 0.2, -0.6, -0.2), (0.0, 0.4, 0.9, 0.5, 0.0), (0.2, 0.71)),
        "friction": ((0.3, 0.5, 0.2, 0.4, 0.3), (0.0, 0.4, 0.6, 0.3, 0.0), (0.3, 0.9)),
        "damping": ((0.3, 0.5, 0.2, 0.4, 0.3), (0.0, 0.4, 0.6, 0.3, 0.0), (0.15, 0.93)),
    }
    channels = {
        key: {
            "components": [
                {"interval": interval, "x": x, "y": [scales[key] * value for value in y]}
                for interval, y in (((0, 1), first), (inner, second))
            ]
        }
        for key, (first, second, inner) in ys.items()
    }
    unit = "rad" if KINDS[name] == "hinge" else "m"
    place = Joint(name=name, type=KINDS[name], range=RANGES[name], unit=unit)
    return Profile(joint=place, channels=Channels.model_validate(channels))


def gradient_problem():
    """Parameters, and the function from them to the two joints' positions, shape (steps, 2)."""
    model = scene(option='gravity="0 0 -9.81"')
    model.opt.tolerance = 1e-30
    m = mjx.put_model(model)
    d = start_data(model, m, (0.05, 0.05))
    t = np.arange(STEPS) * model.opt.timestep
    forces = np.zeros((STEPS, 2))
    forces[:, 0] = 1.3 * np.sin(2 * np.pi * t / 0.6 + 0.3) + 0.8
    forces[:, 1] = 8 * np.sin(2 * np.pi * t / 0.5 + 0.3) + 4
    forces[250:] = 0
    parameters = {
        "fields": joda.mjx.put_fields(model, {n: gradient_profile(n) for n in RANGES}),
        "gravity": m.opt.gravity[2],
        "limit": m.jnt_solref[:, 1],
        "inertia": m.body_inertia[1, 1],
        "mass": m.body_mass[1:],
    }

    def positions(p):
        option = m.opt.replace(gravity=m.opt.gravity.at[2].set(p["gravity"]))
        moved = m.replace(
            opt=option,
            jnt_solref=m.jnt_solref.at[:, 1].set(p["limit"]),
            body_inertia=m.body_inertia.at[1, 1].set(p["inertia"]),
            body_mass=m.body_mass.at[1:].set(p["mass"]),
        )
        return joda.mjx.rollout(
            moved, d, p["fields"], jnp.asarray(forces), read=lambda d: d.qpos[:2]
        )[1]

    return parameters, positions


@pytest.mark.sweep(1, "derivatives of mjx")
def test_derivatives_are_central_differences():
    """By every number of every channel, the limits' damping ratio, inertia, mass and gravity."""
    parameters, positions = gradient_problem()
    # the first components cover the whole range: moved inwards their ends would open a gap
    place = check_slopes(positions, parameters, skip=(".a[0]", ".b[0]"))
    assert (np.ptp(place, axis=0) > 0.8 * SPANS).all()


@pytest.mark.sweep(1, "derivatives of mjx")
def test_reverse_mode_is_central_differences():
    """Through the solver too, by the bound of the friction and the push that overcomes it."""
    rubbing = joints.component((0, 1), (0, 0.5, 1), (0.3, 0.5, 0.2))
    text = joints.scene(friction=rubbing, damping=joints.flat(0.4), inertia=0.1)
    model = mujoco.MjModel.from_xml_string(text)
    profiles = profiles_of(model)
    m, fields = mjx.put_model(model), joda.mjx.put_fields(model, profiles)
    d = mjx.make_data(model)
    d = d.replace(qpos=d.qpos.at[0].set(0.4))

    def end(y, push):
        changed = {"j": fields["j"].replace(friction=fields["j"].friction.replace(y=y))}
        forces = push * jnp.linspace(0, 1, 30)[:, None]
        return joda.mjx.rollout(m, d, changed, forces)[0].qpos[0]

    run = jax.jit(jax.value_and_grad(end, argnums=(0, 1)), compiler_options=FAST)
    y, push, eps = fields["j"].friction.y, 1.0, 1e-5
    _, (by_y, by_push) = run(y, push)
    for k in range(3):
        there, back = (run(y.at[0, k].add(step), push)[0] for step in (eps, -eps))
        expected = float(there - back) / (2 * eps)
        assert float(by_y[0, k]) == pytest.approx(expected, rel=1e-5, abs=1e-10)
    expected = float(run(y, push + eps)[0] - run(y, push - eps)[0]) / (2 * eps)
    assert float(by_push) == pytest.approx(expected, rel=1e-5) and expected > 1e-4
    assert float(by_y[0, 1]) < -1e-4


# --- mistakes


def test_rk4_is_refused():
    model = scene("RK4")
    profiles = {name: profile_of("detent_internal", name) for name in RANGES}
    with pytest.raises(joda.JodaError, match="Euler and implicitfast, not RK4"):
        joda.mjx.put_fields(model, profiles)
    fields = joda.mjx.put_fields(scene(), profiles)
    with pytest.raises(joda.JodaError, match="Euler and implicitfast, not RK4"):
        joda.mjx.step(mjx.put_model(model), mjx.make_data(model), fields)


def test_friction_without_a_row_is_refused():
    model = scene()
    model.dof_frictionloss[:] = 0
    profile = profile_of("constant_friction_hinge", "arm")
    with pytest.raises(joda.JodaError, match=r"'arm' has friction .* add frictionloss="):
        joda.mjx.put_fields(model, {"arm": profile})


def test_noslip_is_refused():
    model = scene(option='noslip_iterations="3"')
    with pytest.raises(joda.JodaError, match="MJX has no noslip solver"):
        joda.mjx.put_fields(model, {})


def python(code: str, **options) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, **options)


@pytest.mark.slow
@pytest.mark.parametrize("missing", ["jax", "mujoco.mjx"])
def test_without_jax_the_error_says_what_to_install(missing):
    done = python(f"import sys; sys.modules['{missing}'] = None; import joda.mjx")
    assert done.returncode
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("joda.errors.JodaError: joda.mjx needs mujoco-mjx (no module")
    assert last.endswith(f"run: pip install 'mujoco-mjx==3.17.*' 'mujoco=={mujoco.__version__}'.")


@pytest.mark.slow
def test_another_version_of_mjx_is_refused():
    code = (
        "import importlib.metadata as metadata; found = metadata.version\n"
        "metadata.version = lambda n: '3.18.0' if n == 'mujoco-mjx' else found(n)\n"
        "import joda.mjx"
    )
    last = python(code).stderr.strip().splitlines()[-1]
    told = f"joda.mjx does not take mujoco-mjx 3.18.0 beside mujoco {mujoco.__version__}; run: pip"
    assert told in last


# --- docs/mjx.md


@pytest.mark.long
def test_the_example_of_the_docs(tmp_path):
    root = Path(__file__).parents[1]
    (code,) = re.findall(r"```python\n(.*?)```", (root / "docs/mjx.md").read_text(), re.DOTALL)
    code = code.replace("ENVIRONMENTS = 1000", "ENVIRONMENTS = 16")
    code = code.replace('"models/knob.xml"', repr(str(root / "models/knob.xml")))
    code += "assert jnp.isfinite(angle).all() and jnp.unique(angle[:, -1, 0]).size == 16\n"
    flags = {"XLA_FLAGS": "--xla_backend_optimization_level=0"}
    done = python(code, cwd=tmp_path, env=os.environ | flags)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("(16, 200, 1)\n")
