"""What meta/info.json says of a LeRobot dataset: its features, their names and units."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, Field, ValidationError

from joda.errors import JodaError
from joda.files import read_json
from joda.importing.log import Role, Signal
from joda.importing.names import read_name
from joda.importing.units import checked
from joda.profile import describe

INFO = Path("meta/info.json")
STATE, ACTION = "observation.state", "action"
FEATURES: dict[str, Role] = {
    STATE: "position",
    "observation.velocity": "velocity",
    ACTION: "ctrl",
}
"""What the numbers of a feature are where their names do not say otherwise."""
CALIBRATED = ("rad", "deg", "-100..100")
"""Units of a robot's joints: info.json does not have them."""
GRIPPERS = re.compile("gripper", re.IGNORECASE)
PERCENT = re.compile(r"so10[01](_follower)?|so_follower", re.IGNORECASE)
"""Robots whose gripper LeRobot gives as 0..100 of its range, whatever the other joints are in."""


class Feature(BaseModel):
    """One feature of the dataset, as info.json describes it."""

    dtype: str = ""
    shape: list[int] = Field(default_factory=list)
    names: Any = None
    units: Any = None


class Info(BaseModel):
    """What is used of info.json."""

    codebase_version: str
    fps: float = Field(gt=0, allow_inf_nan=False)
    features: dict[str, Feature]
    robot_type: str | None = None
    total_episodes: int | None = None


def read_info(path: Path) -> Info:
    """Reads info.json; raises JodaError."""
    try:
        return Info.model_validate_json(read_json(path))
    except ValidationError as error:
        raise JodaError(f"{path}: {describe(error)}") from None


def signals_of(path: Path, info: Info, feature: str) -> tuple[Signal, ...]:
    """The signals of a feature, in the order of its numbers."""
    described = info.features[feature]
    names = _names(path, feature, described)
    units = _units(path, feature, described.units, names)
    out = []
    for name, unit in zip(names, units, strict=True):
        role, of, by_name = read_name(name)
        role = role or (FEATURES[feature] if of == name or by_name else "")
        if feature == ACTION and role != "position":
            role = "ctrl" if role == "ctrl" else ""  # a velocity's command is no position's
        elif feature == ACTION:
            role = "ctrl"
        why, group = "info.json" if unit else "its name", "joints"
        may: tuple[str, ...] = (unit,) if unit else (by_name,) if by_name else CALIBRATED
        if not (unit or by_name) and GRIPPERS.search(name):
            group = f"{name}"
            may = ("0..100", *CALIBRATED, "0..1")
            if PERCENT.fullmatch(info.robot_type or ""):
                may, why = ("0..100",), f"LeRobot's {info.robot_type}"
        out.append(Signal(f"{feature}/{name}", name, role, of, may, why, group))
    return tuple(out)


def _names(path: Path, feature: str, described: Feature) -> list[str]:
    """A name for each number of a feature; the number's own number where there is none."""
    names, count = described.names, int(np.prod(described.shape)) if described.shape else 0
    if isinstance(names, dict) and names and all(isinstance(n, list) for n in names.values()):
        names = [name for some in names.values() for name in some]  # {"motors": [...]}
    elif isinstance(names, dict):
        names = list(names)
    if names is None and 0 < count <= 10_000:
        return [str(k) for k in range(count)]
    if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names):
        raise JodaError(f"{path}: features.{feature}.names must be a list of names.")
    if len(names) != count:
        raise JodaError(
            f"{path}: features.{feature} has {len(names)} names and the shape {described.shape}; "
            "there must be a name for each number."
        )
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise JodaError(f"{path}: features.{feature}.names has '{twice}' twice.")
    return names


def _units(path: Path, feature: str, units: Any, names: Sequence[str]) -> list[str]:
    """The unit of each name, empty where info.json has none."""
    where = f"{path}: features.{feature}.units"
    if units is None:
        return [""] * len(names)
    if isinstance(units, str):
        units = [units] * len(names)
    if isinstance(units, dict):
        units = [units.get(name, "") for name in names]
    if not isinstance(units, list) or len(units) != len(names):
        raise JodaError(f"{where} must be a unit, or a list of one for each name.")
    if not all(isinstance(unit, str) for unit in units):
        raise JodaError(f"{where} must be texts, such as deg.")
    return [checked(unit, where) if unit else "" for unit in units]
