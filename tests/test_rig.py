"""The rig against the scene that it stands for, and hands and releases against closed forms."""

import mujoco
import numpy as np
import pytest
from joints import component, flat, load

from joda import attach, context
from joda.component import Component
from joda.interaction.hand import SET_OUT, pull
from joda.joints.rig import rig
from joda.profile import Channel, Channels, Profile, Resistance
from joda.scenes.model import find_joint, load_model
from joda.scenes.motion import gravity_force, release, settle
from joda.scenes.native import native_attributes, own_friction_row, whole_profile

SEEDS = range(24)


def numbers(values) -> str:
    return " ".join(repr(float(value)) for value in np.atleast_1d(values))


def solids(random: np.random.Generator, count: int) -> str:
    out = ""
    for _ in range(count):
        kind = random.choice(["box", "sphere", "capsule", "cylinder", "ellipsoid"])
        size = random.uniform(0.02, 0.2, 3)
        pos, tilt = random.uniform(-0.5, 0.5, 3), random.uniform(-3, 3, 3)
        out += (
            f'<geom type="{kind}" size="{numbers(size)}" pos="{numbers(pos)}" '
            f'euler="{numbers(tilt)}" mass="{random.uniform(0.1, 3)}"/>'
        )
    return out


def scene(seed: int, *, welded: bool = False) -> str:
    """A joint "j" amid others: offset anchor, tilted axis, armature, bodies on joints below it."""
    random = np.random.default_rng(seed)

    def place() -> str:
        return f'pos="{numbers(random.normal(size=3))}" euler="{numbers(random.normal(size=3))}"'

    def joint(kind: str, name: str = "") -> str:
        low, span = random.uniform(-2, 1), random.uniform(0.1, 3)
        reference = low + span * random.uniform()
        armature = random.choice([0, random.uniform(0, 0.5)])
        text = (
            f'<joint name="{name}" type="{kind}" axis="{numbers(random.normal(size=3))}" '
            f'pos="{numbers(random.normal(size=3))}" range="{low} {low + span}" '
            f'ref="{reference}" armature="{armature}" damping="0.3"/>'
        )
        return "" if welded and name != "j" else text

    kind = "hinge" if seed % 2 else "slide"
    return f"""
    <mujoco><compiler angle="radian"/>
      <option timestep="0.002" integrator="implicitfast" gravity="{numbers(random.normal(size=3) * 6)}"
        tolerance="1e-14"><flag contact="disable"/></option>
      <worldbody><body {place()}>{joint("hinge", "above")}{solids(random, 1)}
        <body {place()}>{joint(kind, "j")}{solids(random, 3)}
          <body {place()}>{joint("slide", "below")}{solids(random, 2)}
            <body {place()}>{joint("hinge", "last")}{solids(random, 1)}</body>
          </body>
        </body></body>
      </worldbody></mujoco>"""  # noqa: E501


def profile(found, size: float) -> Profile:
    """A restoring force with a bump, friction and damping, all of the order of `size`."""

    def curve(*y: float) -> tuple[Component, ...]:
        x = tuple(np.linspace(0, 1, len(y)).tolist())
        return (Component(interval=(0, 1), x=x, y=tuple(size * v for v in y)),)

    return Profile(
        joint=found.joint,
        channels=Channels(
            conservative=Channel(components=curve(3, 1, 2, -4)),
            friction=Resistance(components=curve(0.05, 0.1)),
            damping=Resistance(components=curve(0.1, 0.05)),
        ),
    )


def written(folder, text: str, name: str = "scene.xml"):
    (folder / name).write_text(text)
    return folder / name


