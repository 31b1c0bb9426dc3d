"""What the scene forbids is not claimed: tendons, equality constraints and media in `generate`."""

import mujoco
import numpy as np
import pytest
from scenes import write

from joda import context, generate, generate_all, revise
from joda.component import Component
from joda.interaction.behaviour import behaviour
from joda.interaction.surroundings import surroundings
from joda.profile import Channels, Profile, Resistance
from joda.scenes.assembly import put, taut
from joda.scenes.model import find_joint, load_model
from joda.scenes.motion import play

# A drawer of 3 kg that slides 0.4 m, level, and a lever beside it, and a crank before it.
SCENE = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" {option}/>
  <worldbody>
    <site name="wall" pos=".9 0 .5"/>
    <site name="corner" pos="-.2 0 .5"/>
    <body name="drawer" pos="0 0 .5">
      <joint name="rail" type="slide" axis="1 0 0" range="0 .4" damping="2"/>
      <geom name="box" type="box" size=".1 .2 .1" mass="3"/>
      <site name="front" pos=".1 0 0"/>
    </body>
    <body name="lever" pos="0 2 .5">
      <joint name="swing" axis="0 0 1"/>
      <geom type="box" size=".01 .2 .01" pos="0 .2 0" mass=".2"/>
    </body>
  </worldbody>
  {more}
</mujoco>"""
CHAIR = """<worldbody><body name="chair" pos=".4 0 .5"><joint type="slide" axis="1 0 0"
  frictionloss="5"/><geom type="box" size=".1 .2 .1" mass="6"/></body></worldbody>"""
SPATIAL = '<tendon><spatial name="{}" {}><site site="{}"/><site site="front"/></spatial></tendon>'
PULLS_OPEN = SPATIAL.format("band", 'stiffness="400" springlength="0"', "wall")
HOLDS = SPATIAL.format("rope", 'limited="true" range="0 .5"', "corner")  # taut at 0.2 m
LOCK = '<equality><joint name="lock" joint1="rail" polycoef="0 0 0 0 0"/></equality>'
BOLT = '<equality><weld name="bolt" body1="drawer"/></equality>'
RACK = (
    '<equality><joint name="rack" joint1="swing" joint2="rail" polycoef="0 2.5 0 0 0"/></equality>'
)
WIND = 'density="1.2" wind="60 0 0"'
STAYS = "it stays closed; it stays wherever it is left"


def scene(folder, more="", option=""):
    return write(folder, SCENE.format(more=more, option=option), "model.xml")


def bare(path):
    found = context(path, "rail")
    return found, Profile(joint=found.joint)


def seen(path):
    return behaviour(*bare(path), surroundings(path, "rail"))


ELEMENTS = {"band": PULLS_OPEN, "lock": LOCK, "bolt": BOLT, "rope": HOLDS}
FORBIDS = {
    "band": ("stays shut until it is pulled: no, let go closed it moves away", "it opens"),
    "wind": ("stays shut until it is pulled: no, let go closed it moves away", "it opens"),
    "lock": (
        "get it opened, stuck at s = 0.00 with 60 N, where equality 'lock' acts on",
        "blocked",
    ),
    "bolt": (
        "get it opened, stuck at s = 0.00 with 60 N, where equality 'bolt' acts on",
        "blocked",
    ),
    "rope": ("get it opened, stuck at s = 0.50 with 60 N, where tendon 'rope' acts on", "blocked"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FORBIDS)
def test_what_the_scene_forbids_is_not_claimed(name, tmp_path):
    path = scene(tmp_path, ELEMENTS.get(name, ""), WIND if name == "wind" else "")
    made = generate(path, "rail", tmp_path / "g", proposer="offline", rounds=1, describe=STAYS)
    (round,) = made.history.rounds
    unmet = " ".join(round.unmet)
    assert all(part in unmet for part in FORBIDS[name]), unmet
    assert any("behaviours are simulated in the scene as it is" in note for note in made.notes)
    assert "acts on joint 'rail'" in round.facts.splitlines()[0]


def test_the_same_joint_without_them_keeps_its_claims(tmp_path):
    path = scene(tmp_path)
    made = generate(path, "rail", tmp_path / "g", proposer="offline", rounds=1, describe=STAYS)
    assert made.history.rounds[0].unmet == () and surroundings(path, "rail") is None


def test_revise_and_generate_all_simulate_the_scene_too(tmp_path):
    scene(tmp_path / "models", PULLS_OPEN)
    ((_, made),) = generate_all(
        tmp_path / "models", tmp_path / "all", joint="rail", proposer="offline", rounds=1
    ).items()
    assert "acts on joint 'rail'" in made.history.rounds[0].facts
    again = revise(made.folder, "it must stay closed", proposer="offline")
    assert "let go closed it moves away" in " ".join(again.history.rounds[-1].unmet)


def test_what_is_coupled_moves_along_and_hinders_nothing(tmp_path):
    """By itself the drawer stays wherever it is left; with its lever it does, too."""
    path = scene(tmp_path, RACK)
    behaved = seen(path)
    assert {stretch.goes for stretch in behaved.let_go} == {"stays"}
    assert behaved.opening.arrived and behaved.closing.arrived
    model = load_model(path)
    motion = play(model, find_joint(model, "rail"), 0.25, duration=0.5)
    assert np.ptp(motion.position) < 1e-6


def test_a_joint_goes_no_farther_than_what_is_coupled_to_it(tmp_path):
    """The lever turns by half a radian at most: with 2.5 rad/m the drawer goes 0.2 of its 0.4 m."""
    path = scene(tmp_path, RACK)
    path.write_text(path.read_text().replace('name="swing"', 'name="swing" range="0 .5"'))
    around = surroundings(path, "rail")
    model = load_model(path)
    rail = find_joint(model, "rail")
    allowed = [around.allows(model, rail, s) for s in (0.0, 0.3, 0.49, 0.51, 0.8, 1.0)]
    assert allowed == [True, True, True, False, False, False]
    assert not seen(path).opening.arrived


def test_actuators_that_are_left_out_are_told(tmp_path):
    path = scene(tmp_path, '<actuator><position name="servo" joint="rail" kp="200"/></actuator>')
    made = generate(path, "rail", tmp_path / "g", proposer="offline", rounds=1)
    assert any("acts servo: behaviours are simulated without" in note for note in made.notes)


def test_a_hand_that_the_joint_s_own_friction_stops_is_not_held_by_the_scene(tmp_path):
    found, profile = bare(scene(tmp_path, PULLS_OPEN.replace('"400"', '"1"')))
    stuck = Component(interval=(0, 1), x=(0, 1), y=(200.0, 200.0))
    channels = Channels(friction=Resistance(components=(stuck,)))
    around = surroundings(tmp_path / "model.xml", "rail")
    behaved = behaviour(found, profile.model_copy(update={"channels": channels}), around)
    assert not behaved.opening.arrived and not behaved.opening.held_by


# --- a joint put somewhere in its scene

CRANK = """<mujoco><compiler angle="radian"/><worldbody>
  <body name="crank"><joint name="turn" axis="0 0 1" range="-2 2"/>
    <geom type="capsule" size=".01" fromto="0 0 0 .1 0 0" mass=".1"/>
    <body name="rod" pos=".1 0 0"><joint name="knee" axis="0 0 1"/>
      <geom type="capsule" size=".01" fromto="0 0 0 .3 0 0" mass=".1"/></body></body>
  <body name="slider" pos=".4 0 0"><joint name="stroke" type="slide" axis="1 0 0" range="-.2 0"/>
    <geom size=".02" mass=".3"/></body>
