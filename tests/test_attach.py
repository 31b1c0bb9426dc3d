"""Profiles written into scenes: what changes, what does not, and what is said about it."""

import os
import re
import struct
from pathlib import Path

import mujoco
import numpy as np
import pytest
from matplotlib.image import imsave

from joda import attach as attach_module
from joda.attach import attach
from joda.errors import JodaError
from joda.profile import (
    Channel,
    Channels,
    Component,
    Joint,
    JointLimitHint,
    Profile,
    Resistance,
)
from joda.scene import read_profiles


def component(label: str, *y: float) -> Component:
    """A curve over the whole range."""
    x = tuple(float(u) for u in np.linspace(0, 1, len(y)))
    return Component(label=label, interval=(0, 1), x=x, y=y)


def profile(
    name="door",
    force=(-0.5, -0.2),
    friction=(0.02, 0.01),
    damping=(0.1, 0.3),
    limits=(0.0, 1.5),
    kind="hinge",
    hint=None,
) -> Profile:
    def channel(cls, label, y):
        return cls(components=(component(label, *y),)) if y else cls()

    return Profile(
        joint=Joint(name=name, type=kind, range=limits, unit="rad" if kind == "hinge" else "m"),
        channels=Channels(
            conservative=channel(Channel, "seal, strong", force),
            friction=channel(Resistance, "hinge", friction),
            damping=channel(Resistance, "closer", damping),
        ),
        joint_limit_hint=JointLimitHint(selected_side="high_end", elasticity=hint or "none")
        if hint
        else JointLimitHint(),
    )


LATCH = dict(force=(-0.5, -0.5), friction=None, damping=(0.05, 0.05))
EMPTY = dict(force=None, friction=None, damping=None)

DOOR = """\
<mujoco model="room">
  <compiler angle="radian"/>
  <!-- a door -->
  <worldbody>
    <body name="frame">
      <geom size="1 .1 .1" type="box"/>
      <body name="leaf" pos="0 0 2">
        <joint name="door" axis="0 0 1" range="0 1.5"/>
        <geom type="box" size=".4 .02 .9" pos=".4 0 0" mass="2"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


def write(folder: Path, text: str | bytes = DOOR, name="in.xml") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def attached(folder, text=DOOR, profiles=None, output="out.xml", **options):
    """Input, output and notes of attach; both files in `folder`."""
    before, after = write(folder, text), folder / output
    after.parent.mkdir(parents=True, exist_ok=True)
    return before, after, attach(before, profiles or profile(), after, **options)


def model_of(path: Path) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(path))


def removed(after: bytes) -> bytes:
    """The text without what attach inserts."""
    for pattern in (
        rb'\s*<extension>\s*<plugin plugin="joda.joint_dynamics">.*?</plugin>\s*</extension>',
        rb"""\s*<plugin instance=("joda_[^"]*"|'joda_[^']*')/>""",
        rb"""\s*<equality>\s*<joint name=["']joda_damping_.*?</equality>""",
        rb' frictionloss="1e-12"',
    ):
        after = re.sub(pattern, b"", after, flags=re.DOTALL)
    return after


def differences(before: mujoco.MjModel, after: mujoco.MjModel, tolerance=0.0) -> set[str]:
    """Fields of the model that are not the same, but for names, plugins and equalities."""
    ignored = r"name|plugin|(actuator|sensor)_plugin|eq_|paths|.*pathadr"
    out = set()
    for field in dir(before):
        value = None if field.startswith("_") else getattr(before, field)
        if isinstance(value, np.ndarray) and not re.match(f"({ignored})", field):
            other = getattr(after, field)
            same = value.shape == other.shape and np.allclose(value, other, tolerance, tolerance)
            if not same:
                out.add(field)
    return out


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


