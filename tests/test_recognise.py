"""What a joint is taken for: by names in many languages, by its shape, by a table of one's own."""

import json
import secrets
from pathlib import Path

import mujoco
import numpy as np
import pytest
from articulated import objects
from assets import asset
from joint_table import judge, made

from joda import context, generate, schema
from joda.errors import JodaError
from joda.proposal import Strength
from joda.propose import Answer, Task
from joda.propose.archetype import read_archetypes
from joda.propose.history import History
from joda.propose.naming import _vocabulary, concepts, said
from joda.propose.offline import Offline
from joda.propose.plausible import Force, forces
from joda.propose.recognise import recognise
from joda.propose.requirements import Requirement, read_requirements, state
from joda.scenes.model import find_joint
from joda.scenes.motion import settle
from joda.template import read_templates

MODELS = Path(__file__).parents[1] / "models"


# --- names
@pytest.mark.parametrize(
    ("name", "group", "concept"),
    [
        ("Kuehlschranktuer", "part", "door"),
        ("Kühlschranktür", "object", "refrigerator"),
        ("porte_micro_ondes", "part", "door"),
        ("cajonSuperior", "part", "drawer"),
        ("hingecabinet_left", "object", "cabinet"),
        ("StorageFurniture_45132", "object", "cabinet"),
        ("抽屉_2", "part", "drawer"),
        ("冷蔵庫", "object", "refrigerator"),
        ("drzwi_lodowki", "part", "door"),
        ("rotation_lid", "part", "lid"),
        ("interruttore_luce", "part", "switch"),
        ("link_0_knob", "part", "knob"),
    ],
)
def test_names_in_many_languages_and_conventions_are_understood(name, group, concept):
    assert concept in concepts([name], group)


@pytest.mark.parametrize(
    ("name", "group", "only"),
    [
        ("Kuehlschrank", "object", {"refrigerator"}),
        ("dishwasher_door", "object", {"dishwasher"}),
        ("Ventilator", "object", {"fan"}),
        ("Ventilator", "part", {"rotor"}),
        ("Schublade", "part", {"drawer"}),
        ("Drehknopf", "part", {"knob"}),
        ("Drehknopf_door", "part", {"knob", "door"}),
    ],
)
def test_a_word_within_a_longer_one_says_nothing(name, group, only):
    """A Kuehlschrank is no Schrank, a Schublade no blade, a Ventilator no Ventil."""
    assert concepts([name], group) == only


@pytest.mark.parametrize("group", ["part", "object"])
def test_no_word_speaks_of_two_concepts(group):
    words = [word for known in _vocabulary()[group].values() for word in known]
    assert len(words) == len(set(words)) > 50


@pytest.mark.parametrize(
    "name", ["link_0", "joint_3", "solid", "slide_rail", "base", "m", "left_steering_hinge_joint"]
)
def test_names_that_say_nothing_are_no_lids_and_no_doors(name):
    assert not concepts([name], "part") & {"lid", "door", "tap", "key"}


def test_what_is_to_latch_is_no_latch():
    assert "latch" in said("a latch", "part")
    assert "latch" not in said("It latches, and needs a push to latch.", "part")


# --- the answer
def test_the_answer_says_what_decided_how_sure_and_what_else_it_could_be():
    _, found = recognise(context(MODELS / "dishwasher.xml", "door"))
    assert found.title == "dishwasher door" and found.likely > 0.5
    assert "the object is called dishwasher" in found.describe()
    found = recognise(nameless("dishwasher", "door"))[1]
    told = [one.feature.split()[0] for one in found.decided]
    assert "covers" in told and "weight" in told
    assert found.title in ("dishwasher door", "oven door")
    assert sum(one.likely for one in found.others) <= 1 - found.likely + 0.05


def nameless(model, joint):
    found = context(MODELS / f"{model}.xml", joint)
    return found.model_copy(update={"names": (), "around": ()})


