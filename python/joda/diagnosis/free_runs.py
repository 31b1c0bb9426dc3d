"""Whole runs of a model with its own strengths fitted: how much they are missed by, and why."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.baseline import Baseline
from joda.diagnosis.settings import SETTINGS
from joda.estimation import simplex
from joda.estimation.base_model import BaseModel
from joda.estimation.estimator import Fit, SegmentEstimator
from joda.estimation.segmentation import segments_of
from joda.measured.instability import followed
from joda.measured.measured_joint import Measured
from joda.measured.misfit import rms
from joda.measured.replay import Replayer
from joda.measured.runs import CLEAR, Run, until_end
from joda.measured.whiteness import drifts, free_parts

Array = NDArray[np.float64]

FINER = 4
"""Steps for one of the scene's, for whole runs of a joint that an actuator drives."""
SEARCHED, EACH, TIMES = 16, 100, 2
"""Numbers, with those of the runs' starts, up to which they are searched without derivatives; how
often each is tried, and how often all is begun anew."""
ASIDE, AWAY = 4.0, 0.1
"""How far from the fit that begins: numbers in their steps, starts in what is not known of them."""
DRAWS = 8
"""Strengths that are drawn, to tell how far their errors move a run."""


@dataclass(frozen=True)
class Worst:
    """By how many times what errors explain of it the worst whole run is missed.

    Errors of positions, of the start, of the recorded force and of the fitted strengths. A run that
    is missed by no more than `BEYOND` noises is told in those.

    Attributes:
        free: of runs up to where the joint meets an end of its range: after that the stop decides
            too, not only a law of the joint. Of all of them if it meets one soon in every run.
        whole: of all of the runs.
    """

    free: float
    whole: float


def worst(measured: Measured, baseline: Baseline, others: Sequence[Measured] = ()) -> Worst:
    """How far a model is off the whole runs.

    Args:
        measured: the joint and its runs.
        baseline: the model fitted to them.
        others: the same with numbers of its body and of the measurement that are as likely.
    """

    @cache  # only a run that is missed by much asks for them
    def drawn() -> list[Replayer]:
        return [_replayer(measured, baseline, x, finest) for x in drawn_strengths(baseline)]

    @cache
    def corrected() -> list[Replayer]:
        return [_replayer(other, baseline, baseline.fit.x, finest) for other in others]

    @cache
    def fitted(finer: int) -> Replayer:
        return _replayer(measured, baseline, baseline.fit.x, finer)

    finest = FINER if measured.joint_model.servo else 1

    def times(number: int, part: Run) -> float:
        found = replayed(number, part, fitted(finest))
        if found <= SETTINGS.whole_runs.max_multiple or finest == FINER:
            return found
        return min(found, replayed(number, part, fitted(FINER)))

    def replayed(number: int, part: Run, replayer: Replayer) -> float:
        sigma = measured.sigma[number]
        if not (start := replayer.start(part, sigma)):
            return 0.0
        path = replayer.whole(part, start)
        there = ~np.isnan(path)
        missed = rms(path[there] - part.position[there]) / sigma
        if missed <= SETTINGS.whole_runs.max_multiple:
            return missed
        moved = [other.whole(part, start, True)[there] - path[there] for other in drawn()]
        for other, with_it in zip(corrected(), others, strict=True):
            run = with_it.runs[number]  # a delay leaves it without some of its samples
            force = np.interp(part.time, run.time, run.force)
            zero = float(np.median(np.interp(part.time, run.time, run.position) - part.position))
            begun = replace(start, best=start.best + np.array([zero, 0.0]))
            moved.append(
                (other.whole(replace(part, force=force), begun, True) - zero - path)[there]
            )
        apart = rms(np.concatenate(moved)) if moved else 0.0
        spread = [sigma, replayer.scatter(part, start), apart]
        return missed * sigma / float(np.linalg.norm(spread))

    told, whole = [], 0.0
    for number, (whole_run, sigma) in enumerate(zip(measured.runs, measured.sigma, strict=True)):
        run = followed(measured, whole_run, sigma)
        part = until_end(run, measured.profile.joint.range, CLEAR * sigma)
        found = times(number, part)
        if np.ptp(part.position) >= SETTINGS.whole_runs.before_end * np.ptp(run.position):
            told.append(found)
        whole = max(whole, found if len(part.time) == len(run.time) else times(number, run))
    return Worst(max(told, default=whole), whole)


@dataclass(frozen=True)
class FreeRuns:
    """What free runs as a whole, in which errors add up, say of a model.

    Attributes:
        denied: by them, as it is.
        drifting: by them, whatever its strengths.
        covered: part of all runs' samples that they hold, before they come to an end.
        estimator, base, fit: the model by the whole runs.
        errors: standard errors of its numbers, shape (k,).
    """

    denied: bool
    drifting: bool
    covered: float
    estimator: SegmentEstimator
    base: BaseModel
    fit: Fit
    errors: Array

    @property
    def suffice(self) -> bool:
        """Whether nothing but other strengths, if that, is what the runs ask for."""
        return self.covered > SETTINGS.whole_runs.free_share and not self.drifting


