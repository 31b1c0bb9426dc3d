"""Refinement: bends a joint's profile until simulation matches measured motions."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
import typer
from numpy.typing import NDArray

from joda.diagnosis.adding import Error, error
from joda.diagnosis.data_sufficiency import hardly_moved
from joda.diagnosis.outcome import parting
from joda.diagnosis.plausible import Needs
from joda.diagnosis.shape_refinement import resolved
from joda.errors import JodaError
from joda.estimation.profile_parameters import KINDS, Kind, Parameters, gravity_scale
from joda.files import check_targets, named_like, write_together
from joda.measured.corrections_file import corrections_beside, corrections_text, sensing_of
from joda.measured.driven import read_logs
from joda.measured.excerpts import excerpts
from joda.measured.measured_joint import Measured
from joda.measured.obstructed import clear_of_contacts
from joda.measured.quasi_static import compared
from joda.measured.reading import checked, taken
from joda.measured.runs import QuasiStatic, Run, check_known
from joda.measured.sensing import RIGHT
from joda.measured.visited import unvisited
from joda.pictures.changes import changes
from joda.pictures.style import png
from joda.profile import Profile
from joda.refining.acceptance import refused
from joda.refining.curvefit import CurveProblem
from joda.refining.engine import JointEngine, noise
from joda.refining.fitting import Problem
from joda.refining.refinement import extrapolated, history, picture, unseen
from joda.refining.scene_or_joint import together
from joda.scenes.attaching import attached
from joda.scenes.context import Context, context
from joda.scenes.model import find_joint, joint_name, load_model
from joda.scenes.native import whole_profile
from joda.scenes.scene import profiles_of
from joda.terminal import options
from joda.terminal.progress import loss_bar
from joda.terminal.say import print_json, say, say_changes, with_text_paths
from joda.threads import one_blas_thread

Array = NDArray[np.float64]

ITERATIONS = 120
AS_IT_WAS = 1e-3
"""Change of the inertia, as a part of it, and of gravity's force, in units of its largest, that is
none."""
ELSEWHERE = 5.0
"""How many times as much as what was fitted is what was held out missed at most."""
STILL: tuple[Kind, ...] = ("values", "intervals", "strengths")
"""What quasi-static curves can tell."""


@dataclass(frozen=True)
class Refined:
    """What a refinement did.

    Attributes:
        scene, composed, picture, history: the files that were written.
        corrections: what the runs have wrong, beside the scene; None where they were not said to.
        changes: a line per changed component.
        before, after: RMS position error of whole runs, as `joda compare` tells it, rad or m; of
            curves, RMS error of the force, N·m or N.
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
    corrections: Path | None
    changes: tuple[str, ...]
    before: float
    after: float
    windows: tuple[float, float] | None
    noise: float
    checked: tuple[float, float] | None
    unseen: dict[str, tuple[tuple[float, float], ...]]
    iterations: int
    notes: tuple[str, ...]


