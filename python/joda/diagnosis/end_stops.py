"""How stiff and how damped the ends of the range are, by the runs that come to them, and how far
they yield to a force.

Segments in which a joint comes to an end, or rests there, tell nothing of its own laws, and of the
model's stop all that whole runs need to go on from there. With an impedance d a row of MuJoCo's
bears all but the share 1 - d of what presses on it: with its default of 0.95 an end is 20 times as
stiff against a force as against an impact, and a spring and a damper that press back are a small d.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit

from joda.diagnosis.baseline import Baseline
from joda.diagnosis.free_runs import worst
from joda.diagnosis.impacts import some_of
from joda.diagnosis.settings import SETTINGS
from joda.diagnosis.shape_refinement import clearly, has_restitution
from joda.estimation import simplex
from joda.estimation.estimator import SegmentEstimator
from joda.estimation.problem import as_it_is, segments_for
from joda.estimation.segmentation import segments_of
from joda.joints.joint_model import JointModel
from joda.measured import smoothing
from joda.measured.measured_joint import Measured
from joda.measured.runs import CLEAR, visits
from joda.profile import Profile
from joda.scenes.limits import IMPEDANCES, SecondStop, Stops

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


def fitted_stops(train: Measured, held: Measured | None = None) -> Stops | None:
    """Ends of the range that suit the runs there, if they make all runs, also those that were held
    out, clearly likelier, and each number is worth its price (Schwarz 1978); else None. The
    impedance is changed only where that does so again. Where much is left, one end may get a stop
    besides the joint's limit, of which MuJoCo has one for both.

    Args:
        train: the joint with a profile, and runs to fit.
        held: the same with runs held out, which must be clearly likelier by themselves; None where
            none are.
    """
    if has_restitution(train.profile):  # whose ends are its own
        return None
    fit, judge = _visits(train), _visits(held) if held else None
    if fit is None:
        return None
    price, own = float(np.log(fit.samples)), train.joint_model.stops

    def priced(stops: Stops, numbers: int) -> float:
        return fit.loss(stops) + (judge.loss(stops) if judge else 0.0) + numbers * price

    best, least, z = own, priced(own, 0), np.zeros(0)
    for numbers in (2, 3):
        z = _searched(partial(_misfit, fit, own), z, numbers)
        found = _changed(own, z)
        total = priced(found, numbers) + _unusual(z)
        if clearly(total, least):
            best, least = found, total
    if own.second is None and fit.loss(best) > SETTINGS.whole_runs.end_loss * fit.samples:
        for end in (-1, 1):
            apart = _apart(fit, own, end)
            total = priced(apart, SETTINGS.whole_runs.end_numbers) if apart else np.inf
            if apart and clearly(total, least):
                best, least = apart, total
    if best is own or (held and not (judge and clearly(judge.loss(best), judge.loss(own)))):
        return None
    return best


def _apart(fit: "_Visits", own: Stops, end: int) -> Stops | None:
    """The stop that suits the other end's visits, and what that end has besides, which suits its
    own; None where one of them has too few."""
    here, there = fit.at(end), fit.at(-end)
    if here is None or there is None:
        return None
    both = _changed(own, _all_searched(partial(_misfit, there, own)))

    def stops(x: Array) -> Stops:
        second = _changed(both, x)
        return replace(both, second=SecondStop(end, second.solref, second.solimp))

    return stops(_all_searched(lambda x: here.loss(stops(x)) + _unusual(x)))


def _all_searched(loss: Callable[[Array], float]) -> Array:
    """All three numbers of a stop that suit best, the third sought with the other two near."""
    z = np.zeros(0)
    for numbers in (2, 3):
        z = _searched(loss, z, numbers)
    return z


def _misfit(visits: "_Visits", own: Stops, z: Array) -> float:
    """Loss of what changes the joint's limit, with what is known of that."""
    return visits.loss(_changed(own, z)) + _unusual(z)


def _unusual(z: Array) -> float:
    """How far numbers are off what is usual before the data, in squared standard deviations."""
    return float(np.sum((z / USUAL[: len(z)]) ** 2))


