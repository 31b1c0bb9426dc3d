"""The context of a joint against closed forms."""

import json
import re

import mujoco
import numpy as np
import pytest
from assets import NAMES, asset

from joda import JodaError, context
from joda.scenes.model import joint_type, load_model

G = 9.81
LID = """
<mujoco><compiler angle="radian"/><worldbody><body name="box">
  <geom size=".2 .2 .1" type="box"/>
  <body name="lid" pos="0 0 .3"><joint name="lid" axis="0 -1 0" range="0 2"/>
    <geom type="box" size=".2 .15 .01" pos=".2 0 0" mass="1.5"/>
  </body>
</body></worldbody></mujoco>"""


def write(folder, text):
    (folder / "model.xml").write_text(text)
    return folder / "model.xml"


def test_a_lid_under_gravity(tmp_path):
    found = context(write(tmp_path, LID), "lid")
    q = np.array(found.positions)
    assert (found.parent, found.child) == ("box", "lid")
    assert (found.axis_local, found.axis_world) == ((0, -1, 0), (0, -1, 0))
    assert found.anchor_world == pytest.approx((0, 0, 0.3))
    assert found.moving_mass == pytest.approx(1.5)
    assert (q[0], q[-1], len(q)) == (0, 2, 21)
    about_hinge = 1.5 * ((0.4**2 + 0.02**2) / 12 + 0.2**2)
    assert found.inertia == pytest.approx(np.full(21, about_hinge))
    assert found.equivalent_inertia == pytest.approx(about_hinge)
    assert found.gravity_force == pytest.approx(-1.5 * G * 0.2 * np.cos(q))
    assert found.gravity_scale == pytest.approx(1.5 * G * 0.2)
    assert (found.upper_end, found.closed_end) == ("high_end", "low_end")


def test_a_slide_and_an_inertia_that_changes_with_position(tmp_path):
    """A crane's turret: the load on the arm is carried outward by a slide below the hinge."""
    text = """
    <mujoco><compiler angle="radian"/><worldbody>
      <body name="arm"><joint name="turn" axis="0 0 1" range="-1 1"/>
        <geom size=".1" mass="2"/>
        <body name="load" pos="1 0 0"><joint name="out" type="slide" axis="1 0 0" range="0 .5"/>
          <geom size=".05" mass="3"/></body>
      </body></worldbody></mujoco>"""
    path = write(tmp_path, text)
    turn, out = context(path, "turn"), context(path, "out")
    assert turn.equivalent_inertia == pytest.approx(2 * 0.4 * 0.01 + 3 * (1 + 0.4 * 0.0025))
    assert (turn.upper_end, turn.closed_end, turn.gravity_scale) == ("level", "unknown", 0)
    assert out.inertia == pytest.approx(np.full(21, 3.0))
    assert (out.joint.unit, out.closed_end) == ("m", "low_end")
    assert turn.moving_mass == pytest.approx(5)


def test_inertia_of_a_joint_that_carries_a_linkage_varies(tmp_path):
    """A hinge about a tilted axis through a long part that another joint's reference bends."""
    text = """
    <mujoco><compiler angle="radian"/><worldbody><body><joint name="a" axis="0 0 1" range="0 3"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
      <body><joint name="b" axis="1 0 0" range="0 1.57"/>
        <inertial pos="0 2 0" mass="3" diaginertia=".1 .1 .1"/></body></body>
    </worldbody></mujoco>"""
    found = context(write(tmp_path, text), "b")
    assert found.inertia == pytest.approx(np.full(21, 0.1 + 3 * 4))
    assert found.gravity_force == pytest.approx(-3 * G * 2 * np.cos(found.positions))


ARM = """
<mujoco model="workshop"><compiler angle="radian"/><asset><material name="brass"/></asset>
<worldbody><body name="room"><body name="frame"><geom size=".1"/>
  <body name="door" pos="1 2 3"><joint name="turn" pos="{anchor}" axis="0 0 1" range="0 2"/>
    <geom name="leaf" type="box" size=".4 .02 .9" pos=".4 0 0" mass="2"/>
    <body name="handle" pos=".8 .1 0"><joint name="press" axis="0 1 0" range="0 1"/>
      <geom name="grip" type="box" size=".05 .03 .01" pos="0 .02 0" mass=".1" material="brass"/>
    </body>
  </body>
</body></body></worldbody>
<actuator>{actuators}</actuator></mujoco>"""


