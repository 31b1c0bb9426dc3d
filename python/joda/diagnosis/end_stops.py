"""How stiff and how damped the ends of the range are, by the runs that come to them, and how far
they yield to a force.

Segments in which a joint comes to an end, or rests there, tell nothing of its own laws, and of the
model's stop all that whole runs need to go on from there. With an impedance d a row of MuJoCo's
bears all but the share 1 - d of what presses on it: with its default of 0.95 an end is 20 times as
stiff against a force as against an impact, and a spring and a damper that press back are a small d.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import expit, logit

from joda.diagnosis.baseline import Baseline
from joda.diagnosis.free_runs import worst
from joda.diagnosis.impacts import some_of
from joda.diagnosis.shape_refinement import bouncy, clearly
from joda.estimation.estimator import SegmentEstimator
from joda.estimation.problem import as_it_is, segments_for
from joda.estimation.segmentation import segments_of
from joda.joints.joint_model import JointModel
from joda.measured import smoothing
from joda.measured.measured_joint import Measured
from joda.measured.runs import CLEAR, visits
from joda.profile import Profile
from joda.scenes.limits import IMPEDANCES
from joda.scenes.native import Row

Array = NDArray[np.float64]

ATTRIBUTES = "solreflimit", "solimplimit"
BEFORE, AFTER = 0.25, 3.0
"""How long a joint is followed before it comes to an end, and after it left that, in lengths of the
diagnosis' segments: with what speed it comes back tells of the end."""
FIRST = (-2.8, -1.4, 0.0, 1.4, 2.8), (-0.7, 0.0, 0.7), (-5.0, -3.0, -1.5)
"""Logarithms of factors of the stiffness, of the damping ratio and of the impedance's odds that are
tried first, one at a time."""
USUAL = np.array((1.5, 0.4, 3.0))
"""How far off they are, as logarithms, before the data; one standard deviation."""
WIDE, TRIED, SETTLING = np.array((0.4, 0.4, 1.0)), 30, 6
"""How far a search begins to look, in those; models that it tries for each number, and iterations
that fit the starts of one."""


def fitted_stop(train: Measured, held: Measured | None = None) -> Row | None:
    """The parameters solref and solimp of the ends of the range that suit the runs there (Nelder
    and Mead 1965), if they make all runs, also those that were held out, clearly likelier, and each
    number is worth its price (Schwarz 1978); else None. The impedance is changed only where that
    does so again.

    Args:
        train: the joint with a profile, and runs to fit.
        held: the same with runs held out; None where none are.
    """
    if bouncy(train.profile):  # whose ends are its own
        return None
    fit, judge = _visits(train), _visits(held) if held else None
    if fit is None:
        return None
    price = float(np.log(fit.samples))
    own = train.joint_model.solref, train.joint_model.solimp
    best, least, z = own, fit.loss(own) + (judge.loss(own) if judge else 0.0), np.zeros(0)

    def loss(x: Array) -> float:
        return fit.loss(_changed(own, x)) + float(np.sum((x / USUAL[: len(x)]) ** 2))

    for numbers in (2, 3):
        z = _searched(loss, z, numbers)
        found = _changed(own, z)
        both = loss(z) + (judge.loss(found) if judge else 0.0) + numbers * price
        if clearly(both, least):
            best, least = found, both
    return None if best is own else best


def _searched(loss: Callable[[Array], float], near: Array, numbers: int) -> Array:
    """The first numbers of a stop that suit best, sought from those near, the others from none."""
    begin = np.append(near, np.zeros(numbers - len(near)))
    new = [(k, value) for k in range(len(near), numbers) for value in FIRST[k]]
    first = [begin + value * np.eye(numbers)[k] for k, value in new]
    simplex = min(first, key=loss) + np.vstack([np.zeros(numbers), np.diag(WIDE[:numbers])])
    options = {"maxfev": TRIED * numbers, "initial_simplex": simplex}
    return np.asarray(minimize(loss, simplex[0], method="Nelder-Mead", options=options).x)


@dataclass(frozen=True)
class OtherEnds:
    """Whole runs with the stop that suits them best.

    Attributes:
        changes: what that changes, for a person; nothing where the model's own suits them best.
        times: by how many times what errors explain the worst run is missed with it.
    """

    changes: str
    times: float


