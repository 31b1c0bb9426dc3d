"""A wheel without a profile, and runs of it as an encoder sees them."""

import mujoco
import numpy as np

SCENE = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast" gravity="0 0 0"/>
  <worldbody>
    <body name="wheel">
      <joint name="wheel" axis="0 0 1" range="-1.5 1.5" limited="true" damping="0.02"/>
      <inertial pos="0 0 0" mass="0.5" diaginertia="0.01 0.01 0.01"/>
    </body>
  </worldbody>
</mujoco>
"""


def pushed(scene, rng, number, path, resistance=lambda speed: 0.0, steps=3000):
    """A run of the wheel in a scene, pushed to and fro by a recorded force, against a resistance
    (N·m) that is not the scene's."""
    model = mujoco.MjModel.from_xml_path(str(scene))
    data, rows, pace = mujoco.MjData(model), [], rng.uniform(0.6, 1.2)
    for k in range(steps):
        if k % 4 == 0:
            push = 0.35 * np.sin(pace * data.time + number) + 0.15 * np.sin(3.1 * pace * data.time)
            rows.append((data.time, data.qpos[0] + 5e-4 * rng.normal(), push))
        data.qfrc_applied[0] = push - resistance(float(data.qvel[0]))
        mujoco.mj_step(model, data)
    np.savetxt(path, rows, "%.7f", ",", header="time,position,force", comments="")
