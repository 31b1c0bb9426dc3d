"""Effects beyond the three channels in MJX: the plugin's trajectories, batches, derivatives."""

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import ClassVar

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
import test_load as driven
from effect_cases import cases, profile_of, pushes
from mujoco import mjx
from slopes import FAST, check_slopes
from tables import random_memory, random_table

import joda

jax.config.update("jax_enable_x64", True)
import joda.mjx  # noqa: E402
from joda.field.jaxeffects import NAMES  # noqa: E402
from joda.joints.joint_model import joint_model  # noqa: E402
from joda.profile import Channels  # noqa: E402
from joda.scenes.scene import profiles_of  # noqa: E402

H, STEPS = 0.004, 300
JOINTS = {"arm": "hinge", "drawer": "slide"}
SCENE = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{h}" integrator="{integrator}" iterations="50" ls_iterations="50"
          tolerance="1e-14"/>
  <worldbody>
    <body name="arm"><joint name="arm" axis="0 1 0" range="-0.2 1.3"/>
      <geom type="capsule" fromto="0 0 0 0.5 0 0" size="0.03" mass="0.1" contype="0"
            conaffinity="0"/></body>
    <body name="drawer" pos="0 1 -0.3" euler="0 0.1 0">
      <joint name="drawer" type="slide" axis="1 0 0" range="0 0.3"/>
      <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.03" mass="0.5" contype="0"
            conaffinity="0"/></body>
  </worldbody>
</mujoco>"""
FORCES = {"arm": 0.6, "drawer": 3.0}
"""What is strong for the joint, N·m and N."""


CASES = list(cases("hinge", 1, 1, 1))
SPANS = np.array([1.5, 0.3])
LOW = np.array([-0.2, 0.0])


class Scene:
    """The two joints with the effects of a case: the plugin's motion and that of MJX."""

    found: ClassVar = {}

    def __init__(self, folder, case, integrator="Euler"):
        path = folder / "bare.xml"
        path.write_text(SCENE.format(h=H, integrator=integrator))
        self.profiles = {}
        for name, kind in JOINTS.items():
            if name not in self.found:
                self.found[name] = joda.context(path, name)
            found, force = self.found[name], FORCES[name]
            lo, hi = found.joint.range
            own = case.get(name) if isinstance(case, dict) else None
            own = own or cases(kind, force, found.equivalent_inertia, 0.03 * (hi - lo))[case]
            self.profiles[name] = profile_of(found.joint, own, force)
            joda.attach(path, self.profiles[name], folder / f"{name}.xml", force=True)
            path = folder / f"{name}.xml"
        self.model = mujoco.MjModel.from_xml_path(str(path))
        # one program for all cases; MJX runs no plugins
        self.m = mjx.put_model(self.model).replace(npluginstate=0)
        self.fields = joda.mjx.put_fields(self.model, self.profiles, table=(3, 6), effects=NAMES)

    def only(self, **room):
        """Fields that have the joints' effects and no others."""
        return joda.mjx.put_fields(self.model, self.profiles, **room)

    def start(self, part=0.4):
        """Data with both joints at this part of their range."""
        d = mjx.make_data(self.m).replace(qpos=jnp.array(LOW + part * SPANS))
        return joda.mjx.put_state(self.m, d, self.fields)

    def plugin(self, forces):
        """Positions, shape (steps, 2), and states, shape (steps, 2, 4), by the plugin."""
        d, positions, states = mujoco.MjData(self.model), [], []
        d.qpos[:] = LOW + 0.4 * SPANS
        bodies = [self.model.joint(name).bodyid[0] for name in JOINTS]
        instances = self.model.body_plugin[bodies]
        size = 3 if self.has("backlash") else 1
        behind = self.model.plugin_statenum[instances] - 1 - self.has("load_dependent_friction")
        for force in forces:
            d.qfrc_applied[:] = force
            mujoco.mj_step(self.model, d)
            positions.append(d.qpos.copy())
            first = self.model.plugin_stateadr[instances]
            parts = [d.plugin_state[k : k + size] for k in first]
            memories = d.plugin_state[first + behind] * self.remembers()
            states.append(np.c_[np.pad(parts, ((0, 0), (0, 3 - size))), memories])
        return np.array(positions), np.array(states)

    def mjx(self, forces):
        """The same by MJX."""
        return self.told(*roll(self.m, self.start(), self.fields, jnp.array(forces))[1])

    def told(self, q, held, handles):
        """The same of what MJX's data hold; handles without backlash have no state."""
        rows = [field.place.friction_row for field in self.fields.values()]
        loose, memories = handles[:, :4].reshape(-1, 2, 2), handles[:, 4:, None]
        loose = loose * self.has("backlash")
        memories = memories * self.remembers()
        return np.array(q), np.concatenate([held[:, rows, None], loose, memories], axis=2)

    def has(self, name):
        """Whether the joints have the effect."""
        return any(e.effect == name for e in self.profiles["arm"].effects)

    def remembers(self):
        """Whether the joints have a learned force with a memory."""
        return any(getattr(e, "memory", "none") != "none" for e in self.profiles["arm"].effects)


