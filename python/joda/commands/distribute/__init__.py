"""Diagnoses, improves or generates many joints at once, on this machine or on a cluster."""

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from joda.commands.distribute.pool import by_processes, by_ray
from joda.commands.distribute.task import Result, Task, What, digest, folder_of
from joda.errors import JodaError
from joda.files import make_folder, occupied, write_together
from joda.propose.joints import MODELS, PassedOver, find_jobs
from joda.terminal import options
from joda.terminal.progress import progress_bar
from joda.terminal.say import print_json, say

RESULT = "result.json"
"""In the folder of each joint, once all else is there."""


@dataclass(frozen=True)
class Distributed:
    """A joint that was to be done.

    Attributes:
        label: path of its folder, for `generate` model/joint.
        folder: where its files are.
        told: the result, or the reason why there is none, in a sentence.
        failed: whether there is none.
        kept: whether it was there already.
    """

    label: str
    folder: Path
    told: str
    failed: bool
    kept: bool = False


def distribute(
    what: What,
    cases: str | Path,
    output: str | Path,
    *,
    joint: str | None = None,
    passive: bool = False,
    describe: str = "",
    ray: str | None = None,
    workers: int | None = None,
    resume: bool = False,
    force: bool = False,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> list[Distributed]:
    """Does a command for all joints below a folder; each joint is a task.

    What is made does not depend on where it is made. Each task takes along all that is in its
    model's folder and below it, so machines need share no disk.

    Args:
        what: "diagnose" or "improve": every folder with one model and runs (CSV) is a case;
            "generate": every hinge and slide with a range of every model is, by rules.
        cases: the folder.
        output: folder to fill, with one per joint.
        joint: which joint of each model; else the only one, for `generate` all.
        passive: as for `joda.diagnose`.
        describe: as for `joda.generate`.
        ray: address of a Ray cluster, or "local" for Ray on this machine; by default processes of
            this machine, without Ray.
        workers: at most so many tasks at a time, by default one per core.
        resume: go on with what the folder holds: what was made of the same files with the same
            options stays.
        force: overwrite what the folder holds.
        progress: told how many are done, of how many, and which was the last.

    Returns:
        the joints in the order of their labels.

    Raises:
        JodaError: there is no case, the folder holds files already, or no cluster answers.
    """
    source, target = Path(cases), Path(output)
    if not source.is_dir():
        raise JodaError(f"{source}: no such folder.")
    if occupied(target) and not (force or resume):
        raise JodaError(
            f"{target}: exists already; choose another folder with -o, add --force or go on with "
            "--resume."
        )
    done: list[Distributed] = []
    find = _models if what == "generate" else _cases
    places = list(find(what, source, target, joint, passive, describe, done))
    if not places and not done:
        raise JodaError(
            f"{source}: holds no folder with a model (XML or URDF) and runs (CSV) beside it."
        )
    for one in done:
        _forget(one.folder)
    make_folder(target)
    total, folders = len(places) + len(done), {make.label: make.folder for make in places}

    def pending() -> Iterator[Task]:
        for place in places:
            task = place.task()
            kept = _kept(place.folder, task) if resume and not force else None
            if kept is None:
                yield task
            else:
                done.append(Distributed(task.label, place.folder, kept, False, kept=True))

    running = by_processes(pending(), workers) if ray is None else by_ray(pending(), ray, workers)
    for task, result in running:
        folder = folders[task.label]
        told, failed = result.told, result.failed
        try:
            _write(folder, task, result)
        except JodaError as error:
            told, failed = str(error), True
        done.append(Distributed(task.label, folder, told, failed))
        progress(len(done), total, task.label)
    return sorted(done, key=lambda one: one.label)


@dataclass(frozen=True)
class _Place:
    """A task before its files are read."""

    what: What
    label: str
    folder: Path
    root: Path
    model: Path
    joint: str | None
    runs: tuple[Path, ...]
    made: Path
    options: Mapping[str, Any]

    def task(self) -> Task:
        """With the files."""
        files = {}
        for path in sorted(self.model.parent.rglob("*")):
            log = _is_run(path) and path not in self.runs
            if path.is_file() and not log and self.made not in path.resolve().parents:
                files[folder_of(path, self.root)] = path.read_bytes()
        return Task(
            self.what,
            self.label,
            folder_of(self.model, self.root),
            self.joint,
            tuple(folder_of(path, self.root) for path in self.runs),
            folder_of(self.folder, self.root),
            files,
            self.options,
        )


def _root(source: Path, target: Path) -> Path:
    """What both are below, as they are written: what is below a link stays below it."""
    return Path(os.path.commonpath([os.path.abspath(source), os.path.abspath(target)]))


def _is_run(path: Path) -> bool:
    return path.suffix.lower() == ".csv"


def _cases(
    what: What,
    source: Path,
    target: Path,
    joint: str | None,
    passive: bool,
    describe: str,
    failed: list[Distributed],
) -> Iterator[_Place]:
    """Folders with one model and runs; those with several models are added to `failed`."""
    if describe:
        raise JodaError("--describe is of generate.")
    made = target.resolve()
    for folder in sorted({path.parent for path in source.rglob("*") if _is_run(path)}):
        if made == folder.resolve() or made in folder.resolve().parents:
            continue
        models = sorted(path for path in folder.iterdir() if path.suffix.lower() in MODELS)
        label = folder.relative_to(source).as_posix()
        into = target / label
        if len(models) != 1:
            told = f"{folder}: holds {len(models)} models beside runs; put one there."
            failed.append(Distributed(label, into, told, True))
            continue
        runs = tuple(sorted(filter(_is_run, folder.iterdir())))
        options = {"passive": passive}
        root = _root(source, target)
        yield _Place(what, label, into, root, models[0], joint, runs, made, options)


def _models(
    what: What,
    source: Path,
    target: Path,
    joint: str | None,
    passive: bool,
    describe: str,
    failed: list[Distributed],
) -> Iterator[_Place]:
    """Joints of the models; models that cannot be loaded are added to `failed`."""
    if passive:
        raise JodaError("--passive is of diagnose and improve.")
    jobs, left_out = find_jobs(source, target, joint)
    for label, error in left_out.items():
        mistake = not isinstance(error, PassedOver)
        failed.append(Distributed(label, target / label, str(error), mistake))
        for told in (target / label).glob(f"*/{RESULT}"):
            _forget(told.parent)
    options = {"proposer": "offline", "describe": describe}
    root = _root(source, target)
    for label, (model, name, folder) in jobs.items():
        yield _Place(what, label, folder, root, model, name, (), target.resolve(), options)


def _kept(folder: Path, task: Task) -> str | None:
    """What the folder's result tells, if it is of this task; None: there is none."""
    try:
        told = json.loads((folder / RESULT).read_text("utf-8"))
        there = {name: digest((folder / name).read_bytes()) for name in told["files"]}
        same = there == told["files"] and told["task"] == task.digest
        return str(told["told"]) if same else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _forget(folder: Path) -> None:
    """Takes away what says that a result is there; what cannot be, cannot be written either."""
    with suppress(OSError):
        (folder / RESULT).unlink()


def _write(folder: Path, task: Task, result: Result) -> None:
    """Writes all files of a result, or none; what says that they are there comes last.

    Of a task that failed nothing says so: what was there before is not its result.
    """
    _forget(folder)
    if result.failed:
        return
    files = {name: digest(content) for name, content in sorted(result.files.items())}
    told = {"task": task.digest, "told": result.told, "files": files}
    for name in result.files:
        make_folder((folder / name).parent)
    make_folder(folder)
    write_together({folder / name: content for name, content in result.files.items()})
    write_together({folder / RESULT: json.dumps(told, indent=2, ensure_ascii=False) + "\n"})


def command(
    what: Annotated[
        Literal["diagnose", "improve", "generate"],
        typer.Argument(help="What to do with each joint.", show_default=False),
    ],
    cases: Annotated[
        Path,
        typer.Argument(
            help="Folder of folders with a model and its runs; for generate: of models.",
            show_default=False,
        ),
    ],
    output: options.Folder,
    joint: Annotated[
        str | None,
        typer.Option(help="Which of each model [default: the only one; for generate all]."),
    ] = None,
    passive: options.Passive = False,
    describe: Annotated[
        str, typer.Option(help="For generate: what the joints should do.", show_default=False)
    ] = "",
    ray: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Ray cluster, or local for Ray on this machine [default: processes, no Ray].",
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Tasks at a time [default: one per core].")
    ] = None,
    resume: options.Resume = False,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Diagnose, improve or generate many joints at once.

    Leaves a folder per joint, with result.json last. Example:

        joda distribute generate out --joint door -o many
    """
    with progress_bar() as bar:
        done = distribute(
            what, cases, output, joint=joint, passive=passive, describe=describe, ray=ray,
            workers=workers, resume=resume, force=force, progress=bar,
        )  # fmt: skip
    failed = sum(one.failed for one in done)
    if as_json:
        print_json([{**asdict(one), "folder": str(one.folder)} for one in done])
    else:
        for one in done:
            state = "failed: " if one.failed else "kept: " if one.kept else ""
            say(f"{one.label}: {state}{one.told}")
        say(f"{len(done) - failed} of {len(done)} done; {output}")
    if failed:
        raise JodaError(f"{failed} of {len(done)} joints have no result; see above.")
