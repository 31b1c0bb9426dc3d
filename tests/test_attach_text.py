"""What attach does to the text of a scene: what it adds, and that all else stays."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from scenes import (
    DOOR,
    EMPTY,
    JOINT,
    attached,
    differences,
    furnished,
    model_of,
    profile,
    removed,
    stl,
    swing,
    write,
)

from joda import attach
from joda.scenes.scene import read_profiles


# --- the text
def test_the_scene_is_the_input_with_these_lines_more(tmp_path):
    _, after, notes = attached(tmp_path)
    assert (
        after.read_text()
        == """\
<mujoco model="room">
  <extension>
    <plugin plugin="joda.joint_dynamics">
      <instance name="joda_door">
        <config key="range" value="0 1.5"/>
        <config key="conservative" value="seal, strong: 0 1 | 0 1 | -0.5 -0.2"/>
        <config key="friction" value="hinge: 0 1 | 0 1 | 0.02 0.01"/>
        <config key="damping" value="closer: 0 1 | 0 1 | 0.1 0.3"/>
      </instance>
    </plugin>
  </extension>
  <compiler angle="radian"/>
  <!-- a door -->
  <worldbody>
    <body name="frame">
      <geom size="1 .1 .1" type="box"/>
      <body name="leaf" pos="0 0 2">
        <joint name="door" axis="0 0 1" range="0 1.5" frictionloss="1e-12"/>
        <plugin instance="joda_door"/>
        <geom type="box" size=".4 .02 .9" pos=".4 0 0" mass="2"/>
      </body>
    </body>
  </worldbody>
  <equality>
    <joint name="joda_damping_door" joint1="door" active="true" solref="-1e-12 -1e-12" \
solimp="1e-4 1e-4"/>
  </equality>