@pytest.mark.parametrize(("anchor", "x", "y"), [("0 0 0", 0, 0), ("-.3 .5 7", -0.3, 0.5)])
def test_the_lever_arm_reaches_to_the_grip_else_to_the_farthest_corner(tmp_path, anchor, x, y):
    """Of the grip to its middle; of the leaf: x to 0.8 m, y from -0.02 to 0.02 m, at any height."""
    text = ARM.format(anchor=anchor, actuators="")
    found = context(write(tmp_path, text), "turn")
    assert found.lever_arm == pytest.approx(np.hypot(0.8 - x, 0.12 - y))
    assert found.size == pytest.approx((0.85, 0.17, 1.8))
    bare = text[: text.index('<body name="handle"')] + text[text.index("</body>\n  </body>") + 7 :]
    corners = [(0.8, -0.02), (0.8, 0.02)]
    expected = max(np.hypot(a - x, b - y) for a, b in corners)
    assert context(write(tmp_path, bare), "turn").lever_arm == pytest.approx(expected)


def test_the_lever_arm_is_of_boxes_as_they_are_turned(tmp_path):
    """A square plate of side 2 a, turned by 45 degrees, on a hinge in its corner: 2 a sqrt 2."""
    text = """
    <mujoco><worldbody><body><joint name="j" axis="0 1 0" range="0 90"/>
      <geom type="box" size=".3 .1 .3" pos="0 0 {0}" euler="0 45 0"/></body></worldbody></mujoco>"""
    found = context(write(tmp_path, text.format(0.3 * np.sqrt(2))), "j")
    assert found.lever_arm == pytest.approx(0.6 * np.sqrt(2))
    assert found.size == pytest.approx((0.6 * np.sqrt(2), 0.2, 0.6 * np.sqrt(2)))


def test_a_slide_has_a_lever_arm_of_one_whatever_its_size(tmp_path):
    text = LID.replace('name="lid" axis', 'name="lid" type="slide" axis')
    found = context(write(tmp_path, text), "lid")
    assert (found.lever_arm, found.size) == (1, pytest.approx((0.4, 0.3, 0.02)))


@pytest.mark.parametrize(
    ("actuator", "driven"),
    [
        ('<motor joint="turn"/>', True),
        ('<motor jointinparent="turn"/>', True),
        ('<motor joint="press"/>', False),
    ],
)
def test_a_joint_is_driven_by_an_actuator_that_acts_on_it(tmp_path, actuator, driven):
    found = context(write(tmp_path, ARM.format(anchor="0 0 0", actuators=actuator)), "turn")
    assert found.driven is driven
    assert ("driven by:" in found.describe()) is driven


def test_an_actuator_on_a_tendon_of_the_same_number_does_not_drive_the_joint(tmp_path):
    text = ARM.format(anchor="0 0 0", actuators='<motor tendon="t"/>')
    tendon = '<tendon><fixed name="t"><joint joint="press" coef="1"/></fixed></tendon></mujoco>'
    found = context(write(tmp_path, text.replace("</mujoco>", tendon)), "turn")
    assert found.driven is False


def test_names_begin_with_the_joint_and_its_body_and_surroundings_with_the_nearest(tmp_path):
    path = write(tmp_path, ARM.format(anchor="0 0 0", actuators=""))
    turn, press = context(path, "turn"), context(path, "press")
    assert turn.names == ("turn", "door", "leaf", "handle", "grip", "brass")
    assert turn.around == ("frame", "room", "workshop")
    assert press.names == ("press", "handle", "grip", "brass")
    assert press.around == ("door", "frame", "room", "workshop")


def test_the_closed_end_may_be_the_high_one(tmp_path):
    path = write(tmp_path, LID.replace('range="0 2"', 'range="-2 0"'))
    assert context(path, "lid").closed_end == "high_end"


@pytest.mark.sweep(3)
@pytest.mark.parametrize("name", NAMES)
def test_every_joint_of_other_peoples_scenes_has_a_context(name):
    path = asset(name)
    model = load_model(path)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SPRING  # leaves gravity's energy
    data = mujoco.MjData(model)
    for j in range(model.njnt):
        if joint_type(model, j) not in ("hinge", "slide"):
            continue
        found = context(path, model.joint(j).name or f"#{j}")
        assert min(found.inertia) > 0
        assert np.isfinite(found.gravity_force).all()
        energies = []
        for position in found.positions:  # gravity's force is minus the slope of its potential
            mujoco.mj_resetData(model, data)
            data.qpos[model.jnt_qposadr[j]] = position
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_energyPos(model, data)
            energies.append(data.energy[0])
        slope = -np.gradient(energies, found.positions, edge_order=2)
        scale = max(np.abs(slope).max(), 1e-6)
        if model.nq == model.nv:
            assert np.abs(slope - found.gravity_force).max() < 0.02 * scale