def free_runs(measured: Measured, baseline: Baseline) -> FreeRuns | None:
    """Fits the model's strengths to its free runs, each as one segment.

    Args:
        measured: the joint and its runs.
        baseline: the model fitted to their usual segments.

    Returns:
        None if no run is free.
    """
    if not (parts := free_parts(measured)):
        return None
    ways = [_Whole(measured, baseline.base, parts, accurate) for accurate in (True, False)]
    smooth = [way.fitted(baseline.fit.x) for way in ways]
    fits = [
        searched(way.estimator, way.base, fit) if way.denied(fit) else fit
        for way, fit in zip(ways, smooth, strict=True)
    ]
    best = int(np.argmin([fit.loss for fit in fits]))
    samples = sum(len(run.time) for run in measured.runs)
    errors = ways[best].errors(fits[best])
    if fits[best] is not smooth[best]:  # of a jagged loss its curvature tells nothing
        errors = np.hypot(errors, np.sqrt(np.diag(baseline.covariance)))
    return FreeRuns(
        denied=all(way.denied_as_it_is(fit) for way, fit in zip(ways, fits, strict=True)),
        drifting=all(way.denied(fit) for way, fit in zip(ways, fits, strict=True)),
        covered=sum(len(run.time) for run, _ in parts) / samples,
        estimator=ways[best].estimator,
        base=ways[best].base,
        fit=fits[best],
        errors=errors,
    )


class _Whole:
    """A model and free runs as a whole, in accurate steps or in the scene's own: what a step makes
    of a motion is no effect that is missing."""

    def __init__(
        self,
        measured: Measured,
        base: BaseModel,
        parts: Sequence[tuple[Run, float]],
        accurate: bool,
    ) -> None:
        runs, sigmas = zip(*parts, strict=True)
        (lo, hi), inertia = measured.profile.joint.range, measured.joint_model.inertia
        longest = max(float(np.ptp(run.time)) for run in runs)
        self.parts = parts
        fixed = runs, sigmas, hi - lo, lo, inertia, measured.timestep
        self.segments = segments_of(*fixed, longest, accurate, thinned=False)
        self.estimator = SegmentEstimator(self.segments, np.ones(len(self.segments.at), bool))
        self.base = base.in_steps(self.segments.h, accurate)

    @cached_property
    def given(self) -> Fit:
        """The model as it is, from the starts that suit it best."""
        return self.estimator.begun(self.base.simulator, self.base.unknowns.mean)

    def fitted(self, near: Array) -> Fit:
        """Its strengths fitted, from where they are and from what shorter segments told."""
        make, unknowns = self.base.simulator, self.base.unknowns
        begins = (self.given, self.estimator.begun(make, near))
        fits = [self.estimator.fit(make, unknowns, one.x, one.start) for one in begins]
        return self.estimator.refit(make, unknowns, min(fits, key=lambda fit: fit.loss))

    def denied(self, fit: Fit) -> bool:
        """Whether more is left than noise makes."""
        missed = self.segments.misfit(self.base.simulator(fit.x), fit.start)
        each = np.split(missed, np.cumsum([len(run.time) for run, _ in self.parts])[:-1])
        left = [own / sigma for own, (_, sigma) in zip(each, self.parts, strict=True)]
        return drifts(self.parts, left) < SETTINGS.whole_runs.drift_probability

    def denied_as_it_is(self, fit: Fit) -> bool:
        """The same of the model with its own strengths, and with such as another simulator may ask
        for: towards those that were fitted."""
        own = self.base.unknowns.mean
        nearly = np.clip(
            fit.x,
            own - SETTINGS.whole_runs.simulators_apart * np.abs(own),
            own + SETTINGS.whole_runs.simulators_apart * np.abs(own),
        )
        begun = self.estimator.begun(self.base.simulator, nearly)
        return self.denied(self.given) and self.denied(begun)

    def errors(self, fit: Fit) -> Array:
        """Standard errors of the fitted numbers, shape (k,)."""
        unknowns = self.base.unknowns
        found = self.estimator.covariance(self.base.simulator, unknowns, fit, unknowns.prior_std)
        return np.asarray(
            np.hypot(np.sqrt(np.diag(found)), SETTINGS.whole_runs.simulators_apart * np.abs(fit.x))
        )


def searched(estimator: SegmentEstimator, base: BaseModel, found: Fit) -> Fit:
    """A fit to whole runs after a search without derivatives of its numbers and the runs' starts,
    if these are not too many: where a joint sticks, the loss is jagged."""
    make, unknowns, unknown = base.simulator, base.unknowns, estimator.segments.prior_std
    k = len(found.x)
    scale = np.append(ASIDE * unknowns.step, AWAY * unknown.ravel())
    if len(scale) > SEARCHED:
        return found

    def at(z: Array) -> tuple[Array, Array]:
        off = scale * z
        x = np.clip(found.x + off[:k], unknowns.low, unknowns.high)
        return x, found.start + off[k:].reshape(unknown.shape)

    def loss(z: Array) -> float:
        x, start = at(z)
        return estimator.loss(estimator.squares(make(x), start)[1]) + unknowns.penalty(x)

    z = np.zeros(len(scale))
    for _ in range(TIMES):
        z = simplex.least(loss, z, 1.0, EACH, adaptive=True)
    fit = estimator.fit(make, unknowns, *at(z))
    return min(found, estimator.refit(make, unknowns, fit), key=lambda one: one.loss)


def _replayer(measured: Measured, baseline: Baseline, x: Array, finer: int) -> Replayer:
    """Of the model with other numbers, and the friction row of its fit, in so many times finer
    steps, which then stand for none."""
    own, h = baseline.base.own(x), measured.timestep / finer
    joint_model = replace(measured.joint_model, friction_row=own.friction_row, servo=own.servo)
    joint_model = joint_model.stepped(h) if finer > 1 else joint_model
    return (
        replace(measured, timestep=h)
        .changed(baseline.base.written(x), joint_model=joint_model)
        .replayer
    )


def drawn_strengths(baseline: Baseline) -> Array:
    """Strengths within the errors of the fitted ones, shape (draws, k)."""
    base, x = baseline.base, baseline.fit.x
    if not len(x):
        return np.zeros((0, 0))
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(x, baseline.covariance, DRAWS, method="svd")
    return np.clip(drawn, base.unknowns.low, base.unknowns.high)
