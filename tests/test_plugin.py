# ruff: noqa: E501 (tables of sentences)
"""Loading the plugin, reading its attributes, and what it says when they are wrong."""

import re
import subprocess
import sys

import mujoco
import numpy as np
import pytest
from joints import component, flat, load, scene

import joda
from joda import plugin
from joda.component import Component
from joda.profile import Channels, Joint, Profile, Resistance

TWO_JOINTS = """
<mujoco><extension><plugin plugin="joda.joint_dynamics">
    <instance name="p">{config}</instance></plugin></extension>
  <worldbody><body name="arm"><joint name="turn" range="-90 90" frictionloss="1e-12"/>
    <joint name="lift" type="slide" range="0 .5" frictionloss="1e-12"/><geom size=".1"/>
    <plugin instance="p"/>
  </body></worldbody></mujoco>"""


def refused(text: str) -> str:
    """The plugin's sentence about a model that does not load."""
    with pytest.raises(ValueError) as error:
        mujoco.MjData(mujoco.MjModel.from_xml_string(text))
    lines = [line for line in str(error.value).splitlines() if "joda.joint_dynamics:" in line]
    assert lines, str(error.value)
    return lines[0]


def configured(**config: str) -> str:
    """The test scene with these attributes and no others."""
    keys = "".join(f'<config key="{key}" value="{value}"/>' for key, value in config.items())
    return re.sub(r"<config key=.*/>", keys, scene(), count=1)


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (dict(friction="0 1 | 0 1 | 1 nan"), 'attribute "friction": component 1: "nan" is not a finite number'),
        (dict(friction=flat(-1.0)), 'attribute "friction": component 1: values of friction and damping must not be negative'),
        (dict(damping=flat(1.0) + "; " + flat(-1.0)), 'attribute "damping": component 2: values of friction and damping must not be negative'),
        (dict(conservative="latch: 0 1 | 0 0.5 0.5 1 | 1 1 1 1"), 'attribute "conservative": component 1 "latch": x must increase'),
        (dict(conservative="0 1 | 0 1 | 1 1 1"), 'attribute "conservative": component 1: x has 2 numbers and y has 3; they must be equally many'),
        (dict(conservative="0.5 1.5 | 0 1 | 1 1"), 'attribute "conservative": component 1: the interval must satisfy 0 <= a < b <= 1'),
        (dict(conservative="0 1 | 0 1"), 'attribute "conservative": component 1: expected "label: a b | x ... | y ..."'),
        (dict(friction=flat(1.0), friction_combine="mean"), 'attribute "friction_combine": must be "sum" or "max", got "mean"'),
        (dict(range="1 0"), 'attribute "range": expected two increasing numbers, got "1 0"'),
        (dict(range="0 one"), 'attribute "range": "one" is not a finite number'),
    ],
)  # fmt: skip
def test_bad_attributes_are_refused_in_one_sentence(config, message):
    assert f"joda.joint_dynamics: instance 'p': {message}" in refused(configured(**config))


def test_unknown_attributes_are_refused():
    with pytest.raises(ValueError, match="frction"):
        mujoco.MjModel.from_xml_string(configured(frction=flat(1.0)))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('type="slide" axis="1 0 0" range="0.0 1.0"', 'type="ball"', "joint 'j' is a ball joint; a profile needs a hinge or a slide"),
        ('<joint name="j" type="slide" axis="1 0 0" range="0.0 1.0" frictionloss="1e-12"/>', "<freejoint name='j'/>", "joint 'j' is a free joint; a profile needs a hinge or a slide"),
        ('<joint name="j" type="slide" axis="1 0 0" range="0.0 1.0" frictionloss="1e-12"/>', "", "body 'b' has 0 joints, none at place 0"),
        ('<plugin instance="p"/>', "", "no body refers to it; put <plugin instance=\"...\"/> into the one body that the joint moves"),
        ('<body name="b">', '<body name="c"><geom size=".1"/><plugin instance="p"/></body><body name="b">', "2 bodies refer to it, as in a <replicate>; each needs an instance of its own, as joda attach writes them"),
    ],
)  # fmt: skip
def test_a_wrong_place_is_refused_in_one_sentence(old, new, message):
    text = scene(damping=flat(1.0), equality=False)
    assert old in text
    assert message in refused(text.replace(old, new))


def test_no_range_is_refused():
    text = configured(damping=flat(1.0)).replace('range="0.0 1.0"', "", 1)
    text = re.sub(r"<equality>.*</equality>", "", text)
    assert (
        "attribute \"range\": joint 'j' has no range; give it one, or write this attribute"
        in refused(text)
    )


