"""Stops that bear what presses on them, by closed form and in the simulation of scenes."""

import mujoco
import numpy as np
import pytest

from joda import attach
from joda.component import Component
from joda.profile import Channel, Channels, Joint, Profile
from joda.scenes.limits import FIRM, YIELDING, firm_limit
from joda.scenes.model import load_model
from joda.scenes.motion import release

H = 0.001
SPAN = 0.4
XML = """
<mujoco><compiler angle="radian"/><option gravity="0 0 0" timestep="{h}"/><worldbody><body>
  <joint name="j" axis="0 1 0" range="0 {span}" {more}/>
  <inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/></body></worldbody>
</mujoco>"""


def pressed(tmp_path, torque, inertia, more="") -> tuple[mujoco.MjModel, list[str]]:
    """A rocker that its profile presses with a torque (N·m) against its low end."""
    path = tmp_path / "rocker.xml"
    path.write_text(XML.format(h=H, span=SPAN, inertia=inertia, more=more))
    push = Component(interval=(0, 1), x=(0, 1), y=(-torque, -torque))
    profile = Profile(
        joint=Joint(name="j", type="hinge", range=(0, SPAN), unit="rad"),
        channels=Channels(conservative=Channel(components=(push,))),
    )
    notes = attach(path, profile, tmp_path / "scene.xml", force=True)
    return load_model(tmp_path / "scene.xml"), notes


@pytest.mark.parametrize("more", ["", 'solreflimit="0.01 0.5"', 'solreflimit="-2500 -100"'])
@pytest.mark.parametrize("inertia", [1e-6, 1e-5, 1e-4, 1e-3])
def test_a_pressed_joint_rests_at_its_stop(tmp_path, inertia, more):
    model, _ = pressed(tmp_path, 0.2, inertia, more)
    end = release(model, 0, 0.1 * SPAN, 1.0).position[-1]
    assert -YIELDING * SPAN <= end <= 0
    if inertia < 1e-4:  # it was made firmer
        assert end == pytest.approx(-FIRM * SPAN, rel=0.05) or end > -FIRM * SPAN


def test_the_depth_is_that_of_the_closed_form(tmp_path):
    """Of a stop that is left as it is: acceleration (1 - d) (time constant * ratio)^2."""
    model, notes = pressed(tmp_path, 0.2, 0.02, 'solreflimit="0.02 1" solimplimit="0.9 0.9"')
    assert not any("firmer" in note for note in notes)
    end = release(model, 0, 0.0, 3.0).position[-1]
    assert end == pytest.approx(-(0.2 / 0.02) * (1 - 0.9) * 0.02**2, rel=0.01)


def test_without_it_a_light_rocker_lies_beyond_its_stop(tmp_path):
    model, notes = pressed(tmp_path, 0.2, 1e-5)
    assert any("has firmer limits now" in note for note in notes)
    plain = mujoco.MjModel.from_xml_string(XML.format(h=H, span=SPAN, inertia=1e-5, more=""))
    model.jnt_solref[0], model.jnt_solimp[0] = plain.jnt_solref[0], plain.jnt_solimp[0]
    assert release(model, 0, 0.0, 1.0).position[-1] < -SPAN / 2


def test_heavy_joints_keep_their_stops(tmp_path):
    model, notes = pressed(tmp_path, 3.0, 1.0)
    assert notes == []
    assert model.jnt_solref[0] == pytest.approx([0.02, 1])
    usual = ((0.02, 1.0), (0.9, 0.95, 0.001, 0.5, 2.0))
    assert firm_limit(0.0, SPAN, *usual, H) is None
    assert firm_limit(3.0, SPAN, *usual, H) is None


def test_a_firm_stop_keeps_its_damping_ratio():
    solref, _ = firm_limit(1e5, SPAN, (0.02, 0.3), (0.9, 0.95), H)
    assert [float(x) for x in solref.split()] == pytest.approx([2 * H, 0.3])
    solref, _ = firm_limit(1e5, SPAN, (-400.0, -12.0), (0.9, 0.95), H)
    stiffness, damping = (-float(x) for x in solref.split())
    assert damping / (2 * np.sqrt(stiffness)) == pytest.approx(12 / (2 * np.sqrt(400)))
