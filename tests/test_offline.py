"""The proposer by rules, in its loop with the simulation: every joint ends with its wishes met."""

from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from assets import NAMES, asset
from scenes import write

from joda import compile, context
from joda.field import evaluate
from joda.interaction.behaviour import Behaviour, behaviour
from joda.proposal import Proposal
from joda.propose import Task, Turn
from joda.propose.checks import Seen
from joda.propose.offline import Offline
from joda.propose.recognise import recognise
from joda.propose.requirements import REQUIREMENTS, Requirement, read_requirements, unmet
from joda.scenes.context import Context
from joda.scenes.model import joint_name, joint_type, load_model
from joda.template import read_templates

MODELS = Path(__file__).parents[1] / "models"
OWN = {
    "cabinet": ("door", "flap that its weight opens"),
    "dishwasher": ("door", "dishwasher door"),
    "drawer": ("drawer", "drawer"),
    "knob": ("knob", "selector knob"),
    "laptop": ("lid", "laptop lid"),
    "lighter": ("button", "lighter button"),
    "microwave": ("door", "microwave door"),
    "oven": ("door", "oven door"),
    "refrigerator": ("door", "refrigerator door"),
    "switch": ("rocker", "switch"),
}
GRAVITY = ("cabinet", "dishwasher", "laptop", "lighter", "oven")
KEYS = ("", "1", "two", "three", "4")
ROUNDS = 3
each = pytest.mark.parametrize("name", OWN)


class Loop(NamedTuple):
    """A finished loop: the joint, its rounds, and whether the proposer called it complete."""

    context: Context
    turns: list[Turn]
    complete: bool

    @property
    def last(self) -> Turn:
        return self.turns[-1]


def turn(found: Context, proposal: Proposal, key: str = "", complaint: str = "") -> Turn:
    """What the proposer is shown of a proposal."""
    profile = compile(proposal, found, key=key)
    behaved = behaviour(found, profile)
    lacking = unmet(read_requirements(proposal.whole_motion_descrptn), behaved, found)
    facts = behaved.describe(found)
    return Turn(proposal, profile, behaved, bytes, facts, list(lacking.values()), complaint)


@cache
def loop(path: Path, joint: str, description: str = "", key: str = "") -> Loop:
    """As `joda generate` does it."""
    return loop_of(context(path, joint), description, key)


def loop_of(found: Context, description: str = "", key: str = "") -> Loop:
    task, turns = Task(found, read_templates(), description=description), []
    proposer = Offline(key)
    for _ in range(ROUNDS + 1):
        answer = proposer.propose(task, turns)
        assert answer.usage.requests == 0
        if answer.proposal is None:
            return Loop(found, turns, True)
        turns.append(turn(found, answer.proposal, key))
    return Loop(found, turns, False)


def own(name: str, description: str = "", key: str = "") -> Loop:
    return loop(MODELS / f"{name}.xml", OWN[name][0], description, key)


def joints(path: Path) -> list[str]:
    model = load_model(path)
    every = range(model.njnt)
    return [joint_name(model, j) for j in every if joint_type(model, j) in ("hinge", "slide")]


def does(found: Context, behaved: Behaviour, *requirements: str, number: int = 0) -> None:
    """Asserts that the joint was simulated to do these."""
    assert (
        unmet([Requirement(requirement, number) for requirement in requirements], behaved, found)
        == {}
    )


def good(done: Loop) -> None:
    assert done.complete and len(done.turns) <= ROUNDS
    assert done.last.unmet == []
    assert done.last.behaviour.opening.arrived and done.last.behaviour.closing.arrived


@pytest.mark.sweep(8)
@pytest.mark.parametrize("key", KEYS)
@each
def test_every_own_model_ends_with_its_wishes_met_whatever_is_drawn(name, key):
    done = own(name, key=key)
    good(done)
    assert read_requirements(done.last.proposal.whole_motion_descrptn)