</worldbody><equality><connect body1="rod" body2="slider" anchor=".3 0 0"/></equality></mujoco>"""


@pytest.mark.parametrize("angle", [0.3, -0.9, 1.4])
def test_a_slider_crank_closes_as_geometry_says(angle):
    """x = r cos a + sqrt(l² - r² sin² a), of crank r = 0.1 m and rod l = 0.3 m."""
    model = mujoco.MjModel.from_xml_string(CRANK)
    data = mujoco.MjData(model)
    assert put(model, data, 0, angle)
    reach = 0.1 * np.cos(angle) + np.sqrt(0.09 - 0.01 * np.sin(angle) ** 2)
    assert data.qpos[0] == angle
    assert data.qpos[2] == pytest.approx(reach - 0.4, abs=1e-6)


def test_where_a_linkage_cannot_be_others_stay():
    model = mujoco.MjModel.from_xml_string(CRANK)
    data = mujoco.MjData(model)
    assert not put(model, data, 2, 0.05)  # 0.45 m, and crank and rod are 0.4 m long
    assert data.qpos.tolist() == [0, 0, 0.05]


def test_a_constraint_that_never_held_binds_nothing():
    model = mujoco.MjModel.from_xml_string(CRANK)
    data = mujoco.MjData(model)
    data.qpos[2] = -0.01
    assert put(model, data, 0, 0.7) and data.qpos.tolist() == [0.7, 0, -0.01]


@pytest.mark.parametrize(("position", "beyond"), [(0.19, False), (0.21, True)])
def test_a_rope_is_taut_from_its_length_on(position, beyond, tmp_path):
    model = load_model(scene(tmp_path, HOLDS))
    data = mujoco.MjData(model)
    assert put(model, data, 0, position) and taut(model, data, 0) == beyond


def test_a_blow_adds_nothing_to_what_the_hand_exerts(tmp_path):
    """The drawer strikes something heavy that yields: what brakes it then is not the hand's."""
    found = seen(scene(tmp_path, CHAIR))
    assert found.opening.arrived
    assert 0 < found.opening.steady <= found.opening.force