JOINT = '<joint name="door" axis="0 0 1" range="0 1.5"/>'
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
    paths = []
    for path in (before, after):
        m = model_of(path)
        # both engines the same friction law: the plugin's is without creep
        d = mujoco.MjData(m)
        d.qpos[0], d.qvel[0] = 0.2, 3.0
        path = []
        for _ in range(100):
            mujoco.mj_step(m, d)
            path.append(d.qpos[0])
        paths.append(path)
    assert paths[0] == pytest.approx(paths[1], abs=1e-4)


# --- other folders

TETRAHEDRON = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]


def stl(size: float) -> bytes:
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], "<f4") * np.float32(size)
    faces = (b"\0" * 12 + corners[list(f)].tobytes() + b"\0\0" for f in TETRAHEDRON)
    return b"\0" * 80 + struct.pack("<I", 4) + b"".join(faces)


def furnished(folder: Path, compiler: str, mesh: str, texture: str) -> Path:
    """DOOR with a mesh, a height field, a texture, an include and an attached model."""
    write(folder, stl(1), f"{mesh}t.stl")
    write(folder, struct.pack("<ii4f", 2, 2, 0, 1, 2, 3), f"{mesh}h.bin")
    (folder / texture).mkdir(parents=True, exist_ok=True)
    imsave(folder / f"{texture}t.png", np.full((2, 2, 3), 0.5))
    write(folder, stl(2), "child/meshes/t.stl")
    write(
        folder,
        '<mujoco><compiler meshdir="meshes"/><asset><mesh name="t" file="t.stl"/></asset>'
        '<worldbody><body name="b"><joint name="j"/><geom type="mesh" mesh="t"/></body></worldbody>'
        "</mujoco>",
        "child/child.xml",
    )
    write(folder, '<mujoco><geom type="mesh" mesh="t"/></mujoco>', "parts/geom.xml")
    asset = (
        '<asset><mesh name="t" file="t.stl"/><hfield name="h" file="h.bin" size="1 1 1 1"/>'
        '<texture name="x" type="2d" file="t.png"/><model name="c" file="child/child.xml"/></asset>'
    )
    text = DOOR.replace('<compiler angle="radian"/>', f"{compiler}{asset}")
    text = text.replace("</worldbody>", '<geom type="hfield" hfield="h"/></worldbody>')
    text = text.replace(
        "<geom type", '<include file="parts/geom.xml"/><attach model="c" prefix="c-"/><geom type', 1
    )
    return write(folder, text)


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


# --- several joints

TWO = DOOR.replace(JOINT, JOINT + '\n        <joint name="lift" type="slide" range="0 0.2"/>')
LIFT = dict(name="lift", kind="slide", limits=(0.0, 0.2))


def config(path: Path) -> dict[str, str]:
    """Attributes of the scene's only instance."""
    (plugin,) = mujoco.MjSpec.from_file(str(path)).plugins
    return {key: value for key, value in plugin.config.items() if value}


def test_joints_of_one_body_share_an_instance(tmp_path):
    given = [profile(), profile(**LIFT, force=(1.0, 2.0))]
    _, after, _ = attached(tmp_path, TWO, given)
    assert config(after) == {
        f"{k}.{key}": value for k in (0, 1) for key, value in given[k].attributes().items()
    }
    assert list(read_profiles(after).values()) == given


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_joints_of_one_body_one_after_the_other(tmp_path, order):
    given = [profile(), profile(**LIFT, force=(1.0, 2.0))]
    write(tmp_path, TWO, "0.xml")
    for step, k in enumerate(order):
        attach(tmp_path / f"{step}.xml", given[k], tmp_path / f"{step + 1}.xml")
    assert list(read_profiles(tmp_path / "2.xml").values()) == given
    assert mujoco.MjData(model_of(tmp_path / "2.xml")) is not None
    assert model_of(tmp_path / "2.xml").neq == 2


