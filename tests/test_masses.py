"""Masses and inertias that cannot be, told in a sentence with the numbers."""

import subprocess
import sys

import mujoco
import numpy as np
import pytest
from assets import NAMES, asset
from scenes import write

from joda import compare, context, generate
from joda.measured.run_files import write_run
from joda.measured.runs import Run
from joda.scenes.model import joint_type, load_model

PART = """<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 0"/>
  <asset>{asset}</asset>
  <worldbody>
    <body name="part">
      <joint name="j" axis="0 0 1" range="0 1.6" {joint}/>
      {geoms}
    </body>
  </worldbody>
  <actuator>{actuator}</actuator>
</mujoco>"""


def part(geoms, joint="", asset="", actuator=""):
    return PART.format(geoms=geoms, joint=joint, asset=asset, actuator=actuator)


def warnings(folder, *args, **kwargs):
    return context(write(folder, part(*args, **kwargs)), "j").warnings


def box(x, y, z, more):
    """Full sizes, m."""
    return f'<geom type="box" size="{x / 2} {y / 2} {z / 2}" {more}/>'


def tub(side=0.6, wall=0.01):
    """A mesh: a box without a lid, closed by an inner surface; and its volume, m³."""
    outer, inner = np.array([side] * 3) / 2, np.array([side - 2 * wall] * 3) / 2
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    inside = corners * inner
    inside[1::2, 2] = outer[2]  # the inner surface reaches the rim
    vertices = np.vstack([corners * outer, inside])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4)]
    quads = [*faces, *[tuple(8 + k for k in reversed(face)) for face in faces]]
    quads += [(1, 5, 13, 9), (5, 7, 15, 13), (7, 3, 11, 15), (3, 1, 9, 11)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    text = " ".join(f"{x:.6g}" for x in vertices.ravel())
    face = " ".join(str(k) for t in triangles for k in t)
    volume = side**3 - (side - 2 * wall) ** 2 * (side - wall)
    return f'<mesh name="tub" vertex="{text}" face="{face}"/>', volume


def test_an_oven_door_of_90_grams_is_too_light(tmp_path):
    (said,) = warnings(tmp_path, box(0.6, 0.45, 0.03, 'mass=".09"'))
    litres = 600 * 450 * 30 / 1e6
    assert (
        f"'j' moves 0.09 kg of {litres:.3g} litres, {90 / litres:.2g} kg/m³, lighter than" in said
    )
    assert "set the mass that was weighed (<inertial> or the geoms' mass)" in said
    assert said.endswith("or have it estimated: joda weigh.")
    (said,) = warnings(tmp_path, box(0.6, 0.45, 0.003, 'mass=".09"'))  # a sheet
    assert "of 0.27 m², 0.33 kg/m², lighter than cardboard" in said


def test_a_solid_of_water_s_density_that_is_heavy_is_told(tmp_path):
    (said,) = warnings(tmp_path, box(0.7, 1.8, 0.1, ""))
    assert "moves 126 kg, its 126 litres as solid as water" in said and "shell" in said
    sheet = warnings(tmp_path, box(0.7, 1.8, 0.005, ""))  # 6.3 kg: may be
    assert sheet == ()


def test_a_mesh_weighs_what_its_faces_enclose(tmp_path):
    mesh, volume = tub(1.2, 0.03)
    mesh = mesh.replace("<mesh", '<mesh inertia="exact"')
    (said,) = warnings(tmp_path, '<geom type="mesh" mesh="tub"/>', asset=mesh)
    assert f"its {1e3 * volume:.3g} litres as solid as water" in said
    geom = f'<geom type="mesh" mesh="tub" mass="{0.01 * 1000 * volume}"/>'
    (said,) = warnings(tmp_path, geom, asset=mesh)
    assert f"{1e3 * volume:.3g} litres, 10 kg/m³, lighter than foam" in said


def test_a_mesh_that_mujoco_counts_several_times_is_told(tmp_path):
    mesh, volume = tub(1.2, 0.03)
    path = write(tmp_path, part('<geom type="mesh" mesh="tub"/>', asset=mesh))
    mass = load_model(path).body_mass[1]
    assert mass > 2000 * volume  # MuJoCo's default inertia of a mesh is "legacy"
    (said,) = context(path, "j").warnings
    assert f"as MuJoCo counts {mass:.3g} litres" in said
    assert f"enclose {1e3 * volume:.3g}: set" in said and 'inertia="exact"' in said


def test_a_mesh_whose_hull_mujoco_counts_is_told(tmp_path):
    mesh, volume = tub(0.6, 0.01)
    mesh = mesh.replace("<mesh", '<mesh inertia="convex"')
    path = write(tmp_path, part('<geom type="mesh" mesh="tub"/>', asset=mesh))
    assert load_model(path).body_mass[1] == pytest.approx(1000 * 0.6**3)
    (said,) = context(path, "j").warnings
    assert "as MuJoCo counts 216 litres" in said and f"enclose {1e3 * volume:.3g}: set" in said


def test_mass_where_nothing_of_the_part_is_is_told(tmp_path):
    door = box(0.6, 0.45, 0.03, 'pos=".3 0 0"')
    inertial = '<inertial pos="{} 0 0" mass="4" diaginertia="{} {} {}"/>'
    assert warnings(tmp_path, inertial.format(0.3, 0.1, 0.1, 0.1) + door) == ()
    (said,) = warnings(tmp_path, inertial.format(30, 0.1, 0.1, 0.1) + door)
    assert "moves 4 kg whose centre lies 29." in said and "correct the pos of <inertial>" in said
    (said,) = warnings(tmp_path, inertial.format(0.3, 900, 900, 900) + door)
    assert f"an inertia of {900 + 4 * 0.3**2:.3g} kg·m², as if all of it were 15" in said
    # as modellers leave it: 1 kg, 1 kg m² and the hinge for a centre
    (said,) = warnings(tmp_path, inertial.format(0, 1, 1, 1).replace("4", "1", 1) + door)
    assert "as if all of it were 1 m from the axis, though its geoms reach 0.6" in said


def test_what_is_heavier_than_lead_is_told(tmp_path):
    (said,) = warnings(tmp_path, box(0.02, 0.02, 0.02, 'mass="2"'))
    assert "moves 2 kg within 0.008 litres, 2.5e+05 kg/m³, heavier than lead" in said


@pytest.mark.parametrize(
    ("size", "mass"),
    [
        ((0.6, 0.45, 0.03), 4.0),  # an oven's door
        ((0.7, 1.8, 0.08), 18.0),  # a refrigerator's
        ((0.8, 2.0, 0.04), 40.0),  # a room's, solid
        ((0.02, 0.02, 0.01), 0.004),  # a button
        ((0.33, 0.23, 0.006), 0.4),  # a laptop's lid
        ((0.5, 0.4, 0.15), 3.5),  # a drawer
        ((0.1, 0.1, 0.1), 7.8),  # a block of steel
        ((0.5, 0.5, 0.02), 0.15),  # a board of foam
    ],
)
def test_ordinary_parts_raise_no_doubt(tmp_path, size, mass):
    assert warnings(tmp_path, box(*size, f'mass="{mass}"')) == ()


def test_one_view_of_the_part_that_fits_is_enough(tmp_path):
    """Seen as a hollow box, made of thin panels for contacts: neither alone decides."""
    hull = box(0.6, 0.45, 0.5, 'mass="0" contype="0" conaffinity="0"')
    panel = box(0.6, 0.45, 0.005, 'mass="1.2"')
    assert warnings(tmp_path, hull + panel) == ()


def test_an_inertia_of_armature_is_told_unless_it_is_a_motor_s(tmp_path):
    geoms = box(0.4, 0.02, 0.02, 'mass="1"')
    own = 1 / 12 * (0.4**2 + 0.02**2)
    (said,) = warnings(tmp_path, geoms, 'armature=".1"')
    share = 100 * 0.1 / (0.1 + own)
    assert f"'j': {share:.0f} % of its inertia, 0.1 of {0.1 + own:.3g} kg·m², is armature" in said
    assert warnings(tmp_path, geoms, f'armature="{0.9 * own}"') == ()
    motor = '<motor joint="j"/>'
    assert warnings(tmp_path, geoms, 'armature=".1"', actuator=motor) == ()


def test_a_body_without_geoms_raises_no_doubt(tmp_path):
    inertial = '<inertial pos=".2 0 0" mass=".09" diaginertia=".1 .1 .1"/>'
    assert warnings(tmp_path, inertial) == ()


COUNTED = {"microwave": 0, "cabinet": 0, "table": 0, "kitchen": 10, "drawer": 0, "door": 1}
"""Joints of other people's scenes with a doubt: knobs of armature, lamps and burners of air, a
switch whose mass lies beside it, a latch as hard to turn as if it were twice as long."""


@pytest.mark.slow
@pytest.mark.sweep(3)
@pytest.mark.parametrize("name", NAMES)
def test_other_people_s_scenes_are_seldom_doubted(name):
    path = asset(name)
    model = load_model(path)
    found = [
        context(path, f"#{k}").warnings
        for k in range(model.njnt)
        if joint_type(model, k) in ("hinge", "slide") and np.ptp(model.jnt_range[k]) > 0
    ]
    of_mass = [[one for one in warnings if "its range" not in one] for warnings in found]
    assert sum(map(bool, of_mass)) == COUNTED[name]


def test_compare_generate_and_the_command_say_it(tmp_path):
    path = write(tmp_path, part(box(0.6, 0.45, 0.03, 'mass=".09"'), 'damping=".05"'))
    model = load_model(path)
    data, rows = mujoco.MjData(model), []
    data.qvel[0] = 0.8
    while data.time < 2:
        rows.append((data.time, data.qpos[0]))
        mujoco.mj_step(model, data, 5)
    time, position = np.array(rows).T
    position = position + np.random.default_rng(0).normal(0, 1e-3, len(time))
    write_run(tmp_path / "r.csv", Run("r.csv", time, position, None, np.zeros(len(time)), False))
    said = "lighter than foam"
    assert any(said in note for note in compare(path, "j", [tmp_path / "r.csv"]).notes)
    made = generate(path, "j", tmp_path / "g", proposer="offline", rounds=1)
    assert any(said in note for note in made.notes)
    command = [sys.executable, "-m", "joda", "context", str(path), "--joint", "j"]
    assert said in subprocess.run(command, capture_output=True, text=True, check=True).stdout
