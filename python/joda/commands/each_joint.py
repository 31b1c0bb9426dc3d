"""Compares, diagnoses and improves every joint of logs of several joints, one by one."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from json import dumps, loads
from pathlib import Path

import numpy as np

from joda.commands.compare import compare
from joda.commands.diagnose import diagnose
from joda.commands.improve import Improved, improve
from joda.diagnosis.findings import Diagnosis
from joda.diagnosis.improvement import INTERRUPTED
from joda.diagnosis.outcome import NO_TRUST
from joda.errors import JodaError
from joda.files import check_targets, file_name, named_like, write_text
from joda.measured.comparison import Comparison
from joda.measured.driven import joints_in
from joda.measured.misfit import rms
from joda.measured.scene_replay import Together, replayed_together
from joda.scenes.model import load_model

ALL = "all"
"""In the place of a joint's name: every joint that the logs have."""


@dataclass(frozen=True)
class Compared:
    """A model against logs of several joints.

    Attributes:
        joints: each joint by itself, what the others do to it as a force on it, by name.
        together: replays of the scene as it is, all joints at once; none where a command of one of
            their actuators, or a force, is not known, or runs were corrected.
    """

    joints: dict[str, Comparison]
    together: tuple[Together, ...]

    def rmse(self, joint: str) -> float | None:
        """Of a joint in the replays of all at once, rad or m; None where a run has none."""
        errors = [error for run in self.together if (error := run.rmse.get(joint)) is not None]
        return rms(np.array(errors)) if errors and len(errors) == len(self.together) else None

    def to_json(self) -> str:
        """The comparison as JSON."""
        joints = {
            name: loads(one.to_json()) | {"rmse_together": self.rmse(name)}
            for name, one in self.joints.items()
        }
        runs = [vars(run) for run in self.together]
        return dumps({"joints": joints, "together": runs}, indent=2, ensure_ascii=False) + "\n"


def compare_all(
    model: str | Path,
    runs: Sequence[str | Path],
    joints: Sequence[str] = (ALL,),
    *,
    passive: bool = False,
    corrections: str | Path | None = None,
    json: str | Path | None = None,
    force: bool = False,
    progress: Callable[[str], None] = lambda what: None,
) -> Compared:
    """Compares a model with logs of several joints: each joint by itself, then all at once.

    Args:
        model: MJCF or URDF, with or without profiles.
        runs: CSV files with time, `position:JOINT` and perhaps `velocity:JOINT`, `force:JOINT`,
            `ctrl:ACTUATOR`.
        joints: names; "all": those that the first run has.
        passive: whether the actuators on the joints were off.
        corrections: as in `joda.compare`, of every joint by itself.
        json: file to write, all numbers.
        force: overwrite it.
        progress: told what is being done.

    Raises:
        JodaError: as `joda.compare`.
    """
    check_targets([Path(json)] if json else [], force, [model, *runs])
    found = {}
    for name in named(model, runs, joints):
        progress(name)
        found[name] = compare(model, name, runs, passive=passive, corrections=corrections)
    progress("all joints at once")
    together = (
        ()
        if passive or corrections
        else replayed_together(load_model(Path(model)), [*map(Path, runs)])
    )
    compared = Compared(found, together)
    if json:
        write_text(Path(json), compared.to_json())
    return compared


def diagnose_all(
    model: str | Path,
    runs: Sequence[str | Path],
    joints: Sequence[str] = (ALL,),
    *,
    exclude: Collection[str] = (),
    passive: bool = False,
    trust: Mapping[str, float] = NO_TRUST,
    templates: Sequence[str | Path] = (),
    json: str | Path | None = None,
    force: bool = False,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> dict[str, Diagnosis]:
    """Diagnoses each joint of logs of several joints, as `joda.diagnose` does.

    Args:
        model, runs, joints, passive, json, force: as in `compare_all`.
        exclude: effects that are not considered.
        trust, templates: as in `joda.diagnose`, of every joint.
        progress: told how much is done, of how much, and what.

    Returns:
        the diagnoses by joint.

    Raises:
        JodaError: as `joda.diagnose`.
    """
    check_targets([Path(json)] if json else [], force, [model, *runs])
    names = named(model, runs, joints)
    found: dict[str, Diagnosis] = {}
    for number, name in enumerate(names):

        def report(
            done: int, total: int, what: str, number: int = number, name: str = name
        ) -> None:
            progress(number * total + done, len(names) * total, f"{name}: {what}")

        found[name] = diagnose(
            model,
            name,
            runs,
            exclude=exclude,
            passive=passive,
            trust=trust,
            templates=templates,
            progress=report,
        )
        if json:  # what is done stays, whatever ends the rest
            own = {joint: loads(one.to_json()) for joint, one in found.items()}
            write_text(Path(json), dumps({"joints": own}, indent=2, ensure_ascii=False) + "\n")
    return found


def improve_all(
    model: str | Path,
    runs: Sequence[str | Path],
    output: str | Path,
    joints: Sequence[str] = (ALL,),
    *,
    passive: bool = False,
    trust: Mapping[str, float] = NO_TRUST,
    templates: Sequence[str | Path] = (),
    force: bool = False,
    progress: Callable[[str], None] = lambda what: None,
) -> dict[str, Improved]:
    """Improves one joint of logs of several joints after the other, as `joda.improve` does.

    Args:
        model, runs, joints, passive: as in `compare_all`.
        output: scene to write; beside it, with its name and each joint's, go .composed.json and
            .png. What is done is written joint by joint, and stays if the rest is interrupted.
        trust, templates: as in `joda.diagnose`, of every joint.
        force: overwrite what exists.
        progress: told what is being done.

    Returns:
        what was done by joint; no scene is written where nothing was.

    Raises:
        JodaError: as `joda.improve`.
    """
    target, names = Path(output), named(model, runs, joints)
    suffixes = ".composed.json", ".png"
    kept = {
        (name, end): named_like(target, f".{file_name(name)}{end}")
        for name in names
        for end in suffixes
    }
    check_targets([target, *kept.values()], force, [model, *runs])
    found: dict[str, Improved] = {}
    current = Path(model)
    for name in names:

        def report(what: str, name: str = name) -> None:
            progress(f"{name}: {what}")

        done = improve(
            current, name, runs, target, passive=passive, trust=trust, templates=templates,
            force=force or bool(found), progress=report,
        )  # fmt: skip
        if done.scene and done.composed and done.picture:
            current = done.scene
            composed, picture = (kept[name, end] for end in suffixes)
            done.composed.replace(composed)
            done.picture.replace(picture)
            done = replace(done, composed=composed, picture=picture)
        found[name] = done
        if done.why == INTERRUPTED:
            break
    return found


def named(model: str | Path, runs: Sequence[str | Path], joints: Sequence[str]) -> list[str]:
    """The joints that are meant; raises JodaError if there is none."""
    if not runs:
        raise JodaError("no runs; give at least one CSV file with time and position.")
    if list(joints) not in ([], [ALL]):
        return list(dict.fromkeys(joints))
    there = joints_in(load_model(Path(model)), Path(runs[0]))
    if not there:
        raise JodaError(
            f"{runs[0]}: has no columns 'position:JOINT' of the model's joints; name the joint of "
            "its 'position' with --joint."
        )
    return there
