"""From words to curves: scales, bands, repeatability, and what is said of mistakes."""

import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from joda import JodaError, compile, context
from joda.compiling import BANDS, TRAVEL_TIME, reference_scales
from joda.field import evaluate
from joda.proposal import Proposal

MODEL = """
<mujoco><compiler angle="radian"/><worldbody>
  <body><joint name="{name}" type="{kind}" axis="0 0 1" range="0 {span}"/>
    <inertial pos="0 0 0" mass="2" diaginertia=".3 .3 .3"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def door(tmp_path):
    path = tmp_path / "door.xml"
    path.write_text(MODEL.format(name="door", kind="hinge", span=1.5))
    return path


def effect(name, start=0.0, end=1.0, factor=None, **strength):
    return {
        "effect_name": name,
        "start_ratio": start,
        "end_ratio": end,
        "strength": {"conservative": "none", "friction": "none", "damping": "none", **strength},
        "refineFactor": {"conservative": 1, "friction": 1, "damping": 1, **(factor or {})},
        "confidence": 0.8,
        "reason": "test",
    }


def proposal(*effects, joint="door", kind="revolute", **extra):
    return Proposal.model_validate(
        {
            "joint_summary": {
                "joint_name": joint,
                "joint_type": kind,
                "motion_description": "",
                "overall_confidence": 0.7,
            },
            "whole_motion_descrptn": "",
            "gravity_can_be_ignored": False,
            "joint_limit_hint": {"selected_side": "none", "elasticity": "none"},
            "effect_proposals": effects,
            **extra,
        }
    )


FRICTION = "constant_friction_hinge"
MAGNET = "magnetic_return_to_low_end"


def peak(profile, channel="friction") -> float:
    grid = np.linspace(0, 1, 1001)
    return float(np.abs(evaluate(getattr(profile.channels, channel), grid)[0]).max())


def references(folder, *, mass=2.0, size=0.1, kind="hinge", axis="0 0 1", span=1.5):
    """Of a box of half-length `size` whose one edge is on the axis, and its context."""
    path = folder / "box.xml"
    path.write_text(BOX.format(mass=mass, size=size, kind=kind, axis=axis, span=span))
    found = context(path, "j")
    return reference_scales(found), found


BOX = """
<mujoco><compiler angle="radian"/><worldbody>
  <body><joint name="j" type="{kind}" axis="{axis}" range="0 {span}"/>
    <geom type="box" size="{size} .001 .1" pos="{size} 0 0" mass="{mass}"/></body>
