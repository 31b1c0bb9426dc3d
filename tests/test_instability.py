"""How fast a joint runs away, against closed forms, and what follows from it."""

import mujoco
import numpy as np
import pytest

from joda.diagnosis.outcome import read_runs
from joda.joints.divergence import GROWN, linearized
from joda.measured.instability import followed, longest_followed

INERTIA, WEIGHT, DAMPING = 0.05, 0.8, 0.03
SCENE = """<mujoco><option timestep="0.001" integrator="implicitfast"/><worldbody><body>
  <joint name="rod" axis="0 1 0" range="-100 100" damping="{damping}"/>
  <geom type="sphere" size="0.01" mass="1e-6" contype="0"/>
  <inertial mass="{mass}" pos="0 0 {height}" diaginertia="{rest} {rest} {rest}"/>
</body></worldbody></mujoco>"""


@pytest.fixture
def rod(tmp_path):
    """A rod that stands (or hangs) on its hinge, beside a run of it falling from near the top."""

    def made(height, noise=1e-4):
        mass = WEIGHT / 9.81 / abs(height)
        text = SCENE.format(
            damping=DAMPING, mass=mass, height=height, rest=INERTIA - mass * height**2
        )
        (tmp_path / "rod.xml").write_text(text)
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        data.qpos[0], rows = 1e-3, []
        for _ in range(1500):
            rows.append((data.time, data.qpos[0], data.qvel[0]))
            mujoco.mj_step(model, data)
        off = np.random.default_rng(3).normal(0, noise, len(rows))
        lines = (f"{t:.4f},{q + e:.7f},0" for (t, q, _), e in zip(rows, off, strict=True))
        (tmp_path / "run.csv").write_text("\n".join(["time,position,force", *lines]) + "\n")
        return read_runs(tmp_path / "rod.xml", "rod", [tmp_path / "run.csv"]), np.array(rows)

    return made


def test_at_the_top_it_is_the_root_of_the_linear_equation(rod):
    measured, rows = rod(0.2)
    top = linearized(measured.profile, measured.joint_model, np.zeros(1)).rate[0]
    assert top == pytest.approx(max(np.roots([INERTIA, DAMPING, -WEIGHT])), rel=1e-3)
    early = (rows[:, 1] > 0.01) & (rows[:, 1] < 0.1)  # where MuJoCo's own motion is e^(rate t)
    slope = np.polyfit(rows[early, 0], np.log(rows[early, 1]), 1)[0]
    assert top == pytest.approx(slope, rel=0.02)


def test_where_it_hangs_or_lies_at_an_end_it_is_zero(rod):
    measured, _ = rod(-0.2)
    assert not linearized(measured.profile, measured.joint_model, np.linspace(-1, 1, 9)).rate.any()
    assert longest_followed(measured, 1.5) == 1.5
    (run,), (sigma,) = measured.runs, measured.sigma
    assert len(followed(measured, run, sigma).time) == len(run.time)
    standing, _ = rod(0.2)
    ends = np.deg2rad([-100, -99, 99, 100])
    assert not linearized(standing.profile, standing.joint_model, ends).rate.any()


def test_a_rod_that_stands_is_followed_until_its_noise_is_a_part_of_the_range(rod):
    measured, _ = rod(0.2, noise=2e-3)
    (run,), (sigma,) = measured.runs, measured.sigma
    rate = linearized(measured.profile, measured.joint_model, np.zeros(1)).rate[0]
    upright = np.log(GROWN * np.deg2rad(200) / sigma) / rate  # as long as it is nearly
    assert np.ptp(followed(measured, run, sigma).time) == pytest.approx(upright, rel=0.1)
    assert 0.7 * upright < longest_followed(measured, 1.4) < 1.1 * upright < 1.4