@one_blas_thread
def refine(
    model: str | Path,
    joint: str,
    runs: Sequence[str | Path],
    output: str | Path,
    *,
    check: Sequence[str | Path] = (),
    iterations: int = ITERATIONS,
    fit: Collection[Kind] = ("values", "intervals"),
    keep_shape: bool = True,
    finer: int = 0,
    passive: bool = False,
    scene: bool | None = None,
    corrections: str | Path | None = None,
    force: bool = False,
    progress: Callable[[str, int, int, float], None] = lambda stage, number, total, rms: None,
) -> Refined:
    """Fits a joint's profile to measured motions.

    The joint is simulated by itself, all others held, at the scene's timestep, exactly as MuJoCo
    with the plugin does; its sensitivities are differences. Control points keep their sign, and
    rising and falling parts of a curve keep rising and falling, so that a magnet stays a magnet.
    What the data do not see stays near its value before.

    Args:
        model: a scene (MJCF) whose joint carries a profile.
        joint: its name or address, see `joda.scenes.model.find_joint`.
        runs: measured motions, CSV files with time, position and perhaps force; or all of them
            quasi-static curves, without time.
        output: scene to write; beside it, with its name, go .composed.json, .png and .history.json.
        check: such files that are held out of the fit: where they are missed by more after it,
            nothing is written.
        iterations: at most so many.
        fit: what may change: the control points' values, the intervals' ends, the channels'
            strengths, the damping_ratio of the ends of the range, inertia, a gravity offset.
        keep_shape: see above.
        finer: so many times a control point is put halfway between each two, before the fit.
        passive: whether the actuators on the joint, if there are any, were off.
        scene: whether the whole scene is simulated, in MJX, instead of the joint by itself; None:
            where other joints of the logs, or contacts, move the joint.
        corrections: what is wrong with the runs, as `joda.improve` or `joda.add` wrote it beside
            their scene; it is written beside the new one too. Of a joint by itself only.
        force: overwrite what exists.
        progress: told the stage, the iteration, of how many at most, and the RMS misfit (rad or m;
            N·m or N of curves).

    Returns:
        what was written, and how much better it is.

    Raises:
        JodaError: a file cannot be read or written, the joint carries no profile, a curve may be
            in another unit; or what was fitted is no better, or exerts forces that nothing in the
            runs needs.
    """
    source, target = Path(model), Path(output)
    others = {
        kind: named_like(target, f".{kind}") for kind in ("composed.json", "png", "history.json")
    }
    if corrections:
        others["corrections"] = corrections_beside(target)
    read = [*runs, *check, *([corrections] if corrections else [])]
    check_targets([target, *others.values()], force, read)
    if twice := _both(runs, check):
        raise JodaError(f"{twice}: is fitted too; what is held out (--check) must not be.")
    if unknown := set(fit) - set(KINDS):
        raise JodaError(f"--fit: '{sorted(unknown)[0]}' is none of {', '.join(KINDS)}.")
    if not runs:
        raise JodaError("no runs; give at least one CSV file with time and position.")
    compiled = load_model(source)
    number = find_joint(compiled, joint)
    name = joint_name(compiled, number)
    sensing = sensing_of(corrections, name)
    jointly, notes = together(compiled, number, runs, check, passive, scene)
    if jointly and sensing != RIGHT:
        raise JodaError(
            f"{corrections}: corrects the runs of a joint by itself, and here the whole scene is "
            "simulated; leave it out, or say --no-scene."
        )
    fitted, kept = (
        jointly.logs(compiled, paths)
        if jointly
        else read_logs(compiled, number, paths, passive, sensing)
        for paths in (runs, check)
    )
    measured, held_out, servo = fitted.read, kept.read, fitted.servo or kept.servo
    if _of_one_kind([*measured, *held_out]) and (moving := set(fit) - set(STILL)):
        raise JodaError(
            f"--fit: '{sorted(moving)[0]}' is not in quasi-static curves, leave it out."
        )
    profiles = profiles_of(compiled)
    if name not in profiles:
        raise JodaError(
            f"{source}: joint '{name}' carries no profile; make one with joda generate, or attach "
            "one with joda attach."
        )
    before, found = profiles[name], context(source, name)
    notes += checked([*measured, *held_out], found, float(compiled.opt.timestep))
    notes += [*fitted.notes, *kept.notes]
    whole = whole_profile(compiled, number, before)
    clear = clear_of_contacts(compiled, number, found, whole, measured)
    other = clear_of_contacts(compiled, number, found, whole, held_out) if held_out else None
    notes += [*clear.notes, *(other.notes if other else [])]
    begin = before
    for _ in range(finer):
        begin = resolved(begin)
    timed = [one for one in clear.measured if isinstance(one, Run)]
    still = [one for one in clear.measured if not isinstance(one, Run)]
    check_known(timed)
    parts, _, cut = excerpts(timed)
    notes += cut
    unit = gravity_scale(found, begin)
    fitting = replace(clear, measured=[*parts, *still])
    at_first = taken(compiled, number, found, whole, fitting, servo=servo)
    away = unvisited(at_first)
    parameters = Parameters(begin, fit, keep_shape=keep_shape, gravity=unit, away=away)
    if not len(parameters.start):
        raise JodaError(f"{source}: the profile of joint '{name}' has nothing to fit.")
    if why := hardly_moved(at_first):
        raise JodaError(f"{', '.join(one.name for one in clear.measured)}: {why}")
    if times := at_first.unit_factor:
        raise JodaError(f"{target}: not written, as {compared(times)}: see to its unit first.")

    def all_of(profile: Profile) -> Profile:
        return whole_profile(compiled, number, profile)

    span = begin.joint.range
    sigma = noise(parts, float(np.ptp(span)))
    by_itself = JointEngine(at_first.joint_model, span, parts, sigma, at_first.timestep, all_of)
    engine = jointly.engine(by_itself, number) if jointly else by_itself
    problem: Problem | CurveProblem = (
        Problem(engine, parameters) if timed else CurveProblem(found, all_of, parameters, still)
    )
    first, was = parameters, problem.paths(parameters.start)
    result = problem.fit(iterations, lambda stage, k, rms: progress(stage, k, iterations, rms))
    parameters = problem.parameters
    result = replace(result, theta=_settled(parameters, result.theta))
    after = parameters.written(result.theta)
    refined = all_of(after)
    body = by_itself.body(parameters, result.theta) if set(fit) - set(STILL) else None
    if body:  # armature is all of the inertia that is written
        bodies = found.equivalent_inertia - compiled.dof_armature[compiled.jnt_dofadr[number]]
        body = replace(body, inertia=max(body.inertia, float(bodies)))

    def beside(one: Measured) -> tuple[Error, Error]:
        if jointly:
            own = jointly.engine(replace(by_itself, runs=one.runs), number)
            numbers = (first, first.start), (parameters, result.theta)
            before, after = (Problem(own, which).error(theta) for which, theta in numbers)
            return before, after
        right = one.changed(refined, joint_model=body)
        return error(one, within=False), error(right, within=False)

    errors = beside(at_first)
    apart = beside(taken(compiled, number, found, whole, other, servo=servo)) if other else None
    if reason := refused(errors, apart, problem.sigma, (whole, refined), Needs(at_first)):
        noted = "".join(f" {note}" for note in clear.notes)
        raise JodaError(f"{target}: not written, as {reason}.{noted}")
    hidden = unseen(begin, parameters, result.covariance, away)
    also, besides = _beyond(parameters, result.theta, compiled, number, found)
    written, said, _ = attached(source, after, target, joint=name, native="keep", also=also)
    notes += [*said, *besides, *problem.notes, *extrapolated(before, after, away)]
    balance = np.array(found.positions), -np.array(found.gravity_force)
    paths = was, problem.paths(result.theta)
    figure = picture(before, after, balance, problem, paths, hidden)
    files: dict[Path, bytes | str] = {
        target: written,
        others["composed.json"]: after.to_json(),
        others["png"]: png(figure),
        others["history.json"]: history(
            result, _reported(errors), problem.sigma, _reported(apart) if apart else None, hidden
        ),
    }
    if corrections:
        files[others["corrections"]] = corrections_text({name: sensing})
    write_together(files)
    notes += parting(errors[1], problem.sigma, blocks=False)
    if (
        apart
        and (times := _reported(apart)[1] / max(_reported(errors)[1], problem.sigma)) > ELSEWHERE
    ):
        notes.append(
            f"What was held out is missed {times:.0f} times as much as what was fitted: the fitted "
            "runs may not have been where those were, or a small difference decides there."
        )
    if not check:
        notes.append(
            "Nothing was held out: these are errors of what was fitted. Give other runs with "
            "--check to see the others."
        )
    if result.interrupted:
        notes.append(f"Interrupted; the best of {len(result.history)} iterations was kept.")
    return Refined(
        scene=target,
        composed=others["composed.json"],
        picture=others["png"],
        history=others["history.json"],
        corrections=others.get("corrections"),
        changes=tuple(changes(before, after)),
        before=_reported(errors)[0],
        after=_reported(errors)[1],
        windows=(errors[0].window, errors[1].window) if timed else None,
        noise=problem.sigma,
        checked=_reported(apart) if apart else None,
        unseen=hidden,
        iterations=len(result.history),
        notes=tuple(notes),
    )


