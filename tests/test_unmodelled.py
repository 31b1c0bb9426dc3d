"""What acts on a joint besides itself is said, and then a model is never cleared."""

import mujoco
import numpy as np
import pytest
from test_compare import SCENE, door, runs_of, scene_of

from joda import compare
from joda.measured.comparison import sentences

BODY = '<body name="other" pos="1 0 0"><joint name="wheel" axis="0 1 0"/><geom size=".1"/></body>'
FIXED = '<tendon><fixed name="{}" {}><joint joint="joint" coef="1"/></fixed></tendon>'
EQUAL = "<equality>{}</equality>"
ELEMENTS = {
    "tendon 'band'": FIXED.format("band", 'stiffness="2"'),
    "tendon 'rope'": FIXED.format("rope", 'damping="2"'),
    "equality 'gear'": EQUAL.format('<joint name="gear" joint1="joint" joint2="wheel"/>'),
    "an equality": EQUAL.format('<joint joint1="joint" polycoef="0.5 0 0 0 0"/>'),
    "equality 'rod'": EQUAL.format(
        '<connect name="rod" body1="part" body2="other" anchor="0 0 0"/>'
    ),
    "a medium": '<option density="50" wind="0 8 0"/>',
    "the flag that disables its limits": '<option><flag limit="disable"/></option>',
}
OWN = """<mujoco><compiler angle="radian"/><option timestep=".002" integrator="implicitfast">
    <flag {flag}/></option>
  <worldbody><body><joint name="j" axis="0 1 0" range="-2 2" limited="true" {own}/>
    <inertial pos=".1 0 .05" mass="1" diaginertia=".02 .02 .02"/></body></worldbody></mujoco>"""
ALL = 'damping=".3" frictionloss=".1" stiffness="2" springref=".4"'
POLYNOMIALS = mujoco.mj_version() >= 3009000


def scene_with(folder, extra):
    text = SCENE.format(native='damping="0.5" frictionloss="0.3"').replace(
        "<body>", '<body name="part">'
    )
    text = text.replace("</worldbody>", f"{BODY}</worldbody>{extra}")
    (folder / "scene.xml").write_text(text)
    return folder / "scene.xml"


@pytest.mark.slow
@pytest.mark.parametrize("named", ELEMENTS)
def test_what_a_replay_leaves_out_is_said(named, tmp_path):
    runs = runs_of(door(), tmp_path, 3, 2)
    found = compare(scene_with(tmp_path, ELEMENTS[named]), "joint", runs)
    (note,) = [note for note in found.notes if "leaves that out" in note]
    assert named in note
    assert found.adequacy.verdict != "within_noise"
    assert "no fault of the model" not in " ".join(sentences(found))


@pytest.mark.slow
def test_other_tendons_and_joda_s_own_are_none(tmp_path):
    runs = runs_of(door(), tmp_path, 3, 1)
    wheel = EQUAL.format('<joint joint1="wheel" polycoef="0 0 0 0 0"/>')
    attached = compare(scene_of(door(), tmp_path), "joint", runs)
    assert not [note for note in attached.notes if "leaves that out" in note]
    for extra in (FIXED.format("slack", ""), wheel):
        found = compare(scene_with(tmp_path, extra), "joint", runs)
        assert not [note for note in found.notes if "leaves that out" in note]


def own_runs(folder, text, sigma=3e-4):
    """Two free runs of a joint in MuJoCo as its scene has it."""
    model = mujoco.MjModel.from_xml_string(text)
    rng, paths = np.random.default_rng(), []
    for k, start in enumerate((-1.0, 1.2)):
        data, rows = mujoco.MjData(model), []
        data.qpos[0] = start
        while data.time < 3:
            rows.append((data.time, data.qpos[0] + rng.normal(0, sigma)))
            mujoco.mj_step(model, data, 5)
        paths.append(folder / f"own{k}.csv")
        lines = [f"{t:.5f},{q:.7f}" for t, q in rows]
        paths[-1].write_text("\n".join(["time,position", *lines]) + "\n")
    return paths


@pytest.mark.slow
@pytest.mark.sweep(3)
@pytest.mark.parametrize(
    ("flag", "own"),
    [
        ('frictionloss="disable"', ALL),
        ('damper="disable"', ALL),
        ('spring="disable"', ALL),
        ('constraint="disable"', ALL.replace("frictionloss", "armature")),
        pytest.param(
            'gravity="enable"',
            'damping=".3" stiffness="2 3 4" springref=".4"',
            marks=pytest.mark.skipif(not POLYNOMIALS, reason="this MuJoCo has no polynomials"),
        ),
    ],
)
def test_what_the_scene_switches_off_or_bends_is_replayed_so(flag, own, tmp_path):
    text = OWN.format(flag=flag, own=own)
    (tmp_path / "scene.xml").write_text(text)
    found = compare(tmp_path / "scene.xml", "j", own_runs(tmp_path, text))
    assert found.rmse < (5 if "3 4" in own else 2) * found.noise_floor
    plain = OWN.format(flag='gravity="enable"', own=ALL)
    (tmp_path / "plain.xml").write_text(plain)
    wrong = compare(tmp_path / "plain.xml", "j", own_runs(tmp_path, text))
    assert wrong.adequacy.verdict == "beyond_noise" and wrong.rmse > 10 * wrong.noise_floor


@pytest.mark.skipif(not POLYNOMIALS, reason="this MuJoCo has no polynomials")
def test_the_third_power_of_damping_never_clears_a_model(tmp_path):
    text = OWN.format(flag='gravity="enable"', own='damping="1 0 2"')
    (tmp_path / "scene.xml").write_text(text)
    runs = own_runs(tmp_path, text.replace("1 0 2", "1"))  # as it would be without
    found = compare(tmp_path / "scene.xml", "j", runs)
    assert any("its damping's third power" in note for note in found.notes)
    assert found.adequacy.verdict == "not_enough_data"


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicit", "implicitfast"])
def test_the_scene_s_own_integrator_is_replayed(integrator, tmp_path):
    text = OWN.format(flag='gravity="enable"', own='damping=".3" stiffness="2" springref=".4"')
    text = text.replace("implicitfast", integrator).replace('".002"', '".01"')
    (tmp_path / "scene.xml").write_text(text)
    model = mujoco.MjModel.from_xml_string(text)
    data, rows, rng = mujoco.MjData(model), [], np.random.default_rng()
    data.qpos[0] = -1.0
    while data.time < 4:
        rows.append((data.time, data.qpos[0] + rng.normal(0, 3e-4)))
        mujoco.mj_step(model, data)
    run = tmp_path / "own.csv"
    run.write_text("\n".join(["time,position", *(f"{t:.5f},{q:.7f}" for t, q in rows)]) + "\n")
    found = compare(tmp_path / "scene.xml", "j", [run])
    assert found.rmse < 2 * found.noise_floor
    assert not [note for note in found.notes if "timestep" in note]
