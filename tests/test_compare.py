"""compare: errors against the noise, where a model fails, and what is written."""

import json
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from refine_table import MODELS, bare, measured, pushed, quiet_rig
from scenes import write

from joda import JodaError, attach, compare
from joda.comparison import sentences
from joda.component import Component
from joda.motion import release
from joda.profile import Channel, Channels, Profile, Resistance
from joda.runs import write_run

SPAN = 1.6
FOUND = bare("hinge", SPAN, 0.2)
SCENE = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.005" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="joint" axis="0 1 0" range="0 1.6" limited="true" {native}/>
      <inertial pos="0 0 0" mass="1" diaginertia="0.2 0.2 0.2"/>
    </body>
  </worldbody>
</mujoco>
"""


def flat(value, a=0.0, b=1.0):
    return Component(interval=(a, b), x=(0, 1), y=(value, value))


def door(*conservative, friction=0.3, damping=0.5):
    return Profile(
        joint=FOUND.joint,
        channels=Channels(
            conservative=Channel(components=conservative),
            friction=Resistance(components=(flat(friction),)),
            damping=Resistance(components=(flat(damping),)),
        ),
    )


BUMP = Component(label="bump", interval=(0.5, 0.7), x=(0, 0.5, 1), y=(0, -1.5, 0))


def runs_of(profile, folder, seed, count=3):
    rng = np.random.default_rng(seed)
    model = quiet_rig(FOUND, profile)
    names = []
    for k in range(count):
        run = measured(pushed(model, SPAN, 4.0, rng), SPAN, rng, True)
        write_run(folder / f"run{k}.csv", run)
        names.append(folder / f"run{k}.csv")
    return names


def scene_of(profile, folder, native=""):
    write(folder, SCENE.format(native=native))
    attach(folder / "in.xml", profile, folder / "scene.xml", force=True)
    return folder / "scene.xml"


@pytest.fixture
def seed():
    return int(np.random.default_rng().integers(2**31))


def test_the_true_model_is_at_the_noise_and_fails_nowhere(tmp_path, seed):
    found = compare(scene_of(door(), tmp_path), "joint", runs_of(door(), tmp_path, seed))
    assert found.noise_floor == pytest.approx(5e-4 * SPAN, rel=0.1), seed
    assert found.rmse_window < 3 * found.noise_floor, seed  # a window may begin in a knock
    assert all(place.error < 3 * found.noise_floor for place in found.failing), seed


def test_a_hidden_bump_is_found_where_it_is_and_as_large_as_it_is(tmp_path, seed):
    found = compare(scene_of(door(), tmp_path), "joint", runs_of(door(BUMP), tmp_path, seed))
    assert found.rmse_window > 3 * found.noise_floor, seed
    places = [place for place in found.failing if place.by == "position"]
    worst = max(places, key=lambda place: place.share)
    a, b = worst.interval
    assert a < 0.6 < b, seed
    assert b - a <= 0.6, seed
    assert worst.share > 0.8, seed
    assert 0.1 < worst.force < 1.6, seed  # the model lacks what pushes towards -q
    assert any("too much towards +q" in sentence for sentence in sentences(found))


def test_missing_damping_fails_by_velocity_in_both_directions(tmp_path, seed):
    found = compare(
        scene_of(door(damping=0.0), tmp_path),
        "joint",
        runs_of(door(damping=0.5), tmp_path, seed),
    )
    fast = [place for place in found.failing if place.by == "velocity"]
    ups = [place for place in fast if place.interval[0] >= 0]
    downs = [place for place in fast if place.interval[1] <= 0]
    assert all(place.force > 0 for place in ups), seed
    assert all(place.force < 0 for place in downs), seed
    assert ups or downs, seed


def test_native_elements_are_replayed_like_their_profile(tmp_path, seed):
    runs = runs_of(door(), tmp_path, seed)
    native = write(tmp_path, SCENE.format(native='damping="0.5" frictionloss="0.3"'), "native.xml")
    one, other = (compare(scene, "joint", runs) for scene in (native, scene_of(door(), tmp_path)))
    assert one.rmse_window == pytest.approx(other.rmse_window, rel=1e-6)
    assert one.rmse == pytest.approx(other.rmse, rel=1e-6)


def test_a_whole_run_is_what_mujoco_steps(tmp_path):
    scene = scene_of(door(), tmp_path)
    model = mujoco.MjModel.from_xml_path(str(scene))
    motion = release(quiet_rig(FOUND, door(BUMP)), 0, 0.9, 1.0)
    rng = np.random.default_rng(0)
    run = measured(motion, SPAN, rng)
    write_run(tmp_path / "run.csv", run)
    found = compare(scene, "joint", [tmp_path / "run.csv"])
    data, path = mujoco.MjData(model), []
    data.qpos[0] = 0.9
    for _ in run.time:
        path.append(data.qpos[0])
        mujoco.mj_step(model, data)
    expected = np.sqrt(np.mean((np.array(path) - run.position) ** 2))
    assert found.rmse == pytest.approx(expected, rel=0.05)


def test_the_command_writes_numbers_a_picture_and_a_page(tmp_path):
    scene_of(door(), tmp_path)
    runs_of(door(BUMP), tmp_path, 1, 2)
    line = "joda compare scene.xml run0.csv run1.csv --joint joint --json c.json --report c.html"
    command = [*line.split(), "-o", "c.png"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    told = json.loads((tmp_path / "c.json").read_text())
    assert {"runs", "rmse", "rmse_window", "noise_floor", "failing"} <= set(told)
    assert set(told["runs"][0]) == {"file", "rmse", "rmse_window", "noise_floor"}
    assert {"by", "interval", "error", "share", "significant"} <= set(told["failing"][0])
    assert (tmp_path / "c.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    page = (tmp_path / "c.html").read_text()
    assert "data:image/png;base64," in page
    assert "http" not in page
    again = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert again.returncode == 2
    assert "c.json" in again.stderr


def test_without_jax_it_works(tmp_path):
    scene_of(door(), tmp_path)
    runs_of(door(), tmp_path, 1, 1)
    code = (
        "import sys\nsys.modules['jax'] = None\nimport joda\n"
        "print(joda.compare('scene.xml', 'joint', ['run0.csv']).joint)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.stdout == "joint\n", done.stderr


def test_no_runs_is_a_mistake():
    with pytest.raises(JodaError, match="no runs"):
        compare(MODELS + "/cabinet.xml", "door", [])
