"""joda beside mujoco.sysid on joints that hide an effect, as a Markdown table.

python tests/benchmarks sysid_beside          a fresh seed, which is printed
python tests/benchmarks sysid_beside 1        this one

The cases are of `joda.hidden`, an independent simulator, with hands that move the joint and a
recorded force. Both get the same base model and the same runs.

mujoco.sysid fits MuJoCo's own parameters of the joint: damping, frictionloss, armature, stiffness
and springref, from the base model's values, in windows of 0.4 s from smoothed starts, every sample
of the same weight. (Its own weights, one over the norm of a window's positions, would depend on
where the joint's zero is.) Its friction row is as tight as the one that both are judged with.
Ours names what is missing and adds it.

Both are judged by one function: `joda.diagnosis.adding.error` in windows of 0.4 s on runs that
neither saw; errors are in units of the encoder's noise, and `true` is that of the true joint
(`hidden_floor`).
Seconds are the processor's, of mujoco.sysid and of ours. `report` is what the log of mujoco.sysid's
own report says about the fit; it is not made to name what is missing.
"""

import logging
import re
import secrets
import sys
import tempfile
import time
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import partial
from io import StringIO
from pathlib import Path

import mujoco
import numpy as np
from hidden_cases import AGAIN, read
from hidden_floor import true_error
from mujoco import sysid
from mujoco.sysid.report.sections.insights import AutomatedInsights

from joda.diagnosis.adding import add_effect, error
from joda.diagnosis.phrases import named
from joda.diagnosis.split import parted
from joda.diagnosis.verdict import diagnosed
from joda.hidden import Case, draw, write
from joda.hidden.cases import VISIBLE
from joda.measured import smoothing
from joda.measured.measured_joint import Measured
from joda.measured.reading import read_measured
from joda.measured.replay import SEGMENT_LENGTH

Array = np.ndarray

HIDDEN = (
    *(None, "quadratic_damping", "stribeck_friction", "detent_internal"),
    *("direction_dependent_damping", "position_dependent_friction", "backlash", "added_inertia"),
)
PARAMETERS = {
    "damping": (0.05, 0.0, 5.0),
    "frictionloss": (0.05, 0.0, 3.0),
    "armature": (0.1, 0.0, 5.0),
    "stiffness": (0.1, 0.0, 20.0),
    "springref": (0.5, -2.0, 3.0),
}
"""Least first value, and bounds, in units of `Units`."""
TIGHT = (0.004, 1.0)
"""Solver parameters of friction's row: twice the timestep, as short as MuJoCo takes."""


def case_of(seed: int, effect: str | None) -> Case:
    """Draws again, with the next seed, where the effect hardly shows."""
    for one in range(seed, seed + AGAIN):
        case = draw(one, effect)
        if case.visible >= VISIBLE:
            break
    return case


# --- mujoco.sysid
@dataclass(frozen=True)
class Piece:
    """A segment of a run; times from its begin, s.

    Attributes:
        time, position: of its samples, rad or m.
        start: smoothed position and velocity, shape (2, 1).
        force: at each step, shape (steps + 1, 1).
    """

    time: Array
    position: Array
    start: Array
    force: Array


def pieces_of(measured: Measured) -> list[Piece]:
    """All runs in windows."""
    h, out = measured.timestep, []
    t = h * np.arange(round(SEGMENT_LENGTH / h) + 1)
    for run, sigma in zip(measured.runs, measured.sigma, strict=True):
        for begin in np.arange(run.time[0], run.time[-1] - SEGMENT_LENGTH + 1e-9, SEGMENT_LENGTH):
            inside = (run.time > begin + h) & (run.time <= begin + SEGMENT_LENGTH + 1e-9)
            if np.count_nonzero(inside) < smoothing.MIN_SAMPLES:
                continue
            x = smoothing.smooth(run.time, run.position, np.array([begin]), sigma)
            start = np.array([x.position, x.velocity])
            force = np.interp(begin + t, run.time, run.force)[:, None]
            out.append(Piece(run.time[inside] - begin, run.position[inside], start, force))
    return out


def units(measured: Measured, pieces: list[Piece]) -> dict[str, tuple[float, float]]:
    """Zero and unit of each parameter, in SI: of a size that matters on this joint."""
    (lo, hi), inertia = measured.profile.joint.range, measured.joint_model.inertia
    force, speed = (
        float(np.sqrt(np.mean(np.concatenate(values) ** 2)))
        for values in ([p.force for p in pieces], [p.start[1] for p in pieces])
    )
    return {
        "damping": (0.0, force / speed),
        "frictionloss": (0.0, force),
        "armature": (0.0, inertia),
        "stiffness": (0.0, force / (hi - lo)),
        "springref": (lo, hi - lo),
    }


def put(joint: mujoco.MjsJoint, name: str, value: float) -> None:
    """A parameter's value, in SI, into a joint."""
    if name in ("damping", "stiffness"):
        getattr(joint, name)[0] = value
    else:
        setattr(joint, name, value)