def _both(runs: Sequence[str | Path], check: Sequence[str | Path]) -> str | None:
    """A file that is among both; None if there is none."""
    fitted = {Path(run).resolve() for run in runs}
    return next((str(run) for run in check if Path(run).resolve() in fitted), None)


def _reported(errors: tuple[Error, Error]) -> tuple[float, float]:
    """Of whole runs before and after; of curves, of the force."""
    before, after = (one.window if one.whole is None else one.whole for one in errors)
    return before, after


def _of_one_kind(measured: Sequence[Run | QuasiStatic]) -> bool:
    """Whether these are curves; raises JodaError if some are and some are not."""
    curves = [one.name for one in measured if isinstance(one, QuasiStatic)]
    if curves and len(curves) < len(measured):
        raise JodaError(
            f"{curves[0]}: a quasi-static curve among timed runs; refine to either, one after the "
            "other."
        )
    return bool(curves)


def _settled(parameters: Parameters, theta: Array) -> Array:
    """The numbers, inertia and gravity as they were where they are as good as that."""
    out = theta.copy()
    for kind in ("inertia", "gravity"):
        own = np.array([slot.kind == kind for slot in parameters.slots])
        if np.all(np.abs(theta[own] - parameters.start[own]) < AS_IT_WAS):
            out[own] = parameters.start[own]
    return out


