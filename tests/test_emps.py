"""EMPS, a real drive, by its motor's command: the numbers that others published are found."""

import numpy as np
import pytest
from assets import SHARED

import joda
from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.corrections import numbers
from joda.diagnosis.outcome import read_runs
from joda.measured.run_files import read_run

LOG = SHARED / "data" / "emps" / "emps_estimation.csv"
GAIN = 35.15065188
"""Of the drive, N/V (Janot, Gautier and Brunot 2019)."""
FRICTION, DAMPING, OFFSET = 20.39, 203.5, 3.16
"""Of the screw, N, N·s/m and N; the same."""
MASS = 95.1
MODEL = """<mujoco>
  <option timestep="0.001" gravity="PULL 0 0" integrator="implicitfast"/>
  <worldbody><body>
    <joint name="screw" type="slide" axis="1 0 0" limited="true" range="-0.1 0.35"
           frictionloss="10" damping="120"/>
    <inertial pos="0 0 0" mass="MASS" diaginertia="1 1 1"/>
  </body></worldbody>
  <actuator><motor name="drive" joint="screw" gear="{gear}"/></actuator>
</mujoco>
""".replace("PULL", str(OFFSET / MASS)).replace("MASS", str(MASS))
PARTS = 4
"""Runs that the log is cut into; every second is used: 12 s."""

pytestmark = pytest.mark.skipif(not LOG.exists(), reason="the log is not there")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("emps")
    run = read_run(LOG)
    out = []
    for k in range(0, PARTS, 2):
        part = run.part(np.array_split(np.arange(len(run.time)), PARTS)[k][::2])
        rows = np.stack([part.time, part.position, part.force / GAIN], axis=1)
        out.append(folder / f"part{k}.csv")
        np.savetxt(out[-1], rows, "%.9g", ",", header="time,position,ctrl:drive", comments="")
    return out


@pytest.mark.slow
def test_the_drives_friction_and_gain_are_found_from_its_volts(runs, tmp_path):
    factor = float(np.random.default_rng().uniform(0.7, 1.4))
    print(factor)  # shown where the test fails
    (tmp_path / "emps.xml").write_text(MODEL.format(gear=GAIN * factor))
    found = {
        one.parameter: one
        for one in numbers(fit_baseline(read_runs(tmp_path / "emps.xml", "screw", runs)))
    }
    assert found["actuator_gain"].value == pytest.approx(1 / factor, rel=0.1)
    assert found["frictionloss"].value == pytest.approx(FRICTION, rel=0.15)
    assert found["damping"].value == pytest.approx(DAMPING, rel=0.2)
    assert 0 <= found["time_delay"].value < 0.005


@pytest.mark.slow
def test_volts_are_replayed_as_the_force_that_they_make(runs, tmp_path):
    (tmp_path / "emps.xml").write_text(MODEL.format(gear=GAIN))
    text = runs[0].read_text().replace("ctrl:drive", "force").split("\n")
    rows = [line.rpartition(",") for line in text[1:] if line]
    forced = [text[0], *(f"{head},{float(volts) * GAIN:.9g}" for head, _, volts in rows)]
    (tmp_path / "force.csv").write_text("\n".join(forced) + "\n")
    volts, force = (
        joda.compare(tmp_path / "emps.xml", "screw", [path]).rmse_window
        for path in (runs[0], tmp_path / "force.csv")
    )
    assert volts == pytest.approx(force, rel=0.05)