@pytest.mark.parametrize("seed", SEEDS)
def test_the_rig_has_the_scenes_inertia_and_gravity_over_the_range(tmp_path, seed):
    path = written(tmp_path, scene(seed))
    found = context(path, "j")
    model, alone = load_model(path), rig(found, profile(found, 1.0))
    data, j = mujoco.MjData(model), find_joint(model, "j")
    here, there = mujoco.MjData(alone), int(model.jnt_dofadr[j])
    mass, joint_model = np.empty((model.nv, model.nv)), np.empty((1, 1))
    assert alone.jnt_range[0] == pytest.approx(model.jnt_range[j], rel=1e-15)
    inertia, gravity = [], []
    positions = np.linspace(*model.jnt_range[j], 17)
    for position in positions:
        data.qpos[model.jnt_qposadr[j]] = here.qpos[0] = position
        mujoco.mj_forward(model, data)
        mujoco.mj_forward(alone, here)
        mujoco.mj_fullM(model, data, mass)
        mujoco.mj_fullM(alone, here, joint_model)
        inertia.append((mass[there, there], joint_model[0, 0]))
        gravity.append((-data.qfrc_bias[there], -here.qfrc_bias[0]))
    expected, got = np.array(inertia).T
    assert got == pytest.approx(expected, rel=1e-9)
    expected, got = np.array(gravity).T
    assert got == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert gravity_force(model, j, positions) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_let_go_on_the_rig_it_moves_as_in_the_scene(tmp_path, seed):
    """With all other joints welded in the scene, to 1e-6 of the range over one second."""
    bare = written(tmp_path, scene(seed, welded=True))
    found = context(bare, "j")
    lo, hi = found.joint.range
    given = profile(found, found.gravity_scale + found.equivalent_inertia * (hi - lo))
    attach(bare, given, tmp_path / "full.xml")
    full, alone = load_model(tmp_path / "full.xml"), rig(found, given)
    alone.opt.tolerance = full.opt.tolerance
    assert alone.opt.integrator == full.opt.integrator
    assert alone.opt.timestep == full.opt.timestep
    moved = 0.0
    for share in (0.1, 0.45, 0.8):
        start = lo + share * (hi - lo)
        one = release(full, find_joint(full, "j"), start, 1.0)
        other = release(alone, 0, start, 1.0)
        assert np.abs(one.position - other.position).max() < 1e-6 * (hi - lo)
        moved = max(moved, np.ptp(one.position) / (hi - lo))
    assert moved > 0.1


def test_the_context_of_a_joint_does_not_depend_on_how_others_are_fixed(tmp_path):
    """Joints at their reference move with the body as if they were welded."""
    for seed in SEEDS:
        free = context(written(tmp_path, scene(seed)), "j")
        fixed = context(written(tmp_path, scene(seed, welded=True)), "j")
        assert free.equivalent_inertia == pytest.approx(fixed.equivalent_inertia, rel=1e-12)
        scale = fixed.gravity_scale
        assert free.gravity_force == pytest.approx(fixed.gravity_force, abs=1e-11 * scale)


def test_gravity_that_is_compensated_does_not_act(tmp_path):
    """A body with gravcomp 0.75 weighs a quarter."""
    text = scene(3, welded=True)
    whole = context(written(tmp_path, text), "j").gravity_force
    light = context(written(tmp_path, text.replace("<body ", '<body gravcomp="0.75" ')), "j")
    assert light.gravity_force == pytest.approx(np.array(whole) / 4, rel=1e-9, abs=1e-12)


# --- a hand that pulls
def inside(motion, low=0.3, high=0.7) -> np.ndarray:
    return (motion.position > low) & (motion.position < high)


@pytest.mark.parametrize("mass", [0.2, 5.0])
def test_a_free_mass_needs_only_what_its_slow_setting_out_takes(mass):
    """m a, of a target whose speed is (span/duration) (1 - exp(-t/SET_OUT))."""
    model, _ = load(inertia=mass)
    motion = pull(model, 0, 0.0, 1.0, strength=60, stiffness=1e6, duration=3.0)
    expected = mass / 3 / SET_OUT * np.exp(-motion.time / SET_OUT)
    there = inside(motion)
    assert np.abs(motion.force[there]).max() < 0.02 * np.abs(motion.force).max()
    assert motion.force[there] == pytest.approx(expected[there], rel=0.1)
    assert motion.velocity[there] == pytest.approx(np.full(there.sum(), 1 / 3), rel=0.02)


@pytest.mark.parametrize(("start", "end"), [(0.0, 1.0), (1.0, 0.0)])
@pytest.mark.parametrize("friction", [0.5, 8.0])
def test_a_constant_friction_needs_its_own_force(start, end, friction):
    model, _ = load(friction=flat(friction), inertia=0.5)
    motion = pull(model, 0, start, end, strength=60, stiffness=1000)
    force = np.sign(end - start) * motion.force[np.abs(motion.position - start) > 0.6]
    assert force == pytest.approx(np.full(len(force), friction), rel=0.02)
    assert len(force) > 100


