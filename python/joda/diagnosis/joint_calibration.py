"""Numbers that are off, fitted again together with the effect that is missing beside them.

They were found while that effect was missing, or held as its law was sought: what of them stood in
for it is not off, and how well the others are known is not what it was.
"""

from dataclasses import replace

import numpy as np

from joda.diagnosis.baseline import Baseline, fit_baseline
from joda.diagnosis.calibration import Calibration, as_recorded, covariance, known_as_ratio
from joda.diagnosis.hypothesis_fits import FittedHypothesis, joined
from joda.diagnosis.settings import SETTINGS
from joda.estimation.nuisance import nuisances_of, with_numbers
from joda.measured.measured_joint import Measured


def needed(
    measured: Measured, found: Calibration, baseline: Baseline, effect: FittedHypothesis
) -> Calibration | None:
    """The numbers without which the runs are clearly less likely, the effect being fitted anew.

    Args:
        measured: the joint as it was given, and its runs.
        found: the numbers.
        baseline: the model with them set right, and the segments to which the effect was fitted.
        effect: what is missing.

    Returns:
        itself where all are, None where none is.
    """
    length = baseline.estimator.segments.length
    best, kept = effect.fit.loss, found
    hypothesis = effect.hypothesis
    hypothesis = replace(hypothesis, trials=np.vstack([hypothesis.trials, effect.x]))
    while kept.names:
        tried = []
        ratio = known_as_ratio(kept.names, found.numbers.base)
        for name in ratio or kept.names:
            fewer = kept.only(tuple(one for one in kept.names if one != name))
            without = fit_baseline(fewer.of(measured), length)
            if again := without.fit_hypothesis(hypothesis):
                tried.append((again.fit.loss, fewer))
        if not tried:
            break
        least, fewer = min(tried, key=lambda pair: pair[0])
        if least > best + SETTINGS.corrections.number_loss and not ratio:
            break
        best, kept = min(best, least), fewer
    return kept if kept.names else None


def jointly(
    measured: Measured, found: Calibration, baseline: Baseline, effect: FittedHypothesis
) -> Calibration:
    """The numbers as the runs tell them beside the effect, with their errors; as `needed`."""
    estimator, own = as_recorded(measured, found, baseline.estimator.segments.length)
    k, n = own.base.count, len(own.names)
    left = baseline.base.count - k  # set right, they were free within their errors
    off = effect.fit.x[k : k + left]
    numbers = found.fit.x[-n:] + off
    make, unknowns = joined(with_numbers(own), effect.hypothesis)
    x = np.concatenate([effect.fit.x[:k], numbers, effect.x])
    fit = estimator.fit(make, unknowns, x, estimator.started(make(x)).start)
    fit = estimator.refit(make, unknowns, fit)
    every = nuisances_of(measured, own.base)
    errors = covariance(estimator, own, every, fit, found.alternatives, effect.hypothesis)
    return replace(found, numbers=own, fit=replace(fit, x=fit.x[: k + n]), covariance=errors)
