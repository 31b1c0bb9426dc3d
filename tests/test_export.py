"""joda export: what is written is the scene, and the errors that are told are those it makes."""

import json
import subprocess
import sys
from math import degrees
from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import joda
from joda import export
from joda.component import Component
from joda.effects import (
    AddedInertia,
    AsymmetricFriction,
    Backlash,
    GravityOffset,
    QuadraticDamping,
    StribeckFriction,
)
from joda.profile import Channel, Channels, Joint, Profile, Resistance

SCENE = """
<mujoco>
  <compiler angle="radian"/>
  <asset><mesh name="wedge" vertex="0 0 0  .2 0 0  0 .3 0  0 0 .1"/>
    <material name="red" rgba="1 0 0 1"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <body name="case" pos=".1 .2 .3" euler=".3 .2 .1">
      <geom type="box" size=".1 .2 .3" pos="0 .1 0" material="red"/>
      <body name="lid" pos=".1 0 .2" quat=".8 .6 0 0">
        <joint name="lid" axis="0 .6 .8" pos=".05 -.1 .2" range="-.4 1.4" ref=".3" damping=".1"/>
        <geom type="capsule" size=".03 .2" pos=".1 0 0" euler="0 1 0"/>
        <geom type="mesh" mesh="wedge" pos="0 .1 0" euler="0 0 .4"/>
        <body name="slider" pos="0 0 .3" euler="0 .5 0">
          <joint name="slider" type="slide" axis=".6 0 .8" range="0 .3" ref=".1"/>
          <geom type="cylinder" size=".05 .1"/>
          <body name="tip" pos="0 0 .1"><geom type="sphere" size=".04" group="4"/></body>
        </body>
      </body>
    </body>
    <body name="ball" pos="1 0 1"><freejoint/><geom type="ellipsoid" size=".1 .12 .15"/></body>
  </worldbody>
</mujoco>"""


def part(a, b, *y):
    x = tuple(float(u) for u in np.linspace(0, 1, len(y)))
    return Component(interval=(a, b), x=x, y=y)


LID = Profile(
    joint=Joint(name="lid", type="hinge", range=(-0.4, 1.4), unit="rad"),
    channels=Channels(
        conservative=Channel(components=(part(0, 1, 2.0, -1.0), part(0, 0.3, 0, -1.5, 0))),
        friction=Resistance(components=(part(0, 1, 0.4, 0.2),)),
        damping=Resistance(components=(part(0, 1, 0.5, 0.5), part(0.8, 1, 0, 2.0))),
    ),
    effects=(
        QuadraticDamping(y=(0.2, 0.2)),
        AsymmetricFriction(direction="negative", y=(0.1, 0.1)),
        StribeckFriction(velocity=0.1, y=(0.3, 0.3)),
        GravityOffset(sin=0.2),
        AddedInertia(inertia=0.01),
        Backlash(play=0.01, inertia=0.001),
    ),
)
SLIDER = Profile(
    joint=Joint(name="slider", type="slide", range=(0, 0.3), unit="m"),
    channels=Channels(
        conservative=Channel(components=(part(0, 1, 6.0, -3.0),)),
        friction=Resistance(components=(part(0, 1, 2.0, 2.0),)),
        damping=Resistance(components=(part(0, 1, 4.0, 4.0),)),
    ),
)


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("export")
    (folder / "plain.xml").write_text(SCENE)
    joda.attach(folder / "plain.xml", [LID, SLIDER], folder / "scene.xml")
    return folder / "scene.xml"


@pytest.fixture(scope="module")
def model(scene) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(scene))


def poses(model, names, q):
    """Where in the moved bodies the joints are, and their axes, with the joints at q."""
    data = mujoco.MjData(model)
    for name in names:
        data.qpos[model.joint(name).qposadr] = q[name]
    mujoco.mj_kinematics(model, data)
    ids = [model.joint(name).id for name in names]
    bodies = model.jnt_bodyid[ids]
    turned = np.einsum("nij,nj->ni", data.xmat[bodies].reshape(-1, 3, 3), model.jnt_pos[ids])
    return data.xpos[bodies] + turned, data.xaxis[ids]


