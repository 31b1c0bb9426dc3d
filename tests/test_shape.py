"""Features of a joint that need no names: against shapes whose answer is plain."""

import mujoco
import numpy as np
import pytest

from joda import context
from joda.scenes.outline import box_along, surface

WALL = (
    '<geom type="box" size=".2 .15 .01" pos="0 0 .01"/>'
    '<geom type="box" size=".2 .15 .01" pos="0 0 .39"/>'
    '<geom type="box" size=".01 .15 .2" pos="-.19 0 .2"/>'
    '<geom type="box" size=".01 .15 .2" pos=".19 0 .2"/>'
    '<geom type="box" size=".2 .01 .2" pos="0 .14 .2"/>'
)
SOLID = '<geom type="box" size=".2 .15 .2" pos="0 0 .2"/>'
PANEL = '<geom type="box" size=".2 .01 .2" pos=".2 -.01 0" mass="2"/>'
SIDE = '<joint name="j" axis="0 0 -1" range="0 1.6"/>'


def scene(folder, rest=WALL, joint=SIDE, part=PANEL, at="-.2 -.15 .2", more="", turn="0 0 0"):
    path = folder / "a.xml"
    path.write_text(
        f'<mujoco><compiler angle="radian"/><worldbody><body name="o" euler="{turn}">{rest}'
        f'<body name="p" pos="{at}">{joint}{part}</body>{more}</body></worldbody></mujoco>'
    )
    return context(path, "j")


def test_a_door_covers_a_cavity_and_a_panel_on_a_block_does_not(tmp_path):
    assert scene(tmp_path).shape.covers > 0.1
    assert scene(tmp_path, SOLID).shape.covers == 0
    assert scene(tmp_path, WALL.replace('pos="0 .14 .2"', 'pos="0 5 .2"')).shape.covers == 0


@pytest.mark.parametrize("gap", [0.0, 0.002, 0.004])
def test_a_lid_on_a_solid_base_covers_nothing(tmp_path, gap):
    """As a laptop's: between lid and base is a slit, and no cavity."""
    base = '<geom type="box" size=".12 .17 .01" pos="0 0 .01"/>'
    lid = '<geom type="box" size=".12 .17 .004" pos=".12 0 .004" mass=".5"/>'
    hinge = '<joint name="j" axis="0 -1 0" range="0 2"/>'
    found = scene(tmp_path, base, hinge, lid, at=f"-.12 0 {0.02 + gap}")
    assert found.shape.covers == 0


@pytest.mark.parametrize("turn", ["0 0 0", "0 0 .7", "0 0 -2.2"])
def test_how_an_object_stands_changes_nothing(tmp_path, turn):
    first, other = scene(tmp_path).shape.model_dump(), scene(tmp_path, turn=turn).shape.model_dump()
    numbers = {key: value for key, value in first.items() if isinstance(value, float)}
    assert {key: other[key] for key in numbers} == pytest.approx(numbers, abs=0.05)
    assert {k: v for k, v in other.items() if k not in numbers} == {
        k: v for k, v in first.items() if k not in numbers
    }


def test_the_end_at_which_it_covers_is_closed_whatever_the_reference(tmp_path):
    assert scene(tmp_path).closed_end == "low_end"
    turned = '<joint name="j" axis="0 0 1" range="-1.6 0"/>'
    assert scene(tmp_path, joint=turned).closed_end == "high_end"
    # built open: the reference is at the low end, and closed is the high one
    opened = '<joint name="j" axis="0 0 1" range="0 1.57"/>'
    part = '<geom type="box" size=".01 .2 .2" pos=".01 -.2 0" mass="2"/>'
    assert scene(tmp_path, joint=opened, part=part).closed_end == "high_end"


def test_weight_is_told_by_the_shape_where_the_mass_is_misplaced(tmp_path):
    """A dishwasher's door whose centre of mass lies on its hinge still wants to fall open."""
    joint = '<joint name="j" axis="1 0 0" range="0 1.5"/>'
    part = (
        '<inertial pos="0 0 0" mass="8" diaginertia=".5 .5 .5"/>'
        '<geom type="box" size=".19 .02 .19" pos="0 -.02 .2" mass="0"/>'
    )
    found = scene(tmp_path, joint=joint, part=part, at="0 -.15 0")
    assert found.gravity_scale == pytest.approx(0, abs=1e-6)
    assert found.shape.weight == "opens" and found.shape.covers > 0.1
    lid = '<joint name="j" axis="-1 0 0" range="0 1.4"/>'
    flat = '<geom type="box" size=".2 .15 .01" pos="0 -.15 .01" mass="2"/>'
    shape = scene(tmp_path, joint=lid, part=flat, at="0 .15 .4").shape
    assert (shape.weight, shape.top, shape.axis) == ("closes", True, "level")


