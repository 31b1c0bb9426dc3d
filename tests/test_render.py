"""Pictures of a joint: the moving part is large, blue and in a different place in each."""

from itertools import pairwise
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from assets import asset

from joda import JodaError, render
from joda.offscreen import ask

MICROWAVE = Path(__file__).parents[1] / "models" / "microwave.xml"

THIRD_PARTY = [
    ("microwave", "micro0joint"),
    ("cabinet", "top_level"),
    ("table", "base__drawer"),
    ("table", "base__slide"),
    ("kitchen", "slide_cabinet"),
    ("kitchen", "knob_Joint_1"),
    ("drawer", "goal_slidey"),
]

NO_LIGHT = """
<mujoco><compiler angle="radian"/><worldbody><body>
  <joint name="{joint}" type="{kind}" axis="{axis}" range="0 1"/>
  <geom type="box" size="0.4 0.02 0.3" pos="0.4 0 0" group="{group}" rgba="0 0 0 1"/>
</body></worldbody></mujoco>
"""


@pytest.fixture(scope="session", autouse=True)
def _renders():
    """Skips the module's tests where there is no OpenGL at all."""
    if ask("joda.offscreen", [str(MICROWAVE), "front", "door", [0.0]]) is None:
        pytest.skip("nothing can render here")


def blue(path):
    """Which pixels have the highlight's hue, shape (720, 960)."""
    r, g, b = np.moveaxis(matplotlib.image.imread(path)[..., :3], -1, 0)
    return (b > 0.2) & (r < 0.45 * b) & (g > 0.3 * b) & (g < 0.65 * b)


def orange(path):
    r, g, b = np.moveaxis(matplotlib.image.imread(path)[..., :3], -1, 0)
    return (r > 0.6) & (g > 0.25 * r) & (g < 0.6 * r) & (b < 0.25 * r)


def check(paths):
    """Every picture shows the part and the arrow, and the part moves."""
    masks = [blue(path) for path in paths]
    for mask in masks:
        assert mask.shape == (720, 960)
        assert mask.mean() > 0.08
        inner = mask[5:-5, 5:-5]  # nothing of it is cut off by the frame
        assert inner.sum() == mask.sum()
    for before, after in pairwise(masks):
        assert (before ^ after).mean() > 0.01
    assert np.any(masks, axis=0).mean() > 0.15
    assert all(orange(path).mean() > 0.001 for path in paths)


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


@pytest.mark.parametrize(("name", "joint"), THIRD_PARTY)
def test_third_party(tmp_path, name, joint):
    check(render(asset(name), joint, tmp_path))


@pytest.mark.parametrize("axis", ["0 0 1", "0 0 -1", "1 0 0", "0 1 0", "1 1 0.3"])
@pytest.mark.parametrize("kind", ["hinge", "slide"])
def test_any_axis_without_a_light(tmp_path, kind, axis):
    check(render(one(tmp_path, kind, axis), "lid", tmp_path, count=2))


def test_a_part_that_only_collides_is_shown(tmp_path):
    check(render(one(tmp_path, group=3), "lid", tmp_path, count=2))


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
    with pytest.raises(JodaError, match=r"nothing can render here.*libegl1.*libosmesa6"):
        render(MICROWAVE, "door", tmp_path)
    assert not list(tmp_path.iterdir())
