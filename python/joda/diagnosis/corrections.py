"""The model's own numbers that the measurements contradict, apart from missing effects."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from joda._core import JointSimulator
from joda.component import Component
from joda.diagnosis.baseline import Baseline
from joda.diagnosis.findings import Correction, Parameter
from joda.diagnosis.hypothesis_fits import FittedHypothesis, joined
from joda.diagnosis.settings import SETTINGS
from joda.estimation.base_model import BaseModel, shared_damping
from joda.estimation.estimator import Fit, SegmentEstimator
from joda.estimation.unknowns import Unknowns
from joda.profile import Joint, Profile
from joda.scenes.actuators import Servo
from joda.scenes.native import DAMPING, FRICTION, SPRING

Array = NDArray[np.float64]

GAIN, DRAG, DELAY = "gain of the actuator", "damping of joint and actuator", "delay of commands"
"""What the numbers of an actuator are called."""
STEP = 1e-3
"""Finite-difference step of a force, of how large it may be."""

ZERO = 1e-9
"""A factor that is as good as none."""

NATIVE: dict[str, Parameter] = {
    DAMPING: "damping",
    FRICTION: "frictionloss",
    SPRING: "stiffness",
}
"""The model's own numbers by the labels of their components (`joda.scenes.native`)."""


@dataclass(frozen=True)
class Number:
    """What a number of the model is found to be.

    Attributes:
        label: of a component or its channel, or what of the actuator it is.
        parameter: what it is in the model; None where that is a component of a profile.
        given: the model's; 1 where only a factor tells it.
        value: the right one.
        error: its standard error.
        unit: of all three.
        scale: of which a part is much or little.
        place: of it among those that were fitted.
    """

    label: str
    parameter: Parameter | None
    given: float
    value: float
    error: float
    unit: str
    scale: float
    place: int

    def off(self, least: float) -> bool:
        """Whether it is off, by some part at the least and by several of its errors."""
        return abs(self.value - self.given) > max(
            least * self.scale, SETTINGS.corrections.min_errors * self.error
        )

    @property
    def factor(self) -> float:
        """The right one over the model's; NaN of a delay."""
        return float("nan") if self.parameter == "time_delay" else self.value / self.given

    @property
    def described(self) -> str:
        """How it is off."""
        if self.parameter == "time_delay":
            late, error, given = (1e3 * x for x in (self.value, self.error, self.given))
            return f"{self.label} {late:.3g} ± {error:.2g} ms instead of {given:.3g} ms"
        error = self.error / abs(self.given)
        return f"{self.label} \N{MULTIPLICATION SIGN} {self.factor:.3g} ± {error:.2g}"

    def correction(self, joint: Joint) -> Correction:
        """The number as a correction of the model."""
        assert self.parameter is not None
        name = self.parameter if self.label in NATIVE else self.label
        return Correction(
            parameter=self.parameter,
            joint=joint.name,
            factor=None if np.isnan(self.factor) else self.factor,
            value=self.value,
            error=self.error,
            unit=self.unit,
            explanation=(
                f"The model's {name} is {self.given:.3g} {self.unit}, the runs show "
                f"{self.value:.3g} ± {self.error:.1g} {self.unit}."
            ),
        )


def numbers(
    baseline: Baseline,
    candidate: FittedHypothesis | None = None,
    found: tuple[Array, Array] | None = None,
) -> tuple[Number, ...]:
    """Of the model: strengths of its components, gain and delay of its actuator.

    Args:
        baseline: the model fitted alone.
        candidate: an effect fitted with them.
        found: other values and standard errors than those of the fit, shape (k,) each.
    """
    base = baseline.base
    x, errors = found or (
        (candidate.fit if candidate else baseline.fit).x,
        _errors(baseline, candidate),
    )
    n, joint, servo = len(base.places), base.profile.joint, base.joint_model.servo
    parts = (getattr(base.profile.channels, name).components[k] for name, k in base.places)
    told = zip(base.places, parts, x, errors, strict=False)
    out = [
        _strength(part.label or place[0], part, joint, (float(factor), float(error)), k)
        for k, (place, part, factor, error) in enumerate(told)
    ]
    return (*out, *(_of_actuator(base, servo, x[n:], errors[n:]) if servo else ()))


def numbers_beside(
    baseline: Baseline, effects: Sequence[tuple[FittedHypothesis, float]]
) -> tuple[Number, ...]:
    """The model's own numbers beside an effect that is not sure: beside another that may be missing
    in its place the same runs show others, which belongs to their errors (Bayesian model averaging,
    Hoeting et al., Statistical Science 14, 1999).

    Args:
        baseline: the model fitted alone.
        effects: fitted with it, and how probable each is; the values told are those beside the
            first.
    """
    every = [numbers(baseline, one) for one, _ in effects]
    weights = np.array([probability for _, probability in effects])
    out = []
    for same in zip(*every, strict=True):
        squares = [one.error**2 + (one.value - same[0].value) ** 2 for one in same]
        error = float(np.sqrt(np.average(squares, weights=weights)))
        out.append(replace(same[0], error=error))
    return tuple(out)


