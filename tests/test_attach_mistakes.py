"""What attach says of a mistake, and that nothing is written then."""

import os
from pathlib import Path

import pytest
from scenes import (
    DOOR,
    JOINT,
    TWO,
    UNNAMED,
    URDF,
    attached,
    profile,
    write,
)

from joda import attach
from joda.errors import JodaError
from joda.scenes.scene import read_profiles

MISTAKES = {  # text, profile, options: the sentence
    "unknown joint": (
        TWO,
        profile("dor"),
        {},
        "joint 'dor' not found; hinges and slides of the model: 'door', 'lift'.",
    ),
    "unknown joint, none there": (
        "<mujoco/>",
        profile("dor"),
        {},
        "joint 'dor' not found; hinges and slides of the model: none.",
    ),
    "unknown, unnamed there": (
        UNNAMED,
        profile(),
        {},
        "joint 'door' not found; hinges and slides of the model: '#0', '#1', '#2', '#3'.",
    ),
    "several in the body": (
        UNNAMED,
        profile("body:pair"),
        {},
        "joint 'body:pair' not found; hinges and slides of the model: '#0', '#1', '#2', '#3'.",
    ),
    "place beyond": (
        DOOR,
        profile("#1"),
        {},
        "joint '#1' not found; hinges and slides of the model: 'door'.",
    ),
    "ball": (
        DOOR.replace(JOINT, '<joint name="door" type="ball"/>'),
        profile(),
        {},
        "joint 'door' is a ball joint; a profile needs a hinge or a slide.",
    ),
    "type": (
        DOOR,
        profile(kind="slide"),
        {},
        "joint 'door' is a hinge and the profile is for a slide; set joint.type, joint.unit and "
        "joint.range of the profile.",
    ),
    "two for one": (
        DOOR,
        [profile(), profile("body:leaf")],
        {},
        "joint 'door' is given two profiles.",
    ),
    "joint and two": (
        TWO,
        [profile(), profile("lift")],
        {"joint": "door"},
        "--joint goes with exactly one profile; each profile names its own joint.",
    ),
}


@pytest.mark.parametrize(("text", "given", "options", "sentence"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_told_in_a_sentence_and_nothing_is_written(
    tmp_path, text, given, options, sentence
):
    with pytest.raises(JodaError) as error:
        attached(tmp_path, text, given, **options)
    assert str(error.value) == sentence
    assert os.listdir(tmp_path) == ["in.xml"]


def test_another_plugin_in_the_body_is_told(tmp_path, monkeypatch):
    _, after, _ = attached(tmp_path)
    monkeypatch.setattr("joda.scenes.scene.slot", lambda: -1)  # as if it were another's
    with pytest.raises(JodaError) as error:
        attach(after, profile(), tmp_path / "new.xml")
    assert str(error.value) == (
        "the body of joint 'door' carries another plugin already, and MuJoCo allows one per body; "
        "remove it or put it elsewhere."
    )


def test_a_free_joint_is_refused(tmp_path):
    text = (
        "<mujoco><worldbody><body name='x'><freejoint/><geom size='1'/></body></worldbody></mujoco>"
    )
    with pytest.raises(
        JodaError, match="joint 'body:x' is a free joint; a profile needs a hinge or"
    ):
        attached(tmp_path, text, joint="body:x")


def test_a_missing_model_is_named(tmp_path):
    with pytest.raises(JodaError) as error:
        attach(tmp_path / "no.xml", profile(), tmp_path / "out.xml")
    assert str(error.value) == f"{tmp_path}/no.xml: no such file; give an MJCF or URDF file."


def test_a_missing_profile_is_named(tmp_path):
    with pytest.raises(
        JodaError, match=r"no\.json: cannot be read \(No such file or directory\)\.$"
    ):
        attach(write(tmp_path), tmp_path / "no.json", tmp_path / "out.xml")


def test_broken_xml_is_named_with_the_line(tmp_path):
    with pytest.raises(JodaError) as error:
        attached(tmp_path, "<mujoco>\n<worldbody>\n</mujoco>")
    assert str(error.value) == (
        f"{tmp_path}/in.xml: MuJoCo cannot load it: XML parse error 14: "
        "Error=XML_ERROR_MISMATCHED_ELEMENT ErrorID=14 (0xe) Line number=2: XMLElement "
        "name=worldbody."
    )


def test_names_in_another_encoding_are_told(tmp_path):
    text = DOOR.replace("leaf", "é").encode("latin-1")
    with pytest.raises(JodaError, match=r"in\.xml: it, or a file that it includes, is not UTF-8;"):
        attached(tmp_path, text)


def test_a_urdf_in_another_encoding_is_named(tmp_path):
    before = write(tmp_path, URDF.replace("box", "é").encode("latin-1"), "in.urdf")
    with pytest.raises(JodaError, match=r"in\.urdf: it, or a file that it includes, is not UTF-8;"):
        attach(before, profile("the <lid>"), tmp_path / "out.xml")


def test_an_existing_output_is_kept(tmp_path):
    before = write(tmp_path)
    with pytest.raises(JodaError) as error:
        attach(before, profile(), before)
    assert str(error.value) == f"{before}: exists already; choose another name or add --force."
    assert before.read_text() == DOOR


def test_the_input_may_be_the_output_with_force(tmp_path):
    _, after, _ = attached(tmp_path)
    before = tmp_path / "in.xml"
    attach(before, profile(), before, force=True)
    assert before.read_bytes() == after.read_bytes()
    assert sorted(os.listdir(tmp_path)) == ["in.xml", "out.xml"]


def test_a_folder_is_not_overwritten_even_with_force(tmp_path):
    (tmp_path / "out.xml").mkdir()
    with pytest.raises(JodaError, match=r"out\.xml: cannot be written \(a folder or a device"):
        attached(tmp_path, force=True)
    assert sorted(os.listdir(tmp_path)) == ["in.xml", "out.xml"]


def test_a_missing_output_folder_is_named(tmp_path):
    with pytest.raises(JodaError) as error:
        attach(write(tmp_path), profile(), tmp_path / "no" / "out.xml")
    assert str(error.value) == (
        f"{tmp_path}/no/out.xml: the folder {tmp_path}/no does not exist; create it first."
    )


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    if os.access(folder, os.W_OK):  # root may write anywhere but here
        folder = Path("/proc/self")
        if not folder.is_dir():
            pytest.skip("this user may write everywhere")
    with pytest.raises(JodaError) as error:
        attach(write(tmp_path), profile(), folder / "out.xml")
    assert str(error.value).startswith(f"{folder}/out.xml: cannot be written (")


def test_another_range_is_told_and_the_profile_keeps_its_own(tmp_path):
    given = profile(limits=(0.0, 2.0))
    _, after, notes = attached(tmp_path, DOOR, given)
    assert notes == [
        "joint 'door' has range 0 to 1.5 in the model and 0 to 2 rad in the profile, which keeps "
        "its own."
    ]
    assert read_profiles(after)["door"].joint.range == (0, 2)


def test_a_joint_without_range_is_told(tmp_path):
    _, _, notes = attached(tmp_path, DOOR.replace(' range="0 1.5"', ""))
    assert notes == [
        "joint 'door' has range not set in the model and 0 to 1.5 rad in the profile, which keeps "
        "its own."
    ]
