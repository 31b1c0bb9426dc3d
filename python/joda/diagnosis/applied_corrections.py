"""A joint and its runs with numbers set right: of what it moves, and of the measurement."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from math import isfinite
from typing import Any

from joda.measured.measured_joint import Measured
from joda.measured.sensing import RIGHT, Sensing
from joda.scenes.mass_attributes import Heavier


@dataclass(frozen=True)
class AppliedCorrections:
    """Numbers that are set right.

    Attributes:
        heavier: how much heavier what the joint moves is; None where the model has that right.
        sensing: what is wrong with the measurement.
    """

    heavier: Heavier | None
    sensing: Sensing

    def of(self, measured: Measured) -> Measured:
        """A joint and its runs with them."""
        own = self.heavier
        joint_model = (
            measured.joint_model.heavier(own.inertia, own.gravity, own.turned) if own else None
        )
        return measured.sensed(self.sensing).changed(joint_model=joint_model)


def applied_corrections(values: Mapping[str, float]) -> AppliedCorrections:
    """By the numbers' names: factors of the body, and numbers of a `Sensing`; others are left."""
    mass, inertia, gravity = (values.get(name, 1.0) for name in ("mass", "inertia", "gravity"))
    heavier = Heavier(mass * inertia, mass * gravity, values.get("center_of_mass", 0.0))
    known = {one.name for one in fields(Sensing)} - {"actuator_gain"}
    sensing = Sensing(**{name: value for name, value in values.items() if name in known})
    return AppliedCorrections(None if heavier == Heavier(1.0, 1.0) else heavier, sensing)


def from_report(corrections: Sequence[Any], driven: bool) -> AppliedCorrections | None:
    """As a diagnosis' JSON tells; None where it tells none of these numbers.

    `driven`: whether an actuator acts, whose delay is the model's and is not set right here.
    """
    values = {}
    for one in corrections:
        name, factor, value = (one.get(key) for key in ("parameter", "factor", "value"))
        number = value if factor is None else factor
        if isinstance(name, str) and isinstance(number, int | float) and isfinite(number):
            values[name] = float(number)
    if driven:
        values.pop("time_delay", None)
    found = applied_corrections(values)
    return None if found == AppliedCorrections(None, RIGHT) else found
