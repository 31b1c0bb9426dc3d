"""The paper's cases over compile seeds, against both baselines: numbers, pictures, a gallery."""

import json
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from joda.commands.experiments.base import Case, bundled, unit_shown
from joda.commands.experiments.gallery import Shown, command_line, gallery
from joda.commands.experiments.picture import draw_case
from joda.commands.experiments.table import CASES
from joda.commands.experiments.trial import Tried, try_case, write_baselines
from joda.commands.simulate import Simulated, simulate
from joda.errors import JodaError
from joda.files import fresh, make_folder, write_bytes, write_text
from joda.pictures.offscreen import NoRenderer
from joda.pictures.style import write_png
from joda.terminal import options
from joda.terminal.progress import progress_bar
from joda.terminal.say import print_json, say

SEEDS = 10
FOLDER = "gallery"
"""Beside gallery.md: pictures, and for each case a folder with its scenes and runs."""


@dataclass(frozen=True)
class Experiments:
    """What the cases came to.

    Attributes:
        gallery: the page, beside a folder of the same name with pictures and scenes.
        numbers: its numbers as JSON.
        cases: each with its numbers.
    """

    gallery: Path
    numbers: Path
    cases: tuple[Shown, ...]


def experiments(
    cases: Sequence[str] = (),
    output: str | Path | None = None,
    *,
    seeds: int = SEEDS,
    force: bool = False,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> Experiments:
    """Tries the paper's cases: profiles proposed by rules, against fitted baselines.

    Args:
        cases: their names; all without.
        output: folder to fill; by default joda_experiments, or the first of joda_experiments_2,
            ... that does not exist.
        seeds: how many times each proposal is compiled, with the keys "0", "1", ...
        force: overwrite what an earlier call left in the folder.
        progress: told how many trials are done, of how many, and which is next.

    Returns:
        the numbers, and where the gallery is.

    Raises:
        JodaError: there is no such case, or the folder cannot be written.
    """
    chosen = _chosen(cases)
    if seeds < 1:
        raise JodaError(f"seeds is {seeds}; give at least 1.")
    folder = Path(output) if output is not None else fresh("joda_experiments")
    page, numbers, inside = (folder / name for name in (f"{FOLDER}.md", f"{FOLDER}.json", FOLDER))
    for path in (page, numbers, *(inside / case.name for case in chosen)):
        if path.exists() and not force:
            raise JodaError(
                f"{path}: exists already; choose another folder with -o or add --force."
            )
    done: list[Shown] = []
    for k, case in enumerate(chosen):
        make_folder(inside / case.name)

        def report(seed: int, k: int = k, name: str = case.name) -> None:
            progress(k * seeds + seed, len(chosen) * seeds, f"{name}, seed {seed}")

        done.append(_case(case, inside, seeds, report))
    write_text(numbers, json.dumps({one.case.name: one.as_json() for one in done}, indent=1) + "\n")
    write_text(page, gallery(done, FOLDER))
    return Experiments(page, numbers, tuple(done))


def _chosen(names: Sequence[str]) -> list[Case]:
    known = {case.name: case for case in CASES}
    for name in names:
        if name not in known:
            raise JodaError(f"there is no case '{name}'; there are: {', '.join(known)}.")
    return [known[name] for name in names] or list(CASES)


def _case(case: Case, folder: Path, seeds: int, report: Callable[[int], None]) -> Shown:
    """All seeds; the first one's files stay, with the picture."""
    own, tries = folder / case.name, []
    for seed in range(seeds):
        report(seed)
        if seed == 0:
            tries.append(try_case(case, "0", own))
            continue
        with tempfile.TemporaryDirectory() as other:
            tries.append(try_case(case, str(seed), Path(other)))
    numbers = {way: [one.numbers[way] for one in tries] for way in tries[0].numbers}
    scene = own / tries[0].scene
    write_baselines(case, tries[0], own)
    write_png(draw_case(case, tries[0], numbers, scene), folder / f"{case.name}.png", force=True)
    run, film = _show(case, tries[0], folder)
    return Shown(
        case=case,
        unit=unit_shown(case, tries[0].subjects["joda"]),
        numbers=numbers,
        first=[one.first for one in tries],
        rounds=[one.rounds for one in tries],
        baselines=tries[0].baselines,
        sentences=run.sentences,
        command=command_line(case, f"out/{FOLDER}/{case.name}", tries[0].scene),
        film=film,
    )


def _show(case: Case, tried: Tried, folder: Path) -> tuple[Simulated, bool]:
    """The run that the gallery shows, and whether there is a film of it."""
    own, options = folder / case.name, dict[str, Any](case.show)
    if robot := options.get("robot"):
        write_bytes(own / robot, bundled(robot).read_bytes())
        options["robot"] = own / robot
    gif = folder / f"{case.name}.gif"
    paths: dict[str, Any] = {"output": own / "run.csv", "force": True}
    scene = own / tried.scene
    try:
        return simulate(scene, case.joint, **options, **paths, gif=gif), True
    except NoRenderer:
        return simulate(scene, case.joint, **options, **paths), False


def command(
    cases: Annotated[
        list[str] | None,
        typer.Argument(help="Names of cases [default: all].", show_default=False),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Folder to fill [default: joda_experiments]."),
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="How often each proposal is compiled.")] = 10,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Run the paper's cases against both its baselines.

    Leaves a table, and a gallery of pictures. Each case has a number that says what its object
    does; the profile differs from the fitted baselines where the numbers of all seeds do.
    Example:

        joda experiments switch --seeds 1 -o experiments
    """
    with progress_bar() as bar:
        done = experiments(cases or (), output, seeds=seeds, force=force, progress=bar)
    if as_json:
        print_json({one.case.name: one.as_json() for one in done.cases})
        return
    _say_cases(done.cases)
    for path in (done.gallery, done.numbers):
        say(path)


def _say_cases(shown: Iterable[Shown]) -> None:
    """The table of `joda experiments`."""
    from rich.console import Console
    from rich.table import Table

    ways = {"joda": "profile", "constant": "constant", "spring": "spring"}
    ways |= {"usual": "constant, usual solver"}
    table = Table("case", "number", *ways.values(), "separated", box=None, pad_edge=False)
    for one in shown:
        number = f"{one.case.meaning} ({one.unit}; {one.case.better} is better)"
        spans = (one.span(way) for way in ways)
        table.add_row(one.case.name, number, *spans, "yes" if one.separated else "NO")
    Console(width=None if sys.stdout.isatty() else 130).print(table)
