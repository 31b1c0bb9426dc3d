"""Contacts of a scene with what a joint moves: where they are, and what is not replayed there."""

import json
import re

import mujoco
import numpy as np
import pytest
from assets import asset
from scenes import write

from joda import JodaError, add, attach, compare, context, diagnose, generate, improve, refine
from joda.component import Component
from joda.interaction.behaviour import behaviour
from joda.interaction.surroundings import surroundings
from joda.measured.comparison import sentences
from joda.measured.reading import read_measured
from joda.measured.run_files import read_run, write_run
from joda.measured.runs import QuasiStatic, Run
from joda.profile import Channels, Profile, Resistance
from joda.scenes.contacts import contacts_along
from joda.scenes.model import describe_joint, find_joint, load_model

# A slide of 1 m whose box has its front at 0.1 + q, and a post whose near side is at 0.5 + 0.1 and
# whose far side is out of reach: they touch from q = 0.5 on.
SLIDE = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" gravity="0 0 0" {option}/>
  <worldbody>
    <body name="box">
      <joint name="j" type="slide" axis="1 0 0" range="0 1" damping="1" {joint}/>
      <geom name="front" type="box" size=".1 .1 .1" mass="2"/>
    </body>
    <body name="post" pos="{at} 0 0">{free}<geom type="box" size=".2 .05 .05" {geom}/></body>
  </worldbody>
  {more}
</mujoco>"""
USUAL = {"option": "", "joint": "", "at": ".8", "free": "", "geom": "", "more": ""}
# A leaf of 0.6 m that is 2 cm thick, and a chest with its corner at (0.4, 0.3), as a drawer.
DOOR = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body name="door">
      <joint name="hinge" axis="0 0 1" range="0 1.6" damping=".02"/>
      <geom name="leaf" type="box" size=".3 .01 .2" pos=".3 0 0" mass="{mass}"/>
    </body>
    <body name="chest" pos=".3 .5 0">
      <joint name="pull" type="slide" axis="1 0 0" range="0 .3"/>
      <geom name="drawer" type="box" size=".1 .2 .1" mass="3"/>
    </body>
  </worldbody>
</mujoco>"""
CORNER = float(np.arctan2(0.3, 0.4) - np.arcsin(0.01 / 0.5))
"""Where the leaf's face meets that corner, rad."""


def slide(**changed) -> str:
    return SLIDE.format(**{**USUAL, **changed})


def found(text, path=None, joint="j"):
    model = mujoco.MjModel.from_xml_string(text)
    number = find_joint(model, joint)
    described = describe_joint(model, number)
    return contacts_along(model, number, described, path or described.range)


@pytest.mark.parametrize(
    "option",
    ["", 'cone="elliptic"', 'solver="PGS"', 'solver="CG" cone="elliptic"', 'timestep="0.01"'],
)
def test_a_box_meets_a_post_where_their_sizes_say(option):
    text = slide(option=option).replace('timestep="0.002" ', "" if "timestep" in option else " ")
    (one,) = found(text)
    assert (one.geom, one.other) == ("front", "post")
    assert one.interval == pytest.approx((0.5, 1.0), abs=1e-4)
    assert one.path == pytest.approx((0.5, 1.0), abs=1e-4)
    assert one.presses and one.hinders and not one.along and not one.stop


@pytest.mark.parametrize(
    "changed",
    [
        {"more": '<actuator><position joint="j" kp="500"/></actuator>'},
        {"option": 'gravity="-9.81 0 0"'},
        {"joint": 'stiffness="300" springref="-1"'},
        {"joint": 'frictionloss="30"'},
    ],
    ids=["actuator", "gravity", "spring", "friction"],
)
def test_what_pulls_the_joint_away_or_holds_it_hides_no_contact(changed):
    text = slide(**changed)
    if "option" in changed:
        text = text.replace(' gravity="0 0 0"', "")
    (one,) = found(text)
    assert one.path == pytest.approx((0.5, 1.0), abs=1e-4)


def test_a_leaf_meets_a_corner_where_geometry_says():
    (one,) = found(DOOR.format(mass=4), joint="hinge")
    # It leaves the chest where its end passes the near side: cos q = 0.2 / 0.6, less its thickness.
    far = np.arccos(0.2 / np.hypot(0.6, 0.01)) + np.arcsin(0.01 / np.hypot(0.6, 0.01))
    assert one.path == pytest.approx((CORNER, far), abs=2e-3)
    assert (one.geom, one.other) == ("leaf", "drawer")