def test_the_joints_own_range_is_the_default():
    given, default = (mujoco.MjModel.from_xml_string(t) for t in (
        configured(range="0 1", conservative=component((0, 1), (0, 1), (1, 2))),
        configured(conservative=component((0, 1), (0, 1), (1, 2))),
    ))  # fmt: skip
    forces = []
    for model in (given, default):
        data = mujoco.MjData(model)
        data.qpos[0] = 0.3
        mujoco.mj_forward(model, data)
        forces.append(data.qfrc_passive[0])
    assert forces == pytest.approx([1.3, 1.3])


def test_joints_of_one_body_are_told_apart_by_their_place():
    config = "".join(
        f'<config key="{key}" value="{value}"/>'
        for key, value in {
            "0.conservative": flat(-2.0),
            "1.conservative": flat(3.0),
            "1.damping": flat(1.0),
        }.items()
    )
    model = mujoco.MjModel.from_xml_string(TWO_JOINTS.format(config=config))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.qfrc_passive == pytest.approx([-2, 3])
    assert model.npluginstate == 2


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("friction", "body 'arm' has 2 joints; write each attribute with the joint's place in the body in front, as in \"0.friction\""),
        ("2.friction", "body 'arm' has 2 joints, none at place 2"),
    ],
)  # fmt: skip
def test_wrong_places_in_a_body_are_refused(key, message):
    config = f'<config key="{key}" value="{flat(1.0)}"/>'
    assert message in refused(TWO_JOINTS.format(config=config))


def test_a_joint_is_configured_once():
    assert "is configured twice" in refused(
        configured(**{"friction": flat(1.0), "0.friction": flat(1.0)})
    )


def test_plain_mujoco_loads_the_plugin():
    """From 4.0 on; an older one needs `import joda` beside it."""
    text = scene(damping=flat(1.0))
    first = "mujoco" if int(mujoco.__version__.partition(".")[0]) >= 4 else "joda, mujoco"
    code = f"import {first}; mujoco.MjModel.from_xml_string('''{text}'''); print('loaded')"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (result.stdout, result.stderr) == ("loaded\n", "")


@pytest.mark.parametrize("first", ["joda", "mujoco", "joda.scenes.scene", "joda.cli"])
def test_any_import_order_works(first):
    code = f"import {first}, mujoco, joda; joda.plugin_path()"
    result = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True
    )
    assert (result.returncode, result.stderr) == (0, "")


def test_plugin_path_is_the_library():
    assert joda.plugin_path().name.startswith(f"libjoda_plugin-{mujoco.__version__}.")
    assert joda.plugin_path().is_file()


def test_a_mujoco_that_is_not_the_installed_one_is_refused(monkeypatch):
    monkeypatch.setattr(mujoco, "mj_versionString", lambda: "3.2.7")
    own = mujoco.__version__
    message = f"MuJoCo 3.2.7 runs and {own} is installed; run: pip install --force-reinstall"
    with pytest.raises(joda.JodaError, match=re.escape(message)):
        plugin.load()


def test_the_command_line_says_so_and_stops():
    code = (
        "import mujoco, joda; mujoco.mj_versionString = lambda: '3.2.7'\n"
        "import sys; sys.argv = ['joda', 'schema']\n"
        "from joda.cli import main; main()"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.returncode == 2
    assert result.stderr.startswith("joda: MuJoCo 3.2.7 runs and")
    assert result.stderr.count("\n") == 1


def test_hand_edited_text_is_read_generously():
    """Line breaks, no labels, labels with colons, a closing semicolon."""
    text = "\n  door: latch: 0 .5 | 0 1 | -1 -1 ;\n  0.5 1 | 0 .5 1 | 2 2 2;\n"
    model, data = load(text)
    for position, force in ((0.2, -1), (0.7, 2)):
        data.qpos[0] = position
        mujoco.mj_forward(model, data)
        assert data.qfrc_passive[0] == pytest.approx(force)


def test_a_model_whose_muscles_are_measured_while_it_compiles_loads(tmp_path):
    """MuJoCo steps the model then, before any plugin is initialised."""
    (tmp_path / "arm.xml").write_text(
        '<mujoco><worldbody><body><joint name="elbow" range="0 90"/>'
        '<geom size=".1" pos=".3 0 0" mass="1"/></body></worldbody>'
        '<actuator><muscle joint="elbow"/></actuator></mujoco>'
    )
    rubs = Resistance(components=(Component(interval=(0, 1), x=(0, 1), y=(0.3, 0.3)),))
    joint = Joint(name="elbow", type="hinge", range=(0, np.pi / 2), unit="rad")
    profile = Profile(joint=joint, channels=Channels(friction=rubs))
    joda.attach(tmp_path / "arm.xml", profile, tmp_path / "rubs.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "rubs.xml"))
    assert model.actuator_lengthrange[0] == pytest.approx((0, np.pi / 2), abs=0.05)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 10)
    assert model.nplugin == 1 and np.isfinite(data.qpos).all()
