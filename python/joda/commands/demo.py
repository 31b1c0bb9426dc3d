"""The first contact: an oven door gets its behaviour, beside the same door without a profile."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import as_file, files
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
import typer

from joda.commands.generate import generate
from joda.errors import JodaError
from joda.files import fresh, make_folder, occupied, write_bytes
from joda.interaction.hand import pull
from joda.interaction.pulling import FIRMNESS, SLOW, grip
from joda.measured.run_files import write_run
from joda.measured.runs import Run
from joda.pictures.offscreen import Image, NoRenderer, render
from joda.pictures.style import house_style, write_png
from joda.propose.history import History
from joda.scenes.context import context
from joda.scenes.model import find_joint, load_model
from joda.scenes.motion import Motion, release
from joda.terminal import options
from joda.terminal.progress import spinner
from joda.terminal.rounds import say_round
from joda.terminal.say import print_json, say, say_files, say_viewer, with_text_paths

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MODEL, EXPECTED, JOINT = "oven.xml", "oven.expected.json", "door"
STARTS = (np.deg2rad(45.0), np.deg2rad(5.0))
DURATION = 2.5
NAMES = ("without a profile", "with its profile")
COLOURS = ("#888888", "#c8202f")


@dataclass(frozen=True)
class Demo:
    """What the demo left behind, and what it saw.

    Attributes:
        folder: with the oven and what is expected of it (for `joda.evaluate`), all that
            `joda.generate` leaves, and the motions of the door with the profile as runs:
            let_go_45.csv, let_go_5.csv.
        plain, scene: the oven as it comes, and with the profile.
        picture: both doors beside each other.
        history: the rounds of the generation.
        starts: where the doors were let go, rad: half-way and nearly closed.
        plain_ends, joda_ends: where they were `duration` seconds later, rad.
        plain_force, joda_force: what a hand that opens them slowly needs most, N·m; negative where
            it holds the door back.
    """

    folder: Path
    plain: Path
    scene: Path
    picture: Path
    history: History
    starts: tuple[float, float]
    plain_ends: tuple[float, float]
    joda_ends: tuple[float, float]
    plain_force: float
    joda_force: float
    duration: float


def demo(
    output: str | Path | None = None,
    *,
    force: bool = False,
    progress: Callable[[str], None] = lambda what: None,
) -> Demo:
    """The main job on the bundled oven: `joda.generate` offline, then both doors in motion.

    Args:
        output: folder for everything that is made; created if missing. By default joda_demo, or
            the first of joda_demo_2, joda_demo_3, ... that does not exist.
        force: overwrite what an earlier demo left there.
        progress: told what is being done.

    Returns:
        the files and what happened.

    Raises:
        JodaError: the folder cannot be written, or holds files already.
    """
    folder = Path(output) if output is not None else fresh("joda_demo")
    if occupied(folder) and not force:
        raise JodaError(f"{folder}: exists already; choose another folder with -o or add --force.")
    make_folder(folder)
    plain, scene = folder / MODEL, folder / "scene.xml"
    with as_file(files("joda") / "models") as models:
        for name in (MODEL, EXPECTED):
            write_bytes(folder / name, (models / name).read_bytes())
    made = generate(plain, JOINT, folder, proposer="offline", force=True, progress=progress)

    progress("letting both doors go, opening both by hand")
    both = [load_model(path) for path in (plain, scene)]
    joint = find_joint(both[0], JOINT)
    let_go = [[release(model, joint, start, DURATION) for model in both] for start in STARTS]
    found = context(plain, JOINT)
    hand = grip(found), FIRMNESS * found.lever_arm**2, SLOW
    opened = [pull(model, joint, *found.joint.range, *hand) for model in both]
    for start, (_, motion) in zip(STARTS, let_go, strict=True):
        path = folder / f"let_go_{np.rad2deg(start):.0f}.csv"
        every = slice(None, None, max(round(0.005 / both[1].opt.timestep), 1))
        samples = motion.time[every], motion.position[every], motion.velocity[every]
        write_run(path, Run(path.name, *samples, force=np.zeros(len(samples[0])), forced=False))
    progress("drawing both doors")
    ends = [float(motion.position[-1]) for motion in let_go[0]]
    try:
        views = render(scene, [np.array([angle]) for angle in (STARTS[0], *ends)])
    except NoRenderer:
        views = []
    picture = folder / "demo.png"
    write_png(_picture(let_go, opened, views), picture, force=True)
    plain_ends, joda_ends = zip(
        *[[float(m.position[-1]) for m in pair] for pair in let_go], strict=True
    )
    forces = [float(motion.force[np.argmax(np.abs(motion.force))]) for motion in opened]
    return Demo(
        folder=folder,
        plain=plain,
        scene=scene,
        picture=picture,
        history=made.history,
        starts=(float(STARTS[0]), float(STARTS[1])),
        plain_ends=plain_ends,
        joda_ends=joda_ends,
        plain_force=forces[0],
        joda_force=forces[1],
        duration=DURATION,
    )


def _picture(let_go: list[list[Motion]], opened: list[Motion], views: Sequence[Image]) -> "Figure":
    from matplotlib.figure import Figure

    with house_style():
        figure = Figure(figsize=(12, 7.2 if views else 3.8), dpi=120, layout="constrained")
        grid: Any = figure.add_gridspec(
            2 if views else 1, 3, height_ratios=[1, 0.9][: 1 + bool(views)]
        )
        upper = [figure.add_subplot(grid[0, k]) for k in range(3)]
        for axes, pair, start in zip(upper, let_go, STARTS, strict=False):
            for motion, name, colour in zip(pair, NAMES, COLOURS, strict=True):
                axes.plot(
                    motion.time, np.rad2deg(motion.position), color=colour, lw=2.2, label=name
                )
            axes.set(xlabel="time (s)", ylabel="door angle (degrees)", ylim=(-4, 100))
            axes.axhline(0, color="#333333", lw=0.8)
            axes.set_title(f"let go at {np.rad2deg(start):.0f} degrees", loc="left", fontsize=11)
        for motion, name, colour in zip(opened, NAMES, COLOURS, strict=True):
            angle = np.rad2deg(motion.position)
            upper[2].plot(angle, motion.force, color=colour, lw=2.2, label=name)
        upper[2].axhline(0, color="#333333", lw=0.8)
        upper[2].set(xlabel="door angle (degrees)", ylabel="torque of the hand (N·m)")
        upper[2].set_title("opened slowly by hand", loc="left", fontsize=11)
        corner: Any = {"transform": upper[2].transAxes, "color": "#777777"}
        upper[2].text(0.98, 0.98, "it pulls", ha="right", va="top", **corner)
        upper[2].text(0.04, 0.02, "it holds back", ha="left", va="bottom", **corner)
        upper[0].legend(frameon=False, loc="lower right")
        for axes in upper:
            axes.spines[["top", "right"]].set_visible(False)
        titles = ("let go here", *(f"{name}, {DURATION:g} s later" for name in NAMES))
        for k, (view, title) in enumerate(zip(views, titles, strict=False)):
            axes = figure.add_subplot(grid[1, k])
            axes.imshow(view)
            axes.set_title(title, fontsize=11, loc="left")
            axes.axis("off")
        return figure


def command(
    what: Annotated[
        Literal["oven", "hidden-effect"],
        typer.Argument(
            help="An oven door gets its behaviour; or a joint's hidden effect is found and added."
        ),
    ] = "oven",
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", help="Folder to fill [default: joda_demo, or joda_hidden_effect]."
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="hidden-effect: draws the same joint again.")
    ] = None,
    reveal: Annotated[
        bool, typer.Option("--reveal", help="hidden-effect: say at once what is hidden.")
    ] = False,
    position_only: Annotated[
        bool, typer.Option("--position-only", help="hidden-effect: no force is recorded.")
    ] = False,
    alien: Annotated[
        bool, typer.Option("--alien", help="hidden-effect: a law of no catalogue, to be learned.")
    ] = False,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Give an oven door its behaviour, beside the door without.

    Or simulate a joint with an effect that its model lacks, find it from measured runs, add it,
    and open the seal. Needs no key and no network. Example:

        joda demo -o out

        joda demo hidden-effect --seed 9 --position-only -o hidden
    """
    if what == "hidden-effect":
        _hidden_effect(
            output, as_json, seed=seed, reveal=reveal, position_only=position_only, alien=alien,
            force=force,
        )  # fmt: skip
        return
    if seed is not None or reveal or position_only or alien:
        raise JodaError(
            "--seed, --reveal, --position-only and --alien go with joda demo hidden-effect."
        )

    with spinner("demo") as progress:
        result = demo(output, force=force, progress=progress)
    if as_json:
        told = {key: value for key, value in vars(result).items() if key != "history"}
        print_json({**with_text_paths(told), "rounds": len(result.history.rounds)})
        return
    for round in result.history.rounds:
        say_round(round)
    _say_doors(result)
    names = "demo.png", "profile.png", "scene.xml", "composed.json", "history.json", "oven.xml"
    say_files(result.folder, names)
    say_viewer(result.scene)


def _hidden_effect(output: Path | None, as_json: bool, **asked: Any) -> None:
    from joda import hidden_effect

    if as_json:
        result = hidden_effect(output, **asked)
        print_json({**with_text_paths(asdict(result))})
        return
    result = hidden_effect(output, say=say, **asked)
    names = "compare.html", "diagnosis.html", "new.xml", "new.png", "unseen.html", "sealed.json"
    say_files(result.folder, [name for name in names if (result.folder / name).exists()])


def _say_doors(result: Demo) -> None:
    """What the demo's two doors did."""
    rows = zip(result.starts, result.plain_ends, result.joda_ends, strict=True)
    for start, without, ours in rows:
        say(
            f"Let go at {degrees(start):.0f} degrees, {result.duration:g} s later: without a "
            f"profile at {degrees(without):.1f}, with it at {abs(degrees(ours)):.1f} degrees."
        )
    forces = zip(
        ("without a profile", "with it"), (result.plain_force, result.joda_force), strict=True
    )
    told = [
        f"{name} it {'pulls' if force > 0 else 'holds back'} with up to {abs(force):.1f} N·m"
        for name, force in forces
    ]
    say(f"Opened slowly by hand: {', '.join(told)}.")
