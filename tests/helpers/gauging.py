"""A hinge measured by a hand-held gauge: quasi-static curves by analytic laws."""

import secrets
from pathlib import Path

import numpy as np

from joda.measured.measured_joint import Measured
from joda.measured.reading import read_measured

SPAN, FRICTION = 1.5, 0.2
SCENE = f"""<mujoco><compiler angle="radian"/><worldbody><body>
<joint name="door" type="hinge" axis="0 0 1" range="0 {SPAN}" limited="true"
 damping="0.1" frictionloss="{FRICTION}"/>
<inertial pos=".2 0 0" mass="2" diaginertia=".02 .02 .02"/><geom pos=".2 0 0" size=".1" mass="0"/>
</body></worldbody></mujoco>"""
"""The model: constant friction and damping."""

LAWS = {
    "detent_internal": lambda s, d: -1.5 * (s - 0.5) / 0.05 * np.exp(0.5 - (s - 0.5) ** 2 / 0.005),
    "position_dependent_friction": lambda s, d: -0.5 * d * ((s > 0.3) & (s < 0.6)),
    "spring_return_to_low_end": lambda s, d: -0.3 - s,
    "magnetic_return_to_low_end": lambda s, d: -2 / (1 + s / 0.06) ** 2,
}
"""What the joint has besides: force (N·m) over normalised position and direction of travel."""


def gauged(
    folder: Path, law, ways=(1, -1), noise=0.02, uneven=0.0, samples=150, apart=0.0
) -> Measured:
    """The model with a curve of a joint that has a further force, in folder/model.xml, curve.csv.

    Args:
        folder: to write to.
        law: one such.
        ways: in which the joint is moved, one after the other.
        noise: of the gauge, N·m.
        uneven: amplitude of a force that differs from one stroke to the next, N·m.
        samples: of each way.
        apart: how far the places of the ways may differ, in distances of one way's samples.
    """
    seed = secrets.randbits(32)
    print("seed", seed)
    rng = np.random.default_rng(seed)
    there = np.linspace(0.02, 0.98 * SPAN, samples)
    away = apart * (there[1] - there[0])
    q = np.concatenate([np.sort(there + rng.uniform(-away, away, samples))[::way] for way in ways])
    d = np.repeat(ways, len(there))
    force = FRICTION * d - law(q / SPAN, d) + rng.normal(0, noise, len(q))
    for number in range(3, 12):
        phase = np.repeat(rng.uniform(0, 2 * np.pi, len(ways)), len(there))
        force += uneven * np.sqrt(2 / 9) * np.sin(2 * np.pi * number * q / SPAN + phase)
    rows = "\n".join(f"{a:.5f},{b:.4f}" for a, b in zip(q, force, strict=True))
    (folder / "curve.csv").write_text("position,force\n" + rows + "\n")
    (folder / "model.xml").write_text(SCENE)
    return read_measured(folder / "model.xml", "door", [folder / "curve.csv"])
