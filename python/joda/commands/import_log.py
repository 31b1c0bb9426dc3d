"""Makes runs of a log: of LeRobot datasets, ROS bags and MCAP, and CSV with other names."""

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated

import typer

from joda.errors import JodaError
from joda.files import check_targets, file_name, make_folder, write_together
from joda.importing.columns import Unused, columns_given, picked
from joda.importing.log import Log
from joda.importing.model_names import Names
from joda.importing.opening import open_log
from joda.importing.rows import rows, text
from joda.importing.scaling import given, scaled
from joda.importing.understood import Understood, understood
from joda.importing.units import checked
from joda.plain import plain
from joda.scenes.model import find_joint, joint_name, load_model
from joda.terminal import options
from joda.terminal.progress import progress_bar
from joda.terminal.say import print_json, say


@dataclass(frozen=True)
class Imported:
    """What was made of a log.

    Attributes:
        format: of the log, in words.
        columns: of the runs, and how they were understood.
        unused: the log's other columns: why, and the option that takes one.
        notes: what looks wrong, or was left out, a sentence each.
        runs: the files, one for each recording.
        seconds: how long they are together.
        samples: how many they have together.
    """

    format: str
    columns: tuple[Understood, ...]
    unused: tuple[Unused, ...]
    notes: tuple[str, ...]
    runs: tuple[Path, ...]
    seconds: float
    samples: int