READ = partial(joda.mjx.rollout, read=lambda d: (d.qpos, d._impl.efc_force, d.userdata))
roll = jax.jit(READ, compiler_options=FAST)


def random_forces():
    return np.stack([pushes(f, STEPS * H, H, k) for k, f in enumerate(FORCES.values())], 1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("scenes")


def check_states(actual, expected):
    """Friction as part of a strong force, handles as part of the range and per step."""
    force = np.array(list(FORCES.values()))
    scales = np.stack([1e3 * force, SPANS, SPANS / H, SPANS], axis=1)
    assert np.abs((actual - expected) / scales).max() < 1e-6


# --- trajectories


@pytest.mark.sweep(2, "effects in mjx")
@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_trajectories_are_the_plugins(folder, integrator):
    """All cases side by side, as a batch of environments, each with a model of its own."""
    scenes, forces = {case: Scene(folder, case, integrator) for case in CASES}, random_forces()
    stack = partial(jax.tree.map, lambda *leaves: jnp.stack(leaves))
    each = [(scene.m, scene.start(), scene.fields) for scene in scenes.values()]
    batched = jax.jit(jax.vmap(READ, in_axes=(0, 0, 0, None)), compiler_options=FAST)
    motions = batched(*stack(*each), jnp.array(forces))[1]
    for k, (case, scene) in enumerate(scenes.items()):
        positions, states = scene.plugin(forces)
        found, found_states = scene.told(*(np.array(part[k]) for part in motions))
        assert (np.abs(found - positions).max(0) < 2e-8 * SPANS).all(), case
        check_states(found_states, states)
        assert (np.ptp(positions, axis=0) > 0.4 * SPANS).all(), case
        if integrator == "Euler":
            check_alone(scene, forces, found)


def check_alone(scene, forces, found):
    """The joints by themselves move as they do in the scene."""
    for k, name in enumerate(JOINTS):
        place, profile = scene.fields[name].place, scene.profiles[name]
        bare = scene.found[name]
        own = joint_model(bare, profile, scene.model, place.joint)
        simulator = replace(own, inertia=bare.equivalent_inertia).simulator(profile, H)
        start = np.array([[LOW[k] + 0.4 * SPANS[k], 0.0]])
        path = simulator.replay(forces[:, k], np.zeros(1, int), start, np.array([True]), H)[1]
        assert np.abs(path - found[:, k]).max() < 2e-8 * SPANS[k]


@pytest.mark.slow
@pytest.mark.sweep(2, "effects in mjx")
def test_random_tables_move_as_in_the_plugin(folder):
    """Of fresh seeds, each with another size and memory, side by side as a batch."""
    rng, forces = np.random.default_rng(), random_forces()
    scenes = [
        Scene(
            folder,
            {
                name: (random_table(rng, 0.3 * force, **random_memory(rng, 0.5 * force)),)
                for name, force in FORCES.items()
            },
        )
        for _ in range(6)
    ]
    stack = partial(jax.tree.map, lambda *leaves: jnp.stack(leaves))
    fields = stack(*(scene.only(table=(4, 9)) for scene in scenes))
    d = joda.mjx.put_state(scenes[0].m, mjx.make_data(scenes[0].m), scenes[0].only())
    d = d.replace(qpos=jnp.array(LOW + 0.4 * SPANS))
    m = scenes[0].m
    run = jax.jit(jax.vmap(joda.mjx.rollout, in_axes=(None, None, 0, None)))
    found = np.array(run(m, d, fields, jnp.array(forces))[1][0])
    for path, scene in zip(found, scenes, strict=True):
        positions, _ = scene.plugin(forces)
        assert (np.abs(path - positions).max(0) < 1e-9 * SPANS).all(), scene.profiles
        assert (np.ptp(positions, axis=0) > 0.2 * SPANS).all()


@pytest.mark.long
def test_joints_with_different_effects_stand_side_by_side(folder):
    """Each does what it does beside one with the same effects; only what is there is computed."""
    forces = random_forces()
    both = [Scene(folder, case) for case in ("asymmetric_friction", "presliding_friction")]
    alone = [scene.mjx(forces)[0][:, k] for k, scene in enumerate(both)]
    mixed = {n: scene.profiles[n] for n, scene in zip(JOINTS, both, strict=True)}
    fields = joda.mjx.put_fields(both[0].model, mixed)
    assert fields["arm"].effects.backlash is None
    d = mjx.make_data(both[0].m).replace(qpos=jnp.array(LOW + 0.4 * SPANS))
    found = roll(both[0].m, d, fields, jnp.array(forces))[1][0]
    assert (np.abs(found - np.stack(alone, 1)).max(0) < 1e-9 * SPANS).all()


STOPPED = """
<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.004" gravity="0 0 0" tolerance="1e-14" iterations="50"/>
  <extension><plugin plugin="joda.joint_dynamics">
    <instance name="low">
      <config key="effects" value="end_stop_restitution restitution=0.7 end=low"/></instance>
    <instance name="each"><config key="effects" value="end_stop_restitution restitution=0.2 end=low;
      end_stop_restitution restitution=0.8 end=high"/></instance>
  </plugin></extension>
  <worldbody>
    <body><joint name="first" type="slide" axis="1 0 0" range="0 1"/>{geom}</body>
    <body pos="0 1 0"><joint name="low" type="slide" axis="1 0 0" range="0 1" margin="0.02"/>{geom}
      <plugin instance="low"/></body>
    <body pos="0 2 0"><joint type="ball" range="0 0.3"/>{geom}</body>
    <body pos="0 3 0"><joint name="free" type="slide" axis="1 0 0" frictionloss="0.1"/>{geom}</body>
    <body pos="0 4 0"><joint name="each" axis="1 0 0" range="0 1"/>{geom}
      <plugin instance="each"/></body>
  </worldbody>
  <tendon><fixed frictionloss="0.1" range="-9 9"><joint joint="free" coef="1"/></fixed></tendon>
  <equality><joint joint1="free" joint2="first"/></equality>
</mujoco>""".replace("{geom}", '<geom size="0.1" mass="0.5" contype="0" conaffinity="0"/>')


@pytest.mark.long
def test_end_stops_among_other_rows_are_the_plugins():
    """Of two joints; others have limits and friction before and behind them."""
    model = mujoco.MjModel.from_xml_string(STOPPED)
    dof = np.array([model.joint(name).dofadr[0] for name in ("low", "each")])
    place = np.array([model.joint(name).qposadr[0] for name in ("low", "each")])
    forces = np.zeros((400, model.nv))
    forces[:, 0] = forces[:, dof[0]] = np.repeat([8.0, -8.0, -8.0, 8.0], 100)
    forces[:, dof[1]] = np.repeat([-0.2, 0.2, 0.2, -0.2], 100)
    d = mujoco.MjData(model)
    d.qpos[place] = 0.5
    path = []
    for force in forces:
        d.qfrc_applied[:] = force
        mujoco.mj_step(model, d)
        path.append(d.qpos.copy())
    path = np.array(path)
    assert (path[:, place].min(0) < 0).all() and (path[:, place].max(0) > 1).all()
    m, d = mjx.put_model(model), mjx.make_data(model)
    d = d.replace(qpos=d.qpos.at[place].set(0.5))
    fields = joda.mjx.put_fields(model, profiles_of(model))
    step, found = jax.jit(joda.mjx.step, compiler_options=FAST), []
    for force in forces:
        d = step(m, d.replace(qfrc_applied=jnp.asarray(force)), fields)
        found.append(np.asarray(d.qpos))
    np.testing.assert_allclose(found, path, rtol=0, atol=1e-7)


@pytest.mark.slow
@pytest.mark.sweep(2, "effects in mjx")
@pytest.mark.parametrize("kind", JOINTS.values())
def test_driven_joints_that_touch_others_have_the_load_of_the_plugins(kind):
    """A servo, contacts, a stop, a coupled joint, a tendon, a weight that is partly compensated."""
    options = 'tolerance="1e-14" iterations="100" ls_iterations="50"'
    text = driven.scene(kind, **driven.RICH, body='gravcomp="0.3"', option=options)
    model = mujoco.MjModel.from_xml_string(text)
    model.jnt_range[0] = (-0.2, 0.02)
    d, path, bounds, contacts = mujoco.MjData(model), [], [], []
    m = mjx.put_model(model).replace(npluginstate=0)
    inputs = 0.3 * np.sin(0.05 * np.arange(STEPS))
    push = np.zeros((model.nbody, 6))
    push[model.body("part").id] = 0.0, 1, -1, 0.1, 0.2, 0.3
    d.xfrc_applied[:] = push
    for target in inputs:
        d.ctrl[0] = target
        mujoco.mj_step(model, d)
        path.append(d.qpos.copy())
        bounds.append(driven.bound(model, d))
        contacts.append(d.ncon)
    fields = joda.mjx.put_fields(model, profiles_of(model))
    d = mjx.make_data(m).replace(xfrc_applied=jnp.array(push))
    row, step, found = fields["j"].place.friction_row, jax.jit(joda.mjx.step), []
    for target in inputs:
        d = step(m, d.replace(ctrl=jnp.array([target])), fields)
        found.append([*d.qpos, d._impl.efc_frictionloss[row]])
    found = np.array(found)
    path = np.array(path)
    assert {0, 1} == set(contacts) and path[:, 0].max() > 0.02
    np.testing.assert_allclose(found[:, :-1], path, rtol=0, atol=1e-9)
    np.testing.assert_allclose(found[:, -1], bounds, rtol=0, atol=1e-6)
    assert np.ptp(bounds) > 1


def test_the_example_of_the_docs(folder):
    scene = Scene(folder, "stribeck_friction")
    text = (Path(__file__).parents[1] / "docs/mjx.md").read_text()
    (code,) = re.findall(r"```py\n(.*?)```", text, re.DOTALL)
    names = {"jax": jax, "jnp": jnp, "joda": joda, "mjx": mjx, "model": scene.model}
    names |= {"m": scene.m, "fields": {"knob": scene.fields["arm"]}, "torque": None}
    names["rollout"] = lambda m, d, fields, torque: (d, (fields, m))
    exec(code, names)
    assert names["d"].userdata.shape == (3,)
    velocity = names["angle"]["knob"].effects.stribeck_friction.velocity
    np.testing.assert_array_equal(velocity, [0.05, 0.1, 0.2])


# --- derivatives


STOPS = ("end_stop_restitution.low[]", "end_stop_restitution.high[]")
"""Numbers of joints that do not come to their ends."""
HANDLE, LOAD = ("backlash.handle[]",), ("backlash.load[]", "backlash.share[]")
"""Numbers of a handle and of a load behind a play, which do not go together."""
FIXED = (
    *("learned_force.follows[]", "table.interval[0]", "table.interval[1]"),
    "table.velocities[2]",
)
"""The kind of memory, an interval that is the range, and the velocity that must be 0."""
T = H * np.arange(250)
SWING = np.stack([3.6 * np.sin(2 * np.pi * T) + 0.18, 4.5 * np.sin(2 * np.pi * T / 0.6)], 1)
PUSH = np.repeat(np.array([-4.0, 4.0, 4.0, -4.0]), 60)[:, None] * list(FORCES.values())
STEADY = np.full((60, 2), 0.6) * list(FORCES.values())


@pytest.mark.long
@pytest.mark.sweep(1, "derivatives of mjx")
@pytest.mark.parametrize(
    ("case", "number", "forces", "place", "skip"),
    [
        ("all", 0, SWING, 0.02, (*STOPS, *LOAD, *FIXED)),
        ("backlash behind", 1, STEADY, 0.1, (*HANDLE, "backlash.play[]")),
        ("end_stop_restitution each", 0, PUSH, 0.3, ()),
        ("end_stop_restitution each", 1, PUSH, 0.3, ()),
    ],
)
def test_derivatives_by_all_numbers_are_those_of_central_differences(
    folder, case, number, forces, place, skip
):
    scene, name = Scene(folder, case), list(JOINTS)[number]
    scene.model.opt.tolerance = 1e-30
    m, fields = mjx.put_model(scene.model), scene.only()
    d = joda.mjx.put_state(scene.m, scene.start(place), fields)

    def positions(effects):
        own = fields | {name: fields[name].replace(effects=effects)}
        return joda.mjx.rollout(m, d, own, jnp.array(forces), read=lambda d: d.qpos[number])[1]

    path = check_slopes(positions, fields[name].effects, skip=skip)
    path = (path - LOW[number]) / SPANS[number]
    if case == "all":
        assert path.min() > 0 and path.max() < 1
    if case != "backlash behind":
        assert np.ptp(path) > 0.8


# --- state


def test_backlash_without_state_is_refused(folder):
    scene = Scene(folder, "backlash")
    d = mjx.make_data(scene.m)
    with pytest.raises(joda.JodaError, match=r"no state for it; call d = joda.mjx.put_state\(m"):
        joda.mjx.step(scene.m, d, scene.fields)


def test_the_state_is_behind_the_users_own_data(folder):
    scene = Scene(folder, "backlash")
    m = scene.m.replace(nuserdata=3)
    d = mjx.make_data(scene.m).replace(userdata=jnp.arange(3.0))
    d = joda.mjx.put_state(m, d, scene.fields)
    np.testing.assert_array_equal(d.userdata, [0, 1, 2, *[0] * 6])
    none = joda.mjx.put_fields(scene.model, {})
    assert joda.mjx.put_state(m, d, none).userdata.shape == (3,)


def test_an_effect_on_friction_needs_the_row(folder):
    scene = Scene(folder, "all")
    scene.model.dof_frictionloss[:] = 0
    profile = scene.profiles["arm"].model_copy(update={"channels": Channels()})
    with pytest.raises(joda.JodaError, match=r"'arm' has friction .* add frictionloss="):
        joda.mjx.put_fields(scene.model, {"arm": profile})