@pytest.mark.parametrize(
    "changed",
    [
        {"geom": 'contype="0" conaffinity="0"'},
        {"option": '>  <flag contact="disable"/></option><option'},
        {"more": '<contact><exclude body1="box" body2="post"/></contact>'},
        {"at": "1.4"},
        {"geom": 'gap=".1"', "at": "1.35"},
    ],
    ids=["filter", "flag", "exclude", "out of reach", "within the gap"],
)
def test_where_nothing_resists_there_is_no_contact(changed):
    assert found(slide(**changed)) == ()


def test_what_lies_along_the_path_counts_and_no_more():
    assert found(slide(), path=(0.0, 0.45)) == ()
    (one,) = found(slide(), path=(0.2, 0.7))
    assert one.interval == pytest.approx((0.5, 0.7), abs=1e-4)


def test_a_margin_lets_contacts_begin_before_geoms_touch():
    (one,) = found(slide(geom='margin=".05"'))
    assert one.path[0] == pytest.approx(0.45, abs=1e-3)


def test_a_thin_obstacle_is_found_from_both_sides():
    text = slide(at=".6").replace('size=".2 .05 .05"', 'size=".001 .05 .05"')
    (one,) = found(text)
    assert one.path == pytest.approx((0.499, 0.701), abs=1e-3)


def test_a_box_that_rests_on_a_rail_rubs_all_along_and_is_not_hindered():
    rail = '<geom name="rail" type="box" size="2 .05 .05" pos="0 0 -.1499"/>'
    text = slide(at="3").replace("<worldbody>", f"<worldbody>{rail}")
    (one,) = found(text)
    assert one.other == "rail" and one.along and not one.hinders
    assert one.interval == pytest.approx((0, 1), abs=1e-9)
    smooth = text.replace('type="box"', 'type="box" condim="1"')
    assert found(smooth) == ()  # touches, and nothing rubs


def test_a_wall_at_the_end_of_the_range_is_a_stop():
    (one,) = found(slide(at="1.295"))
    assert one.stop and not one.hinders and one.path[0] == pytest.approx(0.995, abs=1e-4)


def test_a_thing_that_can_move_is_in_the_way_all_the_same():
    (one,) = found(slide(free="<freejoint/>"))
    assert one.path[0] == pytest.approx(0.5, abs=1e-4)


def test_drawers_of_another_people_s_cabinet_stick_before_they_are_shut():
    """As in MuJoCo: let go there, the drawer is thrown out to where the contact begins."""
    path = asset("cabinet")
    model = load_model(path)
    joint = find_joint(model, "top_level")
    described = describe_joint(model, joint)
    (one,) = contacts_along(model, joint, described, described.range)
    assert one.other == "base" and one.interval[1] == 1.0
    data = mujoco.MjData(model)
    data.qpos[model.jnt_qposadr[joint]] = one.path[0] + 2e-4
    mujoco.mj_step(model, data, 1000)
    assert data.qpos[model.jnt_qposadr[joint]] < one.path[0]


# --- what is replayed
def pushed(text, joint, force, folder, name, seconds=4.0, start=0.0, noise=2e-4, seed=0):
    """A run as the scene itself makes it, contacts on, written to a file."""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    number = find_joint(model, joint)
    qpos, dof = model.jnt_qposadr[number], model.jnt_dofadr[number]
    data.qpos[qpos] = start
    rows = []
    while data.time < seconds:
        data.qfrc_applied[dof] = force(data.time)
        rows.append((data.time, data.qpos[qpos], data.qfrc_applied[dof]))
        mujoco.mj_step(model, data, 5)
    time, position, applied = np.array(rows).T
    position = position + np.random.default_rng(seed).normal(0, noise, len(time))
    run = Run(name, time, position, None, applied, True)
    write_run(folder / name, run)
    return folder / name


def to_and_fro(amplitude, period, offset=0.0):
    return lambda t: offset + amplitude * np.sin(2 * np.pi * t / period)


def jammed(folder, count=4):
    """A door of 90 g that jams against a drawer, and runs of it."""
    text = DOOR.format(mass=0.09)
    force = [to_and_fro(0.012, 3.5 + 0.3 * k, 0.004) for k in range(count)]
    return write(folder, text, "model.xml"), [
        pushed(text, "hinge", f, folder, f"run{k}.csv", 6.0, 0.05, seed=k)
        for k, f in enumerate(force)
    ]