JOINTS = ("lid", "slider")


@pytest.mark.parametrize("q", [{"lid": 0.0, "slider": 0.0}, {"lid": 1.1, "slider": 0.25}])
def test_the_urdf_moves_and_weighs_as_the_scene(scene, model, tmp_path, q):
    """As MuJoCo itself reads URDF: where joints are, mass matrix, limits, geoms."""
    written = export(scene, "urdf", tmp_path / "o.urdf")
    other = mujoco.MjModel.from_xml_path(str(tmp_path / "o.urdf"))
    for ours, theirs in zip(poses(model, JOINTS, q), poses(other, JOINTS, q), strict=True):
        assert np.allclose(ours, theirs, atol=1e-6)
    assert other.body_mass.sum() == pytest.approx(model.body_mass[2:].sum(), rel=1e-6)  # fused
    assert np.allclose(mass_matrix(other, q), mass_matrix(model, q, less=0.01), rtol=1e-5)
    assert np.allclose(other.jnt_range[other.joint("lid").id], (-0.4, 1.4))
    (told,) = [one for one in written.joints if one.joint == "lid"]
    dof = other.joint("lid").dofadr[0]
    assert other.dof_damping[dof] == pytest.approx(told.damping[0], rel=1e-6)
    assert other.dof_frictionloss[dof] == pytest.approx(told.friction, rel=1e-6)
    assert (other.geom_type == mujoco.mjtGeom.mjGEOM_MESH).any()
    assert any("no plane" in note for note in written.notes)
    assert sum("lid: not in it is" in note for note in written.notes) == 4


def mass_matrix(model, q, less=0.0):
    data = mujoco.MjData(model)
    for name in JOINTS:
        data.qpos[model.joint(name).qposadr] = q[name]
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    dofs = [model.joint(name).dofadr[0] for name in JOINTS]
    out = full[np.ix_(dofs, dofs)]
    out[0, 0] -= less  # the added inertia, which URDF has no word for
    return out


def test_native_makes_the_error_that_it_tells(scene, model, tmp_path):
    """Force by force against the plugin, over the range; it needs no plugin."""
    told = {one.joint: one for one in export(scene, "native", tmp_path / "n.xml").joints}
    assert "extension" not in (text := (tmp_path / "n.xml").read_text()) and "joda" not in text
    other = mujoco.MjModel.from_xml_path(str(tmp_path / "n.xml"))
    assert (other.nplugin, other.neq, other.njnt) == (0, 0, model.njnt)
    assert other.dof_armature[0] == pytest.approx(0.01)
    for name in JOINTS:
        found = {error.what: error for error in told[name].errors}
        # the plugin writes friction of two bounds as a symmetric one about half their difference
        force = differences(model, other, name) - (0.05 if name == "lid" else 0)
        assert np.sqrt(np.square(force).mean()) == pytest.approx(
            found["conservative force"].rms, rel=1e-3, abs=1e-6
        )
        assert np.abs(force).max() == pytest.approx(
            found["conservative force"].largest, rel=1e-3, abs=1e-6
        )
        assert found["conservative force"].rms == pytest.approx(best(name), rel=1e-6, abs=1e-9)
    assert told["lid"].damping[1] == pytest.approx(0.2, abs=1e-6)
    assert told["slider"].stiffness[0] == pytest.approx(30)
    dof = other.joint("lid").dofadr[0]
    assert other.dof_frictionloss[dof] == pytest.approx(0.35, rel=1e-4)  # 0.3, and half of 0.1


def best(name):
    """What the best of all cubics leaves of the force."""
    profile = {"lid": LID, "slider": SLIDER}[name]
    s = np.linspace(0, 1, 501)
    lo, hi = profile.joint.range
    force = joda.field.evaluate(profile.channels.conservative, s)[0]
    if name == "lid":
        force = force + 0.2 * np.sin(lo + s * (hi - lo))
    return np.sqrt(np.square(force - np.polyval(np.polyfit(s, force, 3), s)).mean())


