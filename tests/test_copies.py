"""Joints that MuJoCo copies or renames: replicate, attach, include, frame, default classes."""

import re

import mujoco
import pytest
from scenes import model_of, profile, write
from test_plugin import refused

from joda import attach, context
from joda.errors import JodaError
from joda.scenes.scene import read_profiles

GIVEN = dict(force=(0.5, 0.5), friction=(0.25, 0.25), damping=(2.0, 2.0), kind="slide")
"""A constant profile: under a push F the joint's speed becomes (F + 0.5 - 0.25) / 2."""
PART = (
    '<body name="b"><joint name="j" type="slide" range="0 1.5"/><geom size=".1" mass=".1"/>'
    "{}</body>"
)
CARRIED = """<mujoco><extension><plugin plugin="joda.joint_dynamics"><instance name="p">
  <config key="range" value="0 1.5"/><config key="conservative" value="0 1 | 0 1 | 0.5 0.5"/>
  <config key="friction" value="0 1 | 0 1 | 0.25 0.25"/>
  <config key="damping" value="0 1 | 0 1 | 2 2"/>
</instance></plugin></extension><worldbody>{}</worldbody><equality><joint name="joda_damping_j"
joint1="j" solref="-1e-12 -1e-12" solimp="1e-4 1e-4"/></equality></mujoco>"""
NAMED = '<plugin instance="p"/>'
INLINE = '<plugin plugin="joda.joint_dynamics"><config key="range" value="0 1.5"/></plugin>'
ASSET = '<asset><model name="child" file="child.xml"/></asset>'
HEAD = '<option gravity="0 0 0"/>'


def scene(inside: str, before: str = "") -> str:
    return f"<mujoco>{HEAD}{before}<worldbody>{inside}</worldbody></mujoco>"


def speed(model: mujoco.MjModel, name: str, force: float = 0.75) -> float:
    """Of the joint after half a second under a force."""
    data = mujoco.MjData(model)
    data.qfrc_applied[model.joint(name).dofadr[0]] = force
    mujoco.mj_step(model, data, round(0.5 / model.opt.timestep))
    return float(data.joint(name).qvel[0])


PLACES = {  # what the model has, the joint's name in it
    "replicate": (
        scene(f'<replicate count="3" offset="0 2 0">{PART.format("")}</replicate>'),
        "j1",
    ),
    "replicates within": (
        scene(
            '<replicate count="2" offset="0 9 0" sep="-"><body><replicate count="2" '
            f'offset="0 2 0" sep="_">{PART.format("")}</replicate></body></replicate>'
        ),
        "j_1-0",
    ),
    "attach": (scene('<attach model="child" body="b" prefix="p-"/>', ASSET), "p-j"),
    "replicate of attach": (
        scene(
            '<replicate count="2" offset="0 2 0"><attach model="child" body="b" prefix="p-"/>'
            "</replicate>",
            ASSET,
        ),
        "p-j1",
    ),
    "frame": (scene(f'<frame euler="0 0 30"><frame>{PART.format("")}</frame></frame>'), "j"),
    "include": (scene('<include file="part.xml"/>'), "j"),
    "classes": (
        scene(
            '<body childclass="worn">' + PART.format("") + "</body>",
            '<default><default class="worn"><joint damping="5" frictionloss="0.3" stiffness="2" '
            'armature="0.01"/></default></default>',
        ),
        "j",
    ),
}


@pytest.mark.parametrize(("text", "name"), PLACES.values(), ids=PLACES)
def test_a_joint_gets_a_profile_wherever_it_stands(tmp_path, text, name):
    write(tmp_path, f"<mujoco><worldbody>{PART.format('')}</worldbody></mujoco>", "child.xml")
    write(tmp_path, f"<mujoco>{PART.format('')}</mujoco>", "part.xml")
    before, after = write(tmp_path, text), tmp_path / "out.xml"
    assert context(before, name).joint.name == name
    attach(before, profile(name, **GIVEN), after)
    assert list(read_profiles(after)) == [name]
    assert speed(model_of(after), name) == pytest.approx((0.75 + 0.5 - 0.25) / 2, rel=1e-3)


def test_a_second_copy_gets_its_own_profile(tmp_path):
    before = write(tmp_path, PLACES["replicate"][0])
    attach(before, profile("j0", **GIVEN), tmp_path / "first.xml")
    other = GIVEN | {"damping": (4.0, 4.0)}
    attach(tmp_path / "first.xml", profile("j2", **other), tmp_path / "second.xml")
    model = model_of(tmp_path / "second.xml")
    assert speed(model, "j0") == pytest.approx(0.5, rel=1e-3)
    assert speed(model, "j2") == pytest.approx(0.25, rel=1e-3)
    assert speed(model, "j1") == pytest.approx(0.75 * 0.5 / 0.1, rel=1e-3)


TWICE = scene(
    '<body pos="0 3 0"><attach model="child" prefix="p-"/></body>'
    '<attach model="child" body="b" prefix="q-"/>',
    ASSET,
)