</worldbody></mujoco>"""


def test_a_heavy_joint_is_moved_through_its_range_in_the_travel_time_by_its_reference(tmp_path):
    """Accelerated over the first half of the way, braked over the second; I = m (2 l)^2 / 3."""
    scales, _ = references(tmp_path, mass=30, size=0.4)
    inertia = 30 * (4 * 0.4**2 + 4 * 0.001**2) / 12 + 30 * 0.4**2
    angle = 2 * 0.5 * (scales["friction"] / inertia) * (TRAVEL_TIME / 2) ** 2
    assert angle == pytest.approx(1.5)


def test_gravity_is_the_reference_where_it_is_larger(tmp_path):
    lift = {"mass": 4, "kind": "slide", "span": 0.1}
    scales, found = references(tmp_path, **lift)
    assert scales["conservative"] == scales["friction"] == pytest.approx(4 * 9.81)
    without = reference_scales(found, ignore_gravity=True)
    assert without["conservative"] == pytest.approx(10)


@pytest.mark.parametrize("size", [0.01, 0.1])
def test_a_light_joint_has_a_hands_10_newtons_at_its_farthest_point_as_reference(tmp_path, size):
    scales, _ = references(tmp_path, mass=0.02, size=size)
    assert scales["friction"] == pytest.approx(10 * np.hypot(2 * size, 0.001))
    scales, _ = references(tmp_path, mass=0.02, kind="slide", axis="1 0 0", span=0.006)
    assert scales["friction"] == pytest.approx(10)


@pytest.mark.parametrize(("mass", "size"), [(0.02, 0.01), (30, 0.4)])
def test_damping_of_the_reference_makes_the_reference_force_at_half_a_metre_per_second(
    tmp_path, mass, size
):
    scales, _ = references(tmp_path, mass=mass, size=size)
    angular = 0.5 / np.hypot(2 * size, 0.001)
    assert scales["damping"] * angular == pytest.approx(scales["friction"])
    scales, _ = references(tmp_path, mass=mass, kind="slide")
    assert scales["damping"] * 0.5 == pytest.approx(scales["friction"])


@pytest.mark.parametrize("label", ["weak", "medium", "strong", "dominant"])
def test_a_label_gives_a_peak_within_its_band(door, label):
    reference = reference_scales(context(door, "door"))["friction"]
    low, high = BANDS[label]
    drawn = [
        peak(compile(proposal(effect(FRICTION, friction=label)), door, key=str(k))) / reference
        for k in range(30)
    ]
    assert low <= min(drawn) <= max(drawn) <= high
    assert max(drawn) - min(drawn) > 0.5 * (high - low)


def test_bands_do_not_overlap():
    bands = sorted(BANDS.values())
    assert all(a[1] < b[0] for a, b in pairwise(bands))


def test_refine_factors_multiply(door):
    plain = compile(proposal(effect(FRICTION, friction="strong")), door)
    refined = compile(proposal(effect(FRICTION, friction="strong", factor={"friction": 0.5})), door)
    assert peak(refined) == pytest.approx(0.5 * peak(plain), rel=1e-5)


def test_what_no_joint_can_need_is_refused(door):
    far = effect(FRICTION, friction="dominant", factor={"friction": 100})
    with pytest.raises(JodaError, match=r"friction would be up to .* times what 'strong' stands"):
        compile(proposal(far), door)
    many = effect(FRICTION, friction="dominant", factor={"friction": 10})
    assert peak(compile(proposal(many), door)) > 0
    with pytest.raises(JodaError, match="propose fewer effects"):
        compile(proposal(*[many] * 12), door)


def test_the_prototype_is_stretched_over_the_interval(door):
    profile = compile(proposal(effect(MAGNET, 0.0, 0.1, conservative="strong")), door)
    (component,) = profile.channels.conservative.components
    assert (component.label, component.interval) == (MAGNET, (0.0, 0.1))
    values, _ = evaluate(profile.channels.conservative, [0.0, 0.05, 0.1, 0.5])
    assert values[0] == pytest.approx(-peak(profile, "conservative"))
    assert values[0] < values[1] < values[2]
    assert values[2:] == pytest.approx([0, 0], abs=1e-12)


def test_revising_one_effect_leaves_the_others_alone(door):
    before = compile(
        proposal(effect(FRICTION, friction="weak"), effect(MAGNET, 0, 0.1, conservative="strong")),
        door,
    )
    after = compile(
        proposal(effect(FRICTION, friction="weak"), effect(MAGNET, 0, 0.2, conservative="medium")),
        door,
    )
    assert before.channels.friction == after.channels.friction
    assert peak(after, "conservative") < peak(before, "conservative")


def test_the_same_bytes_from_another_file_name_and_process(door, tmp_path):
    source = tmp_path / "proposal.json"
    source.write_text(proposal(effect(FRICTION, friction="weak")).model_dump_json())
    other = door.rename(tmp_path / "renamed.xml")
    compile(source, other, output=tmp_path / "a.json")
    code = "import sys, joda; joda.compile(sys.argv[1], sys.argv[2], output=sys.argv[3])"
    subprocess.run([sys.executable, "-c", code, source, other, tmp_path / "b.json"], check=True)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    content = json.loads((tmp_path / "a.json").read_text())
    assert content["channels"]["friction"]["components"][0]["y"] == [0.388646, 0.388646]  # anywhere


def test_the_limit_hint_and_the_combination_are_carried(door):
    hint = {"selected_side": "low_end", "elasticity": "weak"}
    profile = compile(
        proposal(effect(FRICTION, friction="weak"), joint_limit_hint=hint), door, combine="max"
    )
    assert profile.joint_limit_hint.elasticity == "weak"
    assert profile.channels.friction.combine == "max"


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (
            proposal(effect("magic", friction="weak")),
            "effect 'magic' is not in the library",
        ),
        (
            proposal(effect(FRICTION), kind="prismatic"),
            "is a hinge and the proposal is for",
        ),
        (proposal(effect(FRICTION), joint="lid"), "joint 'lid' not found"),
    ],
)
def test_a_proposal_that_does_not_fit_is_told(door, made, message):
    with pytest.raises(JodaError, match=message):
        compile(made, door)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"start_ratio": 0.5, "end_ratio": 0.5}, "start_ratio must be less than end_ratio"),
        ({"end_ratio": 1.5}, "effect_proposals[0].end_ratio"),
        ({"strength": {"friction": "huge"}}, "effect_proposals[0].strength.friction"),
        ({"strenth": {}}, "effect_proposals[0].strenth: unknown key"),
    ],
)
def test_a_bad_file_is_told_by_key(door, tmp_path, change, message):
    content = json.loads(proposal(effect(FRICTION, friction="weak")).model_dump_json())
    content["effect_proposals"][0] |= change
    path = Path(tmp_path / "proposal.json")
    path.write_text(json.dumps(content))
    with pytest.raises(JodaError) as error:
        compile(path, door)
    assert message in str(error.value)