def _searched(loss: Callable[[Array], float], near: Array, numbers: int) -> Array:
    """The first numbers of a stop that suit best, sought from those near, the others from none."""
    begin = np.append(near, np.zeros(numbers - len(near)))
    new = [(k, value) for k in range(len(near), numbers) for value in FIRST[k]]
    first = [begin + value * np.eye(numbers)[k] for k, value in new]
    return simplex.least(loss, min(first, key=loss), WIDE[:numbers], TRIED)


@dataclass(frozen=True)
class OtherEnds:
    """Whole runs with the stop that suits them best.

    Attributes:
        stops: that; None: the model's own.
        changes: what it changes, for a person; nothing where the model's own suits them best.
        times: by how many times what errors explain the worst run is missed with it.
    """

    stops: Stops | None
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
    if not (stops := suited(measured, baseline)):
        return OtherEnds(None, "", times)
    left = worst(measured.stopped(stops), baseline, [other.stopped(stops) for other in others])
    return OtherEnds(stops, changed(measured.joint_model, stops), left.whole)


def suited(measured: Measured, baseline: Baseline) -> Stops | None:
    """Ends of the range that suit the runs, with the model fitted to them; None: its own."""
    return fitted_stops(measured.changed(baseline.base.written(baseline.fit.x)))


def stops_described(joint_model: JointModel, stops: Stops | None) -> list[str]:
    """What ends of the range that were fitted change, for a person; nothing where none were."""
    if stops is None:
        return []
    change = changed(joint_model, stops)
    return [f"ends of the range: {change}, as the runs that come to them show"]


def changed(joint_model: JointModel, stops: Stops) -> str:
    """What ends of the range change of a joint's own, for a person."""
    own, second = joint_model.stops, stops.second
    pairs = zip(ATTRIBUTES, (own.solref, own.solimp), (stops.solref, stops.solimp), strict=True)
    changes = [f"{name} {_short(old)} → {_short(new)}" for name, old, new in pairs if old != new]
    if second and second != own.second:
        values = zip(ATTRIBUTES, (second.solref, second.solimp), strict=True)
        words = " ".join(f"{name} {_short(value)}" for name, value in values)
        changes.append(f"at the {second.where} end besides a tendon's limit with {words}")
    return ", ".join(changes)


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

    def loss(self, stops: Stops) -> float:
        """Twice the negative log-likelihood for ends of the range, robustly."""
        h = self.estimator.segments.h
        own = self.joint_model.stopped(stops).simulator(self.profile, h)
        return self.estimator.started(own, SETTLING).loss

    def at(self, end: int) -> "_Visits | None":
        """Those to one end, -1 the low one, 1 the high one; None where there are fewer than two."""
        segments, middle = self.estimator.segments, float(np.mean(self.profile.joint.range))
        away = [segments.position[row[row >= 0]] - middle for row in segments.rows]
        numbers = np.flatnonzero([end * one[np.argmax(np.abs(one))] > 0 for one in away])
        if len(numbers) < SETTINGS.whole_runs.end_visits:
            return None
        return replace(self, estimator=some_of(segments, numbers))


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
        if part.stop - part.start >= smoothing.MIN_SAMPLES
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


def _changed(own: Stops, z: Array) -> Stops:
    """With factors of the stiffness and of the damping ratio, and of the impedance's odds, by their
    logarithms (MuJoCo's documentation, Computation, Parameters: the stiffness is 1 / (time constant
    x damping ratio)², or a number of its own)."""
    stiffness, ratio = map(float, np.exp(z[:2]))
    (first, second), (least, most, *shape) = own.solref, own.solimp
    if first > 0:
        solref = first / (np.sqrt(stiffness) * ratio), second * ratio
    else:
        solref = first * stiffness, second * ratio * np.sqrt(stiffness)
    if len(z) > 2:
        odds = logit(np.clip(most, *IMPEDANCES))
        least = most = np.clip(expit(odds + z[2]), *IMPEDANCES)  # the same however deep
    solimp = tuple(map(float, (least, most, *shape)))
    return replace(own, solref=tuple(map(float, solref)), solimp=solimp)