@pytest.mark.sweep(2)
@pytest.mark.parametrize("name", NAMES)
def test_every_joint_of_other_peoples_scenes_ends_with_its_wishes_met(name):
    path = asset(name)
    for joint in joints(path):
        good(loop(path, joint))


@pytest.mark.long
def test_joints_under_gravity_need_two_rounds_on_average():
    rounds = [len(own(name, key=key).turns) for name in GRAVITY for key in KEYS]
    assert sum(rounds) / len(rounds) <= 2.2


# --- what it takes a joint for
def kind(path: Path, joint: str) -> str:
    return recognise(context(path, joint))[1].title


@each
def test_an_own_model_is_recognised_whatever_its_file_is_called(name, tmp_path):
    joint, title = OWN[name]
    assert kind(MODELS / f"{name}.xml", joint) == title
    renamed = tmp_path / "a.xml"
    renamed.write_bytes((MODELS / f"{name}.xml").read_bytes())
    assert kind(renamed, joint) == title


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "joint", "title"),
    [
        ("microwave", "micro0joint", "microwave door"),
        ("cabinet", "top_level", "drawer"),
        ("cabinet", "bottom_level", "drawer"),
        ("table", "base__drawer", "drawer"),
        ("table", "base__button", "push button"),
        ("table", "base__switch", "slide switch"),
        ("table", "base__slide", "sliding door"),
        ("kitchen", "knob_Joint_1", "selector knob"),
        ("kitchen", "knob_Joint_4", "selector knob"),
        ("kitchen", "light_switch", "switch"),
        ("kitchen", "slide_cabinet", "sliding door"),
        ("kitchen", "left_hinge_cabinet", "cabinet door"),
        ("kitchen", "right_hinge_cabinet", "cabinet door"),
        ("kitchen", "microwave", "microwave door"),
        ("kitchen", "robot:panda0_joint2", "robot joint"),
        ("kitchen", "robot:panda0_finger_joint1", "robot joint"),
        ("drawer", "goal_slidey", "drawer"),
        ("door", "hinge", "door"),
        ("door", "latch_joint", "handle that springs back to its middle"),
    ],
)
def test_joints_of_other_peoples_scenes_are_recognised(name, joint, title):
    assert kind(asset(name), joint) == title


PLAIN = """
<mujoco model="{model}"><compiler angle="radian"/><worldbody><body name="{body}">
  <joint name="{joint}" type="{type}" axis="{axis}" range="0 {span}"/>
  <geom type="box" size=".3 .02 .4" pos=".3 0 0" mass="3"/></body></worldbody></mujoco>"""


def plain(folder, model="m", body="b", joint="j", type="hinge", axis="0 0 1", span=1.6) -> Context:
    path = folder / "plain.xml"
    text = PLAIN.format(model=model, body=body, joint=joint, type=type, axis=axis, span=span)
    path.write_text(text)
    return context(path, joint)


def test_the_same_part_is_another_kind_on_another_object(tmp_path):
    titles = {
        model: recognise(plain(tmp_path, model, "door"))[0].title
        for model in ("fridge", "microwave", "wardrobe", "m")
    }
    assert titles == {
        "fridge": "refrigerator door",
        "microwave": "microwave door",
        "wardrobe": "cabinet door",
        "m": "cabinet door",  # by its size
    }


KEYS_IN_A_ROW = """<mujoco model="{model}"><worldbody><body name="case">
  <geom type="box" size=".5 .1 .05" pos=".5 -.1 -.06"/>{keys}</body></worldbody></mujoco>"""
KEY_ON_A_HINGE = """<body name="{name}{k}" pos="{x} 0 0">
  <joint name="j{k}" axis="1 0 0" range="-5 0"/>
  <geom type="box" size=".011 .075 .008" pos="0 .075 0" mass=".02"/></body>"""


def test_keys_of_an_instrument_take_a_keys_force_and_come_back(tmp_path):
    keys = "".join(KEY_ON_A_HINGE.format(name="key_", k=k, x=0.03 + 0.024 * k) for k in range(12))
    path = write(tmp_path, KEYS_IN_A_ROW.format(model="piano", keys=keys))
    found = context(path, "j4")
    assert recognise(found)[0].title == "key on a hinge"
    done = loop_of(found)
    good(done)
    assert 0.25 <= done.last.behaviour.opening.steady / found.lever_arm <= 1.5