def test_the_lever_arm_goes_to_the_handle_else_to_the_farthest_edge(tmp_path):
    bar = '<geom type="box" size=".01 .01 .05" pos=".33 -.06 0" mass=".1"/>'
    badge = '<geom type="box" size=".01 .001 .01" pos=".1 -.021 0" mass="0"/>'
    plain = scene(tmp_path).lever_arm
    assert plain == pytest.approx((0.4**2 + 0.02**2) ** 0.5)
    assert scene(tmp_path, part=PANEL + badge).lever_arm == pytest.approx(plain)
    assert scene(tmp_path, part=PANEL + bar).lever_arm == pytest.approx((0.33**2 + 0.06**2) ** 0.5)
    named = '<geom name="Griff" type="box" size=".01 .001 .05" pos=".3 -.02 0" mass=".1"/>'
    assert scene(tmp_path, part=PANEL + named).lever_arm == pytest.approx(0.3, abs=2e-3)


def test_a_dial_on_a_door_is_no_handle(tmp_path):
    """As a safe's: half-way to the edge, on a joint of its own."""
    dial = '<geom type="cylinder" size=".03 .015" pos="0 -.015 0" euler="1.5708 0 0"/>'
    fast = f'<body pos=".2 -.02 0">{dial}</body>'
    turns = f'<body pos=".2 -.02 0"><joint axis="0 1 0" range="0 5"/>{dial}</body>'
    plain = scene(tmp_path).lever_arm
    assert scene(tmp_path, part=PANEL + fast).lever_arm == pytest.approx(0.2, abs=5e-3)
    assert scene(tmp_path, part=PANEL + turns).lever_arm == pytest.approx(plain)


def test_the_lever_arm_of_a_switch_does_not_count_to_a_misplaced_centre_of_mass(tmp_path):
    part = (
        '<inertial pos=".4 0 0" mass=".1" diaginertia="1e-4 1e-4 1e-4"/>'
        '<geom type="box" size=".03 .01 .01" pos=".03 0 0" mass="0"/>'
    )
    assert scene(tmp_path, part=part).lever_arm == pytest.approx(0.06, abs=2e-3)


def test_a_drawer_is_a_tray_that_comes_out(tmp_path):
    joint = '<joint name="j" type="slide" axis="0 -1 0" range="0 .2"/>'
    tray = (
        '<geom type="box" size=".17 .1 .005" pos="0 0 -.05"/>'
        '<geom type="box" size=".005 .1 .05" pos="-.17 0 0"/>'
        '<geom type="box" size=".005 .1 .05" pos=".17 0 0"/>'
        '<geom type="box" size=".17 .005 .05" pos="0 -.1 0"/>'
        '<geom type="box" size=".17 .005 .05" pos="0 .1 0"/>'
    )
    found = scene(tmp_path, joint=joint, part=tray, at="0 -.02 .2")
    assert found.shape.holds and found.shape.sticks_out > 0.1 and found.closed_end == "low_end"
    block = '<geom type="box" size=".17 .1 .05"/>'
    assert not scene(tmp_path, joint=joint, part=block, at="0 -.02 .2").shape.holds


def test_joints_of_equal_shape_are_drawn_alike(tmp_path):
    other = SIDE.replace('"j"', '"k"').replace("0 0 -1", "0 0 1")
    small = other.replace('"k"', '"l"')
    more = (
        f'<body name="q" pos=".2 -.15 .7">{other}{PANEL.replace(".2 -.01", "-.2 -.01")}</body>'
        f'<body name="r" pos=".2 -.15 .9">{small}<geom type="box" size=".1 .01 .1"/></body>'
    )
    found = scene(tmp_path, more=more)
    assert (found.shape.siblings, found.shape.doors, found.shape.controls) == (1, 2, 0)
    path = tmp_path / "a.xml"
    assert context(path, "k").twin == found.twin == "j"
    assert context(path, "l").twin == "l"


