"""The motion that would tell most of a learned law: after it the law's band is narrowest."""

import numpy as np
from numpy.typing import NDArray

from joda._core import JointSimulator
from joda.diagnosis.experiments import Model, means_of, menu, recorded
from joda.diagnosis.learning.fitting import Learned, Learner
from joda.diagnosis.learning.law import Law
from joda.estimation.estimator import SegmentEstimator

Array = NDArray[np.float64]

NARROWER = 0.9
"""Part of the band's width to which a motion worth making brings it."""


def narrowing(learner: Learner, learned: Learned) -> str | None:
    """What to do next with the joint, a sentence; None if no motion of the menu tells much more, or
    nothing moved in what there is.

    Args:
        learner: of the joint and the runs that were fitted.
        learned: the law; it counts as true.
    """
    train, law = learner.train, learned.law
    if not train.runs:
        return None
    unknowns, fit = learner.unknowns(law), learned.fit
    means = means_of(train, learned.estimator.segments, learned.estimator.segments.h)

    def make(x: Array) -> JointSimulator:
        return learner.simulator(law, x, means.h)

    known = np.diag(unknowns.prior_std**-2.0)
    known += learned.estimator.linear(make, unknowns, fit.x, fit.start).normal()[0]
    n = learner.base.count
    off = np.eye(len(fit.x))[n:] * unknowns.step[n:, None]
    here = _curves(law, fit.x[n:])
    shapes = np.zeros((len(here), len(fit.x)))
    for k, one in enumerate(off, start=n):
        shapes[:, k] = (_curves(law, (fit.x + one)[n:]) - here) / unknowns.step[k]
    now = _width(shapes, known)
    best, told = None, NARROWER
    for motion in menu(means):
        segments = recorded(motion, Model(make, unknowns, fit.x), means)
        estimator = SegmentEstimator(segments, segments.count > 0)
        more = estimator.linear(make, unknowns, fit.x, segments.start).normal()[0]
        if (left := _width(shapes, known + more) / now) < told:
            best, told = motion, left
    if best is None:
        return None
    return f"{best.sentence} It would make the law's band {100 * (1 - told):.0f} % narrower."


def _curves(law: Law, x: Array) -> Array:
    """The law's curves with some numbers, one after the other, and what it remembers; in units of
    the usual force."""
    force = law.force_at(x) if law.terms.position else np.zeros(0)
    resists = law.resistance(x) if law.terms.speed else np.zeros(0)
    return np.concatenate([force / law.force, resists / law.force, law.remembered(x)])


def _width(shapes: Array, known: Array) -> float:
    """Of the band, the mean over the curves."""
    return float(np.mean(np.sqrt(np.sum(shapes * np.linalg.solve(known, shapes.T).T, axis=1))))
