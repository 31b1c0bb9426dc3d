"""Numbers of a joint's body and of its measurement that are off, in words."""

from collections.abc import Sequence

from joda.diagnosis.findings import Correction
from joda.estimation.nuisance import FACTORS, NuisanceName
from joda.measured.measured_joint import Measured

WHAT: dict[NuisanceName, str] = {
    "mass": "the mass is {:.3g}{} times the model's",
    "inertia": "the inertia is {:.3g}{} times the model's",
    "gravity": "gravity's pull is {:.3g}{} times the model's",
    "center_of_mass": "the centre of mass is turned by {:.3g}{} {} more than the model's",
    "force_scale": "the force is {:.3g}{} times what was recorded",
    "force_offset": "the force is {:.3g}{} {} more than what was recorded",
    "time_delay": "the recorded force acts {:.3g}{} {} later",
    "position_offset": "the recorded position is {:.3g}{} {} too large",
}
"""With the number, its error and its unit."""
LESS: dict[NuisanceName, tuple[str, str]] = {
    "force_offset": ("more", "less"),
    "time_delay": ("later", "earlier"),
    "position_offset": ("large", "small"),
}
"""The word of a number, and in its place that of one below zero."""
SAME_EFFECT: dict[NuisanceName, str] = {
    "force_offset": " A constant force that the model lacks would do the same{}.",
}
"""What no data tell from a number."""
ONE_WAY = ", and so would more friction in one direction than in the other"
"""The same of an offset that is less than a friction."""


def correction_of(
    measured: Measured,
    name: NuisanceName,
    value: float,
    error: float,
    others: Sequence[tuple[NuisanceName, float]],
) -> Correction:
    """A number that is off, for the user.

    Args:
        measured: the joint as it was given.
        name: of the number.
        value: a factor, or the number in its unit.
        error: its standard error; of a factor's logarithm.
        others: what the data cannot tell from it, and its values.
    """
    joint = measured.profile.joint
    unit = _unit(measured, name)
    error *= value if name in FACTORS else 1.0
    words = _clause(measured, name, value, f" \N{PLUS-MINUS SIGN} {_size(name, error):.2g}")
    alike = " or ".join(_clause(measured, *one) for one in others)
    more = f" As likely by these data: {alike}." if alike else ""
    whole = measured.joint_model.inertia if name == "inertia" else 1.0
    return Correction(
        parameter=name,
        joint=joint.name,
        factor=value if name in FACTORS else None,
        value=whole * value,
        error=whole * error,
        unit=unit,
        explanation=f"{words[0].upper()}{words[1:]}.{more}{_same(measured, name, value)}",
    )


def _same(measured: Measured, name: NuisanceName, value: float) -> str:
    """What no data tell from the number, a further sentence; nothing of most."""
    rubs = sum(max(part.y) for part in measured.profile.channels.friction.components)
    return SAME_EFFECT.get(name, "").format(ONE_WAY if abs(value) < rubs else "")


def _clause(measured: Measured, name: NuisanceName, value: float, error: str = "") -> str:
    """A clause."""
    unit = "ms" if name == "time_delay" else _unit(measured, name)
    size, words = _size(name, value), WHAT[name]
    if name in LESS and value < 0:
        size, words = -size, words.replace(*LESS[name])
    return words.format(size, error, unit)


def _size(name: NuisanceName, value: float) -> float:
    """As it is told: a delay in ms."""
    return 1e3 * value if name == "time_delay" else value


def _unit(measured: Measured, name: NuisanceName) -> str:
    joint = measured.profile.joint
    units = {
        "inertia": "kg·m²" if joint.unit == "rad" else "kg",
        "center_of_mass": "rad",
        "force_offset": joint.force_unit,
        "time_delay": "s",
        "position_offset": joint.unit,
    }
    return units.get(name, "1")
