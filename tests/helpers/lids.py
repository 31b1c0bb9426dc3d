"""A lid that is thrown and comes to rest by drag and friction, in closed form, as measured runs."""

import numpy as np

from joda.measured.reading import read_measured
from joda.measured.run_files import write_run
from joda.measured.runs import Run

INERTIA, FRICTION, SPAN, SIGMA, RATE = 0.03, 0.05, 4.5, 4e-4, 400
SCENE = f"""<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="lid" axis="0 1 0" range="0 {SPAN}" limited="true" frictionloss="{FRICTION}"/>
      <inertial pos="0 0 0" mass="1" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/>
    </body>
  </worldbody>
</mujoco>
"""


def flicked(rng, drag, friction):
    """A lid that is thrown, comes to rest by drag and friction, and rests for as long thrice.

    v' = -k v² - m, k and m drag and friction per inertia, makes v = sqrt(m / k) tan(a - b t) with
    b = sqrt(m k), and q = q0 + log(cos(a - b t) / cos a) / k.
    """
    k, m = drag / INERTIA, friction / INERTIA
    start, speed, b = rng.uniform(0.1, 0.5), rng.uniform(2.5, 3.5), np.sqrt(m * k)
    a = np.arctan(speed * np.sqrt(k / m))
    time = np.arange(0, rng.uniform(3.5, 4.5) * a / b, 1 / RATE)
    return time, start + np.log(np.cos(np.maximum(a - b * time, 0)) / np.cos(a)) / k


def thrown(folder, rng, count, drag, friction=FRICTION):
    """The lid without that drag in its model, nor another friction, and so many runs.

    The drag may differ from run to run, shape (count,).
    """
    (folder / "model.xml").write_text(SCENE)
    files = [folder / f"run{k}.csv" for k in range(count)]
    for file, own in zip(files, np.broadcast_to(drag, count), strict=True):
        time, position = flicked(rng, own, friction)
        noisy = position + SIGMA * rng.standard_normal(len(time))
        write_run(file, Run(file.name, time, noisy, None, 0 * time, False))
    return read_measured(folder / "model.xml", "lid", files)