def errors_beside_a_force(
    estimator: SegmentEstimator, base: BaseModel, fit: Fit, force: float
) -> Array:
    """Standard errors of a model's numbers by the data alone where a force over position may be
    missing too, a line and a bump; shape (k,).

    Args:
        estimator, base, fit: the model, and how it was fitted.
        force: usual, N·m or N.
    """
    n, most = base.count, np.full(3, SETTINGS.corrections.untold_width * force)
    free = Unknowns(-most, most, STEP * most, np.zeros(3), most)

    def make(x: Array) -> JointSimulator:
        low, high, between = map(float, x[n:])
        line = Component(interval=(0.0, 1.0), x=(0.0, 1.0), y=(low, high))
        bump = Component(interval=(0.0, 1.0), x=(0.0, 0.5, 1.0), y=(0.0, between, 0.0))
        profile = base.written(x).with_component("conservative", line)
        return base.with_profile(profile.with_component("conservative", bump), x)

    both = replace(fit, x=np.append(fit.x, np.zeros(3)))
    prior_std = np.append(np.full(n, SETTINGS.corrections.untold_width), most)
    found = estimator.covariance(make, base.unknowns.and_(free), both, prior_std)
    return np.asarray(np.sqrt(np.diag(found))[:n])


def _of_actuator(base: BaseModel, servo: Servo, x: Array, errors: Array) -> list[Number]:
    """Its gain, its damping with the joint's own, and its delay."""
    n, joint = len(base.places), base.profile.joint
    (gain, drag, late), (prior_std, unsure, uneven) = (map(float, own[:3]) for own in (x, errors))
    factor, stiff = float(np.exp(gain)), servo.stiffness
    given, unit = (stiff, f"{joint.force_unit}/{joint.unit}") if stiff > 0 else (1.0, "")
    error = factor * prior_std
    out = [Number(GAIN, "actuator_gain", given, factor * given, error * given, unit, given, n)]
    if servo.damping > 0:
        shared = shared_damping(base.profile, servo)
        own = (base.profile.channels.damping.components[k] for _, k in shared)
        given, factor = servo.damping + sum(part.y[0] for part in own), float(np.exp(drag))
        unit, error = joint.unit_of("damping"), factor * unsure
        size = factor * given
        out.append(Number(DRAG, "damping", given, size, error * given, unit, given, n + 1))
    return [
        *out,
        Number(
            DELAY,
            "time_delay",
            servo.delay,
            late,
            uneven,
            "s",
            SETTINGS.corrections.slow_delay,
            n + 2,
        ),
    ]


@dataclass(frozen=True)
class Corrected:
    """A joint with numbers of its own as the runs show them.

    Attributes:
        profile: of it.
        servo: of its actuators; None where none acted.
    """

    profile: Profile
    servo: Servo | None


def corrected(
    baseline: Baseline, found: Sequence[Number], least: float, x: Array, driven_only: bool = False
) -> Corrected | None:
    """The model with those numbers set right that are off.

    Args:
        baseline: the model fitted.
        found: `numbers` of it.
        least: part by which a number must be off.
        x: the numbers as fitted, these first, shape (k or more,).
        driven_only: only those of its actuator.

    Returns:
        None if none is.
    """
    base = baseline.base
    first = len(base.places) if driven_only else 0
    off = np.zeros(base.count, bool)
    off[[one.place for one in found if one.place >= first and one.off(least)]] = True
    if not off.any():
        return None
    mixed = np.where(off, x[: base.count], base.unknowns.mean)
    return Corrected(base.written(mixed), base.own(mixed).servo)


def _strength(
    label: str, component: Component, joint: Joint, found: tuple[float, float], place: int
) -> Number:
    """Of a component, by its factor and the error of that."""
    factor, error = found
    if label not in NATIVE:
        return Number(label, None, 1.0, factor, error, "", 1.0, place)
    parameter, given = NATIVE[label], component.y[0]
    if parameter == "stiffness":
        given = (given - component.y[-1]) / float(np.ptp(joint.range))
    per = {"damping": f"·s/{joint.unit}", "stiffness": f"/{joint.unit}", "frictionloss": ""}
    unit = joint.force_unit + per[parameter]
    return Number(label, parameter, given, factor * given, error * given, unit, abs(given), place)


