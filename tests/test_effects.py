"""Effects beyond the three channels: their catalogue, texts and files, and what attach writes."""

import json
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import write

from joda import JodaError, Profile, attach, read_profiles
from joda.component import Component
from joda.diagnosis.phrases import effect_names
from joda.effects import (
    CHANNEL_EFFECTS,
    EFFECTS,
    AddedInertia,
    AsymmetricFriction,
    Backlash,
    DirectionDependentDamping,
    EndStopRestitution,
    GravityOffset,
    LearnedForce,
    LoadDependentFriction,
    PreslidingFriction,
    QuadraticDamping,
    StribeckFriction,
)
from joda.joints.resistance import damping, friction_bounds
from joda.pictures.changes import changes
from joda.pictures.draw import draw
from joda.profile import Joint

DOOR = Joint(name="door", type="hinge", range=(0, 1.6), unit="rad")
DRAWER = Joint(name="drawer", type="slide", range=(0, 0.4), unit="m")
PARTLY = {"interval": (0.1, 0.7), "x": (0, 0.4, 1), "y": (0.2, 0.5, 0.0)}
ALL = (
    DirectionDependentDamping(direction="positive", **PARTLY),
    DirectionDependentDamping(direction="negative", y=(0.5, 0.5)),
    AsymmetricFriction(direction="negative", **PARTLY),
    StribeckFriction(velocity=0.07, exponent=1.5, **PARTLY),
    QuadraticDamping(**PARTLY),
    PreslidingFriction(stiffness=120, damping=0.3, breakaway=0.6),
    LoadDependentFriction(coefficient=0.15),
    AddedInertia(inertia=0.04),
    GravityOffset(sin=0.3, cos=-0.2),
    EndStopRestitution(restitution=0.35),
    LearnedForce(
        memory="position",
        time=3.0,
        gain=2.5,
        interval=(0.1, 0.7),
        positions=(0.2, 0.6),
        velocities=(-1.0, 0.0, 0.5, 2.0),
        y=((0.0, 0.0, 0.1, 0.3), (-0.2, 0.0, 0.0, 0.1)),
    ),
    Backlash(play=0.02, inertia=0.003),
)
BEHIND = Backlash(play=0.02, inertia=0.003, side="motor", share=0.8)
EACH_END = (
    EndStopRestitution(restitution=0.7, end="low"),
    EndStopRestitution(restitution=0.1, end="high"),
)
SCENE = """<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body>
      <joint name="door" axis="0 1 0" range="0 1.6" limited="true" {more}/>
      <geom type="box" size="0.3 0.02 0.4" pos="0.3 0 0" mass="2"/>
    </body>
  </worldbody>
</mujoco>
"""


def profile(*effects, joint=DOOR):
    return Profile(joint=joint, effects=effects)


def test_every_effect_of_the_formats_has_one_place():
    named = {
        *("position_dependent_friction", "position_dependent_damping", "stribeck_friction"),
        *("asymmetric_friction", "direction_dependent_damping", "quadratic_damping"),
        *("presliding_friction", "load_dependent_friction", "added_inertia", "gravity_offset"),
        *("backlash", "end_stop_restitution", "learned_force"),
    }
    assert set(EFFECTS) | set(CHANNEL_EFFECTS) == named
    assert {effect.effect for effect in ALL} == set(EFFECTS)


@pytest.mark.parametrize("cls", EFFECTS.values(), ids=EFFECTS)
def test_every_effect_tells_its_law_units_and_typical_values(cls):
    assert all((cls.DESCRIPTION, cls.LAW, cls.SOURCE, cls.SHOWS))
    for name in (*cls.parameters(), *({"y"} & set(cls.model_fields))):
        field = cls.model_fields[name]
        assert field.description, name
        if name not in ("direction", "end", "side", "memory", "power"):
            unit, typical = (field.json_schema_extra[key] for key in ("unit", "typical"))
            assert len(unit) == 2
            assert typical[0] < typical[1]


def test_the_page_lists_what_the_catalogue_holds():
    page = (Path(__file__).parents[1] / "docs" / "effects.md").read_text()
    for name, cls in EFFECTS.items():
        section = page.split(f"### {name}\n")[1].split("\n### ")[0]
        for text in (cls.DESCRIPTION, cls.LAW, cls.SOURCE, cls.SHOWS):
            assert text in section
        for other in cls.CONFUSED_WITH:
            assert other in effect_names() and f"`{other}`" in section
        for key in (*cls.parameters(), *({"y"} & set(cls.model_fields))):
            assert f"`{key}`: {cls.model_fields[key].description}" in section