@pytest.mark.slow
def test_what_lies_in_a_contact_is_left_out_and_said(tmp_path):
    model, runs = jammed(tmp_path)
    raw = [read_run(run) for run in runs]
    inside = [run.position >= CORNER for run in raw]
    assert all(40 < one.sum() < 500 for one in inside)
    measured = read_measured(model, "hinge", runs)
    for run in measured.runs:
        within = run.position >= CORNER - 5e-4
        assert np.isnan(run.force[within]).all() and not np.isnan(run.force[[0, -1]]).any()
        far = run.position < CORNER - 0.1
        assert not np.isnan(run.force[far]).any()
    (said,) = [note for note in measured.notes if "is not free" in note]
    assert f"'leaf' touches 'drawer' from s = {CORNER / 1.6:.3f} to " in said
    assert "samples of run0.csv" in said and "exclude the pair" in said
    told = compare(model, "hinge", runs, json=tmp_path / "c.json")
    assert told.rmse_window < 2 * told.noise_floor and np.isfinite(told.rmse)
    (one,) = json.loads((tmp_path / "c.json").read_text())["contacts"]
    assert {one["geom"], one["other"]} == {"leaf", "drawer"}
    assert one["interval"][0] == pytest.approx(CORNER / 1.6, abs=1e-3)


@pytest.mark.long
def test_no_jam_becomes_an_effect(tmp_path):
    model, runs = jammed(tmp_path, 5)
    diagnosis = tmp_path / "d.json"
    found = diagnose(model, "hinge", runs, json=diagnosis)
    assert json.loads(diagnosis.read_text())["contacts"]
    most = max((one.magnitude for one in found.effects), default=0.0)
    assert most < 0.5  # N·m; without the contact: thousands
    added = add(model, "hinge", diagnosis, runs, tmp_path / "n.xml", effect="stribeck_friction")
    if added.composed:
        friction = Profile.read(added.composed).channels.friction
        assert max((max(c.y) for c in friction.components), default=0.0) < 0.5
    else:
        assert added.reason and not (tmp_path / "n.xml").exists()


def test_a_run_that_is_all_in_a_contact_is_refused_and_others_stay(tmp_path):
    text = slide(at=".8")
    path = write(tmp_path, text, "model.xml")
    free = slide(at="5")
    good = pushed(text, "j", to_and_fro(3, 2.0, -1.0), tmp_path, "good.csv", start=0.2)
    bad = pushed(free, "j", to_and_fro(2, 1.5), tmp_path, "bad.csv", 2.0, start=0.7)
    measured = read_measured(path, "j", [good, bad])
    assert [run.name for run in measured.runs] == ["good.csv"]
    assert any("all samples of bad.csv" in note for note in measured.notes)
    sentence = (
        r"In the scene joint 'j' is not free: 'front' touches 'post' from s = 0\.[567]\d+ to .*; "
        r"that is where bad.csv lie.* move the geoms apart or exclude the pair"
    )
    for command in (compare, diagnose):
        with pytest.raises(JodaError, match=sentence):
            command(path, "j", [bad])
    with pytest.raises(JodaError, match=sentence):
        improve(path, "j", [bad], tmp_path / "new.xml")
    assert not (tmp_path / "new.xml").exists()


def test_samples_of_a_curve_in_a_contact_are_left_out(tmp_path):
    path = write(tmp_path, slide(), "model.xml")
    there = np.concatenate([np.linspace(0.05, 0.9, 40), np.linspace(0.9, 0.05, 40)])
    force = 1.0 + 0.1 * there + np.random.default_rng(0).normal(0, 0.01, 80)
    rows = "\n".join(f"{q:.6f},{f:.6f}" for q, f in zip(there, force, strict=True))
    (tmp_path / "c.csv").write_text(f"position,force\n{rows}\n")
    (curve,) = read_measured(path, "j", [tmp_path / "c.csv"]).curves
    assert isinstance(curve.curve, QuasiStatic)
    assert curve.curve.position.max() < 0.5 and len(curve.curve.position) == 2 * 21
    (tmp_path / "d.csv").write_text("position,force\n" + "\n".join(rows.splitlines()[24:56]) + "\n")
    with pytest.raises(JodaError, match=r"'front' touches 'post' .* d\.csv lie"):
        compare(path, "j", [tmp_path / "d.csv"])