def differences(model, other, name):
    """Conservative forces of the plugin minus those of the other model, at rest."""
    out = []
    for s in np.linspace(0, 1, 501):
        forces = []
        for one in (model, other):
            data = mujoco.MjData(one)
            lo, hi = one.joint(name).range
            data.qpos[one.joint(name).qposadr] = lo + s * (hi - lo)
            mujoco.mj_forward(one, data)
            forces.append(data.qfrc_passive[one.joint(name).dofadr[0]])
        out.append(forces[0] - forces[1])
    return np.array(out)


def test_the_nearest_line_is_that_of_least_squares(scene, tmp_path):
    """Checked by trying the neighbours; URDF's error of the force is the whole force."""
    told = {one.joint: one for one in export(scene, "sdf", tmp_path / "o.sdf").joints}["lid"]
    force = next(error for error in told.errors if error.what == "conservative force")
    q = np.linspace(-0.4, 1.4, 501)
    s = (q + 0.4) / 1.8
    true = joda.field.evaluate(LID.channels.conservative, s)[0] + 0.2 * np.sin(q)

    def rms(k, zero):
        return np.sqrt(np.square(true + k * (q - zero)).mean())

    k, zero = told.stiffness[0], told.reference
    assert rms(k, zero) == pytest.approx(force.rms)
    for dk, dz in ((0.02, 0), (-0.02, 0), (0, 0.02), (0, -0.02)):
        assert rms(k + dk, zero + dz) > force.rms
    urdf = export(scene, "urdf", tmp_path / "u.urdf").joints[0]
    assert urdf.errors[0].rms == pytest.approx(np.sqrt(np.square(true).mean()))


def test_a_force_that_pushes_away_becomes_a_constant_one(tmp_path):
    """No format but MJCF takes a spring of negative stiffness without blowing up."""
    (tmp_path / "plain.xml").write_text(SCENE)
    away = Channels(conservative=Channel(components=(part(0, 1, 1.0, 3.0),)))
    profile = LID.model_copy(update={"channels": away, "effects": ()})
    joda.attach(tmp_path / "plain.xml", profile, tmp_path / "scene.xml")
    (told,) = export(tmp_path / "scene.xml", "sdf", tmp_path / "o.sdf").joints
    assert told.stiffness[0] > 0
    for q in (-0.4, 0.5, 1.4):
        assert -told.stiffness[0] * (q - told.reference) == pytest.approx(2, rel=0.011)
    assert told.errors[0].rms == pytest.approx(2 / np.sqrt(12), rel=0.03)
    (told,) = export(tmp_path / "scene.xml", "usd", tmp_path / "o.usda").joints
    assert told.reference == pytest.approx(2 * np.pi)  # PhysX takes no angle beyond
    assert -told.stiffness[0] * (0.5 - told.reference) == pytest.approx(2, rel=1e-6)


def test_the_sdf_is_the_scene(scene, model, tmp_path):
    """Frames of the links, joint by joint from the world, with the joints at 0; the numbers."""
    told = {one.joint: one for one in export(scene, "sdf", tmp_path / "o.sdf").joints}
    root = ET.parse(tmp_path / "o.sdf").getroot().find("model")
    anchors, axes = poses(model, JOINTS, dict.fromkeys(JOINTS, 0.0))
    for name, anchor, axis in zip(JOINTS, anchors, axes, strict=True):
        position, turn = sdf_frame(root, f"{name}_link")  # a joint has the body's name
        assert np.allclose(position, anchor, atol=1e-7)
        element = root.find(f"joint[@name='{name}']/axis")
        written = np.array(element.findtext("xyz").split(), float)
        assert np.allclose(turn @ written, axis, atol=1e-7)
        dynamics = element.find("dynamics")
        for tag, value in (
            ("damping", told[name].damping[0]),
            ("friction", told[name].friction),
            ("spring_reference", told[name].reference),
            ("spring_stiffness", told[name].stiffness[0]),
        ):
            assert float(dynamics.findtext(tag)) == pytest.approx(value, rel=1e-8)
    assert root.find("joint[@name='lid']/parent").text == "case"
    assert root.find("joint[@name='ball_joint']") is None  # it is free
    assert root.find("link[@name='ball']") is not None
    uri = root.findtext(".//mesh/uri")
    lines = [line.split() for line in (tmp_path / uri).read_text().splitlines()]
    corners = np.array([line[1:] for line in lines if line[0] == "v"], float)
    faces = np.array([line[1:] for line in lines if line[0] == "f"], int) - 1
    assert len(corners) == len(faces) == 4 and len(lines) == 8
    assert np.linalg.norm(np.cross(*np.diff(corners[faces], axis=1).swapaxes(0, 1)), axis=1).all()
    volume = np.linalg.det(corners[faces]).sum() / 6
    assert volume == pytest.approx(0.2 * 0.3 * 0.1 / 6)