@pytest.mark.parametrize(
    ("model", "joint", "requirement"),
    [
        ("cabinet", "door", "opens_past"),
        ("drawer", "drawer", "closes_near"),
        ("knob", "knob", "clicks"),
        ("laptop", "lid", "stays_put"),
        ("lighter", "button", "closes_anywhere"),
        ("oven", "door", "stays_half"),
        ("refrigerator", "door", "held_shut"),
        ("switch", "rocker", "two_sides"),
    ],
)
def test_own_models_are_told_by_their_shape_alone(model, joint, requirement):
    assert requirement in recognise(nameless(model, joint))[0].requirements


@pytest.mark.parametrize(
    ("source", "file", "joint", "requirement"),
    [
        ("table", "", "base__drawer", "closes_near"),
        ("table", "", "base__slide", "stays_put"),
        ("table", "", "base__switch", "two_sides"),
        ("door", "", "latch_joint", "returns_to_middle"),
        ("drawer", "buttonbox.xml", "btnbox_joint", "closes_anywhere"),
        ("drawer", "coffeemachine.xml", "goal_slidey", "closes_anywhere"),
    ],
)
def test_other_peoples_are_told_by_their_shape_alone(source, file, joint, requirement):
    path = asset(source)
    found = context(path.with_name(file) if file else path, joint)
    bare = found.model_copy(update={"names": (), "around": ()})
    assert (
        requirement in recognise(bare)[0].requirements
        and requirement in recognise(found)[0].requirements
    )


def test_a_lever_on_a_stand_of_its_own_stays_where_it_is_put():
    path = asset("drawer").with_name("lever.xml")
    kind, found = recognise(context(path, "LeverAxis"))
    assert found.title == "control lever" and "stays_put" in kind.requirements


HALF = {
    "stays": {"stays_put", "stays_half", "clicks", "free"},
    "closes": {"closes_anywhere", "falls_shut"},
    "opens": {"opens_past"},
}


@pytest.mark.long
def test_objects_that_nobody_has_seen_are_told_by_their_shape_alone():
    """By what they do half-way; drawn anew at each run, a third of the bar for bad luck."""
    seed = secrets.randbelow(2**31)
    rows = list(made(seed, named=False, rounds=1))
    right = 0
    for row in rows:
        requirements = set(recognise(row.found)[0].requirements)
        expected = HALF.get(row.expected.get("half", ""), {"two_sides"})
        right += bool(requirements & expected)
    assert right >= 0.75 * len(rows), f"seed {seed}: {right} of {len(rows)}"


@pytest.mark.slow
def test_what_is_made_of_objects_is_what_is_expected_of_them():
    seed = secrets.randbelow(2**31)
    rows = {row.part: row for row in made(seed, named=True, rounds=1)}
    for part in ("dishwasher door", "rocker", "door lever"):
        result = judge(rows[part])
        assert all(result.met.values()), f"seed {seed}, {part}: {result.met}, {result.took}"


def test_an_expectation_can_fail():
    seed = 5
    row = next(row for row in made(seed, named=True, rounds=1) if row.part == "laptop lid")
    wrong = row._replace(expected={"half": "closes", "opens": "?", "force": (100, 200)})
    assert not any(judge(wrong).met.values())


def test_made_objects_have_one_joint_per_expectation_and_differ_by_seed():
    first, other = objects(1, 1), objects(2, 1)
    assert [one.category for one in first] == [one.category for one in other]
    assert first[0].joints[0].limits != other[0].joints[0].limits


# --- the table
OWN = """
[[archetype]]
title = "hinged widget"
evidence = "we made it"
joint = "hinge"
common = 30
requirements = ["stays_put"]
force = "room door"
effects = [
  { effect = "constant_friction_hinge", place = [0, 1], friction = "weak", reason = "rubs" },
]
shape.travel = [10, 200]
"""