def test_files_and_attributes_keep_everything(tmp_path):
    for whole in (profile(*EACH_END), profile(BEHIND), profile(*ALL)):
        file = write(tmp_path, whole.to_json(), "composed.json")
        assert Profile.read(file) == whole
        assert Profile.from_attributes(DOOR, whole.attributes()) == whole
    assert json.loads(whole.to_json())["schema_version"] == 2
    assert json.loads(profile().to_json())["schema_version"] == 1


@given(
    st.sampled_from([StribeckFriction(velocity=1, y=(1, 1)), PreslidingFriction(stiffness=1)]),
    st.floats(1e-9, 1e9),
)
def test_numbers_survive_the_text(effect, number):
    key = "velocity" if isinstance(effect, StribeckFriction) else "stiffness"
    changed = effect.model_copy(update={key: number})
    again = Profile.from_attributes(DOOR, profile(changed).attributes())
    assert getattr(again.effects[0], key) == number


WRONG = {
    "effects[0]: there is no effect 'stribek'": {"effect": "stribek"},
    "effects[0].stribeck_friction.velocity: missing; add it.": {
        "effect": "stribeck_friction",
        "y": [1, 1],
    },
    "effects[0].backlash.play: must be greater than 0.": {
        "effect": "backlash",
        "play": -1,
        "inertia": 1,
    },
    "effects[0].backlash: share is of what lies behind the play; give side motor.": {
        "effect": "backlash",
        "play": 1,
        "inertia": 1,
        "share": 0.5,
    },
    "effects[0].quadratic_damping: y must not be negative.": {
        "effect": "quadratic_damping",
        "y": [-1, 1],
    },
    "effects[0].end_stop_restitution.end: must be 'both', 'low' or 'high'.": {
        "effect": "end_stop_restitution",
        "restitution": 0.5,
        "end": "upper",
    },
    "effects[0].backlash.width: unknown key": {
        "effect": "backlash",
        "play": 1,
        "inertia": 1,
        "width": 1,
    },
    "effects[0]: a hinge needs sin and cos": {"effect": "gravity_offset", "force": 1},
    "effects[0].quadratic_damping: interval must satisfy": {
        "effect": "quadratic_damping",
        "y": [1, 1],
        "interval": [0.5, 0.4],
    },
}


@pytest.mark.parametrize("said", WRONG)
def test_a_mistake_is_told_in_one_sentence(said, tmp_path):
    content = {**profile().model_dump(mode="json"), "effects": [WRONG[said]]}
    with pytest.raises(JodaError, match=re.escape(said)) as caught:
        Profile.read(write(tmp_path, json.dumps(content), "composed.json"))
    assert "\n" not in str(caught.value)


def test_the_same_effect_twice_is_refused_unless_in_two_directions():
    both = [AsymmetricFriction(direction=d, y=(1, 1)) for d in ("positive", "negative")]
    assert len(profile(*both).effects) == 2
    with pytest.raises(ValueError, match="has asymmetric_friction positive already"):
        profile(both[0], both[0])
    with pytest.raises(ValueError, match="excludes"):
        profile(
            QuadraticDamping(y=(1, 1)),
            QuadraticDamping(direction="positive", y=(1, 1)),
        )


def test_each_end_has_one_restitution():
    assert profile(*EACH_END).effects == EACH_END
    assert EndStopRestitution(restitution=0.7).end == "both"
    with pytest.raises(ValueError, match="has end_stop_restitution low already"):
        profile(EACH_END[0], EACH_END[0])
    with pytest.raises(ValueError, match="end_stop_restitution at both ends excludes that at one"):
        profile(EndStopRestitution(restitution=0.7), EACH_END[1])
    other = EndStopRestitution(restitution=0.3, end="low")
    assert changes(profile(*EACH_END), profile(*EACH_END).with_effect(other)) == [
        "end stop restitution, restitution 0.3, end low, "
        "before end stop restitution, restitution 0.7, end low"
    ]
    assert changes(profile(*EACH_END), profile(EACH_END[0])) == [
        "without end stop restitution high"
    ]


def test_what_is_usual_is_left_out_of_an_effects_text_and_description():
    assert ALL[-1].text() == "backlash play=0.02 inertia=0.003"
    assert ALL[-1].described() == "backlash, play 0.02, inertia 0.003"
    assert BEHIND.text() == "backlash play=0.02 inertia=0.003 side=motor share=0.8"
    assert BEHIND.described() == "backlash, play 0.02, inertia 0.003, side motor, share 0.8"
    assert QuadraticDamping(y=(1, 1)).text().startswith("quadratic_damping direction=both")