def test_a_new_profile_replaces_the_old_one_and_all_of_it(tmp_path):
    _, after, _ = attached(tmp_path)
    new = profile(**(EMPTY | dict(force=(1.0, 0.0, -1.0))))
    notes = attach(after, new, tmp_path / "new.xml")
    assert notes == ["joint 'door' carried a profile already, which the new one replaces."]
    assert read_profiles(tmp_path / "new.xml") == {"door": new}
    assert config(tmp_path / "new.xml") == new.attributes()
    fresh = tmp_path / "fresh.xml"
    attach(tmp_path / "in.xml", new, fresh)
    assert fresh.read_bytes() == (tmp_path / "new.xml").read_bytes()


def test_a_profile_declared_in_an_include_is_replaced_from_another_folder(tmp_path):
    _, after, _ = attached(tmp_path, output="home/out.xml")
    text = after.read_text()
    extension = text[text.index("<extension>") : text.index("</extension>") + 12]
    write(tmp_path, f"<mujoco>{extension}</mujoco>", "home/plugins.xml")
    write(tmp_path, text.replace(extension, '<include file="plugins.xml"/>'), "home/out.xml")
    new = profile(**(EMPTY | dict(force=(1.0, -1.0))))
    attach(after, new, tmp_path / "new.xml")
    assert read_profiles(tmp_path / "new.xml") == {"door": new}


def test_a_profile_written_by_hand_into_the_body_is_replaced(tmp_path):
    inline = (
        '<plugin plugin="joda.joint_dynamics"><config key="0.range" value="0 1"/>'
        '<config key="0.conservative" value="0 1 | 0 1 | 1 1"/></plugin>'
    )
    text = DOOR.replace(JOINT, JOINT + inline).replace(
        "<worldbody>", '<extension><plugin plugin="joda.joint_dynamics"/></extension><worldbody>'
    )
    before, after, notes = attached(tmp_path, text)
    assert read_profiles(before)["door"].joint.range == (0, 1)
    assert read_profiles(after) == {"door": profile()}
    assert notes == ["joint 'door' carried a profile already, which the new one replaces."]
    spec = mujoco.MjSpec.from_file(str(after))
    assert [plugin.name for plugin in spec.plugins] == ["joda_door"]


def test_the_joints_of_a_chain_each_get_their_own(tmp_path):
    links = "".join(f'<body><joint name="j{k}" range="0 1"/><geom size="1"/>' for k in range(5))
    text = f"<mujoco><worldbody>{links}{'</body>' * 5}</worldbody></mujoco>"
    given = [profile(f"j{k}", force=(float(k), 1.0)) for k in (3, 0, 4)]
    _, after, _ = attached(tmp_path, text, given)
    found = read_profiles(after)
    assert list(found) == ["j0", "j3", "j4"]
    assert [found[p.joint.name] for p in given] == given


# --- joints without a name, names of all kinds

UNNAMED = """\
<mujoco>
  <worldbody>
    <body name="top drawer"><joint type="slide" range="0 1.5"/><geom size="1"/></body>
    <body name="pair">
      <joint range="0 1.5" limited="true"/>
      <joint type="slide" range="0 1.5"/>
      <geom size="1"/>
    </body>
    <body><joint type="slide" range="0 1.5"/><geom size="1"/></body>
  </worldbody>
</mujoco>
"""
ADDRESSES = {  # address: id, name afterwards
    "body:top drawer": (0, "top_drawer_joint"),
    "body:top drawer:0": (0, "top_drawer_joint"),
    "#0": (0, "top_drawer_joint"),
    "body:pair:1": (2, "pair_joint"),
    "#2": (2, "pair_joint"),
    "#3": (3, "unnamed_joint"),
}


@pytest.mark.parametrize("address", ADDRESSES)
def test_a_joint_without_a_name_is_found_and_gets_one(tmp_path, address):
    joint, name = ADDRESSES[address]
    given = profile(kind="slide")
    before, after, notes = attached(tmp_path, UNNAMED, given, joint=address)
    assert notes == [f"joint '#{joint}' had no name and is now '{name}'."]
    assert model_of(after).joint(joint).name == name
    (found,) = read_profiles(after).items()
    assert found == (name, profile(name, kind="slide"))
    named = removed(after.read_bytes()).replace(f' name="{name}"'.encode(), b"")
    assert named == before.read_bytes()


