"""A mass from a part's size, where the model's own cannot be."""

import mujoco
import pytest

from joda import context, weigh
from joda.errors import JodaError

TEXT = """
<mujoco><compiler angle="radian"/>
  <asset><material name="{material}"/><mesh name="m" file="m.obj"/></asset>
  <worldbody><geom type="box" size=".4 .3 .4" pos="0 .31 .4"/>
    <body name="door" pos="-.4 0 .4"><joint name="j" axis="0 0 -1" range="0 1.6"/>
      <geom type="box" size=".4 {half} .4" pos=".4 0 0" mass="{mass}" material="{material}"/>
      <body name="knob" pos=".7 -.03 0"><geom type="mesh" mesh="m" mass=".001"/></body>
    </body>
    <body name="bare"><joint name="bare" axis="0 0 1" range="0 1"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>
  </worldbody></mujoco>"""
MESH = "v 0 0 0\nv .01 0 0\nv 0 .01 0\nv 0 0 .01\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def model(folder, mass=0.02, half=0.009, material="plain"):
    (folder / "m.obj").write_text(MESH)
    path = folder / "a.xml"
    path.write_text(TEXT.format(mass=mass, half=half, material=material))
    return path


@pytest.mark.parametrize(
    ("half", "material", "least", "most"),
    [
        (0.009, "plain", 6, 9),  # a board of 0.64 m² and 18 mm, 650 kg/m³: 7.5 kg
        (0.009, "glass", 26, 32),  # 2500 kg/m³: 28.8 kg
        (0.03, "plain", 12, 20),  # 38 litres, hollow
        (0.03, "brushed_steel", 14, 16),  # 3 mm of sheet in all: 15 kg
    ],
)
def test_an_impossible_mass_becomes_one_that_can_be(tmp_path, half, material, least, most):
    path, out = model(tmp_path, half=half, material=material), tmp_path / "new" / "b.xml"
    out.parent.mkdir()
    before = context(path, "j")
    done = weigh(path, "j", out)
    after = context(out, "j")
    assert "lighter than" in done.warnings[0] and not after.warnings
    assert least < after.moving_mass < most
    assert done.estimate.mass == pytest.approx(after.moving_mass, rel=1e-3)
    ratio = after.moving_mass / before.moving_mass
    assert after.equivalent_inertia == pytest.approx(ratio * before.equivalent_inertia, rel=1e-3)
    assert (after.lever_arm, after.joint) == (pytest.approx(before.lever_arm), before.joint)
    old, new = (mujoco.MjModel.from_xml_path(str(p)) for p in (path, out))
    assert new.ngeom == old.ngeom and new.body("bare").mass == old.body("bare").mass


def test_a_mass_that_can_be_is_left_alone_unless_forced(tmp_path):
    path, out = model(tmp_path, mass=8), tmp_path / "b.xml"
    with pytest.raises(JodaError, match="which can be"):
        weigh(path, "j", out)
    assert not out.exists()
    assert weigh(path, "j", out, force=True).before == pytest.approx(8.001)


def test_an_inertia_that_cannot_be_becomes_that_of_the_geoms(tmp_path):
    """A board of 0.3 m about its edge: m w² / 3, and of its thickness."""
    (tmp_path / "a.xml").write_text(
        """<mujoco><worldbody><geom type="box" size=".2 .2 .2" pos="0 .25 0"/>
        <body pos="-.15 -.2 0"><inertial pos=".15 0 0" mass="1" diaginertia="1 1 1"/>
        <joint name="j" axis="0 0 1" range="-110 0"/>
        <geom type="box" size=".15 .01 .15" pos=".15 -.01 0"/></body></worldbody></mujoco>"""
    )
    done = weigh(tmp_path / "a.xml", "j", tmp_path / "b.xml")
    assert "correct the inertia" in done.warnings[0]
    after = context(tmp_path / "b.xml", "j")
    assert not after.warnings
    right = after.moving_mass * ((0.3**2 + 0.02**2) / 12 + 0.15**2 + 0.01**2)
    assert after.equivalent_inertia == pytest.approx(right, rel=1e-3)


def test_a_part_without_geoms_has_no_size(tmp_path):
    with pytest.raises(JodaError, match="moves no geoms"):
        weigh(model(tmp_path), "bare", tmp_path / "b.xml")