def test_a_table_of_ones_own_goes_beside_templates(tmp_path):
    (tmp_path / "mine.toml").write_text(OWN)
    assert read_archetypes([tmp_path])[-1].title == "hinged widget"
    result = generate(
        MODELS / "laptop.xml", "lid", tmp_path / "out", proposer="offline",
        templates=[tmp_path], rounds=1,
    )  # fmt: skip
    round = History.read(tmp_path / "out" / "history.json").rounds[0]
    assert round.recognised is not None and round.recognised.title == "hinged widget"
    assert round.recognised.force.opening == (0.5, 22.2)
    assert result.history.rounds[0].proposal.joint_summary.motion_description.startswith("hinged")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("shape.travel = [10, 200]", "shape.tavel = 1", "shape.tavel is no feature; there are:"),
        ("shape.travel = [10, 200]", 'shape.travel = "far"', "shape.travel must be a number"),
        ("shape.travel = [10, 200]", "shape.travel = [9, 2]", "must be [least, most]"),
        ('["stays_put"]', '["flies"]', "'flies' is none of"),
        ('"room door"', '"barn door"', "'barn door' is none of"),
        ("[[archetype]]", "[[archetype]", ": is no TOML: "),
    ],
)
def test_a_mistake_in_a_table_is_one_sentence(tmp_path, old, new, said):
    (tmp_path / "mine.toml").write_text(OWN.replace(old, new))
    with pytest.raises(JodaError, match=r"mine\.toml") as raised:
        read_archetypes([tmp_path])
    assert said in str(raised.value) and "\n" not in str(raised.value)


def test_a_force_without_a_source_is_an_estimate():
    with pytest.raises(ValueError, match="a source is needed, but for an estimate"):
        Force(name="lid", opening=(1.0, 2.0), basis="standard", source="")


def test_the_format_of_the_table_is_a_schema():
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.Draft202012Validator.check_schema(schema("archetype"))
    assert "evidence" in json.dumps(schema("archetype"))


def test_every_archetype_has_its_force_and_effects_that_there_are():
    names = read_templates()
    for one in read_archetypes():
        assert one.evidence and (one.force or one.unknown or one.driven)
        for part in one.effects:
            filled = part.effect.format(
                closed="low_end", open="high_end", opening="positive", closing="negative"
            )
            assert filled == "detents" or filled in names


def test_every_force_has_a_source_or_is_called_an_estimate():
    assert {row.basis for row in forces().values()} == {"standard", "measured", "estimate"}
    for row in forces().values():
        assert 0 < row.opening[0] < row.opening[1] <= 100
        assert bool(row.source) == (row.basis != "estimate")


def test_the_page_has_the_table_of_forces():
    page = (MODELS.parent / "docs" / "generation.md").read_text()
    for row in forces().values():
        least, most = row.opening
        assert f"| {row.name} | {least:g} to {most:g} | {row.source or 'estimate'} |" in page


# --- forces
@pytest.mark.parametrize(
    ("said", "least", "most"),
    [
        ("It takes 8 to 66.7 N at the handle to open.", 8, 66.7),
        ("Opening it needs at most 22 N.", 0, 22),
        ("It opens with about 20 newtons.", 15, 25),
    ],
)
def test_a_force_at_the_handle_can_be_said(said, least, most):
    requirement = next(
        requirement for requirement in read_requirements(said) if requirement.name == "takes"
    )
    assert (requirement.number, requirement.most) == pytest.approx((least, most))
    assert read_requirements(state([Requirement("takes", least, most)])) == [
        Requirement("takes", least, most)
    ]


def test_a_wish_for_a_force_comes_true(tmp_path):
    done = generate(
        MODELS / "refrigerator.xml", "door", tmp_path / "out", proposer="offline",
        describe="It takes 28 to 34 N at the handle to open.",
    )  # fmt: skip
    last = done.history.rounds[-1]
    arm = context(MODELS / "refrigerator.xml", "door").lever_arm
    assert not last.unmet and 28 <= last.behaviour.opening.steady / arm <= 34


def test_somebody_elses_implausible_force_is_doubted(tmp_path):
    task = Task(context(MODELS / "refrigerator.xml", "door"), read_templates())
    proposal = Offline().propose(task, []).proposal
    first = proposal.effect_proposals[0]
    far = first.model_copy(update={"refineFactor": first.refineFactor.model_copy(
        update={"conservative": 5.0})})  # fmt: skip
    proposal = proposal.model_copy(update={"effect_proposals": (far,)})
    (tmp_path / "p.json").write_text(proposal.to_json())
    model = MODELS / "refrigerator.xml"
    done = generate(model, "door", tmp_path / "out", proposer=tmp_path / "p.json")
    (note,) = done.history.rounds[0].notes
    assert "looks like a refrigerator door" in note and "16 CFR 1750" in note