def test_where_nothing_touches_nothing_changes(tmp_path):
    text = slide(at="5")
    path = write(tmp_path, text, "model.xml")
    file = pushed(text, "j", to_and_fro(3, 2.0), tmp_path, "run.csv", start=0.4)
    measured = read_measured(path, "j", [file])
    assert measured.contacts == () and measured.notes == ()
    assert np.array_equal(measured.runs[0].position, read_run(file).position)


def test_rubbing_all_along_is_said_and_replayed(tmp_path):
    rail = '<geom name="rail" type="box" size="2 .05 .05" pos="0 0 -.1499"/>'
    text = slide(at="5").replace("<worldbody>", f"<worldbody>{rail}")
    path = write(tmp_path, text, "model.xml")
    file = pushed(text, "j", to_and_fro(6, 2.0), tmp_path, "run.csv", start=0.4)
    measured = read_measured(path, "j", [file])
    (said,) = [note for note in measured.notes if "rail" in note]
    assert "wherever the joint was" in said and "comes on top of it" in said
    assert not np.isnan(measured.runs[0].force).any()


def test_refine_refuses_what_lies_in_a_contact(tmp_path):
    model = write(tmp_path, slide(), "model.xml")
    bad = pushed(slide(at="5"), "j", to_and_fro(2, 1.5), tmp_path, "bad.csv", 2.0, start=0.7)
    flat = Component(interval=(0, 1), x=(0, 1), y=(0.5, 0.5))
    channels = Channels(damping=Resistance(components=(flat,)))
    attach(model, Profile(joint=context(model, "j").joint, channels=channels), tmp_path / "s.xml")
    with pytest.raises(JodaError, match=r"'front' touches 'post' .* that is where bad\.csv lie"):
        refine(tmp_path / "s.xml", "j", [bad], tmp_path / "new.xml")


# --- what the scene bars
GATE = DOOR.replace('<joint name="pull" type="slide" axis="1 0 0" range="0 .3"/>', "").format(
    mass=4
)
"""The door, and a chest that stays."""
OPEN = GATE.replace("<option", '<option><flag contact="disable"/></option><option')
BARRED = "The scene blocks joint '{}' where it was measured to move: '{}' touches '{}' from s = "


def swung(folder, name="swung.csv", noise=2e-4):
    """The door, pushed through where the chest is."""
    return pushed(OPEN, "hinge", to_and_fro(1.5, 3.0), folder, name, 3.0, 0.05, noise)


@pytest.mark.long
def test_a_run_through_a_contact_is_a_fault_of_the_scene(tmp_path):
    path = write(tmp_path, GATE, "model.xml")
    run = swung(tmp_path)
    inside = int(np.sum(read_run(run).position > CORNER + 0.02))
    found = compare(path, "hinge", [run], json=tmp_path / "c.json")
    assert found.adequacy.verdict == "beyond_noise"
    says = BARRED.format("hinge", "leaf", "drawer") + f"{CORNER / 1.6:.3f}"
    said = " ".join(sentences(found))
    assert f"Beyond the noise: {says[0].lower()}{says[1:]}" in said
    count, total = map(
        int, re.search(r"and (\d+) of (\d+) samples of swung.csv lie", said).groups()
    )
    assert total == 301 and 30 < count <= inside
    assert not any("scene blocks" in note for note in found.notes)
    assert json.loads((tmp_path / "c.json").read_text())["adequacy"]["barred"].startswith(says)
    runs = [run, swung(tmp_path, "more.csv")]
    diagnosed = diagnose(path, "hinge", runs, json=tmp_path / "d.json")
    assert any(note.startswith(says) for note in diagnosed.notes)


def test_a_curve_through_a_contact_is_one_too(tmp_path):
    path = write(tmp_path, slide(geom='solref=".01 1"'), "model.xml")
    there = np.concatenate([np.linspace(0.05, 0.95, 60), np.linspace(0.95, 0.05, 60)])
    rows = "\n".join(f"{q:.6f},{1 + 0.01 * q:.6f}" for q in there)
    (tmp_path / "c.csv").write_text(f"position,force\n{rows}\n")
    barred = read_measured(path, "j", [tmp_path / "c.csv"]).barred
    assert barred.startswith(BARRED.format("j", "front", "post") + "0.500 to 0.950")