</mujoco>
"""
    )
    assert notes == []


PID = """
  <extension><plugin plugin="mujoco.pid"><instance name="c">
    <config key='kp' value='2'/></instance></plugin></extension>
  <actuator><plugin joint="door" plugin="mujoco.pid" instance="c"/></actuator>"""
TOUCH = """
  <extension>
    <plugin plugin='mujoco.sensor.touch_grid'/>
  </extension>
  <sensor>
    <plugin name="touch" plugin="mujoco.sensor.touch_grid" objtype="site" objname="s">
      <config key="size" value="7 7"/><config key="fov" value="45 45"/>
      <config key="gamma" value="0"/><config key="nchannel" value="1"/>
    </plugin>
  </sensor>"""
SITED = DOOR.replace("</body>", "<site name='s'/></body>", 1)
VARIANTS = {
    "as it is": DOOR,
    "single quotes": DOOR.replace('"', "'"),
    "spaces around =": re.sub('="', ' = "', DOOR),
    "lines in tags": DOOR.replace(
        JOINT, '<joint\n\n   name="door"\n axis="0 0 1" range="0 1.5"\n/>'
    ),
    "end tag": DOOR.replace(JOINT, JOINT[:-2] + "></joint>"),
    "end tag and comment": DOOR.replace(JOINT, JOINT[:-2] + "><!-- <joint/> --></joint>"),
    "comments": DOOR.replace(JOINT, f"<!-- <joint name='door'/> -->{JOINT}<!-- > -->"),
    "CRLF": DOOR.replace("\n", "\r\n"),
    "BOM": "\ufeff" + DOOR,
    "declaration": "<?xml version='1.0' encoding='utf-8'?>\n<!-- first -->\n" + DOOR,
    "BOM, declaration, CRLF": '\ufeff<?xml version="1.0"?>\r\n' + DOOR.replace("\n", "\r\n"),
    "trailing": DOOR + "\n<!-- after all -->\n\n",
    "tabs": DOOR.replace("  ", "\t"),
    "one line": re.sub(r"\n *", "", DOOR),
    "unicode": DOOR.replace("a door", "门 🚪").replace("leaf", "Türblatt"),
    "empty elements": DOOR.replace("<worldbody>", "<option/><default/><asset></asset><worldbody>"),
    "frame": DOOR.replace(JOINT, f"<frame pos='1 0 0'>{JOINT}</frame>"),
    "another extension": DOOR.replace("</worldbody>", "</worldbody>" + PID),
    "a plugin sensor": SITED.replace("</worldbody>", "</worldbody>" + TOUCH),
    "other equalities": DOOR.replace("</worldbody>", "</worldbody><equality></equality>"),
    "Latin-1": DOOR.replace("a door", "90°").encode("latin-1"),
    "keyframe": DOOR.replace("</mujoco>", '<keyframe><key qpos="1"/></keyframe></mujoco>'),
}


@pytest.mark.parametrize("text", VARIANTS.values(), ids=VARIANTS)
def test_all_else_is_kept_byte_for_byte(tmp_path, text):
    before, after, _ = attached(tmp_path, text)
    assert removed(after.read_bytes()) == before.read_bytes()
    assert differences(model_of(before), model_of(after)) == {
        "dof_frictionloss",
        "body_plugin",
    }
    assert list(read_profiles(after).values()) == [profile()]


@pytest.mark.parametrize("text", [VARIANTS["CRLF"], VARIANTS["BOM, declaration, CRLF"]])
def test_a_file_with_crlf_gets_no_bare_line_feed(tmp_path, text):
    _, after, _ = attached(tmp_path, text)
    content = after.read_bytes()
    assert content.count(b"\n") == content.count(b"\r\n")


def test_native_values_change_where_they_stand(tmp_path):
    tag = "<joint damping = '2'\n  name='door' stiffness=\"3\" range='0 1.5' frictionloss='1' />"
    _, after, _ = attached(tmp_path, DOOR.replace(JOINT, tag))
    assert (
        '<joint damping="0"\n  name=\'door\' stiffness="0" range=\'0 1.5\' frictionloss="1e-12" />'
    ) in after.read_text()


def test_an_include_that_holds_the_joint_is_written_out_in_place(tmp_path):
    leaf = DOOR[
        DOOR.index("<body name='leaf'".replace("'", '"')) : DOOR.index("    </body>\n  </w")
    ]
    write(tmp_path, f"<mujoco>\n  <!-- leaf -->\n  {leaf.strip()}\n</mujoco>\n", "leaf.xml")
    write(tmp_path, "<mujoco><asset/></mujoco>", "assets.xml")
    text = DOOR.replace(leaf, '<include file="leaf.xml"/>\n')
    text = text.replace("<worldbody>", '<include file="assets.xml"/><worldbody>')
    before, after, _ = attached(tmp_path, text)
    content = removed(after.read_bytes()).decode()
    assert content == text.replace('<include file="leaf.xml"/>', f"<!-- leaf -->\n  {leaf.strip()}")
    assert differences(model_of(before), model_of(after)) == {"dof_frictionloss", "body_plugin"}


def test_a_joint_included_alone_into_its_body_is_written_out(tmp_path):
    write(tmp_path, f"<mujoco>{JOINT}</mujoco>", "joint.xml")
    before, after, _ = attached(tmp_path, DOOR.replace(JOINT, '<include file="joint.xml"/>'))
    assert removed(after.read_bytes()).decode() == DOOR
    assert differences(model_of(before), model_of(after)) == {"dof_frictionloss", "body_plugin"}


# --- native values
NATIVE = 'damping="2" stiffness="3" frictionloss="0.5"'
FIELDS = ("dof_damping", "dof_dampingpoly", "jnt_stiffness", "jnt_stiffnesspoly")


def native(path: Path) -> list[float]:
    """damping, stiffness, each with its polynomial, and frictionloss of the door."""
    m = model_of(path)
    joint = m.joint("door").id
    values = [np.ravel(getattr(m, field)[joint]) for field in FIELDS]
    return [*map(float, np.concatenate(values)), float(m.dof_frictionloss[joint])]


REPLACED = [0, 0, 0, 0, 0, 0, 1e-12]
NATIVES = {  # what the joint has, what is said of it, what it compiles to
    "attributes": (NATIVE, "damping 2, stiffness 3, frictionloss 0.5"),
    "polynomials": ('damping="1 2 3" stiffness="4 5 6"', "damping 1 2 3, stiffness 4 5 6"),
    "a polynomial's last": ('damping="0 0 3"', "damping 0 0 3"),
    "some": ('stiffness="3"', "stiffness 3"),
}


@pytest.mark.parametrize(("values", "said"), NATIVES.values(), ids=NATIVES)
def test_native_values_are_replaced(tmp_path, values, said):
    _, after, notes = attached(tmp_path, DOOR.replace("axis", f"{values} axis"))
    assert native(after) == REPLACED
    assert notes == [f"joint 'door' has native {said}, replaced by the profile (--native replace)."]


@pytest.mark.parametrize(("values", "said"), NATIVES.values(), ids=NATIVES)
def test_native_values_are_kept(tmp_path, values, said):
    text = DOOR.replace("axis", f"{values} axis")
    before, after, notes = attached(tmp_path, text, native="keep")
    kept = native(before)
    assert native(after) == [*kept[:-1], kept[-1] or 1e-12]
    assert notes == [f"joint 'door' has native {said}, kept besides the profile (--native keep)."]


@pytest.mark.parametrize("values", [NATIVE, 'damping="1 2 3"', 'springdamper="0.1 1"'])
@pytest.mark.parametrize("named", [False, True], ids=["main class", "named class"])
def test_native_values_of_a_default_class_are_replaced_for_this_joint_only(tmp_path, values, named):
    default = f"<joint {values}/>"
    joints = '<joint name="door"', '<body><joint name="other"/><geom size="1"/></body></worldbody>'
    if named:
        default = f"<default class='heavy'>{default}</default>"
        joints = tuple(j.replace("<joint", "<joint class='heavy'") for j in joints)
    text = DOOR.replace("<worldbody>", f"<default>{default}</default><worldbody>")
    text = text.replace('<joint name="door"', joints[0]).replace("</worldbody>", joints[1])
    before, after, _ = attached(tmp_path, text)
    assert native(after) == REPLACED
    old, new = (model_of(path) for path in (before, after))
    for field in (*FIELDS, "dof_frictionloss"):
        assert np.array_equal(getattr(old, field)[1], getattr(new, field)[1])


def test_a_spring_given_as_time_and_ratio_is_replaced(tmp_path):
    _, after, notes = attached(tmp_path, DOOR.replace("axis", 'springdamper="1 1" axis'))
    assert native(after) == REPLACED
    assert "native damping" in notes[0] and "stiffness" in notes[0]


def test_kept_friction_acts_besides_the_profiles(tmp_path):
    """Breakaway at the sum of both."""
    text = DOOR.replace("axis", 'frictionloss="0.5" axis')
    only = profile(**(EMPTY | dict(friction=(0.3, 0.3))))
    _, after, _ = attached(tmp_path, text, only, native="keep")
    m = model_of(after)
    for torque, moves in ((0.79, False), (0.81, True)):
        d = mujoco.MjData(m)
        d.qpos[0], d.qfrc_applied[0] = 0.5, torque
        mujoco.mj_step(m, d, 500)
        assert (abs(d.qpos[0] - 0.5) > 1e-4) == moves


def test_an_empty_profile_kept_besides_native_values_changes_nothing(tmp_path):
    text = DOOR.replace("axis", f"{NATIVE} axis")
    before, after, _ = attached(tmp_path, text, profile(**EMPTY), native="keep")
    assert moves(after) == pytest.approx(moves(before), abs=1e-4)


def moves(path: Path) -> np.ndarray:
    """The door's positions over 0.2 s from a swing."""
    return swing(model_of(path), 0.2, 3.0, 100)


