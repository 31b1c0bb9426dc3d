"""The context of a joint against closed forms."""

import json

import mujoco
import numpy as np
import pytest
from assets import NAMES, asset

from joda import JodaError, context
from joda.model import joint_type, load_model

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


def test_the_closed_end_may_be_the_high_one(tmp_path):
    path = write(tmp_path, LID.replace('range="0 2"', 'range="-2 0"'))
    assert context(path, "lid").closed_end == "high_end"


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
