"""Which joints attach finds: several, unnamed, oddly named, generated; profiles read back."""

from pathlib import Path
from xml.sax.saxutils import quoteattr

import mujoco
import pytest
from scenes import (
    DOOR,
    EMPTY,
    JOINT,
    LIFT,
    TWO,
    UNNAMED,
    URDF,
    attached,
    differences,
    furnished,
    model_of,
    profile,
    removed,
    write,
)

from joda import attach
from joda.errors import JodaError
from joda.scenes.scene import read_profiles


# --- several joints
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
    text = DOOR.replace('"door"', quoteattr(name))
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


@pytest.mark.parametrize(
    "what", [*(what for what, _ in GENERATED.values()), CLOTH], ids=[*GENERATED, "flexcomp"]
)
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