def test_joints_without_a_name_at_once_get_different_names(tmp_path):
    given = [profile(f"#{k}", kind="slide") for k in (0, 2, 3)]
    text = UNNAMED.replace(' range="0 1.5" limited="true"', ' type="slide" range="0 1.5"')
    _, after, _ = attached(tmp_path, text, [profile("#1", kind="slide"), *given])
    assert list(read_profiles(after)) == [
        "top_drawer_joint",
        "pair_joint",
        "pair_joint0",
        "unnamed_joint",
    ]


def test_several_bodies_whose_first_joint_has_no_name_do_not_clash(tmp_path):
    body = '<body><joint type="slide"/><joint name="{}" range="0 1.5"/><geom size="1"/></body>'
    text = f"<mujoco><worldbody>{body.format('a')}{body.format('b')}</worldbody></mujoco>"
    _, after, _ = attached(tmp_path, text, [profile("a"), profile("b")])
    assert list(read_profiles(after)) == ["a", "b"]


@pytest.mark.parametrize(
    "name", ["top drawer", "a&b", "<door>", 'the "door"', "it's", "\"'", "抽屉 🚪", "a/b:c", "#7x"]
)
def test_names_of_all_kinds(tmp_path, name):
    text = DOOR.replace('"door"', attach_module.quoteattr(name))
    _, after, notes = attached(tmp_path, text, profile(name))
    assert read_profiles(after) == {name: profile(name)}
    assert attach(after, profile(name), tmp_path / "again.xml")
    assert (tmp_path / "again.xml").read_bytes() == after.read_bytes()
    assert notes == []


# --- joints that are not in the text

CLOTH = (
    '<flexcomp name="cloth" type="grid" count="2 2 1" spacing=".1 .1 .1" mass="1" dim="2">'
    '<edge equality="true"/></flexcomp>'
)
GENERATED = {
    "replicate": (
        '<replicate count="3" offset="1 0 0"><body name="b"><joint name="j" range="0 1.5"/>'
        '<geom size=".1"/></body></replicate>',
        "j1",
    ),
    "replicate in a body": (
        '<body name="o"><geom size=".1"/><replicate count="2" euler="0 0 1"><body pos="1 0 0">'
        '<joint name="j" range="0 1.5"/><geom size=".1"/></body></replicate></body>',
        "j0",
    ),
    "attach": ('<attach model="child" body="b" prefix="p-"/>', "p-j"),
}


def generated(folder: Path, what: str) -> Path:
    child = (
        '<mujoco><compiler angle="radian"/>'
        '<worldbody><body name="b"><joint name="j" range="0 1.5"/><geom size=".1"/></body>'
        "</worldbody></mujoco>"
    )
    write(folder, child, "child.xml")
    asset = '<asset><model name="child" file="child.xml"/></asset><worldbody>'
    return write(folder, DOOR.replace("<worldbody>", asset + what))


@pytest.mark.parametrize(("what", "name"), GENERATED.values(), ids=GENERATED)
def test_a_generated_joint_is_written_out_first(tmp_path, what, name):
    before, after = generated(tmp_path, what), tmp_path / "out.xml"
    notes = attach(before, profile(name), after)
    assert notes == [
        f"{before} was written out by MuJoCo first, numbers rounded to six digits: joint '{name}' "
        "is not found there by its name."
    ]
    assert read_profiles(after) == {name: profile(name)}
    assert differences(model_of(before), model_of(after), 1e-5) == {"body_plugin"}


@pytest.mark.parametrize("what", [*(what for what, _ in GENERATED.values()), CLOTH])
def test_generated_joints_elsewhere_leave_the_text_alone(tmp_path, what):
    before, after = generated(tmp_path, what), tmp_path / "out.xml"
    assert attach(before, profile(), after) == []
    assert removed(after.read_bytes()) == before.read_bytes()
    assert read_profiles(after) == {"door": profile()}