STICK = """<mujoco model="console"><worldbody><body name="base"><geom type="box" size=".1 .1 .03"/>
  <body name="joystick" pos="0 0 .03"><joint name="j" axis="1 0 0" range="-30 30"/>
  <geom type="capsule" size=".012" fromto="0 0 0 0 0 .12" mass=".08"/></body></body></worldbody>
</mujoco>"""


def test_a_joystick_comes_back_to_its_middle(tmp_path):
    found = context(write(tmp_path, STICK), "j")
    assert recognise(found)[0].title == "joystick"
    good(loop_of(found))


BOTH_WAYS = """<mujoco model="{object}"><worldbody><body name="base">{base}
  <body name="{part}" pos="{at}"><joint name="j" {joint}/>{moves}</body>
</body></worldbody></mujoco>"""
FRAME = '<geom type="box" size=".03 .05 1" pos="0 {} 1"/>'


@pytest.mark.parametrize(
    ("title", "parts"),
    [
        (
            "door that swings both ways",
            {
                "object": "saloon", "part": "leaf", "at": "0 -.4 1",
                "base": FRAME.format(-0.47) + FRAME.format(0.47),
                "joint": 'axis="0 0 1" range="-80 80"',
                "moves": '<geom type="box" size=".014 .38 .5" pos="0 .39 0" mass="12"/>',
            },
        ),
        (
            "flap that swings both ways",
            {
                "object": "cats", "part": "flap", "at": "0 0 .3",
                "base": FRAME.format(-0.18) + FRAME.format(0.18),
                "joint": 'axis="0 1 0" range="-70 70"',
                "moves": '<geom type="box" size=".003 .11 .13" pos="0 0 -.132" mass=".2"/>',
            },
        ),
        (
            "hanging pedal",
            {
                "object": "truck", "part": "clutch_pedal", "at": ".06 0 .5",
                "base": '<geom type="box" size=".02 .3 .3" pos="0 0 .3"/>',
                "joint": 'axis="0 1 0" range="0 20"',
                "moves": '<geom type="box" size=".01 .01 .16" pos="0 0 -.17" mass=".5"/>'
                '<geom type="box" size=".006 .04 .03" pos=".016 0 -.32" mass=".1"/>',
            },
        ),
        (
            "plunger of a syringe",
            {
                "object": "syringe", "part": "plunger", "at": "0 0 .12",
                "base": '<geom type="box" size=".002 .01 .05" pos=".012 0 .05"/>'
                '<geom type="box" size=".002 .01 .05" pos="-.012 0 .05"/>',
                "joint": 'type="slide" axis="0 0 -1" range="0 .06"',
                "moves": '<geom type="cylinder" size=".005 .04" pos="0 0 .02" mass=".005"/>'
                '<geom type="cylinder" size=".009 .002" pos="0 0 .06" mass=".002"/>',
            },
        ),
        (
            "wheel that rolls",
            {
                "object": "bicycle", "part": "rear_wheel", "at": "0 0 .34",
                "base": '<geom type="box" size=".01 .01 .25" pos="0 .06 .6"/>',
                "joint": 'axis="0 1 0" range="-720 720"',
                "moves": '<geom type="cylinder" size=".34 .02" zaxis="0 1 0" mass="1.5"/>',
            },
        ),
    ],
)  # fmt: skip
def test_what_goes_both_ways_hangs_or_rolls_does_as_such_things_do(tmp_path, title, parts):
    found = context(write(tmp_path, BOTH_WAYS.format(**parts)), "j")
    assert recognise(found)[0].title == title
    good(loop_of(found))


