"""Pictures of a joint: the moving part is blue, fills the frame and visibly moves."""

from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from assets import asset

from joda import JodaError, render
from joda.pictures import offscreen
from joda.pictures.offscreen import NoRenderer

MICROWAVE = Path(__file__).parents[1] / "models" / "microwave.xml"

THIRD_PARTY = [
    ("microwave", "micro0joint"),
    ("cabinet", "top_level"),
    ("table", "base__drawer"),
    ("table", "base__slide"),
    ("kitchen", "slide_cabinet"),
    ("kitchen", "knob_Joint_1"),
    ("kitchen", "light_switch"),
    ("kitchen", "microwave"),
    ("drawer", "goal_slidey"),
]

NO_LIGHT = """
<mujoco><compiler angle="radian"/><worldbody><body>
  <joint name="{joint}" type="{kind}" axis="{axis}" range="0 1"/>
  <geom type="box" size="0.4 0.02 0.3" pos="0.4 0 0" group="{group}" rgba="0 0 0 1"/>
</body></worldbody></mujoco>
"""


RANDOM = """
<mujoco><compiler angle="radian"/><worldbody>
  <geom type="plane" size="0 0 1" pos="0 0 {floor}" rgba="0.5 0.4 0.3 1"/>
  <geom type="box" size="{post}" pos="{aside}" rgba="0.6 0.6 0.5 1"/>
  <body quat="{turned}">
    <joint name="part" type="{kind}" axis="{axis}" pos="{anchor}" range="{range}"/>
    <geom type="box" size="{box}" rgba="{colour} 1"/>
    <geom type="capsule" fromto="0 0 0 {tip}" size="{thin}" rgba="0.8 0.8 0.8 1"/>
  </body>
</worldbody></mujoco>
"""


@pytest.fixture(scope="session", autouse=True)
def _renders():
    """Skips the module's tests where there is no OpenGL at all."""
    try:
        offscreen.render(MICROWAVE, [])
    except NoRenderer:
        pytest.skip("nothing can render here")


def pixels(path):
    """RGB, 0 to 1, shape (720, 960, 3)."""
    return matplotlib.image.imread(path)[..., :3]


def blue(path):
    """Which pixels are of the highlight, its markings among them, shape (720, 960)."""
    r, g, b = np.moveaxis(pixels(path), -1, 0)
    return (b - r > 0.15) & (b - g > 0.02)


def orange(path):
    r, g, b = np.moveaxis(pixels(path), -1, 0)
    return (r > 0.6) & (g > 0.25 * r) & (g < 0.6 * r) & (b < 0.25 * r)


def check(paths):
    """The part and the arrow fill the frame, nothing is cut off, and the motion is seen."""
    parts = [blue(path) for path in paths]
    assert parts[0].shape == (720, 960)
    assert all(part.any() and orange(path).any() for part, path in zip(parts, paths, strict=True))
    shown = np.any([*parts, orange(paths[0])], axis=0)
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    assert max(np.ptp(rows) / 720, np.ptp(columns) / 960) > 0.75
    assert min(rows[0], columns[0], 719 - rows[-1], 959 - columns[-1]) >= 5
    part = parts[0] | parts[-1]
    change = np.abs(pixels(paths[0]) - pixels(paths[-1])).max(axis=2)
    assert (change > 0.1)[part].mean() > 0.1


def random_scene(seed):
    """A box with a stick, anywhere, of any size, on a hinge or slide in any direction."""
    rng = np.random.default_rng(seed)
    size = 10 ** rng.uniform(-2.5, 0.5)
    box = size * rng.uniform(0.05, 0.5, 3)
    kind = ("hinge", "slide")[seed % 2]
    width = rng.uniform(0.4, 3) if kind == "hinge" else size * rng.uniform(0.2, 1)
    middle = width * rng.uniform(-0.5, 0.5)
    angle = rng.uniform(0, 2 * np.pi)

    def text(*values):
        return " ".join(f"{value:.6g}" for value in np.ravel(values))

    return RANDOM.format(
        floor=text(-3 * size),
        post=text(0.3 * size, 0.3 * size, 3 * size),
        aside=text(2.5 * size * np.cos(angle), 2.5 * size * np.sin(angle), 0),
        turned=text(rng.normal(size=4)),
        kind=kind,
        axis=text(rng.normal(size=3)),
        anchor=text(box * rng.uniform(-1, 1, 3)),
        range=text(middle - width / 2, middle + width / 2),
        box=text(box),
        colour=text(rng.uniform(0, 1, 3)),
        tip=text(box * rng.uniform(-1.5, 1.5, 3)),
        thin=text(0.04 * size),
    )


def one(tmp_path, kind="hinge", axis="0 0 1", group=0, joint="lid"):
    path = tmp_path / "one.xml"
    path.write_text(NO_LIGHT.format(kind=kind, axis=axis, group=group, joint=joint))
    return path


