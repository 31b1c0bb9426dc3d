"""What the steps of the joint by itself leave of joints that lack nothing, by how many a segment
has, as MuJoCo takes them and of second order; and how long a replay takes.

python tests/benchmarks steps [CASES] [SEED]     of each family; of a fresh seed, which is printed
"""

import secrets
import sys
import time

import numpy as np
from hidden_cases import read

from joda.estimation import segmentation
from joda.estimation.problem import posed, segments_for
from joda.hidden import FAMILIES, draw
from joda.measured.measured_joint import Measured

MANY = (900, 300, 150, 100, 60)
"""Steps that a segment has at least."""


def left(measured: Measured, steps: int, accurate: bool) -> tuple[float, float]:
    """Loss per sample of the model, and seconds of a replay."""
    segmentation.STEPS = steps
    segments = segments_for(measured)
    estimator, base = posed(measured, segments, accurate)
    fit = estimator.fit(base.simulator, base.unknowns, base.unknowns.mean)
    fit = estimator.refit(base.simulator, base.unknowns, fit)
    simulator, begun = base.simulator(fit.x), time.process_time()
    segments.misfit(simulator, fit.start)
    return fit.loss / estimator.samples, time.process_time() - begun


def main() -> None:
    given = [int(word) for word in sys.argv[1:]]
    cases, seed = (*given, *(3, secrets.randbits(31))[len(given) :])
    print(f"{cases} joints of each family that lack nothing, seed {seed}: loss per sample, ms\n")
    print(f"{'':28} " + "".join(f"{n:>18}" for n in MANY))
    for family in FAMILIES:
        for number in range(cases):
            measured, _ = read(draw(seed + number, None, True, None, family))
            for accurate, scheme in enumerate(("as MuJoCo", "second order")):
                rows = np.array([left(measured, steps, bool(accurate)) for steps in MANY])
                told = "".join(f"{loss:10.4f} {1000 * took:7.2f}" for loss, took in rows)
                print(f"{family:14} {scheme:13} {told}", flush=True)


if __name__ == "__main__":
    main()