def test_models_that_carry_a_profile_are_attached_under_new_names(tmp_path):
    write(tmp_path, CARRIED.format(PART.format(NAMED).replace("/>", ' frictionloss="1e-12"/>', 1)),
          "child.xml")  # fmt: skip
    path = write(tmp_path, TWICE)
    model = model_of(path)
    assert [speed(model, name) for name in ("p-j", "q-j")] == pytest.approx([0.5, 0.5], rel=1e-3)
    assert list(read_profiles(path)) == ["p-j", "q-j"]
    new = profile("q-j", **GIVEN | {"damping": (4.0, 4.0)})
    notes = attach(path, new, tmp_path / "new.xml")
    assert notes[1:] == ["joint 'q-j' carried a profile already, which the new one replaces."]
    model = model_of(tmp_path / "new.xml")
    assert speed(model, "p-j") == pytest.approx(0.5, rel=1e-3)
    assert speed(model, "q-j") == pytest.approx(0.25, rel=1e-3)


@pytest.mark.parametrize("suffix", ["", "-s"])
def test_a_spec_attaches_a_profile_with_prefix_and_suffix(suffix):
    part = PART.format(NAMED).replace("/>", ' frictionloss="1e-12"/>', 1)
    child, parent = mujoco.MjSpec.from_string(CARRIED.format(part)), mujoco.MjSpec()
    parent.option.gravity = [0, 0, 0]
    parent.worldbody.add_frame().attach_body(child.body("b"), "p-", suffix)
    assert speed(parent.compile(), f"p-j{suffix}") == pytest.approx(0.5, rel=1e-3)


CRASHES = {
    "replicate": scene(
        f'<replicate count="2" offset="0 2 0">{PART.format(NAMED)}</replicate>',
        '<extension><plugin plugin="joda.joint_dynamics"><instance name="p">'
        '<config key="range" value="0 1.5"/></instance></plugin></extension>',
    ),
    "replicate of attach": PLACES["replicate of attach"][0],
}


@pytest.mark.parametrize("text", CRASHES.values(), ids=CRASHES)
def test_a_replicate_with_an_instance_is_refused_before_mujoco_crashes(tmp_path, text):
    write(tmp_path, CARRIED.format(PART.format(NAMED)), "child.xml")
    path = write(tmp_path, text)
    sentence = (
        f'{path}: a <replicate> holds <plugin instance="p"/>, on which MuJoCo crashes; take that '
        "line out and give each copy its profile with: joda attach."
    )
    for command in (
        context,
        lambda model, joint: attach(model, profile(joint), tmp_path / "o.xml"),
    ):
        with pytest.raises(JodaError) as error:
            command(path, "j0")
        assert str(error.value) == sentence
    assert not (tmp_path / "o.xml").exists()


def test_a_model_that_attaches_itself_is_told_before_mujoco_crashes(tmp_path):
    path = write(tmp_path, TWICE.replace("child.xml", "in.xml"))
    with pytest.raises(JodaError, match=r"in\.xml: attaches itself, by way of its <asset>; remove"):
        context(path, "j")


def test_a_model_that_includes_itself_is_told(tmp_path):
    path = write(tmp_path, scene('<include file="in.xml"/>'))
    with pytest.raises(JodaError, match=r"in\.xml: MuJoCo cannot load it: .*in\.xml"):
        context(path, "j")


def test_what_that_sentence_says_to_do_works(tmp_path):
    taken_out = re.sub(r"<extension>.*</extension>", "", CRASHES["replicate"]).replace(NAMED, "")
    before = write(tmp_path, taken_out)
    attach(before, [profile(name, **GIVEN) for name in ("j0", "j1")], tmp_path / "out.xml")
    model = model_of(tmp_path / "out.xml")
    assert [speed(model, name) for name in ("j0", "j1")] == pytest.approx([0.5, 0.5], rel=1e-3)


def test_copies_that_share_an_instance_are_refused_by_the_plugin():
    extension = '<extension><plugin plugin="joda.joint_dynamics"/></extension>'
    inside = f'<replicate count="3" offset="0 2 0">{PART.format(INLINE)}</replicate>'
    assert refused(scene(inside, extension)) == (
        "joda.joint_dynamics: instance '': 3 bodies refer to it, as in a <replicate>; each needs "
        "an instance of its own, as joda attach writes them"
    )


def test_an_instance_without_a_name_cannot_be_attached_and_that_is_told(tmp_path):
    extension = '<extension><plugin plugin="joda.joint_dynamics"/></extension>'
    child = write(tmp_path, scene(PART.format(INLINE), extension), "child.xml")
    with pytest.raises(JodaError) as error:
        context(write(tmp_path, TWICE), "p-j")
    assert str(error.value) == (
        f'{child}: a body holds <plugin plugin="joda.joint_dynamics"> itself, which MuJoCo cannot '
        "attach to another model; put it into an <instance> of <extension> and <plugin "
        'instance="..."/> into the body.'
    )
    attach(child, profile("j", **GIVEN), tmp_path / "named.xml")
    write(tmp_path, TWICE.replace("child.xml", "named.xml"))
    assert speed(model_of(tmp_path / "in.xml"), "q-j") == pytest.approx(0.5, rel=1e-3)