BESIDE = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <body name="ground">
      <geom size=".1"/>
      <body name="lid"><joint name="lid" range="0 90" limited="true"/><geom size=".1" pos=".2 0 0"/>
        <body name="sensor" pos=".1 0 0"/>
        <body name="lid_link" pos="0 .2 0">
          <joint name="hatch" axis="0 1 0" damping="10" frictionloss=".5" armature=".1"
            stiffness="3" springref="30"/>
          <geom size=".05"/>
          <body name="sensor_joint"><joint name="bare" axis="1 0 0"/><geom size=".05"/></body>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""
"""One joint has a profile, one native elements, one nothing; and names that may collide."""
ONLY_LID = Profile(
    joint=Joint(name="lid", type="hinge", range=(0, np.pi / 2), unit="rad"),
    channels=Channels(friction=Resistance(components=(part(0, 1, 0.4, 0.2),))),
)


@pytest.fixture(scope="module")
def beside(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("beside")
    (folder / "plain.xml").write_text(BESIDE)
    joda.attach(folder / "plain.xml", ONLY_LID, folder / "scene.xml")
    return folder / "scene.xml"


def test_in_sdf_all_of_a_model_have_names_of_their_own(beside, tmp_path):
    export(beside, "sdf", tmp_path / "o.sdf")
    root = ET.parse(tmp_path / "o.sdf").getroot().find("model")
    names = [one.get("name") for one in root if one.tag in ("link", "joint")]
    assert len(set(names)) == len(names) == 6 + 6 and "world" not in names
    links = {one.get("name") for one in root.findall("link")}
    for joint in root.findall("joint"):
        assert joint.findtext("child") in links
        assert joint.findtext("parent") in links | {"world"}
    assert {"lid", "hatch", "bare"} <= {one.get("name") for one in root.findall("joint")}


def test_what_has_no_mass_weighs_next_to_nothing(beside, tmp_path):
    """An SDF link without a mass weighs 1 kg, one of USD what its shapes make of it."""
    export(beside, "sdf", tmp_path / "o.sdf")
    root = ET.parse(tmp_path / "o.sdf").getroot().find("model")
    masses = [float(one.findtext("inertial/mass")) for one in root.findall("link")]
    whole = mujoco.MjModel.from_xml_path(str(beside)).body_mass.sum()
    assert sum(masses) == pytest.approx(whole, rel=1e-8) and all(mass > 0 for mass in masses)
    assert all(float(one.text) > 0 for one in root.iterfind("link/inertial/inertia/*"))

    from pxr import Usd, UsdPhysics

    export(beside, "usd", tmp_path / "o.usda")
    stage = Usd.Stage.Open(str(tmp_path / "o.usda"))
    bodies = [one for one in stage.Traverse() if one.HasAPI(UsdPhysics.RigidBodyAPI)]
    masses = [UsdPhysics.MassAPI(one).GetMassAttr().Get() for one in bodies]
    assert len(masses) == 5 and sum(masses) == pytest.approx(whole) and all(m > 0 for m in masses)


def test_in_urdf_a_pad_without_mass_makes_nothing_heavier(tmp_path):
    """A link that collides and has no <inertial> weighs what its shapes make of it."""
    pad = '<body pos=".1 0 0"><geom type="box" size=".05 .01 .02" mass="0"/></body>'
    (tmp_path / "plain.xml").write_text(
        '<mujoco><compiler angle="radian"/><worldbody><body><joint name="lid" range="-.4 1.4"/>'
        f'<inertial pos="0 0 0" mass=".02" diaginertia="1e-5 1e-5 1e-5"/>{pad}</body>'
        "</worldbody></mujoco>"
    )
    joda.attach(
        tmp_path / "plain.xml", LID.model_copy(update={"effects": ()}), tmp_path / "scene.xml"
    )
    export(tmp_path / "scene.xml", "urdf", tmp_path / "o.urdf")
    other = mujoco.MjModel.from_xml_path(str(tmp_path / "o.urdf"))
    assert other.body_mass.sum() == pytest.approx(0.02, rel=1e-6)


def test_a_joint_without_a_profile_keeps_what_the_scene_gives_it(beside, tmp_path):
    told = export(beside, "urdf", tmp_path / "o.urdf")
    assert [one.joint for one in told.joints] == ["lid"]  # errors are those of profiles
    assert set(told.notes) == {
        "1 joint armature is left out",
        "1 native spring is left out",
        "URDF has no plane: 1 plane is left out",
    }
    urdf = mujoco.MjModel.from_xml_path(str(tmp_path / "o.urdf"))
    assert [float(urdf.joint("hatch").damping[0]), *urdf.joint("hatch").frictionloss] == [10, 0.5]
    assert [float(urdf.joint("bare").damping[0]), *urdf.joint("bare").frictionloss] == [0, 0]

    told = export(beside, "sdf", tmp_path / "o.sdf")
    assert told.notes == ("1 joint armature is left out",)
    root = ET.parse(tmp_path / "o.sdf").getroot().find("model")
    dynamics = root.find("joint[@name='hatch']/axis/dynamics")
    written = [(one.tag, pytest.approx(float(one.text), rel=1e-8)) for one in dynamics]
    springref = np.radians(30)
    assert written == [
        ("damping", 10),
        ("friction", 0.5),
        ("spring_reference", springref),
        ("spring_stiffness", 3),
    ]

    from pxr import Usd, UsdPhysics

    assert export(beside, "usd", tmp_path / "o.usda").notes == ()
    stage = Usd.Stage.Open(str(tmp_path / "o.usda"))
    joint = stage.GetPrimAtPath("/o/joint_hatch")
    drive = UsdPhysics.DriveAPI.Get(joint, "angular")
    assert np.degrees(drive.GetDampingAttr().Get()) == pytest.approx(10)
    assert drive.GetTargetPositionAttr().Get() == pytest.approx(30)
    assert joint.GetAttribute("mjc:frictionloss").Get() == 0.5
    assert joint.GetAttribute("mjc:armature").Get() == 0.1


def test_powers_that_no_other_format_has_are_told(tmp_path):
    (tmp_path / "plain.xml").write_text(BESIDE.replace('damping="10"', 'damping="10 2"'))
    joda.attach(tmp_path / "plain.xml", ONLY_LID, tmp_path / "scene.xml")
    notes = export(tmp_path / "scene.xml", "sdf", tmp_path / "o.sdf").notes
    assert "1 damping polynomial is left out" in notes


def sdf_frame(root, name):
    """Position and rotation of a link in the world."""
    pose = root.find(f"link[@name='{name}']/pose")
    values = np.array(pose.text.split(), float)
    turn, position = Rotation.from_euler("xyz", values[3:]).as_matrix(), values[:3]
    above = pose.get("relative_to")
    if above is None:
        return position, turn
    there, turned = sdf_frame(root, above)
    return there + turned @ position, turned @ turn


def test_the_usd_is_the_scene(scene, model, tmp_path):
    """As usd-core reads it: frames at both sides of each joint, units per degree, friction."""
    Usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdGeom, UsdPhysics

    told = {one.joint: one for one in export(scene, "usd", tmp_path / "o.usda").joints}
    stage = Usd.Stage.Open(str(tmp_path / "o.usda"))
    cache = UsdGeom.XformCache()
    anchors, axes = poses(model, JOINTS, dict.fromkeys(JOINTS, 0.0))
    for name, anchor, axis in zip(JOINTS, anchors, axes, strict=True):
        prim = stage.GetPrimAtPath(f"/o/joint_{name}")
        joint = UsdPhysics.Joint(prim)
        sides = []
        for side in (0, 1):
            body = getattr(joint, f"GetBody{side}Rel")().GetTargets()[0]
            frame = cache.GetLocalToWorldTransform(stage.GetPrimAtPath(body))
            at = frame.Transform(getattr(joint, f"GetLocalPos{side}Attr")().Get())
            turn = getattr(joint, f"GetLocalRot{side}Attr")().Get()
            along = frame.TransformDir(turn.Transform((0, 0, 1)))
            across = frame.TransformDir(turn.Transform((1, 0, 0)))
            sides.append((at, along, across))
        assert np.allclose(sides[0], sides[1], atol=1e-6)
        assert np.allclose(sides[1][0], anchor, atol=1e-6)
        assert np.allclose(sides[1][1], axis, atol=1e-6)
        way, per = ("angular", degrees(1)) if name == "lid" else ("linear", 1.0)
        drive = UsdPhysics.DriveAPI.Get(prim, way)
        own = told[name]
        for value, expected in (
            (drive.GetStiffnessAttr().Get() * per, own.stiffness[0]),
            (drive.GetDampingAttr().Get() * per, own.damping[0]),
            (drive.GetTargetPositionAttr().Get() / per, own.reference),
            (prim.GetAttribute("mjc:frictionloss").Get(), own.friction),
            (
                prim.GetAttribute(f"physxJointAxis:{way}:staticFrictionEffort").Get(),
                own.static_friction,
            ),
        ):
            assert value == pytest.approx(expected, rel=1e-6)
    assert told["lid"].static_friction == pytest.approx(told["lid"].friction + 0.3)
    mass = UsdPhysics.MassAPI(stage.GetPrimAtPath("/o/lid"))
    assert mass.GetMassAttr().Get() == pytest.approx(model.body("lid").mass[0])
    assert not stage.GetPrimAtPath("/o/world").HasAPI(UsdPhysics.RigidBodyAPI)


BALL = """<mujoco><compiler angle="radian"/><worldbody>
  <body name="one"><joint name="lid" range="-.4 1.4" limited="true"/><geom size=".1"/></body>
  <body><joint name="c" type="ball"/><geom size=".1"/></body></worldbody></mujoco>"""


def test_what_no_other_format_can_say_is_refused(tmp_path):
    (tmp_path / "plain.xml").write_text(BALL)
    profile = LID.model_copy(update={"effects": ()})
    joda.attach(tmp_path / "plain.xml", profile, tmp_path / "scene.xml")
    with pytest.raises(joda.JodaError, match="joint 'c' is a ball joint; only hinges"):
        export(tmp_path / "scene.xml", "urdf", tmp_path / "o.urdf")
    assert not (tmp_path / "o.urdf").exists()
    export(tmp_path / "scene.xml", "native", tmp_path / "n.xml")


SEVERAL = """<mujoco><compiler angle="radian"/><worldbody>
  <body name="base" pos=".1 0 .2" euler=".3 0 .2"><geom size=".1" pos="0 0 -.1"/>
    <joint name="root" axis="0 0 1" pos=".05 0 0"/>
    <body name="two" pos="0 .3 0" euler="0 .4 0">
      <joint name="out" type="slide" axis="1 .5 0" ref=".07" pos=".3 .1 0" armature=".01"/>
      <joint name="lid" axis="0 1 1" range="-.4 1.4" limited="true" pos=".1 .2 .05" ref=".2"/>
      <joint axis="1 0 0" pos="-.1 0 .1" damping=".4"/>
      <geom type="box" size=".1 .05 .02" pos=".1 0 0"/>
      <body name="tip" pos="0 0 .2"><joint name="last" axis="0 1 0" pos="0 0 -.02"/>
        <geom size=".03"/></body>
    </body>
  </body></worldbody></mujoco>"""
"""A body with three joints, which act about different points and have references."""


@pytest.fixture(scope="module")
def several(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("several")
    (folder / "plain.xml").write_text(SEVERAL)
    profile = LID.model_copy(update={"effects": ()})
    joda.attach(folder / "plain.xml", profile, folder / "scene.xml")
    return folder / "scene.xml"


def test_a_body_with_several_joints_is_a_chain(several, tmp_path):
    """As MuJoCo itself reads URDF: centres of mass in the world, the mass matrix, the numbers."""
    written = export(several, "urdf", tmp_path / "o.urdf")
    model = mujoco.MjModel.from_xml_path(str(several))
    other = mujoco.MjModel.from_xml_path(str(tmp_path / "o.urdf"))
    assert any("two has 3 joints" in note for note in written.notes)
    q = np.array([0.4, 0.15, 0.9, -0.6, 0.3])  # root, out, lid, without a name, last
    assert other.nq == model.nq == len(q)
    full = []
    for one in (model, other):
        data = mujoco.MjData(one)
        data.qpos[:] = q
        mujoco.mj_forward(one, data)
        mass = np.zeros((one.nv, one.nv))
        mujoco.mj_fullM(one, data, mass)
        full.append((data.body("tip").xipos, data.body("two").xipos, mass))
    full[0][2][1, 1] -= 0.01  # armature, which URDF has no word for
    for ours, theirs in zip(*full, strict=True):
        assert np.allclose(ours, theirs, atol=1e-6)
    told = {one.joint: one for one in written.joints}["lid"]
    assert other.dof_frictionloss[2] == pytest.approx(told.friction, rel=1e-6)
    assert other.dof_damping[3] == pytest.approx(0.4)
    assert np.allclose(other.jnt_range[2], (-0.4, 1.4))


@pytest.mark.parametrize("to", ["sdf", "usd"])
def test_a_chain_stands_where_the_body_is(several, tmp_path, to):
    """Where the joints of the body are, and their axes, with all joints at 0."""
    model = mujoco.MjModel.from_xml_path(str(several))
    written = tmp_path / f"o.{to}"
    export(several, to, written)
    names = ("root", "out", "lid", "last")
    data = mujoco.MjData(model)
    data.qpos[:] = 0
    mujoco.mj_kinematics(model, data)
    for name in names:
        anchor, axis = data.joint(name).xanchor, data.joint(name).xaxis
        place, along = joint_frame(written, to, name)
        if name != "out":  # a slide is the same anywhere on its line
            assert np.allclose(place, anchor, atol=1e-6)
        assert np.allclose(along, axis, atol=1e-6)


def joint_frame(path: Path, to: str, name: str):
    """Where the moved side of a joint is in the world, and its axis there."""
    if to == "sdf":
        root = ET.parse(path).getroot().find("model")
        element = root.find(f"joint[@name='{name}']")
        position, turn = sdf_frame(root, element.findtext("child"))
        return position, turn @ np.array(element.findtext("axis/xyz").split(), float)
    Usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdGeom, UsdPhysics

    stage = Usd.Stage.Open(str(path))
    joint = UsdPhysics.Joint(stage.GetPrimAtPath(f"/o/joint_{name}"))
    body = joint.GetBody1Rel().GetTargets()[0]
    frame = UsdGeom.XformCache().GetLocalToWorldTransform(stage.GetPrimAtPath(body))
    turn = joint.GetLocalRot1Attr().Get()
    along = frame.TransformDir(turn.Transform((0, 0, 1)))
    return frame.Transform(joint.GetLocalPos1Attr().Get()), along


CHILD = """<mujoco model="child">{unit}<worldbody><body name="door">
  <joint name="lid" axis="0 0 1" range="{range}"/>
  <geom type="box" size=".2 .01 .3" pos=".2 0 0" mass="4"/></body></worldbody></mujoco>"""
PARENT = """<mujoco model="parent"><compiler angle="{unit}"/>
  <asset><model name="c" file="child_p.xml"/></asset>
  <worldbody><attach model="c" body="door" prefix="L_"/></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("child", "limits", "parent"),
    [("", "-20 80", "radian"), ('<compiler angle="radian"/>', "-.35 1.4", "degree")],
    ids=["degrees in radians", "radians in degrees"],
)
def test_native_keeps_the_unit_of_a_file_that_is_attached(child, limits, parent, tmp_path):
    """A line of force is exact in both, wherever the angle's unit is set."""
    (tmp_path / "child.xml").write_text(CHILD.format(unit=child, range=limits))
    line = Channel(components=(Component(interval=(0, 1), x=(0, 1), y=(2.0, -1.0)),))
    profile = LID.model_copy(update={"channels": Channels(conservative=line), "effects": ()})
    joda.attach(tmp_path / "child.xml", profile, tmp_path / "child_p.xml")
    (tmp_path / "parent.xml").write_text(PARENT.format(unit=parent))
    export(tmp_path / "parent.xml", "native", tmp_path / "n.xml")
    forces = []
    for name in ("parent", "n"):
        one = mujoco.MjModel.from_xml_path(str(tmp_path / f"{name}.xml"))
        data = mujoco.MjData(one)
        data.qpos[0] = 0.5
        mujoco.mj_forward(one, data)
        forces.append(data.qfrc_passive[0])
    assert forces[1] == pytest.approx(forces[0], rel=1e-5) and forces[0] > 0.4


def test_in_usd_no_body_has_the_name_of_a_joint(tmp_path):
    Usd = pytest.importorskip("pxr.Usd")
    from pxr import UsdPhysics

    (tmp_path / "plain.xml").write_text(
        '<mujoco><worldbody><body name="joint_lid" gravcomp="1"><joint name="lid" '
        'range="-20 80"/><geom size=".1"/></body></worldbody></mujoco>'
    )
    joda.attach(tmp_path / "plain.xml", ONLY_LID, tmp_path / "scene.xml")
    written = export(tmp_path / "scene.xml", "usd", tmp_path / "o.usda")
    assert "1 gravity compensation is left out" in written.notes
    stage = Usd.Stage.Open(str(tmp_path / "o.usda"))
    kinds = {
        prim.GetName(): prim.GetTypeName()
        for prim in stage.Traverse()
        if prim.GetName().startswith("joint_lid")
    }
    assert kinds == {"joint_lid": "Xform", "joint_lid_2": "PhysicsRevoluteJoint"}
    joint = UsdPhysics.Joint(stage.GetPrimAtPath("/o/joint_lid_2"))
    assert joint.GetBody1Rel().GetTargets() == ["/o/joint_lid"]


def test_mistakes_are_one_sentence(scene, tmp_path):
    (tmp_path / "plain.xml").write_text(SCENE)
    with pytest.raises(joda.JodaError, match="carries no profile; attach one first"):
        export(tmp_path / "plain.xml", "sdf", tmp_path / "o.sdf")
    with pytest.raises(joda.JodaError, match="exists already"):
        export(scene, "sdf", tmp_path / "plain.xml")
    with pytest.raises(joda.JodaError, match="written as text; let the file's name end in"):
        export(scene, "usd", tmp_path / "o.usdc")
    code = (
        "import sys; sys.modules['pxr'] = None\nimport joda\n"
        f"try: joda.export({str(scene)!r}, 'usd', {str(tmp_path / 'o.usda')!r})\n"
        "except joda.JodaError as error: print(error)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert 'needs usd-core; run: pip install ".[export]"' in run.stdout


def test_the_command_tells_errors_in_units(scene, tmp_path):
    command = [Path(sys.executable).parent / "joda", "export", scene, "--to", "urdf"]
    run = subprocess.run([*command, "-o", "a.urdf"], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert "conservative force, N·m" in run.stdout and "friction, N " in run.stdout
    run = subprocess.run(
        [*command, "-o", "b.urdf", "--json"], cwd=tmp_path, capture_output=True, text=True
    )
    told = json.loads(run.stdout)
    assert told["files"][0] == "b.urdf"
    assert [error["unit"] for error in told["joints"][1]["errors"]] == ["N"] * 3