def test_mistakes_are_told_in_a_sentence(tmp_path):
    path = write(tmp_path, LID)
    with pytest.raises(JodaError, match=r"joint 'lit' not found; .* of the model: 'lid'"):
        context(path, "lit")
    with pytest.raises(JodaError, match="joint 'lid' has no range; add range="):
        context(write(tmp_path, LID.replace('range="0 2"', "")), "lid")


def test_it_is_json(tmp_path):
    found = context(write(tmp_path, LID), "lid")
    content = json.loads(found.model_dump_json())
    assert content["joint"] == {"name": "lid", "type": "hinge", "range": [0, 2], "unit": "rad"}


COUPLED = """
<mujoco><compiler angle="radian"/><option viscosity="0.01"/><worldbody>
  <geom name="wall" type="box" size=".02 .3 .3" pos="-.1 .6 0"/>
  <body name="door"><joint name="door" axis="0 0 1" range="0 2" damping=".5" frictionloss=".2"
      stiffness="1.5" springref=".3" armature=".04"/>
    <geom name="leaf" type="box" size=".02 .4 .3" pos="0 .4 0" mass="5"/></body>
  <body name="twin" pos="3 0 0"><joint name="twin" axis="0 0 1" range="0 2"/>
    <geom type="box" size=".02 .4 .3" pos="0 .4 0" mass="5"/></body>
</worldbody>
<equality><joint name="linked" joint1="door" joint2="twin"/></equality>
<actuator><motor name="opener" joint="door"/></actuator></mujoco>"""


def test_what_the_model_itself_gives_a_joint(tmp_path):
    """The leaf, 2 cm thick on either side, meets the wall's face, 8 cm before it, on its way."""
    found = context(write(tmp_path, COUPLED), "door")
    own = found.native
    assert (own.damping, own.frictionloss, own.armature) == (0.5, 0.2, 0.04)
    assert (own.stiffness, own.springref) == (1.5, 0.3)
    assert own.unmodelled == ("equality 'linked'", "a medium (<option density viscosity wind>)")
    first = own.contacts[0]
    assert (first.geom, first.other, first.stop) == ("leaf", "wall", False)
    # its corner at (-0.02, 0.8) reaches the face x = -0.08 at asin(0.08 / r) - asin(0.02 / r)
    r = np.hypot(0.8, 0.02)
    meets = np.arcsin(0.08 / r) - np.arcsin(0.02 / r)
    assert first.interval[0] == pytest.approx(meets / 2, abs=2e-3)
    told = found.describe()
    assert "own elements: damping 0.5 N·m·s/rad, friction 0.2 N·m, a spring of 1.5 N·m/rad" in told
    assert "also acting:  equality 'linked'" in told and "driven by:    opener" in told
    assert "contacts:     leaf meets wall from s = 0.0" in told
    assert json.loads(found.model_dump_json())["native"]["springref"] == 0.3


def test_a_plain_joint_has_no_elements_of_its_own(tmp_path):
    found = context(write(tmp_path, LID), "lid")
    assert "own elements: none" in found.describe()
    assert not found.native.contacts and not found.native.unmodelled


CAP = """<robot name="bottle">{more}<link name="base"/><link name="helper"/>
  <link name="cap"><collision><geometry><cylinder radius=".02" length=".02"/>
  </geometry></collision></link>
  <joint name="rises" type="prismatic"><axis xyz="0 0 1"/><parent link="base"/>
  <child link="helper"/><limit lower="0" upper=".03" effort="1" velocity="1"/></joint>
  <joint name="turns" type="revolute"><axis xyz="0 0 1"/><parent link="helper"/>
  <child link="cap"/><limit lower="0" upper="6" effort="1" velocity="1"/></joint></robot>"""


def test_a_link_without_a_mass_is_told_with_a_remedy_that_works(tmp_path):
    path = tmp_path / "bottle.urdf"
    path.write_text(CAP.format(more=""))
    with pytest.raises(
        JodaError, match=r"MuJoCo cannot load it: .* A link without a mass"
    ) as error:
        context(path, "rises")
    (remedy,) = re.findall("write (<mujoco>.*</mujoco>) into", str(error.value))
    path.write_text(CAP.format(more=remedy))
    assert context(path, "rises").joint.range == (0.0, 0.03)
