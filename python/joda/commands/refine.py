"""Gradient refinement: bends a joint's profile until simulation matches measured motions."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.plausible import Needs, implausible
from joda.diagnosis.reshaping import resolved
from joda.errors import JodaError
from joda.files import check_targets, write_together
from joda.joints.parameters import KINDS, Kind, Parameters, gravity_scale
from joda.measured.driven import read_logs
from joda.measured.excerpts import excerpts
from joda.measured.obstructed import clear_of_contacts
from joda.measured.reading import checked, taken
from joda.measured.runs import QuasiStatic, Run
from joda.pictures.changes import changes
from joda.pictures.style import png
from joda.refining.curvefit import CurveProblem
from joda.refining.refinement import history, picture, unseen
from joda.scenes.attaching import attached
from joda.scenes.context import Context, context
from joda.scenes.model import find_joint, joint_name, load_model
from joda.scenes.native import whole_profile
from joda.scenes.scene import profiles_of

if TYPE_CHECKING:
    from joda.refining.fitting import Problem

Array = NDArray[np.float64]

ITERATIONS = 60
STILL: tuple[Kind, ...] = ("values", "intervals", "strengths")
"""What quasi-static curves can tell."""
WORSE = 1.05
"""How much more what is held out may be missed by after a fit, as a factor."""
PARTED = 5.0
"""Whole runs that are missed by so many times more than windows have parted from the measured."""


@dataclass(frozen=True)
class Refined:
    """What a refinement did.

    Attributes:
        scene, composed, picture, history: the files that were written.
        changes: a line per changed component.
        before, after: RMS position error of whole runs from their starts, which are fitted within
            the measurement's error, rad or m; of curves, RMS error of the force, N·m or N.
        windows: the same of windows of 0.4 s, before and after; None of curves.
        noise: of the measured position or force.
        checked: the same error where it was held out of the fit; None without such.
        unseen: per channel, intervals of normalised position of which the data told little.
        iterations: how many there were.
        notes: what the user should be told, a sentence each.
    """

    scene: Path
    composed: Path
    picture: Path
    history: Path
    changes: tuple[str, ...]
    before: float
    after: float
    windows: tuple[float, float] | None
    noise: float
    checked: tuple[float, float] | None
    unseen: dict[str, tuple[tuple[float, float], ...]]
    iterations: int
    notes: tuple[str, ...]


def refine(
    model: str | Path,
    joint: str,
    runs: Sequence[str | Path],
    output: str | Path,
    *,
    check: Sequence[str | Path] = (),
    iterations: int = ITERATIONS,
    method: Literal["lm", "adam"] = "lm",
    fit: Collection[Kind] = ("values", "intervals"),
    keep_shape: bool = True,
    finer: int = 0,
    passive: bool = False,
    force: bool = False,
    progress: Callable[[str, int, int, float], None] = lambda stage, number, total, rms: None,
) -> Refined:
    """Fits a joint's profile to measured motions.

    The joint is simulated by itself, all others held, at the scene's timestep, exactly as MuJoCo
    with the plugin does, and differentiated. Control points keep their sign, and rising and falling
    parts of a curve keep rising and falling, so that a magnet stays a magnet. What the data do not
    see stays near its value before.

    Args:
        model: a scene (MJCF) whose joint carries a profile.
        joint: its name or address, see `joda.scenes.model.find_joint`.
        runs: measured motions, CSV files with time, position and perhaps force; or all of them
            quasi-static curves, without time.
        output: scene to write; beside it, with its name, go .composed.json, .png and .history.json.
        check: such files that are held out of the fit: where they are missed by more after it,
            nothing is written.
        iterations: at most so many.
        method: Levenberg-Marquardt, or Adam as in the paper.
        fit: what may change: the control points' values, the intervals' ends, the channels'
            strengths, the damping_ratio of the ends of the range, inertia, a gravity offset.
        keep_shape: see above.
        finer: so many times a control point is put halfway between each two, before the fit.
        passive: whether the actuators on the joint, if there are any, were off.
        force: overwrite what exists.
        progress: told the stage, the iteration, of how many at most, and the RMS misfit (rad or m;
            N·m or N of curves).

    Returns:
        what was written, and how much better it is.

    Raises:
        JodaError: a file cannot be read or written, the joint carries no profile, JAX is missing;
            or what was fitted is no better, or exerts forces that nothing in the runs needs.
    """
    source, target = Path(model), Path(output)
    beside = {
        kind: target.with_suffix(f".{kind}") for kind in ("composed.json", "png", "history.json")
    }
    check_targets([target, *beside.values()], force, runs)
    if unknown := set(fit) - set(KINDS):
        raise JodaError(f"fit: '{sorted(unknown)[0]}' is none of {', '.join(KINDS)}.")
    if not runs:
        raise JodaError("no runs; give at least one CSV file with time and position.")
    compiled = load_model(source)
    number = find_joint(compiled, joint)
    (measured, unused), (held_out, more) = (
        read_logs(compiled, number, paths, passive) for paths in (runs, check)
    )
    if _of_one_kind([*measured, *held_out]) and (moving := set(fit) - set(STILL)):
        raise JodaError(f"fit: '{sorted(moving)[0]}' is not in quasi-static curves, leave it out.")
    name = joint_name(compiled, number)
    profiles = profiles_of(compiled)
    if name not in profiles:
        raise JodaError(
            f"{source}: joint '{name}' carries no profile; make one with joda generate, or attach "
            "one with joda attach."
        )
    before, found = profiles[name], context(source, name)
    notes = [*checked([*measured, *held_out], found, float(compiled.opt.timestep)), *unused, *more]
    whole = whole_profile(compiled, number, before)
    clear = clear_of_contacts(compiled, number, found, whole, measured)
    other = clear_of_contacts(compiled, number, found, whole, held_out) if held_out else None
    notes += [*clear.notes, *(other.notes if other else [])]
    begin = before
    for _ in range(finer):
        begin = resolved(begin)
    timed = [one for one in clear.measured if isinstance(one, Run)]
    parts, _, cut = excerpts(timed)
    notes += cut
    unit = gravity_scale(found, begin)
    parameters = Parameters(begin, fit, keep_shape=keep_shape, gravity=unit)
    if not len(parameters.start):
        raise JodaError(f"{source}: the profile of joint '{name}' has nothing to fit.")
    problem = _problem(found, compiled, number, parameters, parts if timed else clear.measured)
    result = problem.fit(
        iterations, method, lambda stage, k, rms: progress(stage, k, iterations, rms)
    )
    after = parameters.written(result.theta)
    errors = problem.rms(parameters.start), problem.rms(result.theta)
    windows = problem.windows(result.theta)
    apart = None
    if other:
        unseen_runs = _problem(found, compiled, number, parameters, other.measured)
        apart = unseen_runs.rms(parameters.start), unseen_runs.rms(result.theta)
    if reason := _worse(errors, windows, apart, problem.sigma):
        raise JodaError(f"{target}: not written, as {reason}.")
    needs = Needs(taken(compiled, number, found, whole, clear)) if timed else None
    if reason := implausible(needs, after):
        raise JodaError(f"{target}: not written, as {reason}.")
    hidden = unseen(begin, parameters, result.covariance)
    also, mended = _beyond(parameters, result.theta, compiled, number, found)
    scene, said = attached(source, after, target, joint=name, also=also)
    notes += [*said, *mended, *problem.notes]
    balance = np.array(found.positions), -np.array(found.gravity_force)
    figure = picture(before, after, balance, problem, result, hidden)
    write_together(
        {
            target: scene,
            beside["composed.json"]: after.to_json(),
            beside["png"]: png(figure),
            beside["history.json"]: history(result, errors, problem.sigma, apart, hidden),
        }
    )
    if windows and errors[1] > PARTED * max(windows[1], problem.sigma):
        notes.append(
            "Whole runs still part from the measured ones although windows of 0.4 s do not: near "
            "a barrier a small difference decides to which side a joint snaps."
        )
    if result.interrupted:
        notes.append(f"Interrupted; the best of {len(result.history)} iterations was kept.")
    return Refined(
        scene=target,
        composed=beside["composed.json"],
        picture=beside["png"],
        history=beside["history.json"],
        changes=tuple(changes(before, after)),
        before=errors[0],
        after=errors[1],
        windows=windows,
        noise=problem.sigma,
        checked=apart,
        unseen=hidden,
        iterations=len(result.history),
        notes=tuple(notes),
    )


def _worse(
    errors: tuple[float, float],
    windows: tuple[float, float] | None,
    apart: tuple[float, float] | None,
    noise: float,
) -> str | None:
    """Why the fitted profile is no better than it was, as a clause; None if it is."""
    if apart and apart[1] > WORSE * max(apart[0], noise):
        return (
            f"what was held out (--check) is missed by {apart[1]:.3g} with it instead of "
            f"{apart[0]:.3g}"
        )
    if errors[1] > errors[0] > noise and (windows is None or windows[1] > windows[0]):
        return f"it is missed by {errors[1]:.3g} instead of {errors[0]:.3g} after the fit"
    return None


def _of_one_kind(measured: Sequence[Run | QuasiStatic]) -> bool:
    """Whether these are curves; raises JodaError if some are and some are not."""
    curves = [one.name for one in measured if isinstance(one, QuasiStatic)]
    if curves and len(curves) < len(measured):
        raise JodaError(
            f"{curves[0]}: a quasi-static curve among timed runs; refine to either, one after the "
            "other."
        )
    return bool(curves)


def _problem(
    found: Context,
    model: mujoco.MjModel,
    joint: int,
    parameters: Parameters,
    measured: Sequence[Run | QuasiStatic],
) -> "Problem | CurveProblem":
    """What is to be fitted; raises JodaError if that takes JAX and it is missing."""
    curves = [one for one in measured if isinstance(one, QuasiStatic)]
    if curves:
        return CurveProblem(found, model, joint, parameters, curves)
    try:
        from joda.joints import solo
        from joda.refining.fitting import Problem
    except ImportError as error:
        raise JodaError(
            f'refine needs JAX (no module {error.name}); run: pip install ".[mjx]"'
        ) from None
    first = solo.from_context(found, parameters.profile, model, joint, attached=True)
    runs = [one for one in measured if isinstance(one, Run)]
    return Problem(first, parameters, runs, float(model.opt.timestep))


def _beyond(
    parameters: Parameters, theta: Array, model: mujoco.MjModel, joint: int, found: Context
) -> tuple[dict[str, str], list[str]]:
    """What was fitted besides the profile: attributes for the joint, and sentences."""
    also, said = {}, []
    values = {
        (slot.kind, slot.index): value for slot, value in zip(parameters.slots, theta, strict=True)
    }
    if ("damping_ratio", 0) in values:
        constant, ratio = model.jnt_solref[joint]
        also["solreflimit"] = f"{constant:.6g} {ratio * np.exp(values['damping_ratio', 0]):.6g}"
    if ("inertia", 0) in values:
        inertia = found.equivalent_inertia * np.exp(values["inertia", 0])
        armature = model.dof_armature[model.jnt_dofadr[joint]] + inertia - found.equivalent_inertia
        unit = "kg·m²" if found.joint.type == "hinge" else "kg"
        said.append(f"Inertia: {found.equivalent_inertia:.4g} → {inertia:.4g} {unit}.")
        if armature >= 0:
            also["armature"] = f"{armature:.6g}"
        else:
            said[-1] = said[-1][:-1] + ", which is less than the bodies have; make them lighter."
    if ("gravity", 0) in values:
        unit_force = gravity_scale(found, parameters.profile)
        a, b = (unit_force * values.get(("gravity", k), 0.0) for k in (0, 1))
        what = f"{a:.4g} cos q + {b:.4g} sin q N·m" if found.joint.type == "hinge" else f"{a:.4g} N"
        said.append(
            f"Gravity's force on the joint lacks {what}; mend the bodies' centre of mass or tilt."
        )
    return also, said