def test_an_effect_takes_the_place_of_its_like():
    first = profile(Backlash(play=0.01, inertia=0.001))
    second = first.with_effect(Backlash(play=0.02, inertia=0.001)).with_effect(ALL[4])
    assert [effect.key for effect in second.effects] == ["backlash", "quadratic_damping both"]
    assert second.effects[0].play == 0.02
    assert changes(first, second) == [
        "backlash, play 0.02, inertia 0.001, before backlash, play 0.01, inertia 0.001",
        "quadratic damping, up to 0.5",
    ]
    assert changes(second, first)[1] == "without quadratic damping both"
    curve = Component(label="worn", **PARTLY)
    assert first.with_component("friction", curve).channels.friction.components == (curve,)


def test_bounds_and_damping_are_the_laws():
    s = np.array([0.05, 0.34, 0.9])
    partly = np.array([0.0, 0.5, 0.0])  # the curve at its control point, and outside
    whole = profile(*ALL)
    at_rest = friction_bounds(whole, s, 0.0, load=2.0)
    np.testing.assert_allclose(at_rest[0], 0.15 * 2 + partly)
    np.testing.assert_allclose(at_rest[1], 0.15 * 2 + 2 * partly)
    moving = friction_bounds(whole, s, -0.07)
    np.testing.assert_allclose(moving[0], partly * np.exp(-1))
    # between the rows of the learned force, beyond its velocities
    up, down = 0.65 * 0.3 + 0.35 * 0.1, 0.35 * 0.2
    learned = np.array([0.0, 0.5, 0.0])
    np.testing.assert_allclose(damping(whole, s, 2.0), partly + 2 * partly + up * learned)
    np.testing.assert_allclose(damping(whole, s, -2.0), 0.5 + 2 * partly + down * learned)


def test_a_picture_shows_every_effect():
    figure = draw(profile(*ALL))
    words = " ".join(text.get_text() for axes in figure.axes for text in axes.texts)
    for effect in ALL:
        assert effect.effect.replace("_", " ") in words
    labels = {artist.get_label() for axes in figure.axes for artist in axes.get_children()}
    assert "± at rest, before it breaks away" in labels
    assert "at −1 rad/s" in labels


def attached(folder, *effects, more="", scene="in.xml", out="out.xml"):
    if scene == "in.xml":
        write(folder, SCENE.format(more=more))
    attach(folder / scene, profile(*effects), folder / out, force=True)
    return mujoco.MjModel.from_xml_path(str(folder / out))


@pytest.mark.parametrize("effects", [ALL, EACH_END])
def test_a_scene_carries_them_and_gives_them_back(effects, tmp_path):
    attached(tmp_path, *effects)
    assert read_profiles(tmp_path / "out.xml")["door"].effects == effects


def test_inertia_is_armature_and_goes_with_the_effect(tmp_path):
    assert attached(tmp_path, AddedInertia(inertia=0.04), more='armature="0.1"').dof_armature == [
        pytest.approx(0.14)
    ]
    more = attached(tmp_path, AddedInertia(inertia=0.2), scene="out.xml", out="more.xml")
    assert more.dof_armature == [pytest.approx(0.3)]
    assert attached(tmp_path, scene="more.xml", out="none.xml").dof_armature == [pytest.approx(0.1)]


@pytest.mark.parametrize("restitution", [0.0, 0.2, 0.5, 0.8])
@pytest.mark.parametrize("step", [0.001, 0.002, 0.005])
def test_an_end_stop_throws_back_as_fast_as_asked(restitution, step, tmp_path):
    text = SCENE.format(more="").replace(
        "<worldbody>", f'<option gravity="0 0 0" timestep="{step}"/><worldbody>'
    )
    write(tmp_path, text, "stop.xml")
    model = attached(tmp_path, EndStopRestitution(restitution=restitution), scene="stop.xml")
    data = mujoco.MjData(model)
    for speed, end in ((0.4, 0), (1.7, 1), (5.3, 0)):
        mujoco.mj_resetData(model, data)
        data.qpos[0], data.qvel[0] = (0.1, -speed) if end == 0 else (1.5, speed)
        away = 1 if end == 0 else -1
        for _ in range(round(20 / speed / step)):
            mujoco.mj_step(model, data)
            inside = min(data.qpos[0], 1.6 - data.qpos[0]) >= 0
            if inside and away * data.qvel[0] > 0:
                break
        assert away * data.qvel[0] / speed == pytest.approx(restitution, abs=0.05)


def test_a_stop_without_limits_is_noted(tmp_path):
    text = SCENE.format(more="").replace(' limited="true"', "").replace(' range="0 1.6"', "")
    write(tmp_path, text)
    notes = attach(tmp_path / "in.xml", profile(ALL[9]), tmp_path / "out.xml")
    assert any("has no limits" in note for note in notes)


def test_a_slide_has_a_force(tmp_path):
    offset = GravityOffset(force=1.5)
    assert profile(offset, joint=DRAWER).attributes()["effects"] == "gravity_offset force=1.5"
