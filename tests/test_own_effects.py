"""An effect whose card is written outside of the package: it is found, and told in its words."""

from collections.abc import Iterator

import mujoco
import numpy as np
import pytest

from joda import diagnose
from joda.effects import EFFECTS, Effect, LearnedForce
from joda.effects.guesses import STRENGTH, TRIAL, InitialGuess, Units

NAME = "root_drag"
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


class RootDrag(Effect):
    """Drag that grows with the root of speed, executed as a table over speed."""

    NAME = "drag that grows with the root of speed"
    KIND = "resistance"
    DESCRIPTION = "A film of grease that thins as it is sheared."
    LAW = "force -y sign(v) sqrt(|v|)"
    SOURCE = "power-law fluid: Ostwald 1925, de Waele 1923"
    SHOWS = "Slow motions lose more than in proportion to their speed, fast ones less."

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """Of the same size everywhere."""
        rising = joint.speed * np.geomspace(0.01, 4.0, 11)
        speeds = np.concatenate([-rising[::-1], [0.0], rising])
        unit = joint.force / joint.speed**0.5

        def effect(x):
            y = unit * x[0] * np.sign(speeds) * np.sqrt(np.abs(speeds))
            return LearnedForce(velocities=tuple(speeds), y=(tuple(y),))

        yield InitialGuess([STRENGTH], [[TRIAL]], effect, lambda x: unit * x[0], "N·m·(s/rad)^0.5")


def pushed(size, rng, number, path):
    """A run of the wheel pushed to and fro against such a drag, as an encoder sees it."""
    model = mujoco.MjModel.from_xml_string(SCENE)
    data, rows, pace = mujoco.MjData(model), [], rng.uniform(0.6, 1.2)
    for k in range(2000):
        speed = float(data.qvel[0])
        push = 0.3 * np.sin(pace * data.time + number) + 0.2 * np.sin(3.1 * pace * data.time)
        if k % 4 == 0:
            held = push
            rows.append((data.time, data.qpos[0] + 5e-4 * rng.normal(), push))
        data.qfrc_applied[0] = held - size * np.sign(speed) * abs(speed) ** 0.5
        mujoco.mj_step(model, data)
    np.savetxt(path, rows, "%.7f", ",", header="time,position,force", comments="")


@pytest.mark.slow
def test_it_is_diagnosed_by_its_card_alone(tmp_path, monkeypatch, rng):
    size = rng.uniform(0.08, 0.16)
    scene = tmp_path / "wheel.xml"
    scene.write_text(SCENE)
    runs = [tmp_path / f"run{k}.csv" for k in range(3)]
    for number, path in enumerate(runs):
        pushed(size, rng, number, path)
    monkeypatch.setitem(EFFECTS, NAME, RootDrag)
    found = diagnose(scene, "wheel", runs)
    first = found.effects[0]
    assert found.verdict == "missing_effect" and first.effect == NAME, found.summary
    assert first.magnitude == pytest.approx(size, abs=max(3 * first.magnitude_error, 0.05 * size))
    assert RootDrag.NAME in found.summary
