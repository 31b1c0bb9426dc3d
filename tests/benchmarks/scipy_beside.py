"""joda's Gauss-Newton beside SciPy's `least_squares` on the same problems, as a Markdown table.

python tests/benchmarks scipy_beside [CASES] [SEED]     of a fresh seed, which is printed

Each problem is a hidden effect's own hypothesis: the model's factors, the effect's numbers and a
start for every segment, from the hypothesis' first trial. Both get the same residuals: a segment's,
shrunk so that the sum of their squares is joda's robust loss. SciPy gets the bounds, one step for
each number as its scale, and the pattern of the Jacobian, so that all starts are differenced at
once; joda eliminates them. Loss is what is left (less is better), seconds are the processor's.
"""

import secrets
import sys
import time

import numpy as np
from hidden_cases import Job, case_of, read
from scipy.optimize import least_squares
from scipy.sparse import block_diag, csr_matrix, hstack, vstack

from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.hypothesis_fits import joined
from joda.estimation.estimator import CAUCHY_SCALE, SegmentEstimator
from joda.hidden import EFFECTS, Case

Array = np.ndarray
BETTER = 1.0
"""How much less loss counts as less."""


class Problem:
    """Numbers and starts as one vector, with residuals whose squares are the robust loss."""

    def __init__(self, estimator: SegmentEstimator, make, unknowns, x: Array) -> None:
        self.estimator, self.make, self.unknowns = estimator, make, unknowns
        self.segments, self.k = estimator.segments, len(x)

    def residuals(self, theta: Array) -> Array:
        start = self.start(theta)
        r, squares = self.estimator.squares(self.make(theta[: self.k]), start)
        room = CAUCHY_SCALE * np.maximum(self.segments.count, 1)
        part = np.sqrt(room * np.log1p(squares / room) / np.maximum(squares, 1e-300))
        part = part * self.estimator.counts
        z = (start - self.segments.start) / self.segments.prior_std
        own = np.concatenate([r * part[:, None], z * part[:, None]], axis=1).ravel()
        known, x = self.unknowns, theta[: self.k]
        doubt = (x - known.mean) / known.prior_std
        rough = () if known.rough is None else known.rough @ x
        return np.concatenate([own, doubt, rough])

    def start(self, theta: Array) -> Array:
        segments = self.segments
        return segments.start + segments.prior_std * theta[self.k :].reshape(segments.start.shape)

    @property
    def pattern(self):
        """What depends on what: a segment's residuals on the numbers and on its own start."""
        m, d = self.segments.start.shape
        rows = self.segments.rows.shape[1] + d
        own = block_diag([np.ones((rows, d))] * m)
        numbers = csr_matrix(np.ones((m * rows, self.k)))
        rough = 0 if self.unknowns.rough is None else len(self.unknowns.rough)
        beside = csr_matrix(np.ones((self.k + rough, self.k)))
        none = csr_matrix((self.k + rough, m * d))
        return vstack([hstack([numbers, own]), hstack([beside, none])])


def compared(case: Case) -> tuple[float, float, float, float]:
    """Losses of joda and SciPy, and their seconds."""
    measured = read(case)[0]
    baseline = fit_baseline(measured)
    hypothesis = next(h for h in baseline.hypotheses if h.effect == case.seal["effect"])
    make, unknowns = joined(baseline.base, hypothesis)
    x = np.concatenate([baseline.fit.x, hypothesis.trials[0]])
    x = np.clip(x, unknowns.low, unknowns.high)
    estimator, begun = baseline.estimator, time.process_time()
    own = estimator.fit(make, unknowns, x, iterations=100)
    ours = time.process_time() - begun
    problem = Problem(estimator, make, unknowns, x)
    m, d = estimator.segments.start.shape
    free = np.full(m * d, np.inf)
    begun = time.process_time()
    theirs = least_squares(
        problem.residuals,
        np.concatenate([np.clip(x, unknowns.low + 1e-9, unknowns.high - 1e-9), np.zeros(m * d)]),
        bounds=(np.append(unknowns.low, -free), np.append(unknowns.high, free)),
        x_scale=np.append(unknowns.step, np.ones(m * d)),
        diff_step=1e-4,
        jac_sparsity=problem.pattern,
        ftol=1e-6,
        xtol=1e-8,
        gtol=1e-8,
        max_nfev=100,
    )
    return own.loss, 2 * theirs.cost, ours, time.process_time() - begun


def main() -> None:
    given = [int(text) for text in sys.argv[1:]]
    count, seed = (*given, *(24, secrets.randbelow(2**31))[len(given) :])
    print(f"seed {seed}\n")
    print("| effect | loss, joda | loss, SciPy | s, joda | s, SciPy |\n|---|---|---|---|---|")
    rng, rows = np.random.default_rng(seed), []
    for name in rng.permutation([one for one in EFFECTS if one != "end_stop_restitution"])[:count]:
        case = case_of(Job(seed, "scipy", 0, int(rng.integers(2**31)), str(name)))
        row = compared(case)
        rows.append(row)
        print(f"| {name} | {row[0]:.1f} | {row[1]:.1f} | {row[2]:.2f} | {row[3]:.2f} |", flush=True)
    ours, theirs, short, long = np.array(rows).T
    print(f"\nSciPy takes {np.median(long / short):.1f} times as long in the median.")
    less, more = np.sum(ours < theirs - BETTER), np.sum(ours > theirs + BETTER)
    print(f"Less loss: joda {less}, SciPy {more}, alike {len(rows) - less - more} of {len(rows)}.")


if __name__ == "__main__":
    main()