@pytest.mark.parametrize(("factor", "told"), [(1, False), (5, True), (0.001, True)])
def test_a_scale_that_the_names_belie_is_told(tmp_path, factor, told):
    """PartNet-Mobility's own files are scaled to unit size: a laptop's lid of 1.7 m."""

    def size(*lengths):
        return " ".join(f"{factor * length:g}" for length in lengths)

    path = tmp_path / "a.xml"
    path.write_text(
        f'<mujoco model="laptop"><worldbody><geom type="box" size="{size(0.12, 0.17, 0.01)}"/>'
        f'<body name="lid" pos="{size(-0.12, 0, 0.02)}"><joint axis="0 -1 0" range="0 130"/>'
        f'<geom type="box" size="{size(0.12, 0.17, 0.004)}" pos="{size(0.12, 0, 0)}" mass="0.5"/>'
        "</body></worldbody></mujoco>"
    )
    task = Task(context(path, "#0"), read_templates())
    notes = Offline().propose(task, []).notes
    assert len(notes) == told
    if told:
        assert "Names say laptop lid" in notes[0] and "mend the model's scale" in notes[0]


def test_what_a_part_is_on_is_told_by_the_nearest_name(tmp_path):
    """A knob of an oven that stands in a kitchen of cabinets is the oven's."""
    path = tmp_path / "kitchen.xml"
    path.write_text(
        '<mujoco model="kitchen_cabinets"><worldbody><body name="cupboards"><geom size=".5"/>'
        '<body name="oven"><geom type="box" size=".3 .3 .3"/><body name="k1" pos="0 -.32 .2">'
        '<joint name="j" axis="0 1 0" range="0 270"/><geom type="cylinder" size=".02 .02" '
        'euler="90 0 0"/></body></body></body></worldbody></mujoco>'
    )
    found = recognise(context(path, "j"))[1]
    assert "the object is called oven" in [one.feature for one in found.decided]
    assert found.title == "selector knob"


SINK = (
    '<mujoco model="{name}"><compiler angle="radian"/><worldbody><body name="{name}">'
    '<geom type="box" size=".4 .3 .02"/><body name="handle" pos=".1 .2 .1">'
    '<joint name="j" axis="0 1 0" range="0 .52"/><geom type="box" size=".1 .02 .02" pos=".09 0 0"/>'
    "</body></body></worldbody></mujoco>"
)