def test_the_door_from_closed_to_open(tmp_path):
    paths = render(MICROWAVE, "door", tmp_path / "new" / "folder")
    assert [path.name for path in paths] == [
        "door_0.00.png",
        "door_0.25.png",
        "door_0.50.png",
        "door_0.75.png",
        "door_1.00.png",
    ]
    assert sorted(paths[0].parent.iterdir()) == paths
    check(paths)


@pytest.mark.sweep(4)
@pytest.mark.parametrize(("name", "joint"), THIRD_PARTY)
def test_third_party(tmp_path, name, joint):
    check(render(asset(name), joint, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["0 0 1", "0 0 -1", "1 0 0", "0 1 0", "1 1 0.3"])
@pytest.mark.parametrize("kind", ["hinge", "slide"])
def test_any_axis_without_a_light(tmp_path, kind, axis):
    check(render(one(tmp_path, kind, axis), "lid", tmp_path, count=2))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_random_scenes(tmp_path, seed):
    path = tmp_path / "random.xml"
    path.write_text(random_scene(seed))
    check(render(path, "part", tmp_path, count=2))


@pytest.mark.parametrize("colours", ["0 0 0 1,1 1 1 1", "1 1 1 1,0 0 0 1", "0.6 0.6 0.6 1,1 0 0 1"])
def test_a_marking_on_a_part_is_seen(tmp_path, colours):
    """A line on a disc that turns about its own axis: nothing else shows the motion."""
    disc, line = colours.split(",")
    path = tmp_path / "disc.xml"
    path.write_text(f"""
<mujoco><worldbody><body>
  <joint name="disc" axis="0 0 1" range="0 90"/>
  <geom type="cylinder" size="0.2 0.05" rgba="{disc}"/>
  <geom type="box" size="0.09 0.015 0.001" pos="0.1 0 0.05" rgba="{line}"/>
</body></worldbody></mujoco>""")
    low, high = (pixels(p) for p in render(path, "disc", tmp_path, count=2))
    line_share = 0.18 * 0.03 / (np.pi * 0.2**2)
    seen = np.abs(low - high).max(axis=2) > 0.2
    assert seen.sum() > 0.3 * line_share * blue(tmp_path / "disc_0.00.png").sum()


def test_a_part_that_only_collides_is_shown(tmp_path):
    check(render(one(tmp_path, group=3), "lid", tmp_path, count=2))


def test_pictures_are_as_large_as_is_asked_for(tmp_path):
    for path in render(one(tmp_path), "lid", tmp_path, count=2, size=(480, 360)):
        assert matplotlib.image.imread(path).shape[:2] == (360, 480)


def test_any_number_of_pictures(tmp_path):
    paths = render(one(tmp_path), "lid", tmp_path, count=3)
    assert [path.name for path in paths] == ["lid_0.00.png", "lid_0.50.png", "lid_1.00.png"]
    with pytest.raises(JodaError, match="count is 1; give at least 2 pictures"):
        render(MICROWAVE, "door", tmp_path, count=1)


def test_a_name_that_is_no_file_name(tmp_path):
    paths = render(one(tmp_path, joint="robot/$arm:1"), "robot/$arm:1", tmp_path, count=2)
    assert [path.name for path in paths] == ["robot_arm_1_0.00.png", "robot_arm_1_1.00.png"]


def test_the_model_is_left_alone(tmp_path):
    path = one(tmp_path)
    before = path.read_bytes()
    render(path, "lid", tmp_path / "out", count=2)
    assert path.read_bytes() == before


@pytest.mark.long
def test_overwrites_only_when_told(tmp_path):
    path = one(tmp_path)
    first = render(path, "lid", tmp_path, count=2)[1]
    first.write_bytes(b"mine")
    with pytest.raises(JodaError, match=r"lid_0.00.png: exists already; .* add --force"):
        render(path, "lid", tmp_path, count=2)
    assert first.read_bytes() == b"mine"
    render(path, "lid", tmp_path, count=2, force=True)
    assert first.read_bytes() != b"mine"


def test_a_joint_that_does_not_exist(tmp_path):
    with pytest.raises(JodaError, match=r"joint 'lid' not found; .*: 'door'"):
        render(MICROWAVE, "lid", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_joint_that_moves_nothing_visible(tmp_path):
    path = one(tmp_path)
    path.write_text(path.read_text().replace("0 0 0 1", "0 0 0 0"))
    with pytest.raises(JodaError, match="joint 'lid' moves no geom that can be seen"):
        render(path, "lid", tmp_path / "out")


def test_a_folder_that_is_a_file(tmp_path):
    path = one(tmp_path)
    with pytest.raises(JodaError, match="cannot be made"):
        render(path, "lid", path)


@pytest.mark.parametrize("backend", ["disabled", "nonsense"])
def test_where_nothing_can_render(tmp_path, monkeypatch, backend):
    monkeypatch.setenv("MUJOCO_GL", backend)
    with pytest.raises(NoRenderer, match=r"nothing can render here.*libegl1.*libosmesa6"):
        render(MICROWAVE, "door", tmp_path)
    assert not list(tmp_path.iterdir())