def test_a_model_that_mujoco_writes_out_wrongly_is_refused(tmp_path):
    """Its writer forgets the mesh folder of attached models."""
    before = furnished(tmp_path, '<compiler angle="radian" meshdir="m"/>', "m/", "")
    message = r"out\.xml: written out by MuJoCo the model is another one \(body_mass\); attach to "
    with pytest.raises(JodaError, match=message + "the file in which the joint itself is written"):
        attach(before, profile("c-j", limits=(0, 1)), tmp_path / "out.xml")
    assert not [*tmp_path.glob("*out*"), *tmp_path.glob(".*")]


URDF = """\
<robot name="box">
  <link name="base"/>
  <link name="lid &amp; seal">
    <inertial>
      <mass value="2"/><inertia ixx=".1" iyy=".1" izz=".2" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <joint name="the &lt;lid&gt;" type="revolute">
    <parent link="base"/><child link="lid &amp; seal"/>
    <axis xyz="1 2 3"/><limit lower="0" upper="1.5" effort="1" velocity="1"/>
    <dynamics damping="0.7" friction="0.3"/>
  </joint>
</robot>
"""


def test_urdf_becomes_mjcf(tmp_path):
    before = write(tmp_path, URDF, "in.urdf")
    notes = attach(before, profile("the <lid>"), tmp_path / "out.xml")
    assert notes == [
        f"{before} was written out by MuJoCo first, numbers rounded to six digits: the root "
        "element is <robot>, not <mujoco>.",
        "joint 'the <lid>' has native damping 0.7, frictionloss 0.3, replaced by the profile "
        "(--native replace).",
    ]
    assert read_profiles(tmp_path / "out.xml") == {"the <lid>": profile("the <lid>")}
    old, new = model_of(before), model_of(tmp_path / "out.xml")
    assert new.jnt_axis == pytest.approx(old.jnt_axis, abs=1e-6)
    assert new.body_inertia == pytest.approx(old.body_inertia, rel=1e-5)
    assert (new.dof_damping[0], new.dof_frictionloss[0]) == (0, 1e-12)


# --- mistakes

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
    monkeypatch.setattr("joda.scene.PLUGIN", "another")  # MuJoCo brings none for bodies
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
    with pytest.raises(JodaError, match=r"out\.xml: cannot be written \(Is a directory\)\.$"):
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


# --- the limits' elasticity


def rebound(path: Path, h: float) -> float:
    """Speed after hitting the upper limit over the speed before; mean over the place in a step."""
    m = model_of(path)
    m.opt.timestep = h
    m.opt.gravity[:] = 0
    speeds = []
    for k in range(5):
        d = mujoco.MjData(m)
        d.qvel[0] = 0.5
        d.qpos[0] = 1.5 - (20.1 + k / 5) * h * d.qvel[0]
        while d.time < 0.5:
            mujoco.mj_step(m, d)
        speeds.append(-d.qvel[0] / 0.5)
    return float(np.mean(speeds))


RATIOS = {"none": 1.0, "weak": 0.5, "medium": 0.25, "strong": 0.1}


def restitution(ratio: float) -> float:
    """Of a spring and damper that never pull (Schwager and Pöschel 2007)."""
    if ratio == 1:
        return float(np.exp(-2))
    root = np.sqrt(1 - ratio**2)
    angle = np.pi - np.arctan2(2 * ratio * root, 1 - 2 * ratio**2)
    return float(np.exp(-ratio / root * angle))


@pytest.mark.parametrize("h", [0.005, 0.002, 0.0005])
@pytest.mark.parametrize(
    "limit", ["", 'solreflimit="0.01 2"', 'solreflimit="-2500 -100"', 'solreflimit="0.001 1"']
)
def test_the_rebound_is_that_of_the_hinted_damping_ratio(tmp_path, h, limit):
    option = f"<option timestep='{h}'/>"
    text = DOOR.replace("axis", f"{limit} axis").replace("<worldbody>", option + "<worldbody>")
    for hint, ratio in RATIOS.items():
        given = profile(**EMPTY, hint=hint)
        _, after, notes = attached(tmp_path, text, given, output=f"{hint}.xml")
        if hint == "none":
            assert notes == []
        else:
            assert notes == [
                f"joint 'door' has limits of damping ratio {ratio:g} now ({hint} elasticity; "
                "MuJoCo has one value for both ends)."
            ]
            assert rebound(after, h) == pytest.approx(restitution(ratio), rel=0.12)