# --- other folders


FOLDERS = {
    "none": ("", "", ""),
    "meshdir": ('<compiler meshdir="m"/>', "m/", ""),
    "texturedir": ('<compiler texturedir="a/b/"/>', "", "a/b/"),
    "both": ("<compiler texturedir='x' meshdir='m'/>", "m/", "x/"),
    "assetdir": ('<compiler assetdir="a"/>', "a/", "a/"),
    "assetdir and meshdir": ('<compiler assetdir="a" meshdir="m"/>', "m/", "a/"),
    "twice": ('<compiler meshdir="x"/><compiler meshdir="m"/>', "m/", ""),
}


@pytest.mark.parametrize("kind", FOLDERS)
@pytest.mark.parametrize("output", ["out.xml", "below/this/out.xml", "../beside/out.xml"])
def test_assets_are_found_from_any_folder(tmp_path, kind, output):
    compiler, mesh, texture = FOLDERS[kind]
    before = furnished(tmp_path / "home", f"{compiler}<compiler angle='radian'/>", mesh, texture)
    after = tmp_path / "home" / output
    after.parent.mkdir(parents=True, exist_ok=True)
    assert attach(before, profile(), after) == []
    assert differences(model_of(before), model_of(after)) == {"dof_frictionloss", "body_plugin"}


