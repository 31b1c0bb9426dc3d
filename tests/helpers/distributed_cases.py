"""Simulated doors that lack something, each in a folder with its model and runs."""

from pathlib import Path

import mujoco
import numpy as np

DOOR = """<mujoco>
  <compiler angle="radian"/><option timestep="0.002" gravity="0 0 0"/>
  <worldbody><body><joint name="door" axis="0 0 1" range="0 1.6" {native}/>
    <geom type="box" size=".4 .02 .9" pos=".4 0 0" mass="3" contype="0"/></body></worldbody>
</mujoco>"""


def make(folder: Path, count: int, seconds: float = 3.0, seed: int = 0) -> Path:
    """So many doors whose friction or damping their models lack; returns the folder."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        case = folder / f"door_{number:04d}"
        case.mkdir(parents=True)
        (case / "door.xml").write_text(DOOR.format(native=""))
        kind = ("frictionloss", "damping")[number % 2]
        truth = DOOR.format(native=f'{kind}="{rng.uniform(0.4, 1.2):.3f}"')
        for run in range(2):
            lines = _run(truth, seconds, rng, 0.4 + 0.2 * run)
            (case / f"run{run}.csv").write_text("\n".join(lines) + "\n")
    return folder


def _run(truth: str, seconds: float, rng: np.random.Generator, period: float) -> list[str]:
    model = mujoco.MjModel.from_xml_string(truth)
    data = mujoco.MjData(model)
    data.qpos[0] = 0.8
    lines = ["time,position,force"]
    for step in range(round(seconds / model.opt.timestep)):
        force = 3 * np.sin(2 * np.pi * data.time / period) + 1.0 * np.sin(data.time)
        if step % 5 == 0:
            noise = 2e-4 * rng.standard_normal()
            lines.append(f"{data.time:.4f},{data.qpos[0] + noise:.6f},{force:.5f}")
        data.qfrc_applied[0] = force
        mujoco.mj_step(model, data)
    return lines