def with_other_ends(
    measured: Measured, baseline: Baseline, others: Sequence[Measured], times: float
) -> OtherEnds:
    """How far whole runs are missed with the stop that suits them best.

    Args:
        measured: the joint and its runs.
        baseline: the model fitted to them.
        others: see `worst`.
        times: how far they are missed with the model's own.
    """
    fitted = measured.changed(baseline.base.written(baseline.fit.x))
    if not (stop := fitted_stop(fitted)):
        return OtherEnds("", times)
    left = worst(measured.stopped(stop), baseline, [other.stopped(stop) for other in others])
    return OtherEnds(changed(measured.joint_model, stop), left.whole)


def written(joint_model: JointModel, stop: Row | None) -> tuple[dict[str, str], list[str]]:
    """Attributes of a joint's element in MJCF for a stop that was fitted, and what is changed, for
    a person; nothing of either where none was fitted."""
    if stop is None:
        return {}, []
    own = {
        name: " ".join(f"{value:.6g}" for value in values)
        for name, values in zip(ATTRIBUTES, stop, strict=True)
    }
    change = changed(joint_model, stop)
    return own, [f"ends of the range: {change}, as the runs that come to them show"]


def changed(joint_model: JointModel, stop: Row) -> str:
    """What a stop changes of a joint's own, for a person."""
    own = joint_model.solref, joint_model.solimp
    return ", ".join(
        f"{name} {_short(before)} → {_short(now)}"
        for name, before, now in zip(ATTRIBUTES, own, stop, strict=True)
        if before != now
    )


def _short(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:.4g}" for value in values)


@dataclass(frozen=True)
class _Visits:
    """What the joint does where it comes to an end of its range, in the scene's own steps.

    Attributes:
        estimator: of segments, each from before it comes there until long after it left.
        joint_model: of the joint.
        profile: that it carries.
    """

    estimator: SegmentEstimator
    joint_model: JointModel
    profile: Profile

    @property
    def samples(self) -> float:
        return self.estimator.samples

    def loss(self, stop: Row) -> float:
        """Twice the negative log-likelihood for a stop, robustly."""
        h = self.estimator.segments.h
        own = self.joint_model.stopped(stop).simulator(self.profile, h)
        return self.estimator.started(own, SETTLING).loss


def _visits(measured: Measured) -> _Visits | None:
    """(Some of) the visits to the ends; None where there are none."""
    if not measured.runs:
        return None
    lo, hi = measured.profile.joint.range
    around = segments_for(measured).length
    pairs = [
        (run.part(part), sigma)
        for run, sigma in zip(measured.runs, measured.sigma, strict=True)
        for part in visits(run, (lo, hi), CLEAR * sigma, (BEFORE * around, AFTER * around))
        if part.stop - part.start >= smoothing.LEAST
    ]
    if not pairs:
        return None
    runs, sigmas = zip(*pairs, strict=True)
    longest = 2 * max(float(np.ptp(run.time)) for run in runs)
    fixed = lo, measured.joint_model.inertia, measured.timestep, longest
    segments = segments_of(runs, sigmas, hi - lo, *fixed, fine=False, cut_at_ends=False)
    numbers = np.flatnonzero(segments.long_enough)
    if not len(numbers):
        return None
    return _Visits(some_of(segments, numbers), as_it_is(measured), measured.profile)


def _changed(own: Row, z: Array) -> Row:
    """With factors of the stiffness and of the damping ratio, and of the impedance's odds, by their
    logarithms (MuJoCo's documentation, Computation, Parameters: the stiffness is 1 / (time constant
    x damping ratio)², or a number of its own)."""
    stiffness, ratio = map(float, np.exp(z[:2]))
    (first, second), (least, most, *shape) = own
    if first > 0:
        solref = first / (np.sqrt(stiffness) * ratio), second * ratio
    else:
        solref = first * stiffness, second * ratio * np.sqrt(stiffness)
    if len(z) > 2:
        odds = logit(np.clip(most, *IMPEDANCES))
        least = most = np.clip(expit(odds + z[2]), *IMPEDANCES)  # the same however deep
    return tuple(map(float, solref)), tuple(map(float, (least, most, *shape)))