def test_the_handle_of_a_sink_is_a_taps_and_that_of_a_stand_is_none(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(SINK.format(name="kitchen_sink"))
    kind, found = recognise(context(path, "j"))
    assert found.title == "handle of a tap" and found.force.opening == (1, 22.2)
    assert kind.requirements == ("stays_put",)
    path.write_text(SINK.format(name="throttle"))
    assert "tap" not in recognise(context(path, "j"))[1].title


DOOR = (
    '<mujoco><compiler angle="radian"/><worldbody><body name="frame">'
    '<geom type="box" size=".02 .05 .36" pos="-.5 0 0"/><geom type="box" size=".02 .05 .36" '
    'pos=".5 0 0"/><body name="door" pos="-.48 0 0"><joint name="j" axis="0 0 1" range="0 1.57"/>'
    '<geom type="box" size=".3 .03 .25" pos=".3 0 0"/><body name="latch" pos=".5 0 0">'
    '<joint name="k" axis="0 1 0" range="0 1.8"/><geom type="box" size=".2 .02 .02"/>'
    '<geom type="cylinder" size=".02 .16" euler="1.57 0 0"/></body></body></body></worldbody>'
    "</mujoco>"
)


def test_the_latch_of_a_door_is_no_throttle(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(DOOR)
    assert recognise(context(path, "k"))[1].title != "control lever"


def test_a_spout_is_no_door(tmp_path):
    """What turns on an upright axis at the edge of an object, and is no plate, covers nothing."""
    path = tmp_path / "a.xml"
    path.write_text(
        '<mujoco><compiler angle="radian"/><worldbody><body><geom type="box" size=".5 .35 .3"/>'
        '<body pos="0 .3 .3"><joint name="j" axis="0 0 1" range="0 3.1"/>'
        '<geom type="box" size=".03 .03 .2" pos="0 0 .2"/>'
        '<geom type="box" size=".2 .03 .03" pos=".2 0 .4"/></body></body></worldbody></mujoco>'
    )
    assert recognise(context(path, "j"))[1].title == "spout"


# --- robots
ROBOT = (
    '<mujoco><compiler angle="radian"/><worldbody>{bodies}</worldbody>'
    "<actuator>{motor}</actuator><equality>{held}</equality></mujoco>"
)


def links(count, name="link"):
    """So many links in a row, as a body."""
    out = ""
    for k in reversed(range(count)):
        out = (
            f'<body name="{name}_{k}" pos=".25 0 0"><joint name="{name}{k}" axis="0 1 0" '
            f'range="-1.5 1.5"/><geom type="box" size=".12 .03 .03" pos=".12 0 0"/>{out}</body>'
        )
    return out


@pytest.mark.parametrize(
    ("count", "joint", "motor", "held", "robot"),
    [
        (6, "a2", "", "", True),  # six in a row, as a URDF has them
        (3, "a1", "", "", False),  # a lamp
        (3, "a2", '<motor joint="a0"/>', "", True),  # what a motor carries
        (3, "a0", '<motor joint="a2"/>', "", True),  # what carries a motor
        (3, "a1", '<motor joint="b0"/>', "", False),  # another's motor
        (3, "a0", '<motor joint="b0"/>', '<connect body1="a_2" body2="b_0" anchor="0 0 0"/>', True),
        (3, "a1", '<motor joint="b0"/>', '<joint joint1="a1" joint2="b0"/>', True),
        (3, "a1", "", '<joint joint1="a1" joint2="b0"/>', False),
        (3, "a1", '<motor joint="b0"/>', '<joint joint1="a1" joint2="b0" active="false"/>', False),
    ],
)
def test_a_robots_joint_is_told_whichever_of_its_joints_the_motors_are_on(
    tmp_path, count, joint, motor, held, robot
):
    path = tmp_path / "a.xml"
    foot = '<geom type="box" size=".1 .1 .1" pos="0 0 -.2"/>'
    bodies = "".join(
        f'<body pos="0 {y} 0">{foot}{links(many, name)}</body>'
        for y, many, name in ((0, count, "a"), (1, 1, "b"))
    )
    path.write_text(ROBOT.format(bodies=bodies, motor=motor, held=held))
    found = context(path, joint)
    assert found.shape.machine is robot
    title = recognise(found)[1].title
    assert (title in ("robot joint", "joint of an unknown kind")) is robot


# --- how fast it shuts, where it holds
@pytest.mark.parametrize(
    ("said", "requirement"),
    [
        ("It shuts with at most 0.4 m/s at the handle.", Requirement("arrives", most=0.4)),
        (
            "It closes by itself and arrives with less than 1.5 m/s.",
            Requirement("arrives", most=1.5),
        ),
        ("It holds between 20 and 110 degrees.", Requirement("holds_between", 20, 110)),
        (
            "The lid stays where it is from 15 to 62.5 degrees.",
            Requirement("holds_between", 15, 62.5),
        ),
    ],
)
def test_a_speed_and_angles_can_be_said(said, requirement):
    assert requirement in read_requirements(said)
    assert read_requirements(state([requirement])) == [requirement]


BOX = """<mujoco model="{called}"><compiler angle="radian"/><worldbody>
  <geom type="box" size="{half} .25 .02" pos="{half} 0 -.4"/>
  <geom type="box" size="{half} .02 .2" pos="{half} .23 -.2"/>
  <geom type="box" size="{half} .02 .2" pos="{half} -.23 -.2"/>
  <geom type="box" size=".02 .25 .2" pos=".02 0 -.2"/>
  <geom type="box" size=".02 .25 .2" pos="{front} 0 -.2"/>
  <body name="lid"><joint name="lid" axis="0 -1 0" range="0 {widest}" pos="0 0 .02"/>
    <geom type="box" size="{half} .25 .015" pos="{half} 0 .017" mass="{mass}"/></body>
</worldbody></mujoco>"""


def chest(folder, called):
    drawn = secrets.SystemRandom()
    half = drawn.uniform(0.2, 0.3)
    mass = drawn.uniform(1.5, 3.4)  # what holds a heavier lid, a hand can hardly open
    numbers = {"half": half, "front": 2 * half - 0.02, "mass": mass}
    path = folder / f"{called}.xml"
    path.write_text(BOX.format(called=called, widest=drawn.uniform(1.4, 1.9), **numbers))
    return path


def test_a_toy_chests_lid_holds_between_the_standards_angles(tmp_path):
    """Nothing of it is asked of the simulation's own sentence: it is let go here."""
    path = chest(tmp_path, "toybox")
    last = generate(path, "lid", tmp_path / "toy", proposer="offline").history.rounds[-1]
    assert last.recognised.title == "toy chest lid" and not last.unmet
    scene = mujoco.MjModel.from_xml_path(str(tmp_path / "toy" / "scene.xml"))
    joint = find_joint(scene, "lid")
    for angle in (12, 35, 58):
        rest = settle(scene, joint, np.radians(angle), 10).position[-1]
        assert np.degrees(rest) == pytest.approx(angle, abs=1.3)  # 12.7 mm of 0.56 m
    last = generate(chest(tmp_path, "box"), "lid", tmp_path / "box", proposer="offline")
    other = last.history.rounds[-1]
    assert "falls shut" in " ".join(other.met) and other.recognised.force.shuts.most == 3.5


@pytest.mark.slow
def test_a_door_that_would_slam_is_slowed(tmp_path):
    """One that is to shut more slowly than 0.16 m/s may come to rest before: then that is told."""
    limit = secrets.SystemRandom().uniform(0.1, 0.3)
    said = f"It goes back by itself from anywhere; it shuts with at most {limit:.2f} m/s."
    out = tmp_path / "out"
    done = generate(MODELS / "refrigerator.xml", "door", out, proposer="offline", describe=said)
    last = done.history.rounds[-1]
    found = context(MODELS / "refrigerator.xml", "door")
    if limit < 0.165 and last.unmet:
        assert all("settles" in one or "m/s" in one for one in last.unmet)
        return
    assert not last.unmet and last.behaviour.fastest.speed * found.lever_arm <= limit + 0.005
    assert f"It shuts with at most {limit:.2g} m/s at the handle." in last.met


class Slamming:
    """Proposes nothing but a strong spring."""

    name = "slamming"

    def propose(self, task, turns):
        if turns:
            return Answer(None)
        first = Offline().propose(task, ()).proposal
        spring = first.effect_proposals[0].model_copy(
            update={
                "effect_name": "spring_return_to_low_end",
                "start_ratio": 0.0,
                "end_ratio": 1.0,
                "strength": Strength(conservative="strong"),
            }
        )
        update = {"effect_proposals": (spring,), "whole_motion_descrptn": "It closes."}
        return Answer(first.model_copy(update=update))


@pytest.mark.slow
def test_what_somebody_proposes_is_held_against_real_joints(tmp_path):
    """A laptop's lid that a spring slams shut: it should hold, and such lids take less."""
    done = generate(MODELS / "laptop.xml", "lid", tmp_path / "lid", proposer=Slamming())
    told = " ".join(done.history.rounds[-1].notes)
    assert "which holds between 20 and 110 degrees (an estimate), but let go at" in told
    done = generate(MODELS / "refrigerator.xml", "door", tmp_path / "door", proposer=Slamming())
    told = " ".join(done.history.rounds[-1].notes)
    assert "which shuts with at most 0.6 m/s at the handle (an estimate), but it arrives" in told


def test_the_page_has_the_table_of_speeds_and_angles():
    page = (MODELS.parent / "docs" / "generation.md").read_text()
    for row in forces().values():
        if row.shuts:
            told = row.shuts.source or "estimate"
            assert f"| {row.name} | shuts with at most {row.shuts.most:g} m/s | {told} |" in page
        if row.holds:
            a, b = row.holds.between
            told = row.holds.source or "estimate"
            assert f"| {row.name} | holds between {a:g} and {b:g} degrees | {told} |" in page
