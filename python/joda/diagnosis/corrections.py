"""The model's own numbers that the measurements contradict, apart from missing effects."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from joda.component import Component
from joda.diagnosis.asking import Asked
from joda.diagnosis.baseline import Base, joined
from joda.diagnosis.guessing import Guess
from joda.profile import Joint
from joda.scenes.native import DAMPING, FRICTION, SPRING

Array = NDArray[np.float64]

OFF, FAR_OFF = 0.05, 0.3
"""By how much a number must be off to be worth a word; and where something else is missing."""
CLEARLY = 3.0
"""And by so many of its standard errors."""
ANYTHING = 10.0
"""How far off a number may be of which the data tell nothing, in its own unit."""
ALIKE = 0.12
"""By how much factors may differ that are one."""

Parameter = Literal["damping", "frictionloss", "stiffness"]
NATIVE: dict[str, Parameter] = {
    DAMPING: "damping",
    FRICTION: "frictionloss",
    SPRING: "stiffness",
}
"""The model's own numbers by the labels of their components (`joda.scenes.native`)."""


@dataclass(frozen=True)
class Correction:
    """A number of the model that the measurements contradict.

    Attributes:
        parameter: the joint's attribute in MJCF.
        joint: its name.
        factor: the right value over the model's.
        value: the right one.
        error: its standard error.
        unit: of both.
        explanation: for a person.
    """

    parameter: Parameter
    joint: str
    factor: float
    value: float
    error: float
    unit: str
    explanation: str


@dataclass(frozen=True)
class Strength:
    """What a component's strength is found to be, in units of the model's.

    Attributes:
        label: of the component, or its channel.
        component: as the model has it.
        factor: the right strength over the model's.
        error: its standard error.
    """

    label: str
    component: Component
    factor: float
    error: float

    def off(self, least: float) -> bool:
        """Whether it is off, by some part at the least and by several of its errors."""
        return abs(self.factor - 1) > max(least, CLEARLY * self.error)

    @property
    def told(self) -> str:
        """Its factor."""
        return f"{self.label} \N{MULTIPLICATION SIGN} {self.factor:.3g} ± {self.error:.2g}"


def strengths(asked: Asked, guess: Guess | None = None) -> tuple[Strength, ...]:
    """Of the model's components, as fitted alone or together with an effect."""
    base, fit = asked.base, guess.fit if guess else asked.fit
    n = len(base.places)
    errors = _errors(asked, guess)[:n]
    parts = (getattr(base.profile.channels, name).components[k] for name, k in base.places)
    return tuple(
        Strength(part.label or place[0], part, float(factor), float(error))
        for place, part, factor, error in zip(base.places, parts, fit.x[:n], errors, strict=True)
    )


def _errors(asked: Asked, guess: Guess | None) -> Array:
    """Standard errors of all fitted numbers by the data alone, with what is left over as noise:
    what was known of them before makes none of them surer."""
    base, fit = asked.base, guess.fit if guess else asked.fit
    make, unknowns = joined(base, guess.hypothesis) if guess else (base.solo, base.unknowns)
    doubt = np.full(len(fit.x), ANYTHING)
    return np.asarray(np.sqrt(np.diag(asked.judge.covariance(make, unknowns, fit, doubt))))


def corrections(found: Sequence[Strength], joint: Joint, least: float) -> tuple[Correction, ...]:
    """What of the model's own numbers is off.

    Args:
        found: strengths of its components.
        joint: of the model.
        least: part by which a number must be off.
    """
    return tuple(
        _correction(one, NATIVE[one.label], joint)
        for one in found
        if one.label in NATIVE and one.off(least)
    )


def _correction(one: Strength, parameter: Parameter, joint: Joint) -> Correction:
    given = one.component.y[0]
    if parameter == "stiffness":
        given = (given - one.component.y[-1]) / float(np.ptp(joint.range))
    per = {"damping": f"·s/{joint.unit}", "stiffness": f"/{joint.unit}", "frictionloss": ""}
    unit = joint.force_unit + per[parameter]
    value, error = one.factor * given, one.error * given
    return Correction(
        parameter=parameter,
        joint=joint.name,
        factor=one.factor,
        value=value,
        error=error,
        unit=unit,
        explanation=(
            f"The model's {parameter} is {given:.3g} {unit}, the runs show {value:.3g} ± "
            f"{error:.1g} {unit}."
        ),
    )


def off(found: Sequence[Strength]) -> str:
    """Which strengths are off and by what, with their errors; empty if none is."""
    return ", ".join(one.told for one in found if one.off(OFF))


def off_beside(found: Sequence[Strength]) -> str:
    """Which strengths are far off beside an effect, as a further sentence; empty if none is."""
    told = ", ".join(one.told for one in found if one.off(FAR_OFF))
    return f" The model's own numbers are off besides: {told}." if told else ""


def by_one_factor(found: Sequence[Strength]) -> str:
    """That all strengths that the data tell are off by one factor, a further sentence: then it may
    be the force's."""
    x = np.array([one.factor for one in found if one.error < OFF])
    mean = float(x.mean()) if len(x) > 1 else 1.0
    if abs(mean - 1) < FAR_OFF or np.abs(x / mean - 1).max() > ALIKE:
        return ""
    return (
        f" All by one factor, about {mean:.2g}: the measured force may be in another unit, or its "
        "lever arm another."
    )


def one_factor(base: Base, guess: Guess) -> str | None:
    """That more inertia and all the model's strengths are one factor, a clause: then it may be that
    of the recorded force. None if that is not so."""
    if guess.hypothesis.effect != "added_inertia" or not base.places:
        return None
    inertia = 1 + guess.hypothesis.magnitude(guess.x) / base.single.inertia
    factors = np.array([inertia, *guess.fit.x[: len(base.places)]])
    mean = float(factors.mean())
    if mean < 1 + ALIKE or np.abs(factors / mean - 1).max() > ALIKE:
        return None
    return (
        f"inertia and all of the model's own numbers are too small by one factor, about "
        f"{mean:.2g}: the recorded force may be so many times too large (its unit, a lever arm), "
        "and nothing be missing"
    )