def identified(case: Case, train: Measured) -> tuple[dict[str, float], str]:
    """Parameters in SI that mujoco.sysid finds, and what its report says."""
    spec = mujoco.MjSpec.from_string(case.model)
    joint, pieces = spec.joint(case.joint), pieces_of(train)
    joint.solref_friction = TIGHT
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.tolerance = 1e-14
    spec.add_actuator(name="hand", target=case.joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    base = {"damping": float(joint.damping[0]), "frictionloss": float(joint.frictionloss)}
    scales, parameters = units(train, pieces), sysid.ParameterDict()
    for name, (least, lo, hi) in PARAMETERS.items():
        zero, unit = scales[name]

        def write_native(spec, parameter, name=name, zero=zero, unit=unit) -> None:
            put(spec.joint(case.joint), name, zero + unit * parameter.value.item())

        first = min(max(base.get(name, 0.0) / unit, least), hi)
        parameters.add(sysid.Parameter(name, first, lo, hi, modifier=write_native))
    model, series, signal = spec.compile(), sysid.TimeSeries, [case.joint + "_qpos"]
    sequences = sysid.ModelSequences(
        "joint",
        spec,
        [f"window {k}" for k in range(len(pieces))],
        [sysid.create_initial_state(model, *piece.start) for piece in pieces],
        [series(spec.option.timestep * np.arange(len(p.force)), p.force) for p in pieces],
        [series.from_names(p.time, p.position[:, None], model, signal) for p in pieces],
        allow_missing_sensors=True,
    )
    residuals = sysid.build_residual_fn(
        models_sequences=[sequences], modify_residual=partial(misfit, case.noise), n_threads=1
    )
    with redirect_stdout(StringIO()):
        fitted, _ = sysid.optimize(parameters, residuals, verbose=False)
    values = {
        name: zero + unit * fitted[name].value.item() for name, (zero, unit) in scales.items()
    }
    log = AutomatedInsights("log", fitted).get_context()["insights"]
    told = "; ".join(f"{one['title']}" + where(one["message"]) for one in log)
    return values, told


def where(message: str) -> str:
    """The parameter that a line of the report is about."""
    name = re.search(r"<b>(\w+)", message)
    return f" ({name[1]})" if name else ""


def misfit(noise: float, params, predicted, measured, model, everything, state):
    """Of a window, in noises: as mujoco.sysid asks for."""
    near = np.interp(measured.times, state[:, 0], state[:, 1])[:, None]
    return (near - measured.data) / noise, measured, measured


def theirs(case: Case, train: Measured, folder: Path) -> tuple[float, str]:
    """Held-out error of what mujoco.sysid fits, rad or m, and what its report says."""
    values, told = identified(case, train)
    spec = mujoco.MjSpec.from_string(case.model)
    for name, value in values.items():
        put(spec.joint(case.joint), name, value)
    (folder / "fitted.xml").write_text(spec.to_xml())
    write(case, folder)
    runs = [folder / run.name for run in case.held_out]
    return error(read_measured(folder / "fitted.xml", case.joint, runs)).window, told


# --- ours
def ours(train: Measured, held_out: Measured, before: float) -> tuple[float, str]:
    """Held-out error after adding what is named first, rad or m, and what is said."""
    found = diagnosed(train).diagnosis
    if not found.effects:
        return before, found.verdict
    first = found.effects[0]
    told = f"{named(first.effect)} ({first.probability:.2f})"
    if first.indistinguishable_from:
        told += ", or " + " or ".join(map(named, first.indistinguishable_from))
    if found.verdict != "missing_effect":
        told = f"{found.verdict}; nearest: {told}"
    added_effect = add_effect(*parted(train), first.effect, first.direction)
    after = error(held_out, added_effect.profile).window if added_effect.effect else before
    return after, told


# --- the table
COLUMNS = (
    *("hidden effect", "noise", "true", "before", "mujoco.sysid", "joda", "s", "s"),
    *("report", "joda says (probability)"),
)


def row(case: Case, effect: str | None) -> str:
    """Of the table."""
    train, held_out = read(case)
    before = error(held_out).window
    with tempfile.TemporaryDirectory() as folder:
        begun = time.process_time()
        fitted, report = theirs(case, train, Path(folder))
        between = time.process_time()
    added_effect, told = ours(train, held_out, before)
    spent = between - begun, time.process_time() - between
    hidden = named(effect) if effect else "none"
    noise = f"{case.noise:.1e} {train.profile.joint.unit}"
    errors = [f"{one / case.noise:.2f}" for one in (true_error(case), before, fitted, added_effect)]
    cells = [hidden, noise, *errors, *(f"{one:.0f}" for one in spent), report, told]
    return f"| {' | '.join(cells)} |"


def table(seed: int) -> None:
    """All cases of one seed."""
    print(f"seed {seed}; errors in units of the noise\n")
    print(f"| {' | '.join(COLUMNS)} |\n{'|---' * len(COLUMNS)}|")
    for k, effect in enumerate(HIDDEN):
        print(row(case_of(seed + AGAIN * k, effect), effect), flush=True)


def main() -> None:
    logging.getLogger("absl").setLevel(logging.ERROR)  # mujoco.sysid on positions, not sensors
    table(int(sys.argv[1]) if sys.argv[1:] else secrets.randbits(31))