def import_log(
    log: str | Path,
    model: str | Path,
    output: str | Path,
    *,
    joint: str | None = None,
    columns: Sequence[str] = (),
    units: Sequence[str] = (),
    zeros: Sequence[str] = (),
    without: Sequence[str] = (),
    episodes: Sequence[int] = (),
    topics: Sequence[str] = (),
    interpolate: bool = False,
    force: bool = False,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> Imported:
    """Makes runs of a log, with the names and units of a model; the command `joda import`.

    Args:
        log: folder of a LeRobot dataset or a ROS 2 bag; .mcap, .db3 or .bag file; CSV.
        model: MJCF or URDF whose joints and actuators it is of.
        output: folder for the runs, a CSV for each episode.
        joint: only this one's, as `time`, `position` and what else there is of `velocity` and
            `force`; without it, `position:JOINT`, `ctrl:ACTUATOR` and so on of all joints.
        columns: "TARGET=NAME": which column of the log is `position:JOINT`, `velocity:JOINT`,
            `force:JOINT`, `ctrl:ACTUATOR` or `time`.
        units: "NAME=UNIT" of columns, by name or pattern.
        zeros: "NAME=NUMBER": what a column has where the model has 0, in the column's unit.
        without: columns to leave out, by name or pattern.
        episodes: of a dataset, by number; none means all.
        topics: of a bag; none means all.
        interpolate: bring what has times of its own to those of the first position.
        force: overwrite runs that exist.
        progress: told how far it is, of how far, and at what.

    Returns:
        what was understood, and the files.

    Raises:
        JodaError: the log cannot be read, or what a column is cannot be known; the option that
            settles it is named.
    """
    source, folder = Path(log), Path(output)
    named = columns_given(columns)
    unit_of = {name: checked(unit, f"--unit {name}") for name, unit in _pairs(units, "--unit")}
    zero_of = {name: _number(name, number) for name, number in _pairs(zeros, "--zero")}
    compiled = load_model(Path(model))
    names, only = Names(compiled), None if joint is None else find_joint(compiled, joint)
    if folder.exists() and not folder.is_dir():
        raise JodaError(f"{folder}: is a file; give a folder for the runs.")
    time = named.pop("time", "")
    read = open_log(source, list(named.values()), time, unit_of, episodes, topics, progress)
    read = _left(read, without)
    _check_known(read, {**unit_of, **zero_of})
    chosen, unused = picked(read, names, named, only)
    if only is not None:
        commands = [pick for pick in chosen if pick.role == "ctrl"]
        told = "a run of one joint has no commands; without --joint, it becomes "
        unused += [Unused(pick.signal.name, told + pick.target) for pick in commands]
        chosen = [pick for pick in chosen if pick.role != "ctrl"]
    columns_made = scaled(read, compiled, chosen, unit_of, zero_of)
    targets = [folder / f"{file_name(one.name)}.csv" for one in read.recordings]
    made = [rows(read, one, columns_made, interpolate) for one in read.recordings]
    found, warnings = understood(compiled, made, columns_made)
    alone = None if only is None else next(p for p in chosen if p.role == "position")
    comment = "\n".join(
        [f"joda import: {read.format}, {source.resolve().name}", "time in s; rad or m, and per s"]
        + [f"{one.target} = {one.column} ({one.unit})" for one in found]
    )
    texts = [text(one, columns_made, comment, alone) for one in made]
    if folder.exists():
        check_targets(targets, force, _inputs(source, model))
    make_folder(folder)
    check_targets(targets, force, _inputs(source, model))
    write_together(dict(zip(targets, texts, strict=True)))
    notes = [*read.notes, *(note for one in made for note in one.notes), *warnings]
    if only is not None and names.driven[only]:
        notes.append(
            f"Joint '{joint_name(compiled, only)}' has an actuator in the model: what it did is in "
            "a run without --joint, and one with it is right only if the actuator was off."
        )
    return Imported(
        format=read.format,
        columns=tuple(found),
        unused=tuple(unused),
        notes=tuple(notes),
        runs=tuple(targets),
        seconds=sum(float(one.time[-1]) for one in made),
        samples=sum(len(one.time) for one in made),
    )


def _pairs(texts: Sequence[str], option: str) -> list[tuple[str, str]]:
    """NAME=VALUE, where NAME may have a = itself."""
    pairs = []
    for one in texts:
        name, is_pair, value = one.rpartition("=")
        if not is_pair or not name.strip() or not value.strip():
            raise JodaError(
                f"{option} {one}: must be NAME=VALUE, with a column of the log as NAME."
            )
        pairs.append((name.strip(), value.strip()))
    return pairs


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not abs(value) < 1e30:
        raise JodaError(f"--zero {name}={text}: must be a number, in the unit of the column.")
    return value


def _left(log: Log, without: Sequence[str]) -> Log:
    """The log without some of its signals; raises JodaError for one that it does not have."""
    for pattern in without:
        if not any(given({pattern: ""}, s) is not None for s in log.signals):
            log.named(pattern)  # says what there is
    gone = dict.fromkeys(without, "")
    kept = [s for s in log.signals if given(gone, s) is None]
    return replace(log, signals=tuple(kept))


def _check_known(log: Log, options: Mapping[str, object]) -> None:
    """Raises JodaError for an option of a column that is not there."""
    for name in options:
        if name != log.times and not any(given({name: ""}, s) is not None for s in log.signals):
            log.named(name)  # says what there is


def _inputs(log: Path, model: str | Path) -> list[str | Path]:
    return [log, model] if log.is_file() else [model]


FILES = 3


def command(
    log: Annotated[
        Path,
        typer.Argument(
            help="LeRobot dataset (folder), ROS bag (folder, .mcap, .db3, .bag) or CSV.",
            show_default=False,
        ),
    ],
    model: Annotated[
        Path, typer.Option(help="MJCF or URDF file whose joints they are.", show_default=False)
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="Folder for the runs.", show_default=False)
    ],
    joint: Annotated[
        str | None,
        typer.Option(help="Only this joint, in runs of one [default: all, in runs of several]."),
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TARGET=NAME",
            help="Which column is position:JOINT, velocity:JOINT, force:JOINT, ctrl:ACTUATOR or "
            "time.",
        ),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=UNIT",
            help="A column's unit: rad, deg, turn, m, cm, mm, 0..1, 0..100 (percent), -100..100, "
            "raw; with - before it, the other direction; of times s, ms, us, ns. NAME may have *.",
        ),
    ] = None,
    zero: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=NUMBER",
            help="What a column has where the model has 0, in its own unit. NAME may have *.",
        ),
    ] = None,
    without: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="A column to leave out. NAME may have *."),
    ] = None,
    episode: Annotated[
        list[int] | None, typer.Option(min=0, help="Of a dataset, only this one.")
    ] = None,
    topic: Annotated[list[str] | None, typer.Option(help="Of a bag, only this one.")] = None,
    interpolate: Annotated[
        bool,
        typer.Option("--interpolate", help="Bring what has times of its own to the positions'."),
    ] = False,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Make runs of a LeRobot dataset, a ROS bag or a CSV.

    Prints what it took each column for; what is not sure it refuses, and names the option that
    settles it. Options can be repeated. Reads LeRobot 2 and 3, and of bags (MCAP too) JointState
    and JointTrajectoryControllerState. Examples:

        joda import out/let_go_5.csv --model out/oven.xml --joint door -o runs
        joda import out/let_go_45.csv --model out/oven.xml --column position:door=position -o logs
    """
    with progress_bar() as bar:
        made = import_log(
            log, model, output, joint=joint, columns=column or (), units=unit or (),
            zeros=zero or (), without=without or (), episodes=episode or (), topics=topic or (),
            interpolate=interpolate, force=force, progress=bar,
        )  # fmt: skip
    if as_json:
        print_json({**asdict(made), "runs": [str(path) for path in made.runs]})
        return
    _say(made, output)


def _say(made: Imported, output: Path) -> None:
    runs = "1 run" if len(made.runs) == 1 else f"{len(made.runs)} runs"
    say(f"{made.format}: {runs}, {made.seconds:.3g} s, {made.samples} samples.")
    _say_understood(made.columns)
    for one in made.unused:
        say(f"Not used: {one.name}: {one.why}")
    for note in made.notes:
        say(note)
    _name(made.runs, output)


def _name(runs: Sequence[Path], output: Path) -> None:
    for path in runs[: FILES if len(runs) > FILES else len(runs)]:
        say(path)
    if len(runs) > FILES:
        say(f"and {len(runs) - FILES} more in {output}")


def _say_understood(columns: Iterable[Understood]) -> None:
    """The table of `joda import`."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    heads = ("column", "becomes", "unit", "known by", "range", "model's", "sign", "zero", "delay")
    table = Table(*heads, box=None, pad_edge=False)
    for one in columns:
        texts = (
            one.column, one.target, one.unit, one.why, _ends(one.range), _ends(one.model_range),
            one.sign or "-", _zero(one), _delay(one),
        )  # fmt: skip
        table.add_row(*(Text(plain(text)) for text in texts))
    Console(width=None if sys.stdout.isatty() else 160).print(table)


def _ends(span: tuple[float, float] | None) -> str:
    return "-" if span is None else f"{span[0]:.3g} to {span[1]:.3g}"


def _zero(one: Understood) -> str:
    """Whether the zero can be the model's; of a command how far its joint is from it."""
    if one.offset is not None:
        return f"off by {one.offset:.2g}"
    if one.model_range is None:
        return "-"
    return f"{100 * one.outside:.2g} % outside" if one.outside else "inside"


def _delay(one: Understood) -> str:
    if one.delay is None or one.delay_resolution is None:
        return "-"
    return f"{1e3 * one.delay:.0f} ms (samples: {1e3 * one.delay_resolution:.3g})"