def test_the_rebound_grows_with_the_hint(tmp_path):
    speeds = []
    for hint in RATIOS:
        attached(tmp_path, DOOR, profile(**EMPTY, hint=hint), output=f"{hint}.xml")
        speeds.append(rebound(tmp_path / f"{hint}.xml", 0.002))
    assert speeds == sorted(speeds) and speeds[0] < 0.2 and speeds[-1] > 0.7


# --- the scene afterwards


def settles(m: mujoco.MjModel, names: list[str], start: float) -> np.ndarray:
    d = mujoco.MjData(m)
    joints = [m.joint(name) for name in names]
    for joint in joints:
        d.qpos[joint.qposadr] = start
    while d.time < 3:
        mujoco.mj_step(m, d)
    return np.array([d.qpos[joint.qposadr[0]] for joint in joints])


def test_the_scene_does_what_the_profile_says(tmp_path):
    """Constant force F = -0.5 over damping 0.05: shut in a while; without the profile it stays."""
    before, after, _ = attached(tmp_path, DOOR, profile(**LATCH))
    assert settles(model_of(before), ["door"], 0.4) == pytest.approx(0.4)
    assert settles(model_of(after), ["door"], 0.4) == pytest.approx(0, abs=5e-3)


def test_friction_and_damping_come_from_their_rows(tmp_path):
    """Terminal speed (push - friction) / damping, where an explicit damping force diverges."""
    only = profile(force=None, friction=(0.3, 0.3), damping=(500.0, 500.0))
    _, after, _ = attached(tmp_path, DOOR, only)
    m = model_of(after)
    assert 500 * m.opt.timestep * m.dof_invweight0[0] > 2
    d = mujoco.MjData(m)
    d.qfrc_applied[0] = 50.3
    mujoco.mj_step(m, d, 100)
    assert d.qvel[0] == pytest.approx(0.1, rel=1e-5)


def test_other_joints_move_as_they_did(tmp_path):
    """A pendulum beside the door, and one that hangs on it, while the door has nothing to do."""
    bob = '<body pos="{}"><joint name="{}" axis="0 1 0"/><geom size=".1" pos=".3 0 0"/></body>'
    text = DOOR.replace("</worldbody>", bob.format("0 9 9", "beside") + "</worldbody>")
    text = text.replace("<geom type", bob.format("0 0 5", "on it") + "<geom type")
    before, after, _ = attached(tmp_path, text, profile(**EMPTY))
    paths = []
    for path in (before, after):
        m = model_of(path)
        d = mujoco.MjData(m)
        states = []
        for _ in range(1000):
            mujoco.mj_step(m, d)
            states.append(d.qpos.copy())
        paths.append(np.array(states))
    assert np.ptp(paths[0], axis=0)[1:].min() > 1
    assert paths[0] == pytest.approx(paths[1], abs=1e-6)


def test_inert_equalities_of_a_default_class_stay_inert(tmp_path):
    """A default class for equalities does not reach the row that carries the damping."""
    default = '<default><equality solref="0.002 1" solimp="0.99 0.999" active="false"/></default>'
    text = DOOR.replace("<worldbody>", default + "<worldbody>")
    _, after, _ = attached(tmp_path, text, profile(**(EMPTY | dict(damping=(500.0, 500.0)))))
    m = model_of(after)
    d = mujoco.MjData(m)
    d.qfrc_applied[0] = 50
    mujoco.mj_step(m, d, 100)
    assert d.qvel[0] == pytest.approx(0.1, rel=1e-5)