def _errors(baseline: Baseline, candidate: FittedHypothesis | None) -> Array:
    """Standard errors of all fitted numbers by the data alone, with what is left over as noise:
    what was known of them before makes none of them surer."""
    base, fit = baseline.base, candidate.fit if candidate else baseline.fit
    make, unknowns = (
        joined(base, candidate.hypothesis) if candidate else (base.simulator, base.unknowns)
    )
    prior_std = np.full(len(fit.x), SETTINGS.corrections.untold_width)
    return np.asarray(
        np.sqrt(np.diag(baseline.estimator.covariance(make, unknowns, fit, prior_std)))
    )


def corrections(found: Sequence[Number], joint: Joint, least: float) -> tuple[Correction, ...]:
    """What of the model's own numbers is off.

    Args:
        found: the numbers.
        joint: of the model.
        least: part by which a number must be off.
    """
    return tuple(one.correction(joint) for one in found if one.parameter and one.off(least))


def off(found: Sequence[Number], least: float = SETTINGS.corrections.min_off) -> str:
    """Which numbers are off by a part at the least, and by what, with their errors; empty if none
    is."""
    return ", ".join(one.described for one in found if one.off(least))


def off_beside(found: Sequence[Number]) -> str:
    """Which numbers are far off beside an effect, as a further sentence; empty if none is."""
    told = ", ".join(one.described for one in found if one.off(SETTINGS.corrections.min_off_beside))
    return f" The model's own numbers that suit the runs best with it: {told}." if told else ""


def off_without(found: Sequence[Number]) -> str:
    """Which numbers are off where no effect is named, as a further sentence; empty if none is."""
    told = off(found)
    return f" The model's own numbers that suit the runs best without it: {told}." if told else ""


def by_one_factor(found: Sequence[Number], forced: bool) -> str:
    """That all strengths that the data tell are off by one factor, a further sentence: then it may
    be the force's or, where none was recorded and of an actuator too, the inertia's.

    Args:
        found: the numbers.
        forced: whether a force was measured.
    """
    x = np.array([one.factor for one in _determined(found)])
    mean = float(x.mean()) if len(x) > 1 else 1.0
    if (
        abs(mean - 1) < SETTINGS.corrections.min_off_beside
        or np.abs(x / mean - 1).max() > SETTINGS.corrections.one_factor
    ):
        return ""
    if not forced or any(one.parameter == "actuator_gain" for one in found):
        return (
            f" All by one factor, about {mean:.2g}: these numbers may be right, and the joint's "
            f"inertia {1 / mean:.2g} times the model's."
        )
    return (
        f" All by one factor, about {mean:.2g}: the measured force may be in another unit, or its "
        "lever arm another."
    )


def heavier(found: Sequence[Number]) -> float:
    """Probability that the joint's inertia is more than the model's, where no force was recorded
    and all strengths are less by one factor: that each is off by a factor of its own, and these are
    alike by chance, is the other way to see it. Factors are log-normal before the data; 0 where
    fewer than two are told."""
    from scipy.stats import multivariate_normal  # loading it takes longer than a short command

    told = _determined(found)
    off = np.log([max(one.factor, ZERO) for one in told])
    if len(told) < 2 or off.mean() > 0:
        return 0.0
    errors = np.diag([(one.error / one.value) ** 2 for one in told])
    n, apart, alike = np.zeros(len(told)), np.eye(len(told)), np.ones((len(told), len(told)))
    usual = SETTINGS.corrections.usual_spread**2
    one, each = (
        multivariate_normal.logpdf(off, n, usual * prior + errors) for prior in (alike, apart)
    )
    return float(expit(one - each - np.log(SETTINGS.corrections.as_often)))


def _determined(found: Sequence[Number]) -> list[Number]:
    """Those that the data tell."""
    return [
        one
        for one in found
        if one.error < SETTINGS.corrections.min_off * one.scale and np.isfinite(one.factor)
    ]


def one_factor(base: BaseModel, candidate: FittedHypothesis) -> str | None:
    """That more inertia and all the model's strengths are one factor, a clause: then it may be that
    of the recorded force. None if that is not so."""
    if candidate.hypothesis.effect != "added_inertia" or not base.places:
        return None
    inertia = 1 + candidate.hypothesis.magnitude(candidate.x) / base.joint_model.inertia
    factors = np.array([inertia, *candidate.fit.x[: len(base.places)]])
    mean = float(factors.mean())
    if (
        mean < 1 + SETTINGS.corrections.one_factor
        or np.abs(factors / mean - 1).max() > SETTINGS.corrections.one_factor
    ):
        return None
    return (
        f"inertia and all of the model's own numbers are too small by one factor, about "
        f"{mean:.2g}: the recorded force may be so many times too large (its unit, a lever arm), "
        "and nothing be missing"
    )
