"""A model against measurements: its errors against the noise, and where it fails."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from json import dumps

from joda.measured.adequacy import LOUD, Adequacy, Adequate
from joda.measured.curves import CurveError, FailingForce, curves_described
from joda.measured.errors import MULTIPLE, Missed, RunError
from joda.measured.failing_intervals import Failing
from joda.plain import plain
from joda.scenes.contacts import Contact

MAX_INTERVALS = 6
"""Most places that are told."""


@dataclass(frozen=True)
class Comparison:
    """A model against measured runs and quasi-static curves.

    Attributes:
        joint: its name.
        unit: of position, rad or m.
        runs: errors by run.
        rmse, rmse_window, noise_floor: of all runs together, rad or m; None without a run.
        adequacy: whether the runs show a fault of the model; None without a run.
        failing: where it fails, the largest share first.
        failing_window: length of the segments that show it, s; 0: pieces of whole runs.
        curves: errors by quasi-static curve.
        curves_adequacy: whether the curves show one; None without a curve.
        failing_force: where its quasi-static force fails, the largest share first.
        notes: what is suspicious about the data, a sentence each.
        contacts: of the scene that resist the joint where it was measured.
    """

    joint: str
    unit: str
    runs: tuple[RunError, ...]
    rmse: float | None
    rmse_window: float | None
    noise_floor: float | None
    adequacy: Adequacy | None
    failing: tuple[Failing, ...]
    failing_window: float
    curves: tuple[CurveError, ...]
    curves_adequacy: Adequate | None
    failing_force: tuple[FailingForce, ...]
    notes: tuple[str, ...]
    contacts: tuple[Contact, ...]

    def to_json(self) -> str:
        """The comparison as JSON."""
        content = {
            "joint": self.joint,
            "unit": self.unit,
            "runs": [vars(run) for run in self.runs],
            **{key: getattr(self, key) for key in ("rmse", "rmse_window", "noise_floor")},
            "adequacy": asdict(self.adequacy) if self.adequacy else None,
            "failing": [vars(place) for place in self.failing],
            "failing_window": self.failing_window,
            "curves": [vars(curve) for curve in self.curves],
            "curves_adequacy": self.curves_adequacy,
            "failing_force": [vars(place) for place in self.failing_force],
            "notes": list(self.notes),
            "contacts": [vars(contact) for contact in self.contacts],
        }
        return plain(dumps(content, indent=2, ensure_ascii=False, allow_nan=False)) + "\n"


def sentences(comparison: Comparison) -> list[str]:
    """The comparison for a person: how far off, where most."""
    curves = curves_described(
        comparison.curves, comparison.failing_force, comparison.curves_adequacy
    )
    return (_of_runs(comparison) if comparison.runs else []) + curves


def _of_runs(comparison: Comparison) -> list[str]:
    unit, floor = comparison.unit, comparison.noise_floor
    errors = {
        "free-run (open-loop) error": comparison.rmse,
        "segment error (0.4 s horizon)": comparison.rmse_window,
    }
    parts = [f"{what} {error:.3g} {unit}" for what, error in errors.items() if error is not None]
    if parts:
        told = ", ".join([f"{parts[0]} RMS", *parts[1:]])
        noise = f"the measurement's noise is {floor:.2g} {unit}."
        out = [f"{told[0].upper()}{told[1:]}; {noise}"]
    else:
        out = ["No run could be replayed."]
    out += [f"{run.file}: {run.reason}." for run in comparison.runs if run.reason]
    return [*out, *_verdict(comparison), *_places(comparison)]


def _verdict(comparison: Comparison) -> Iterator[str]:
    """The all-clear, or why there is none."""
    found = comparison.adequacy
    assert found is not None
    if found.verdict == "within_noise":
        yield (
            f"Nothing beyond the noise: the error of every run and every segment is less than "
            f"{MULTIPLE:g} times the noise, and the residual force has no pattern; these runs show "
            "no fault of the model."
        )
    if found.barred:
        yield f"Beyond the noise: {found.barred[0].lower()}{found.barred[1:]}"
    worst = [one for one in (found.run, found.segment) if one and one.multiple >= MULTIPLE]
    if found.verdict == "not_enough_data" and worst:
        told = ", and ".join(map(_explained, worst))
        yield f"Not enough to tell whether the model is right: {told}."
        if found.segment and found.segment.multiple < MULTIPLE:
            yield f"The error of every segment of 0.4 s is less than {MULTIPLE:g} times the noise."
    elif found.verdict == "not_enough_data" and not found.whole:
        yield (
            "Not enough to tell whether the model is right: nothing in what is replayed is beyond "
            "the noise, but not all is replayed (see the notes)."
        )
    elif found.verdict == "not_enough_data" and found.adrift:
        yield (
            "Not enough to tell whether the model is right: the error of every run and every "
            f"segment is less than {MULTIPLE:g} times the noise, but more is left of whole runs "
            "than noise of position and force makes: a small fault of the model, or what the force "
            "did between its samples."
        )
    elif found.verdict == "not_enough_data" and comparison.failing:
        yield (
            "Not enough to tell whether the model is right: the error of every run and every "
            f"segment is less than {MULTIPLE:g} times the noise, but some are clearly larger than "
            "others."
        )
    elif found.verdict == "not_enough_data" and found.repeats:
        yield (
            "Not enough to tell whether the model is right: positions repeat while the joint "
            "moves, so that what was taken for noise is motion; record each measured value once."
        )
    elif found.verdict == "not_enough_data" and found.loudness >= LOUD:
        yield f"Not enough to tell whether the model is right: {_loud(found)}"
    elif found.verdict == "not_enough_data":
        yield (
            "Not enough to tell whether the model is right: too few samples, or too little motion "
            "in them."
        )
    elif found.verdict == "beyond_noise" and worst:
        yield f"Beyond the noise: {', and '.join(map(_worst, worst))}."
        if not found.whole:
            yield "Not all that acts is replayed (see the notes): that may be the error."
    elif found.verdict == "beyond_noise" and not found.barred and found.pattern is not None:
        every = "every run and segment" if found.segment else "every run"
        small = "Beyond noise" if found.loudness >= LOUD else "Small, but not noise"
        yield (
            f"{small}: the error of {every} is less than {MULTIPLE:g} times the noise, yet it has "
            f"a pattern that noise makes in {_rarely(found.pattern)}."
        )
        if found.loudness >= LOUD:
            yield f"How far beyond these runs cannot tell: {_loud(found)}"
    if found.verdict == "beyond_noise" and not (found.barred or comparison.failing):
        yield "The data do not show where in position, speed, direction, load or time it fails."


def _loud(found: Adequacy) -> str:
    return (
        f"what was taken for noise is {100 * found.loudness:.0f} % of the motion, and part of it "
        "may be what the joint does between two samples; record faster."
    )


def _worst(one: Missed) -> str:
    if one.time is None:
        return f"the free run of {one.file} is off by {_much(one)}"
    first, last = one.time
    return f"the segment of {one.file} at {first:.3g} to {last:.3g} s is off by {_much(one)}"


def _much(one: Missed) -> str:
    return f"{_times(one.multiple)} the noise" if one.multiple < 1e6 else "more than can be told"


def _times(multiple: float) -> str:
    return f"{multiple:.0f} times" if multiple >= 10 else f"{multiple:.2g} times"


def _explained(one: Missed) -> str:
    return (
        f"{_worst(one)}, of which errors of the measured initial state and force alone can make "
        f"{_times(one.explained)} the noise"
    )


def _rarely(probability: float) -> str:
    return f"1 of {1 / probability:.0f} cases" if probability > 1e-4 else "hardly any case"


def _places(comparison: Comparison) -> Iterator[str]:
    unit = comparison.unit
    force = "N·m" if unit == "rad" else "N"
    for place in comparison.failing[:MAX_INTERVALS]:
        a, b = place.interval
        where = {
            "position": f"at s = {a:.2f} to {b:.2f}",
            "velocity": f"at {a:.3g} to {b:.3g} {unit}/s",
            "direction": "while moving towards " + ("+q" if b > 0 else "\N{MINUS SIGN}q"),
            "time": f"at {a:.3g} to {b:.3g} s",
            "load": f"under a load of {a:.3g} to {b:.3g} {force}",
        }[place.by]
        if place.force is None:
            how = "where the mean residual force is within its error of zero"
        else:
            much = "much" if place.force > 0 else "little"
            how = (
                f"where the mean residual force is {abs(place.force):.2g} {force}: the model "
                f"pushes too {much} towards +q"
            )
        share = f"{100 * place.share:.0f}" if place.share >= 0.01 else "less than 1"
        yield f"By {place.by}: {share} % of the error is {where}, {how}."
