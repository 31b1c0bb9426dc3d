"""What a diagnosis says: a verdict, and the effects that may be missing."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from joda.diagnosis.settings import SETTINGS
from joda.errors import JodaError
from joda.files import read_json
from joda.plain import plain
from joda.scenes.contacts import Contact

Verdict = Literal["missing_effect", "adequate", "unexplained", "insufficient_data"]
OfModel = Literal[
    "mass", "inertia", "gravity", "center_of_mass", "damping", "frictionloss", "stiffness"
]
OfMeasurement = Literal[
    "actuator_gain", "time_delay", "force_scale", "force_offset", "position_offset"
]
Parameter = OfModel | OfMeasurement


@dataclass(frozen=True)
class Correction:
    """A number of the model or of the measurement that the runs contradict.

    Attributes:
        parameter: the joint's attribute in MJCF, or what of its body, its actuator or the
            measurement it is.
        joint: its name.
        factor: the right value over the model's; None where that is zero.
        value: the right one.
        error: its standard error.
        unit: of both.
        explanation: for a person.
    """

    parameter: Parameter
    joint: str
    factor: float | None
    value: float
    error: float
    unit: str
    explanation: str


@dataclass(frozen=True)
class Finding:
    """An effect that may be missing.

    Attributes:
        effect: its name.
        name: what a model without it lacks, in a few words.
        interval: where it acts, in normalised position.
        interval_error: one standard deviation of either end.
        probability: that it is the missing one, 0 to 1.
        direction: both, positive or negative.
        magnitude: how large it is.
        magnitude_error: one standard deviation that covers: about 68 % of true values lie within
            it, 95 % within two (`joda.diagnosis.uncertainty`).
        unit: of the magnitude.
        explanation: for a person.
        held_out_error_before, held_out_error_after: RMS misfit of segments that were held out of
            the fit, robust, see `joda.diagnosis.holdout`; rad or m.
        indistinguishable_from: effects that these data cannot tell from it.
    """

    effect: str
    name: str
    interval: tuple[float, float]
    interval_error: tuple[float, float]
    probability: float
    direction: Literal["both", "positive", "negative"]
    magnitude: float
    magnitude_error: float
    unit: str
    explanation: str
    held_out_error_before: float
    held_out_error_after: float
    indistinguishable_from: tuple[str, ...]

    @property
    def sized(self) -> bool:
        """Whether its size is anything but zero."""
        return abs(self.magnitude) > SETTINGS.naming.no_size * self.magnitude_error


@dataclass(frozen=True)
class Diagnosis:
    """What a model lacks.

    Attributes:
        joint: its name.
        verdict: one effect is missing; the model is adequate; something is missing that no known
            effect explains; the data tell nothing.
        summary: the verdict in a sentence.
        effects: the most likely first.
        unvisited: where no run has been, in normalised position.
        noise_floor: of the measured positions, or of the forces of curves.
        unit: of that noise and of the errors held out.
        next_experiment: that would decide what is open; None if nothing is.
        notes: what is suspicious about the data.
        contacts: of the scene that resist the joint where it was measured.
        corrections: numbers of the model that the data contradict, apart from what is missing.
        confounder: of the measurement, that would look as the first effect does, a clause: then
            that is added only if it is asked for by name. None if there is none.
        unexplained_probability: that what is missing is none of the known effects, by the same map
            as theirs; None where nothing was weighed, or more than that map decided.
    """

    joint: str
    verdict: Verdict
    summary: str
    effects: tuple[Finding, ...]
    unvisited: tuple[tuple[float, float], ...]
    noise_floor: float
    unit: str
    next_experiment: str | None
    notes: tuple[str, ...]
    contacts: tuple[Contact, ...]
    corrections: tuple[Correction, ...] = ()
    confounder: str | None = None
    unexplained_probability: float | None = None

    def to_json(self) -> str:
        """The diagnosis as JSON."""
        return plain(json.dumps(asdict(self), indent=2, ensure_ascii=False)) + "\n"


def read_diagnosis(path: Path) -> dict[str, Any]:
    """A diagnosis that was written before; raises JodaError if it is none."""
    try:
        content = json.loads(read_json(path))
    except json.JSONDecodeError as error:
        raise JodaError(f"{path}, line {error.lineno}: not JSON ({error.msg}).") from None
    except (ValueError, RecursionError) as error:  # numbers too long, brackets too deep
        raise JodaError(f"{path}: not JSON that can be read ({error}).") from None
    effects = content.get("effects") if isinstance(content, dict) else None
    if not isinstance(effects, list) or not all(
        isinstance(one, dict) and isinstance(one.get("effect"), str) for one in effects
    ):
        raise JodaError(f"{path}: key 'effects' is missing; give what joda diagnose --json wrote.")
    return dict(content)