def test_what_is_carried_and_what_is_a_link(tmp_path):
    lever = (
        '<body name="h" pos=".35 -.03 0"><joint name="h" axis="0 1 0" range="0 1"/>'
        '<geom type="box" size=".05 .01 .01" pos="-.05 0 0"/></body>'
    )
    assert scene(tmp_path, part=PANEL + lever).shape.carries
    shape = context(tmp_path / "a.xml", "h").shape
    assert shape.carried and not shape.linked
    link = lever.replace('size=".05 .01 .01"', 'size=".2 .02 .15"')
    assert scene(tmp_path, part=PANEL + link).shape.linked


def test_the_box_of_least_face_is_found_at_any_angle():
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="box" size=".3 .1 .05" euler="0 0 33"/></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = box_along(surface(model, data, [0]), np.array([0.0, 0.0, 1.0]))
    assert found.size == pytest.approx([0.1, 0.6, 0.2], rel=0.02)


def test_a_silhouette_is_that_of_the_mesh_and_not_of_its_hull(tmp_path):
    """A disc fills pi/4 of its box; a ring of four bars 1 - 0.6² of it, whatever its hull says."""
    disc = '<geom type="cylinder" size=".2 .01" euler="1.5708 0 0" pos=".2 -.01 0" mass="2"/>'
    assert scene(tmp_path, part=disc).shape.fill == pytest.approx(np.pi / 4, abs=0.02)
    assert scene(tmp_path).shape.fill == 1.0
    corners = [(s * x, y, s * z) for s in (0.2, 0.12) for y in (-0.01, 0.01) for x, z in
               ((-1, -1), (1, -1), (1, 1), (-1, 1))]  # fmt: skip
    faces = []
    for k in range(4):
        n = (k + 1) % 4  # outer back, outer front, inner back, inner front: 0, 4, 8, 12
        for a, b in ((0, 4), (4, 12), (12, 8), (8, 0)):
            faces += [(a + k, a + n, b + n), (a + k, b + n, b + k)]
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
    (tmp_path / "ring.obj").write_text(
        text + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces)
    )
    path = tmp_path / "b.xml"
    path.write_text(
        '<mujoco><compiler angle="radian"/><asset><mesh name="m" file="ring.obj" inertia="shell"/>'
        f'</asset><worldbody><body name="o">{WALL}<body pos="-.2 -.15 .2">{SIDE}'
        '<geom type="mesh" mesh="m" pos=".2 -.01 0" mass="2"/></body></body></worldbody></mujoco>'
    )
    assert context(path, "j").shape.fill == pytest.approx(1 - 0.6**2, abs=0.06)


def test_the_room_beyond_either_end_is_that_to_the_object(tmp_path):
    """A slide of 0.1 m whose block of 0.1 m stops 0.05 m before one wall, and at the other."""
    rest = (
        '<geom type="box" size=".01 .2 .2" pos="-.06 0 0"/>'
        '<geom type="box" size=".01 .2 .2" pos=".21 0 0"/>'
    )
    part = '<geom type="box" size=".05 .05 .05" mass="1"/>'
    slide = '<joint name="j" type="slide" axis="1 0 0" range="0 .1"/>'
    seen = scene(tmp_path, rest, slide, part, "0 0 0").shape
    assert seen.room_closed == pytest.approx(0, abs=0.02)
    assert seen.room_open == pytest.approx(0.5, abs=0.02)
    free = scene(tmp_path, rest, slide.replace('"1 0 0"', '"0 0 1"'), part, "0 0 0").shape
    assert free.room_closed == free.room_open == 1.0


def test_a_tray_lies_and_a_panel_stands(tmp_path):
    wide, deep, thin = np.random.default_rng().uniform([0.15, 0.15, 0.01], [0.3, 0.3, 0.05])
    slide = '<joint name="j" type="slide" axis="0 -1 0" range="0 .2"/>'
    for size, lies in (((wide, deep, thin), True), ((thin, deep, wide), False)):
        part = f'<geom type="box" size="{" ".join(map(str, size))}" mass="1"/>'
        assert scene(tmp_path, joint=slide, part=part).shape.lies == lies


def test_a_joint_is_centred_whose_reference_is_in_the_middle_of_its_range(tmp_path):
    low, span, off = np.random.default_rng().uniform([-2, 0.5, 0.2], [1, 2, 0.5])
    for reference, centred in ((low + span / 2, True), (low + (0.5 + off) * span, False)):
        ends = f'range="{low} {low + span}" ref="{reference}"'
        joint = f'<joint name="j" axis="0 0 -1" {ends}/>'
        assert scene(tmp_path, joint=joint).shape.centred == centred