@pytest.mark.parametrize(
    ("option", "geom", "force", "noise"),
    [
        ('gravity="0 0 0"', 'solref=".02 .3"', 40.0, 1e-5),
        ('gravity="6 0 0"', 'solref=".1 1" solimp=".5 .8 .02"', 15.0, 1e-3),
        ('gravity="0 0 0" cone="elliptic"', 'solref=".004 1"', 80.0, 2e-4),
        ('gravity="9 0 0" integrator="implicitfast"', 'solref="-500 -5"', 5.0, 2e-4),
    ],
)
def test_a_run_that_bumps_into_a_contact_as_it_is_proves_nothing(
    option, geom, force, noise, tmp_path
):
    text = slide(geom=geom).replace('gravity="0 0 0"', option)
    path = write(tmp_path, text, "model.xml")
    run = pushed(text, "j", to_and_fro(force, 2.3), tmp_path, "run.csv", start=0.15, noise=noise)
    measured = read_measured(path, "j", [run])
    assert measured.barred == "" and any("left out there" in note for note in measured.notes)


@pytest.mark.parametrize(
    "changed",
    [{"free": "<freejoint/>"}, {"geom": 'condim="3" solref="-1 -1"'}],
    ids=["moved", "soft"],
)
def test_what_yields_bars_nothing(changed, tmp_path):
    path = write(tmp_path, slide(**changed), "model.xml")
    run = pushed(slide(at="5"), "j", to_and_fro(3, 2.0), tmp_path, "run.csv", start=0.4)
    assert read_measured(path, "j", [run]).barred == ""


def test_a_run_with_unknown_forces_proves_nothing(tmp_path):
    path = write(tmp_path, GATE, "model.xml")
    lines = swung(tmp_path).read_text().splitlines()
    lines[100] = lines[100].rpartition(",")[0] + ","
    (tmp_path / "gap.csv").write_text("\n".join(lines) + "\n")
    assert read_measured(path, "hinge", [tmp_path / "gap.csv"]).barred == ""


# --- generate
def bare(path, joint):
    found = context(path, joint)
    return found, Profile(joint=found.joint)


def test_a_behaviour_is_simulated_in_the_scene_that_blocks_it(tmp_path):
    path = write(tmp_path, DOOR.format(mass=4), "model.xml")
    found, profile = bare(path, "hinge")
    around = surroundings(path, "hinge")
    seen = behaviour(found, profile, around)
    assert not seen.opening.arrived
    assert seen.opening.at == pytest.approx(CORNER / 1.6, abs=0.01)
    assert "'leaf' touches 'drawer' from s = 0.39" in seen.opening.held_by
    *_, last = seen.let_go
    assert last.goes == "blocked" and last.start == (pytest.approx(0.4, abs=0.04), 1.0)
    assert behaviour(found, profile).opening.arrived  # by itself it would


def test_what_can_be_pushed_aside_blocks_nothing(tmp_path):
    path = write(tmp_path, slide(free="<freejoint/>", geom='mass=".2"'), "model.xml")
    found, profile = bare(path, "j")
    seen = behaviour(found, profile, surroundings(path, "j"))
    assert seen.opening.arrived and "post" in seen.touched


def test_the_joint_s_own_actuator_is_off_in_the_scene(tmp_path):
    motor = '<actuator><position joint="j" kp="1e4"/></actuator>'
    path = write(tmp_path, slide(more=motor), "model.xml")
    seen = behaviour(*bare(path, "j"), surroundings(path, "j"))
    assert seen.opening.at == pytest.approx(0.5, abs=0.01)


def test_generate_says_what_blocks_a_motion(tmp_path):
    path = write(tmp_path, DOOR.format(mass=4), "model.xml")
    made = generate(
        path, "hinge", tmp_path / "g", proposer="offline", rounds=1,
        describe="it stays wherever it is left",
    )  # fmt: skip
    (round,) = made.history.rounds
    unmet = "\n".join(round.unmet)
    assert re.search(r"cannot get it opened, stuck at s = 0\.39 .* 'leaf' touches 'drawer'", unmet)
    assert re.search(r"stays wherever it is left: no, let go at \d+ to \d+ % .* is blocked", unmet)
    assert "in the scene as it is: 'leaf' touches 'drawer'" in round.facts
    assert any("simulated in the scene as it is" in note for note in made.notes)
    assert "'leaf' touches 'drawer'" in (tmp_path / "g" / "history.json").read_text()