def _beyond(
    parameters: Parameters, theta: Array, model: mujoco.MjModel, joint: int, found: Context
) -> tuple[dict[str, str], list[str]]:
    """What was fitted besides the profile: attributes for the joint, and sentences."""
    also, said = {}, []
    if "damping_ratio" in parameters.kinds:
        constant, ratio = model.jnt_solref[joint]
        also["solreflimit"] = (
            f"{constant:.6g} {ratio * np.exp(parameters.number(theta, 'damping_ratio')):.6g}"
        )
    if "inertia" in parameters.kinds:
        inertia = found.equivalent_inertia * np.exp(parameters.number(theta, "inertia"))
        armature = model.dof_armature[model.jnt_dofadr[joint]] + inertia - found.equivalent_inertia
        unit = "kg·m²" if found.joint.type == "hinge" else "kg"
        said.append(f"Inertia: {found.equivalent_inertia:.4g} → {inertia:.4g} {unit}.")
        if parameters.number(theta, "inertia") == 0.0:
            said[-1] = f"Inertia: as it is, {found.equivalent_inertia:.4g} {unit}, within 0.1 %."
        elif armature >= 0:
            also["armature"] = f"{armature:.6g}"
        else:
            said[-1] = (
                f"{said[-1][:-1]}, which is less than the bodies have; make them lighter. The "
                "errors are those with the bodies as they are."
            )
            also["armature"] = "0"
    if "gravity" in parameters.kinds:
        a, b = (parameters.number(theta, "gravity", k) for k in (0, 1))
        what = f"{a:.4g} cos q + {b:.4g} sin q N·m" if found.joint.type == "hinge" else f"{a:.4g} N"
        said.append(
            f"Gravity's force on the joint lacks {what}: it is in the profile as a gravity_offset; "
            "the bodies' centre of mass or tilt may be off."
            if a or b
            else "Gravity: as it is."
        )
    return also, said


def command(
    model: Annotated[
        Path, typer.Argument(help="Scene whose joint carries a profile.", show_default=False)
    ],
    runs: options.Runs,
    joint: options.Joint,
    output: options.Scene,
    check: Annotated[
        list[Path] | None, typer.Option(help="A run that is only compared, not fitted.")
    ] = None,
    iterations: Annotated[int, typer.Option(min=1, help="Most iterations of a fit.")] = 120,
    fit: Annotated[
        str,
        typer.Option(
            help="What may change, with commas: values, intervals, strengths (one factor for "
            "each channel), damping_ratio, inertia, gravity."
        ),
    ] = "values,intervals",
    free_shape: Annotated[
        bool,
        typer.Option(
            "--free-shape",
            help="Let curves change their sign, and rising parts become falling ones.",
        ),
    ] = False,
    finer: Annotated[
        int, typer.Option(min=0, max=3, help="So many times control points are doubled first.")
    ] = 0,
    passive: options.Passive = False,
    scene: Annotated[
        bool | None,
        typer.Option(
            "--scene/--no-scene",
            help="Simulate the whole scene in MJX, or the joint by itself [default: the scene "
            "where other joints of the logs, or contacts, move the joint].",
            show_default=False,
        ),
    ] = None,
    corrections: options.Corrections = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Bend a joint's profile until it moves as was measured.

    Leaves, beside the scene, its .composed.json, .png and .history.json, and .corrections.json
    where what is wrong with the runs was given. Example:

        joda refine oven/scene.xml out/let_go_5.csv out/let_go_45.csv --joint door -o better.xml
    """
    from joda import Profile

    with loss_bar() as bar:
        result = refine(
            model, joint, runs, output, check=check or (), iterations=iterations,
            fit=[name.strip() for name in fit.split(",") if name.strip()],  # type: ignore[misc]
            keep_shape=not free_shape, finer=finer, passive=passive, scene=scene,
            corrections=corrections, force=force, progress=bar,
        )  # fmt: skip
    if as_json:
        print_json(with_text_paths(asdict(result)))
        return
    say_changes(result.changes)
    _say_errors(result, Profile.read(result.composed).joint.unit)
    for note in result.notes:
        say(note)
    beside = result.composed, result.picture, result.history, result.corrections
    for path in filter(None, (result.scene, *beside)):
        say(path)


def _say_errors(result: Refined, unit: str) -> None:
    """How near the simulation came to the measurement, and where that told little.

    Args:
        result: of a refinement.
        unit: of its joint's position, rad or m.
    """
    what = "Position"
    if result.windows is None:
        what, unit = "Force", {"rad": "N·m", "m": "N"}[unit]
    say(
        f"{what} error: {result.before:.3g} → {result.after:.3g} {unit} RMS after "
        f"{result.iterations} iterations; the measurement's noise is {result.noise:.2g} {unit}."
    )
    if result.windows:
        first, last = result.windows
        say(f"Segment error (0.4 s horizon): {first:.3g} → {last:.3g} {unit}.")
    if result.checked:
        say(f"On the runs held out: {result.checked[0]:.3g} → {result.checked[1]:.3g} {unit} RMS.")
    for channel, places in result.unseen.items():
        if places:
            where = ", ".join(f"s = {a:.2f} to {b:.2f}" for a, b in places)
            say(f"The data tell little of {channel} at {where}: it is hardly measured there.")