KNOB = """<mujoco model="house"><worldbody><body name="frame">
  <geom type="box" size=".05 .05 1.05" pos="0 -.52 1.05"/>
  <body name="door" pos="0 -.46 1"><joint name="hinge" axis="0 0 1" range="0 100"/>
    <geom type="box" size=".02 .44 1" pos="0 .45 0" mass="20"/>
    <body name="knob" pos=".03 .83 0"><joint name="j" axis="1 0 0" range="-50 50"/>
      <geom type="cylinder" size=".01 .02" zaxis="1 0 0" pos=".015 0 0" mass=".05"/>
      <geom type="sphere" size=".028" pos=".055 0 0" mass=".2"/></body></body>
</body></worldbody></mujoco>"""


@pytest.mark.parametrize("name", ["knob", "link_2"])
def test_a_doors_round_knob_comes_back_to_its_middle(tmp_path, name):
    found = context(write(tmp_path, KNOB.replace('"knob"', f'"{name}"')), "j")
    assert "springs back to its middle" in recognise(found)[0].title
    good(loop_of(found))


STAND = '<geom type="box" size=".06 .05 .02" pos="0 .08 0"/>'

NOTHING = """
<mujoco><compiler angle="radian"/><worldbody><body>
  <joint name="j" axis="1 0 0" range="0 1.6"/><geom type="sphere" size=".2" mass="3"/>
</body></worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("kind", "object", "part", "joint", "moves"),
    [
        ("handle that springs back", "door", "door_handle", 'axis="0 1 0" range="0 45"',
         '<geom type="box" size=".06 .008 .01" pos="-.055 -.05 0" mass=".1"/>'),
        ("joystick", "joystick", "stick", 'axis="0 1 0" range="-25 25"',
         '<geom type="capsule" size=".012" fromto="0 0 0 0 0 .14" mass=".08"/>'),
        ("wheel that rolls", "shopping_cart", "cart_wheel", 'axis="0 1 0" range="-360 360"',
         '<geom type="cylinder" size=".06 .015" zaxis="0 1 0" mass=".3"/>'),
        ("hanging pedal", "cockpit", "accelerator", 'axis="0 1 0" range="0 25"',
         '<geom type="box" size=".006 .01 .1" pos="0 0 -.1" mass=".3"/>'),
    ],
)  # fmt: skip
def test_what_names_and_shape_say_together(tmp_path, kind, object, part, joint, moves):
    base = '<geom type="box" size=".4 .02 1" pos=".33 .03 0"/>' if object == "door" else STAND
    text = BOTH_WAYS.format(
        object=object, part=part, at="0 0 0.06", base=base, joint=joint, moves=moves
    )
    found = context(write(tmp_path, text), "j")
    assert recognise(found)[0].title == kind


def test_a_joint_that_nothing_tells_of_has_low_confidence_and_can_be_moved(tmp_path):
    (tmp_path / "a.xml").write_text(NOTHING)
    found = context(tmp_path / "a.xml", "j")
    kind, seen = recognise(found)
    assert kind.unknown and seen.force is None
    done = loop_of(found)
    good(done)
    assert {effect.confidence for effect in done.last.proposal.effect_proposals} == {seen.likely}
    assert recognise(plain(tmp_path, "fridge", "door"))[1].likely > 0.5


def test_the_users_words_name_the_kind(tmp_path):
    assert recognise(plain(tmp_path), "the door of a fridge")[0].title == "refrigerator door"


def test_what_latches_is_not_taken_for_a_latch(tmp_path):
    found = context(MODELS / "knob.xml", "knob")
    assert recognise(found, "It latches shut and needs a push to latch.")[0].title == OWN["knob"][1]
    assert recognise(plain(tmp_path), "a latch")[0].title == "handle that springs back"


# --- what the user says comes true
@pytest.mark.sweep(8)
@pytest.mark.parametrize(
    ("name", "description", "requirements"),
    [
        ("refrigerator", "It closes softly by itself from anywhere.", "closes_anywhere soft"),
        ("refrigerator", "The door does not close by itself.", "left_open held_shut"),
        ("refrigerator", "It stays wide open.", "stays_open held_shut"),
        ("refrigerator", "It latches shut.", "latched"),
        ("cabinet", "stays wherever it is left", "stays_put"),
        ("cabinet", "Goes back by itself from anywhere, never slams.", "closes_anywhere soft"),
        ("cabinet", "holds half-way open", "stays_half"),
        ("drawer", "a soft-close drawer", "soft closes_near held_shut"),
        ("drawer", "It closes by itself.", "closes_anywhere"),
        ("drawer", "It latches shut and needs a push to latch.", "latched"),
        ("drawer", "does not close by itself", "left_open"),
        ("microwave", "It closes by itself when nearly closed and stays wide open.",
         "closes_near stays_open"),
        ("microwave", "It does not latch.", "stays_put"),
        ("microwave", "The door does not close by itself.", "left_open latched"),
        ("dishwasher", "stays wherever it is left", "stays_put"),
        ("laptop", "It does not close by itself.", "left_open stays_put"),
        ("oven", "It stays wherever it is left.", "stays_put"),
        ("dishwasher", "It falls open past half-way.", "opens_past held_shut"),
        ("lighter", "The button goes back by itself from anywhere.", "closes_anywhere"),
        ("switch", "The rocker springs back to its middle.", "returns_to_middle"),
        ("knob", "It returns to the middle when let go.", "returns_to_middle"),
        ("knob", "It turns smoothly and has no clicks.", ""),
    ],
)  # fmt: skip
def test_what_the_user_says_of_a_joint_comes_true(name, description, requirements):
    done = own(name, description)
    good(done)
    does(done.context, done.last.behaviour, *requirements.split())


@pytest.mark.sweep(6)
@pytest.mark.parametrize("key", KEYS)
@pytest.mark.parametrize("count", [2, 3, 5, 9])
def test_a_knob_clicks_into_as_many_positions_as_are_said(count, key):
    done = own("knob", f"It clicks into {count} positions.", key)
    good(done)
    behaved = done.last.behaviour
    does(done.context, behaved, "clicks", number=count)
    rests = np.array([stretch.end for stretch in behaved.let_go])
    places = np.linspace(0, 1, count)
    nearest = np.abs(rests[:, None] - places).argmin(axis=1)
    assert set(nearest) == set(range(count))
    moved = [stretch.goes != "stays" for stretch in behaved.let_go]
    assert np.abs(rests - places[nearest])[moved].max() < 0.13 / (count - 1)


def test_what_the_user_denies_is_not_proposed():
    usual, without = own("knob"), own("knob", "It has no clicks.")
    assert usual.last.behaviour.settles_at and not without.last.behaviour.settles_at
    names = [effect.effect_name for effect in without.last.proposal.effect_proposals]
    assert not any("detent" in name or "spring" in name for name in names)
    closing = Seen(own("refrigerator").last.behaviour, own("refrigerator").context)
    assert REQUIREMENTS["left_open"].check(closing) != ""


def test_a_wish_leaves_what_it_does_not_touch():
    """A fridge that stays wide open still closes when nearly closed and stays where it is left."""
    done = own("refrigerator", "It stays fully open.")
    does(done.context, done.last.behaviour, "closes_near", "held_shut", "stays_put", "stays_open")


@pytest.mark.sweep(2)
@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize(("name", "degrees"), [("refrigerator", 20), ("microwave", 50)])
def test_a_door_closes_from_the_angle_that_is_said(name, degrees, mirror):
    found = context(MODELS / f"{name}.xml", OWN[name][0])
    found = reflected(found) if mirror else found
    done = loop_of(found, f"It closes by itself from about {degrees} degrees on.")
    good(done)
    does(found, done.last.behaviour, "closes_from", number=degrees)
    names = [turned(e.effect_name) if mirror else e.effect_name for e in effects(done)]
    assert names.count("magnetic_return_to_low_end") == 1, "instead of what shuts it usually"


@pytest.mark.sweep(2)
@pytest.mark.parametrize("key", KEYS)
def test_a_catch_gives_way_and_the_door_moves_on_freely(key):
    said = "A catch keeps it shut, past it the door moves on with hardly any resistance."
    done = own("refrigerator", said, key)
    good(done)
    does(done.context, done.last.behaviour, "caught", "free", "held_shut")
    low, high = (e for e in effects(done) if "return" in e.effect_name)
    assert low.end_ratio == high.start_ratio
    pull = -evaluate(done.last.profile.channels.conservative, np.linspace(0, 0.1, 201))[0]
    assert 0.02 < pull.argmax() * 0.1 / 200 < 0.04, "it rises to where it gives way"
    assert np.abs(np.diff(pull)).max() < 0.15 * pull.max(), "without a jump"


def effects(done: Loop):
    return done.last.proposal.effect_proposals


# --- the answer is a function of the question
@pytest.mark.sweep(3)
@each
def test_the_same_question_gets_the_same_bytes(name):
    path, joint = MODELS / f"{name}.xml", OWN[name][0]
    again = loop_of(context(path, joint))
    assert [t.proposal.to_json() for t in again.turns] == [
        t.proposal.to_json() for t in own(name).turns
    ]


def reflected(found: Context) -> Context:
    """The same joint with q turned round: closed at the high end."""
    lo, hi = found.joint.range
    ends = {"low_end": "high_end", "high_end": "low_end"}
    return found.model_copy(
        update={
            "joint": found.joint.model_copy(update={"range": (-hi, -lo)}),
            "positions": tuple(-q for q in reversed(found.positions)),
            "inertia": tuple(reversed(found.inertia)),
            "gravity_force": tuple(-force for force in reversed(found.gravity_force)),
            "closed_end": ends.get(found.closed_end, found.closed_end),
            "upper_end": ends.get(found.upper_end, found.upper_end),
            "axis_local": tuple(-x for x in found.axis_local),
            "axis_world": tuple(-x for x in found.axis_world),
        }
    )


SWAP = [("low_end", "high_end"), ("positive", "negative")]


def turned(name: str) -> str:
    for one, other in SWAP:
        name = name.replace(one, "?").replace(other, one).replace("?", other)
    return name


@each
def test_a_mirrored_joint_gets_the_mirrored_proposal(name):
    found = context(MODELS / f"{name}.xml", OWN[name][0])
    task = Task(found, read_templates())
    one = Offline().propose(task, []).proposal
    other = Offline().propose(Task(reflected(found), task.templates), []).proposal
    assert other.whole_motion_descrptn == one.whole_motion_descrptn
    assert len(other.effect_proposals) == len(one.effect_proposals)
    for a, b in zip(one.effect_proposals, other.effect_proposals, strict=True):
        assert b.effect_name == turned(a.effect_name)
        assert (b.start_ratio, b.end_ratio) == pytest.approx((1 - a.end_ratio, 1 - a.start_ratio))
        assert (a.strength, a.refineFactor, a.confidence) == (
            b.strength, b.refineFactor, b.confidence,
        )  # fmt: skip


@pytest.mark.sweep(3)
@each
def test_a_mirrored_joint_ends_with_its_wishes_met(name):
    found = context(MODELS / f"{name}.xml", OWN[name][0])
    done = loop_of(reflected(found))
    good(done)
    assert done.last.behaviour.closed_end == "high_end"


# --- rounds
@pytest.mark.sweep(3)
@each
def test_mending_changes_strengths_and_not_what_was_proposed(name):
    for key in KEYS:
        turns = own(name, key=key).turns
        for before, after in pairwise(turns):
            assert after.proposal != before.proposal
            assert before.unmet
            assert after.proposal.joint_summary == before.proposal.joint_summary
            assert after.proposal.whole_motion_descrptn == before.proposal.whole_motion_descrptn
            kept = [(e.effect_name, e.start_ratio) for e in after.proposal.effect_proposals]
            was = [(e.effect_name, e.start_ratio) for e in before.proposal.effect_proposals]
            assert kept[: len(was)] == was