def test_two_copies_in_a_parent_both_work(tmp_path):
    _, after, _ = attached(tmp_path, DOOR, profile(**LATCH))
    parent = mujoco.MjSpec()
    for side in ("left-", "right-"):
        frame = parent.worldbody.add_frame(pos=[0, 3 if side == "left-" else -3, 0])
        parent.attach(mujoco.MjSpec.from_file(str(after)), frame=frame, prefix=side)
    names = ["left-door", "right-door"]
    m = parent.compile()
    assert settles(m, names, 0.4) == pytest.approx(0, abs=5e-3)
    (tmp_path / "parent.xml").write_text(parent.to_xml())
    found = read_profiles(tmp_path / "parent.xml")
    assert list(found.values()) == [profile(name, **LATCH) for name in names]
    assert settles(model_of(tmp_path / "parent.xml"), names, 0.4) == pytest.approx(0, abs=5e-3)


def test_a_prefixed_copy_gets_a_new_profile_without_a_second_row(tmp_path):
    _, after, _ = attached(tmp_path, DOOR, profile(**LATCH))
    parent = mujoco.MjSpec()
    parent.attach(
        mujoco.MjSpec.from_file(str(after)), frame=parent.worldbody.add_frame(), prefix="x-"
    )
    parent.compile()
    (tmp_path / "parent.xml").write_text(parent.to_xml())
    attach(tmp_path / "parent.xml", profile("x-door"), tmp_path / "new.xml")
    assert read_profiles(tmp_path / "new.xml") == {"x-door": profile("x-door")}
    assert model_of(tmp_path / "new.xml").neq == 1


def trajectory(m: mujoco.MjModel) -> np.ndarray:
    d = mujoco.MjData(m)
    d.qpos[0], d.qvel[0] = 0.8, 0.3
    out = []
    for _ in range(500):
        mujoco.mj_step(m, d)
        out.append(d.qpos[0])
    return np.array(out)


def test_mujocos_own_writer_and_binary_files_keep_the_behaviour(tmp_path):
    _, after, _ = attached(tmp_path)
    m = model_of(after)
    expected = trajectory(m)
    spec = mujoco.MjSpec.from_file(str(after))
    assert np.array_equal(trajectory(spec.compile()), expected)
    (tmp_path / "again.xml").write_text(spec.to_xml())
    assert trajectory(model_of(tmp_path / "again.xml")) == pytest.approx(expected, abs=1e-6)
    mujoco.mj_saveModel(m, str(tmp_path / "m.mjb"))
    binary = mujoco.MjModel.from_binary_path(str(tmp_path / "m.mjb"))
    assert np.array_equal(trajectory(binary), expected)


# --- reading profiles


def test_a_scene_without_profiles_has_none(tmp_path):
    assert read_profiles(write(tmp_path)) == {}


def test_a_scene_that_does_not_load_is_named(tmp_path):
    path = write(tmp_path, DOOR.replace('size=".4', 'size="-.4'))
    with pytest.raises(JodaError, match=r"in\.xml: MuJoCo cannot load it: "):
        read_profiles(path)


def test_a_bad_range_in_a_scene_is_told(tmp_path):
    _, after, _ = attached(tmp_path)
    after.write_text(after.read_text().replace('value="0 1.5"', 'value="1 0"'))
    with pytest.raises(JodaError) as error:
        read_profiles(after)
    assert str(error.value) == (
        f"{after}: MuJoCo cannot load it: joda.joint_dynamics: instance 'joda_door': attribute "
        '"range": expected two increasing numbers, got "1 0".'
    )


def test_without_a_range_of_its_own_a_profile_has_the_joints(tmp_path):
    _, after, _ = attached(tmp_path)
    text = after.read_text().replace('<config key="range" value="0 1.5"/>', "")
    after.write_text(text.replace('range="0 1.5"', 'range="0 1.25"'))
    assert read_profiles(after)["door"].joint.range == (0, 1.25)