def test_assets_are_found_from_a_folder_behind_a_link(tmp_path):
    before = furnished(tmp_path / "home", '<compiler angle="radian" meshdir="m"/>', "m/", "")
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "a" / "b", target_is_directory=True)
    after = tmp_path / "link" / "out.xml"
    attach(before, profile(), after)
    assert differences(model_of(before), model_of(after)) == {"dof_frictionloss", "body_plugin"}
    attach(after, profile(), tmp_path / "out.xml")
    assert model_of(tmp_path / "out.xml").nmesh == 2


def test_assets_are_found_whatever_the_current_folder(tmp_path, monkeypatch):
    furnished(tmp_path / "home", '<compiler angle="radian" meshdir="m"/>', "m/", "")
    monkeypatch.chdir(tmp_path / "home" / "m")
    attach("../in.xml", profile(), "../../out.xml")
    attach("../in.xml", profile(), "out.xml")
    monkeypatch.chdir(tmp_path)
    for path in ("out.xml", "home/m/out.xml"):
        assert model_of(Path(path)).nmesh == 2


def test_an_absolute_asset_folder_stays(tmp_path):
    folder = tmp_path / "home"
    compiler = f'<compiler angle="radian" assetdir="{folder}"/>'
    before = furnished(folder, compiler, "", "")
    (tmp_path / "new").mkdir()
    attach(before, profile(), tmp_path / "new" / "out.xml")
    assert compiler in (tmp_path / "new" / "out.xml").read_text()
    model_of(tmp_path / "new" / "out.xml")


def test_an_include_names_its_own_asset_folder_also_from_elsewhere(tmp_path):
    write(tmp_path, stl(1), "home/m/t.stl")
    part = '<mujoco><compiler meshdir="m"/><asset><mesh name="t" file="t.stl"/></asset></mujoco>'
    write(tmp_path, part, "home/part.xml")
    text = DOOR.replace("<worldbody>", '<include file="part.xml"/><worldbody>')
    before = write(tmp_path, text, "home/in.xml")
    attach(before, profile(), tmp_path / "out.xml")
    assert model_of(tmp_path / "out.xml").nmesh == 1


def test_attaching_again_from_folder_to_folder_keeps_all(tmp_path):
    before = furnished(tmp_path / "home", '<compiler angle="radian" meshdir="m"/>', "m/", "")
    steps = [tmp_path / "a" / "1.xml", tmp_path / "a" / "b" / "2.xml", tmp_path / "3.xml"]
    for old, new in zip([before, *steps], steps, strict=False):
        new.parent.mkdir(parents=True, exist_ok=True)
        attach(old, profile(), new)
    assert differences(model_of(before), model_of(steps[-1])) == {"dof_frictionloss", "body_plugin"}
