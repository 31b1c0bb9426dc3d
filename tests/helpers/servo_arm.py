"""An arm with a position servo, simulated by nobody's engine: logs of its command and position."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

XML = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body name="arm">
      <joint name="elbow" axis="0 1 0" range="-1.5 1.5" limited="true" damping=".05"
        frictionloss="{friction}" armature=".02"/>
      <inertial pos="0.2 0 0" mass="0.6" diaginertia="0.01 0.01 0.01"/>
    </body>
  </worldbody>
  <actuator>
    <position name="servo" joint="elbow" kp="{kp}" kv="1.5" forcerange="-12 12"/>
  </actuator>
</mujoco>
"""
INERTIA, WEIGHT = 0.01 + 0.6 * 0.2**2 + 0.02, 0.6 * 9.81 * 0.2
STEP, RATE, NOISE = 1e-4, 100, 3e-4


@dataclass(frozen=True)
class Arm:
    """The true arm: its gain (N·m/rad), dry friction (N·m), friction by load, delay (s)."""

    kp: float = 40.0
    friction: float = 0.3
    by_load: float = 0.0
    delay: float = 0.0

    def model(self, path: Path) -> Path:
        """The MJCF that says so, but for what it cannot say."""
        path.write_text(XML.format(kp=self.kp, friction=self.friction))
        return path

    def log(self, path: Path, seed: int, seconds: float = 6.0) -> Path:
        """A run that follows a smooth command, held between samples; encoder noise."""
        rng = np.random.default_rng(seed)
        pace, phase = rng.uniform(0.2, 0.8, 4), rng.uniform(0, 2 * np.pi, 4)
        size = rng.uniform(0.1, 0.35, 4)
        time = np.arange(round(seconds * RATE)) / RATE
        command = np.sin(2 * np.pi * np.outer(time, pace) + phase) @ size
        each = round(1 / RATE / STEP)
        late = np.maximum(np.arange(len(time) * each) * STEP - self.delay, 0.0)
        signal = command[np.floor(late * RATE + 1e-9).astype(int)].tolist()
        q, v, path_of = float(command[0]), 0.0, []
        for k, u in enumerate(signal):
            if k % each == 0:
                path_of.append(q)
            servo = min(max(self.kp * (u - q) - 1.5 * v, -12.0), 12.0)
            weight = WEIGHT * np.cos(q)
            v += STEP / INERTIA * (servo + weight - 0.05 * v)
            most = STEP / INERTIA * (self.friction + self.by_load * abs(servo - weight))
            v = v - most if v > most else v + most if v < -most else 0.0
            q += STEP * v
        measured = np.array(path_of) + rng.normal(0, NOISE, len(time))
        rows = zip(time, measured, command, strict=True)
        lines = [f"{t:.6f},{x:.7f},{u:.7f}" for t, x, u in rows]
        path.write_text("\n".join(["time,position,ctrl:servo", *lines]) + "\n")
        return path

    def logs(self, folder: Path, count: int = 4, seconds: float = 6.0) -> list[Path]:
        """Runs of fresh seeds."""
        seeds = np.random.SeedSequence().generate_state(count)
        return [self.log(folder / f"run{k}.csv", int(s), seconds) for k, s in enumerate(seeds)]