def test_a_spring_needs_k_x():
    k = 20.0
    model, _ = load(conservative=component((0, 1), (0, 1), (0, -k)))
    motion = pull(model, 0, 0.0, 1.0, strength=60, stiffness=1000)
    there = inside(motion, 0.3, 0.95)
    assert motion.force[there] == pytest.approx(k * motion.position[there], rel=0.02)
    assert motion.position[-1] == pytest.approx(0.995, abs=0.002)


def test_a_hand_gives_up_where_it_is_too_weak():
    """Against a wall of 30 N from the middle on a hand of 20 N stays there, never beyond 20 N."""
    model, _ = load(conservative=component((0.5, 1), (0, 0.2, 1), (0, -30, -30)))
    motion = pull(model, 0, 0.0, 1.0, strength=20, stiffness=1000)
    assert np.abs(motion.force).max() == 20
    assert np.all(motion.force[motion.time > motion.time[-1] - 0.49] == 20)
    assert 0.5 < motion.position[-1] < 0.6
    assert motion.time[-1] < 4
    stronger = pull(model, 0, 0.0, 1.0, strength=40, stiffness=1000)
    assert stronger.position[-1] >= 0.995
    assert stronger.force[inside(stronger, 0.7, 0.9)] == pytest.approx(30, rel=0.02)


# --- let go until it rests
def test_settling_ends_when_the_joint_rests():
    """A spring to the middle with critical damping (m = 1, k = 40): at rest long before 15 s."""
    model, _ = load(
        conservative=component((0, 1), (0, 1), (20, -20)), damping=flat(2 * np.sqrt(40))
    )
    motion = settle(model, 0, 0.1, 15.0)
    t, w = motion.time, np.sqrt(40)
    assert 1.0 < t[-1] < 3.0
    assert motion.position == pytest.approx(0.5 - 0.4 * (1 + w * t) * np.exp(-w * t), abs=0.004)


def test_settling_ends_at_once_where_friction_holds():
    model, _ = load(conservative=flat(-4), friction=flat(5))
    motion = settle(model, 0, 0.6, 15.0)
    assert motion.time[-1] < 0.5
    assert motion.position == pytest.approx(np.full(len(motion.position), 0.6), abs=1e-3)


def test_settling_ends_when_patience_does():
    """An oscillation that nothing damps does not end."""
    model, _ = load(conservative=component((0, 1), (0, 1), (20, -20)), h=0.001)
    motion = settle(model, 0, 0.3, 4.0)
    assert motion.time[-1] == pytest.approx(4.0, abs=0.02)
    assert motion.position == pytest.approx(0.5 - 0.2 * np.cos(np.sqrt(40) * motion.time), abs=0.01)


DRAWER = """<mujoco><compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast" gravity="0 0 0" tolerance="1e-14"/>
  <worldbody><body>
    <joint name="j" type="slide" axis="1 0 0" range="-0.3 0.4" damping="1.5" stiffness="20"
           springref="0.1" frictionloss="0.8" solreffriction="0.03 0.9" solimpfriction="0.8 0.9"/>
    <geom size="0.1" mass="0.7"/>
  </body></worldbody></mujoco>"""


def test_a_joint_with_native_elements_alone_is_the_scenes_own(tmp_path):
    """Friction that yields as MuJoCo's default row does; with the plugin it would not."""
    (tmp_path / "in.xml").write_text(DRAWER)
    scene = load_model(tmp_path / "in.xml")
    found = context(tmp_path / "in.xml", "j")
    profile = whole_profile(scene, 0, Profile(joint=found.joint))
    assert native_attributes(profile) == {
        "stiffness": pytest.approx((20.0,)),
        "springref": pytest.approx((0.1,)),
        "frictionloss": (0.8,),
        "damping": (1.5,),
    }
    row = own_friction_row(scene, 0)
    forces = 3 * np.sin(0.01 * np.arange(2000))
    paths = []
    for model in (scene, rig(found, profile, row), rig(found, profile)):
        data = mujoco.MjData(model)
        data.qpos[0], path = 0.05, []
        model.opt.tolerance = 1e-14
        for force in forces:
            data.qfrc_applied[0] = force
            mujoco.mj_step(model, data)
            path.append(data.qpos[0])
        paths.append(np.array(path))
    np.testing.assert_allclose(paths[1], paths[0], rtol=0, atol=1e-7)
    assert np.abs(paths[2] - paths[0]).max() > 1e-4
    more = profile.with_component(
        "friction", Component(label="pad", interval=(0, 1), x=(0, 1), y=(1, 1))
    )
    assert native_attributes(more) == {}
