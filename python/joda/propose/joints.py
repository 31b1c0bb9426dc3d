"""The joints of models that can have a profile."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import mujoco

from joda.errors import JodaError
from joda.files import file_name, read_text
from joda.scenes.model import joint_name, joint_type, load_model

MODELS = (".xml", ".urdf")
"""How names of models end."""

NO_RANGE = (
    "passed over, as it has no range, over which a profile is: if it is to have one, give it a "
    'range="0 1.5", in a URDF a <limit> and another type than continuous.'
)


class PassedOver(JodaError):
    """Why a joint was left alone, which is nobody's mistake."""


class Job(NamedTuple):
    """A joint, and the folder for it."""

    model: Path
    joint: str
    folder: Path


def only_joint(path: Path) -> str:
    """The model's only hinge or slide with a range; raises JodaError if it has several or none."""
    names = ranged(load_model(path))
    if len(names) == 1:
        return names[0]
    listed = ", ".join(f"'{name}'" for name in names)
    raise JodaError(
        f"{path}: choose a joint with --joint: {listed}."
        if names
        else f'{path}: holds no hinge or slide with a range; add range="lo hi" to the joint.'
    )


def ranged(model: mujoco.MjModel) -> list[str]:
    """Names of the joints that can have a profile: hinges and slides that have a range."""
    return [name for name, has in _movable(model) if has]


def endless(model: mujoco.MjModel) -> list[str]:
    """Names of the hinges and slides that have no range, and so can have no profile."""
    return [name for name, has in _movable(model) if not has]


def _movable(model: mujoco.MjModel) -> list[tuple[str, bool]]:
    """Hinges and slides, and whether they have a range."""
    return [
        (joint_name(model, k), bool(model.jnt_range[k][0] < model.jnt_range[k][1]))
        for k in range(model.njnt)
        if joint_type(model, k) in ("hinge", "slide")
    ]


def find_jobs(
    source: Path, target: Path, joint: str | None
) -> tuple[dict[str, Job], dict[str, JodaError]]:
    """The joints to be done, by label; and why models, and joints without a range, are not."""
    jobs: dict[str, Job] = {}
    failed: dict[str, JodaError] = {}
    others = set()
    for path, stem, part in _models(source, target):
        try:
            model = load_model(path)
            names = ranged(model)
        except JodaError as error:
            if not part:
                failed[stem] = error
            continue
        taken: set[str] = set()
        for name in names:
            folder = target / stem / _unique(file_name(name), taken)
            if joint in (None, name):
                jobs[f"{stem}/{name}"] = Job(path, name, folder)
            else:
                others.add(name)
        for name in endless(model):
            if joint in (None, name):
                failed[f"{stem}/{name}"] = PassedOver(NO_RANGE)
    if not jobs and others:
        listed = ", ".join(f"'{name}'" for name in sorted(others))
        raise JodaError(f"{source}: no model has a joint '{joint}'; there are: {listed}.")
    mistakes = [str(one) for one in failed.values() if not isinstance(one, PassedOver)]
    if not jobs and (mistakes or not failed):
        raise JodaError(
            " ".join(mistakes)
            or f"{source}: holds no model with a hinge or slide that has a range."
        )
    return jobs, failed


def _models(source: Path, target: Path) -> Iterator[tuple[Path, str, bool]]:
    """MJCF and URDF files below the folder, but for what joda made there.

    Yields:
        path, a name of its own (the path without its ending, where that is the only one), and
        whether another file includes it.
    """
    if not source.is_dir():
        raise JodaError(f"{source}: no such folder.")
    made = target.resolve()
    texts = {
        path: _text(path)
        for path in sorted(source.rglob("*"))
        if path.suffix.lower() in MODELS and made not in path.resolve().parents
    }
    includes = re.compile(r"<include\s[^<>]*\bfile\s*=\s*[\"']([^\"']*)")
    parts = {Path(file).name for text in texts.values() for file in includes.findall(text)}
    taken: set[str] = set()
    for path, text in texts.items():
        if re.search(r"<(?:mujoco|robot)\b", text):
            stem = path.relative_to(source).with_suffix("").as_posix()
            yield path, _unique(stem, taken), path.name in parts


def _text(path: Path) -> str:
    """What the file says but for comments; where it cannot be read, that it is a model."""
    try:
        return re.sub(r"<!--.*?(?:-->|\Z)", "", read_text(path), flags=re.DOTALL)
    except JodaError:
        return "<mujoco>"


def _unique(name: str, taken: set[str]) -> str:
    """The name, or the first of name_2, name_3, ... that is not taken; it then is."""
    number, free = 1, name
    while free.lower() in taken:
        number += 1
        free = f"{name}_{number}"
    taken.add(free.lower())
    return free
