"""What the steps of the joint by itself leave of joints that lack nothing, by how many a segment
has, as MuJoCo takes them and of second order; and how long a replay takes.

python tests/benchmarks steps [CASES] [SEED]     of each family; of a fresh seed, which is printed
"""

import secrets
import sys
import time
from dataclasses import replace

import numpy as np
from hidden_cases import read

from joda.diagnosis.baseline import fit_baseline
from joda.estimation import segmentation
from joda.hidden import FAMILIES, draw
from joda.joints.joint_model import JointModel
from joda.measured.reading import Measured

MANY = (900, 300, 150, 100, 60)
"""Steps that a segment has at least."""
ENGINE = "as MuJoCo"


def left(measured: Measured, steps: int) -> tuple[float, float]:
    """Loss per sample of the model, and seconds of a replay."""
    segmentation.STEPS = steps
    found = fit_baseline(measured)
    estimator, simulator = found.estimator, found.base.simulator(found.fit.x)
    begun = time.process_time()
    estimator.segments.misfit(simulator, found.fit.start)
    return found.fit.loss / estimator.samples, time.process_time() - begun


def main() -> None:
    given = [int(word) for word in sys.argv[1:]]
    cases, seed = (*given, *(3, secrets.randbits(31))[len(given) :])
    stepped = JointModel.stepped
    print(f"{cases} joints of each family that lack nothing, seed {seed}: loss per sample, ms\n")
    print(f"{'':28} " + "".join(f"{n:>18}" for n in MANY))
    for family in FAMILIES:
        for number in range(cases):
            measured, _ = read(draw(seed + number, None, True, None, family))
            for scheme in (ENGINE, "second order"):
                engine = scheme == ENGINE
                JointModel.stepped = (  # type: ignore[method-assign]
                    (lambda own, h: replace(stepped(own, h), trapezoidal=False))
                    if engine
                    else stepped
                )
                rows = np.array([left(measured, steps) for steps in MANY])
                told = "".join(f"{loss:10.4f} {1000 * took:7.2f}" for loss, took in rows)
                print(f"{family:14} {scheme:13} {told}", flush=True)


if __name__ == "__main__":
    main()
