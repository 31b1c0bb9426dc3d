"""An interaction with a joint of a scene, simulated: a run, its picture, a film."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Annotated

import mujoco
import numpy as np
import typer
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.files import check_target, named_like, write_together
from joda.interaction.script import Describe, interaction, perform
from joda.interaction.traces import FORCE, draw_force, draw_position, shade
from joda.measured.run_files import run_text
from joda.measured.runs import Run
from joda.pictures.film import frames, write_film
from joda.pictures.style import clean, house_style, png
from joda.scenes.context import Context, context
from joda.scenes.model import find_joint, joint_name, load_model, moves_with
from joda.scenes.motion import FAST, Motion, fast, usual_speed
from joda.terminal import options
from joda.terminal.progress import spinner
from joda.terminal.say import print_json, say, with_text_paths

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Intervals = Sequence[tuple[float, float]]

POSITION = "#1f5fbf"


@dataclass(frozen=True)
class Simulated:
    """What a joint did.

    Attributes:
        csv, picture: the run, as `joda compare` reads it, and its picture.
        film: the animation, if one was asked for.
        joint, unit: its name, and of its position: rad or m.
        says: what was done.
        run: time, position, velocity, and the force on the joint from outside.
        speed: the usual speed, rad/s or m/s: the hand's, else the mean while the joint moves.
        fast: intervals of time (s) in which it moves more than three times as fast.
        sentences: what happened.
    """

    csv: Path
    picture: Path
    film: Path | None
    joint: str
    unit: str
    says: str
    run: Run
    speed: float
    fast: tuple[tuple[float, float], ...]
    sentences: tuple[str, ...]


def simulate(
    scene: str | Path,
    joint: str,
    *,
    release: float | bool | None = None,
    push: float | bool | None = None,
    impulse: float | bool | None = None,
    hand: Sequence[float] | bool | None = None,
    open: bool = False,
    robot: str | Path | None = None,
    start: float | None = None,
    seconds: float | None = None,
    speed: float | None = None,
    strength: float | None = None,
    stiffness: float | None = None,
    pause: float | None = None,
    duration: float | None = None,
    output: str | Path | None = None,
    gif: str | Path | None = None,
    force: bool = False,
    progress: Callable[[str], None] = lambda what: None,
) -> Simulated:
    """Simulates one interaction with a joint, the whole scene with its contacts moving along.

    Exactly one of the first six is given; True stands for what is usual: let go half-way, pushed
    with 10 N at the lever arm or an impulse that takes it through the range in 1 s, towards open,
    or opened by the hand and shut again. The scene begins at rest at its keyframe `home`, if it
    has one, else at its reference.

    Args:
        scene: MJCF or URDF, with or without profiles.
        joint: its name or address, see `joda.scenes.model.find_joint`.
        release: let it go here, rad or m.
        push: with this force, N·m or N, for `seconds`, then let go.
        impulse: N·m·s or N·s, within 20 ms.
        hand: positions (rad or m) to which a virtual hand takes the joint one after the other: a
            spring and a damper to a target of limited speed, with limited strength.
        open: a hand takes it slowly, in 10 s, from the closed end to the other.
        robot: CSV file with `time` (s) and a column for each actuator of the scene that is driven,
            named like it: its control, linear in between.
        start: where the joint begins, rad or m; by default where the scene has it.
        seconds: how long a push lasts; by default all the time.
        speed: of the hand, rad/s or m/s; by default it takes 3 s through the range.
        strength: of the hand, N·m or N; by default 60 N at the lever arm.
        stiffness: of the hand, N·m/rad or N/m; by default 1000 N/m at the lever arm.
        pause: how long (s) the hand holds the joint wherever it has taken it.
        duration: of all, s; by default 3 s, or until the hand is done, or 2 s after the robot's
            last target. A hand that is done lets go.
        output: CSV to write; its picture goes beside it, as .png. By default beside the scene, with
            the name of the interaction.
        gif: animation to write.
        force: overwrite files that exist.
        progress: told what is being done.

    Returns:
        the run and what was written.

    Raises:
        JodaError: a file cannot be read or written, the joint does not exist, or the interaction
            cannot be as it is asked for.
        NoRenderer: a JodaError; the animation cannot be made here. All else is written.
    """
    source = Path(scene)
    model = load_model(source)
    number = find_joint(model, joint)
    found = context(source, joint_name(model, number))
    done = interaction(
        model, number, found, release=release, push=push, impulse=impulse, hand=hand or None,
        open=open or None, robot=robot, start=start, seconds=seconds, speed=speed,
        strength=strength, stiffness=stiffness, pause=pause, duration=duration,
    )  # fmt: skip
    csv = Path(output) if output is not None else source.with_suffix(f".{done.kind}.csv")
    picture, film = named_like(csv, ".png"), Path(gif) if gif is not None else None
    if csv.suffix == ".png" or film in (csv, picture):
        raise JodaError(f"{film or csv}: is the name of its picture; give the run one in .csv.")
    for path in (csv, picture, *([film] if film else [])):
        check_target(path, force)
    progress(done.says)
    poses: list[Array] = []
    touched: set[str] = set()
    own = moves_with(model, int(model.jnt_bodyid[number]))

    def watch(data: mujoco.MjData) -> None:
        if film:
            poses.append(data.qpos.copy())
        touched.update(_touching(model, data, own) if data.ncon else ())

    motion = perform(model, number, done, watch)
    usual = done.speed or usual_speed(motion)
    quick, than = fast(motion, usual), "the hand's speed" if done.speed else "its mean speed"
    run = Run(csv.name, motion.time, motion.position, motion.velocity, motion.force, forced=True)
    text = run_text(run, f"joint {found.joint.name} of {source.name}: {done.says}")
    words = Describe(found)
    drawn = png(_picture(motion, quick, found, done.says, than))
    write_together({csv: text, picture: drawn})
    if film:
        progress("rendering")
        _write_film(source, motion, poses, words, film)
    return Simulated(
        csv=csv,
        picture=picture,
        film=film,
        joint=found.joint.name,
        unit=words.unit,
        says=done.says,
        run=run,
        speed=usual,
        fast=quick,
        sentences=(
            *_sentences(motion, quick, words, done.says, touched, than),
            *filter(None, [done.note]),
        ),
    )


def _write_film(
    scene: Path, motion: Motion, poses: Sequence[Array], words: Describe, path: Path
) -> None:
    shown, pace = frames(motion.time)
    sped = f", {pace:.1f} times as fast" if pace > 1 else ""
    captions = [
        f"{motion.time[k]:.1f} s    {words.at(float(motion.position[k]))}{sped}" for k in shown
    ]
    write_film(scene, [poses[k] for k in shown], captions, path)


def _touching(model: mujoco.MjModel, data: mujoco.MjData, own: NDArray[np.bool_]) -> set[str]:
    """Bodies in contact with what the joint moves."""
    bodies = model.geom_bodyid[data.contact.geom]
    return {
        model.body(body).name or f"body {body}"
        for body in bodies[own[bodies].sum(axis=1) == 1].ravel()
        if not own[body]
    }


def _sentences(
    motion: Motion,
    quick: Intervals,
    words: Describe,
    says: str,
    touched: set[str],
    than: str,
) -> list[str]:
    out = [f"{words.context.joint.name}: {says}."]
    out.append(f"{motion.time[-1]:.3g} s later it is at {words.at(float(motion.position[-1]))}.")
    most = int(np.argmax(np.abs(motion.force)))
    if motion.force[most]:
        by = f"; contact with {', '.join(sorted(touched))} is part of it" if touched else ""
        out.append(
            f"Largest force on it from outside: {motion.force[most]:.3g} {words.force} at "
            f"{motion.time[most]:.3g} s, {words.at(float(motion.position[most]))}{by}."
        )
    if quick:
        listed = ", ".join(f"{a:.3g} to {b:.3g} s" for a, b in quick)
        out.append(f"Sudden motion, more than {FAST:g} times {than}: {listed}.")
    return out


def _picture(motion: Motion, quick: Intervals, found: Context, says: str, than: str) -> "Figure":
    """Position and force over time, sudden motion shaded."""
    from matplotlib.figure import Figure

    with house_style():
        figure = Figure(figsize=(8, 5.2), dpi=120, layout="constrained")
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[1.4, 1])
        draw_position(upper, motion, found.joint, colour=POSITION)
        draw_force(lower, motion, found.joint, colour=FORCE)
        upper.set_xlim(motion.time[0], motion.time[-1])
        for axes in (upper, lower):
            shade(axes, quick, f"more than {FAST:g} times {than}")
        if quick:
            upper.legend(frameon=False, fontsize=8)
        title = "\n".join(wrap(f"{clean(found.joint.name)}: {says}", 100))
        upper.set_title(title, loc="left", fontsize=9, parse_math=False)
        lower.set_xlabel("time (s)")
    return figure


def command(
    scene: options.Model,
    joint: options.Joint,
    release: Annotated[
        str | None, typer.Option(help="Let it go here (rad or m); without a value: half-way.")
    ] = None,
    push: Annotated[
        str | None,
        typer.Option(
            help="Push with this force (N·m or N), see --for; without a value: 10 N at the edge."
        ),
    ] = None,
    impulse: Annotated[
        str | None,
        typer.Option(
            help="This impulse (N·m·s or N·s) within 20 ms; without a value: through "
            "the range in 1 s."
        ),
    ] = None,
    hand: Annotated[
        str | None,
        typer.Option(
            help="A hand takes it to these positions (rad or m, with commas) one after the other; "
            "without a value: opens it and shuts it."
        ),
    ] = None,
    open: Annotated[
        bool, typer.Option("--open", help="A hand opens it slowly, in 10 s: quasi-static.")
    ] = False,
    robot: Annotated[
        Path | None,
        typer.Option(help="A robot of the scene goes through this CSV: time, actuators by name."),
    ] = None,
    start: Annotated[
        float | None, typer.Option(help="Where it begins (rad or m) [default: as in the scene].")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option("--for", help="How long a push lasts (s) [default: all along].")
    ] = None,
    speed: Annotated[
        float | None, typer.Option(help="Speed of the hand (rad/s or m/s) [default: range / 3 s].")
    ] = None,
    strength: Annotated[
        float | None,
        typer.Option(help="Largest force of the hand (N·m or N) [default: 60 N at the lever arm]."),
    ] = None,
    stiffness: Annotated[
        float | None,
        typer.Option(
            help="Stiffness of the hand (N·m/rad or N/m) [default: 1000 N/m at the lever arm]."
        ),
    ] = None,
    pause: Annotated[
        float | None, typer.Option(help="How long the hand rests at each position (s).")
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(help="Length of the run (s) [default: 3, or until hand or robot is done]."),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="CSV to write, and .png [default: beside SCENE]."),
    ] = None,
    gif: Annotated[Path | None, typer.Option(help="Write an animation to this file.")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Let a joint go, push it, or take it by a hand, in its scene.

    Exactly one of --release, --push, --impulse, --hand, --open and --robot. Leaves a picture and a
    run, which holds time, position, velocity and the force on the joint from outside, as joda
    compare and joda diagnose read it. Example:

        joda simulate oven/scene.xml --joint door --release 0.09 -o shuts.csv

        joda simulate oven/scene.xml --joint door --hand 1.2,0 --pause 0.5 -o hand.csv
    """
    with spinner("simulate") as progress:
        done = simulate(
            scene, joint, release=_number("release", release), push=_number("push", push),
            impulse=_number("impulse", impulse), hand=_positions(hand), open=open, robot=robot,
            start=start, seconds=seconds, speed=speed, strength=strength, stiffness=stiffness,
            pause=pause, duration=duration, output=output, gif=gif, force=force, progress=progress,
        )  # fmt: skip
    if as_json:
        told = {field.name: getattr(done, field.name) for field in fields(done)}
        told |= {"end": float(done.run.position[-1]), "seconds": float(done.run.time[-1])}
        print_json(with_text_paths({key: told[key] for key in told if key != "run"}))
        return
    for sentence in done.sentences:
        say(sentence)
    for path in filter(None, (done.csv, done.picture, done.film)):
        say(path)


def _number(option: str, text: str | None) -> float | bool | None:
    if text is None or text == options.USUAL:
        return None if text is None else True
    try:
        return float(text)
    except ValueError:
        raise JodaError(f"--{option} is '{text}'; give a number, or nothing.") from None


def _positions(text: str | None) -> list[float] | bool | None:
    if text is None or text == options.USUAL:
        return None if text is None else True
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise JodaError(
            f"--hand is '{text}'; give positions (rad or m) with commas, as in 1.2,0."
        ) from None
