"""One joint as a task that any process on any machine can run: files in, files out."""

import hashlib
import json
import os
import posixpath
import tempfile
from collections.abc import Mapping
from contextlib import chdir
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from joda.commands.diagnose import diagnose
from joda.commands.generate import generate
from joda.commands.improve import improve
from joda.errors import JodaError
from joda.propose.joints import ranged
from joda.scenes.model import load_model

What = Literal["diagnose", "improve", "generate"]


@dataclass(frozen=True)
class Task:
    """A joint, and what is to be done with it.

    Attributes:
        what: the command.
        label: what it is called.
        model: file of the model, below an imagined root, as all paths here.
        joint: its name or address; None: the only one of the model.
        runs: files of the measured runs.
        output: folder of what is made.
        files: path to content, of all that the model's folder holds.
        options: further arguments of the command.
    """

    what: What
    label: str
    model: str
    joint: str | None
    runs: tuple[str, ...]
    output: str
    files: Mapping[str, bytes]
    options: Mapping[str, Any]

    @property
    def digest(self) -> str:
        """Of all that the result depends on but joda's version and where the folders are."""
        here = posixpath.dirname(self.model)
        files = {posixpath.relpath(path, here): digest(own) for path, own in self.files.items()}
        told = [self.what, self.joint, dict(self.options), files]
        return digest(json.dumps(told, sort_keys=True).encode())

    @property
    def size(self) -> int:
        """Bytes of its files."""
        return sum(map(len, self.files.values()))


@dataclass(frozen=True)
class Result:
    """What a task has made.

    Attributes:
        files: path below the task's output to content; empty where it failed.
        told: the result, or the reason why there is none, in a sentence.
        failed: whether a user's mistake prevented it.
    """

    files: Mapping[str, bytes]
    told: str
    failed: bool

    @property
    def size(self) -> int:
        """Bytes of its files."""
        return sum(map(len, self.files.values()))


def digest(content: bytes) -> str:
    """By which content is known again."""
    return hashlib.sha256(content).hexdigest()


def run(task: Task) -> Result:
    """Runs a task in a folder of its own, which is gone afterwards."""
    with tempfile.TemporaryDirectory() as root, chdir(root):
        for name, content in task.files.items():
            path = Path(name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        output = Path(task.output)
        output.mkdir(parents=True, exist_ok=True)
        try:
            told = _do(task, output)
        except JodaError as error:
            return Result({}, str(error), True)
        made = (path for path in sorted(output.rglob("*")) if path.is_file())
        files = {path.relative_to(output).as_posix(): path.read_bytes() for path in made}
        return Result(files, told, False)


def _do(task: Task, output: Path) -> str:
    """Runs the command; returns its result in a sentence."""
    if task.what == "generate":
        done = generate(task.model, task.joint, output, **task.options)
        behaves = "complete" if done.history.complete else "not complete"
        return f"{behaves} after {len(done.history.rounds)} rounds"
    joint = task.joint or _only(task.model)
    if task.what == "diagnose":
        json, report = output / "diagnosis.json", output / "diagnosis.html"
        return diagnose(
            task.model, joint, task.runs, json=json, report=report, **task.options
        ).summary
    scene, report = output / "new.xml", output / "improved.html"
    improved = improve(task.model, joint, task.runs, scene, report=report, **task.options)
    added = ", ".join(step.effect for step in improved.steps if step.effect)
    return f"{added or 'nothing'} added; {improved.why}"


def _only(model: str) -> str:
    names = ranged(load_model(Path(model)))
    if len(names) != 1:
        listed = ", ".join(f"'{name}'" for name in names) or "none"
        raise JodaError(
            f"{model}: has {len(names)} hinges and slides with a range ({listed}); name one with "
            "--joint."
        )
    return names[0]


def folder_of(path: Path, root: Path) -> str:
    """A path below the root, as tasks have it."""
    return Path(os.path.relpath(path, root)).as_posix()
