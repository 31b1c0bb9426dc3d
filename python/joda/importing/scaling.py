"""What makes the model's numbers of each column: its unit, told or found by its range."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Any

import mujoco
import numpy as np

from joda.errors import JodaError
from joda.importing.columns import Pick
from joda.importing.log import Array, Log, Signal
from joda.importing.units import (
    MODEL,
    RAW,
    Linear,
    LoggedRange,
    decided,
    linear,
)
from joda.scenes.model import joint_type


@dataclass(frozen=True)
class Scaled:
    """A column with its unit.

    Attributes:
        pick: the column.
        unit: in which the log has it.
        why: how that is known.
        to_model: makes the model's numbers of the log's.
    """

    pick: Pick
    unit: str
    why: str
    to_model: Linear


def given(texts: Mapping[str, Any], signal: Signal) -> Any:
    """What an option says of a signal, by its name, whole or short, or a pattern; else None."""
    for name in (signal.name, signal.short):
        if name in texts:
            return texts[name]
    fits = (p for p in texts if fnmatchcase(signal.name, p) or fnmatchcase(signal.short, p))
    return next((texts[pattern] for pattern in fits), None)


def scaled(
    log: Log,
    model: mujoco.MjModel,
    picks: Sequence[Pick],
    units: Mapping[str, str],
    zeros: Mapping[str, float],
) -> list[Scaled]:
    """Units of all columns.

    Args:
        log: what was read.
        model: compiled.
        picks: the columns, positions first.
        units: given by the user, by name or pattern of signals.
        zeros: what a signal has where the model has 0, in its own unit, likewise.

    Raises:
        JodaError: a unit is not one of the column's, or cannot be known; the option that settles
            it is named.
    """
    limits = {pick.joint: _limits(model, pick.joint) for pick in picks if pick.joint >= 0}
    zero = {pick.signal.name: float(given(zeros, pick.signal) or 0.0) for pick in picks}
    known: dict[str, tuple[str, str]] = {}
    for pick in picks:
        signal = pick.signal
        if unit := given(units, signal):
            known[signal.name] = (unit, "as said")
        elif len(signal.units) == 1:
            known[signal.name] = (signal.units[0], signal.why)
    _find(log, model, [pick for pick in picks if pick.role == "position"], known, limits, zero)
    positions = {p.joint: known[p.signal.name][0] for p in picks if p.role == "position"}
    return [
        _scaled(log, model, pick, known.get(pick.signal.name), positions, limits, zero)
        for pick in picks
    ]


def _find(
    log: Log,
    model: mujoco.MjModel,
    positions: Sequence[Pick],
    known: dict[str, tuple[str, str]],
    limits: Mapping[int, tuple[float, float] | None],
    zero: Mapping[str, float],
) -> None:
    """Finds the units of positions by their ranges, those of a group together."""
    groups: dict[tuple[str, bool], list[Pick]] = {}
    for pick in positions:
        if pick.signal.name not in known:
            hinge = joint_type(model, pick.joint) == "hinge"
            group = pick.signal.group or pick.signal.name
            groups.setdefault((group, hinge), []).append(pick)
    for (_, hinge), some in groups.items():
        seen = [
            LoggedRange(p.signal.name, *_span(log, p), hinge, limits[p.joint], zero[p.signal.name])
            for p in some
        ]
        asked = some[0].signal.units or ("rad", "deg")
        swap = {"rad": "m", "deg": "mm"}
        may = tuple(unit if hinge else swap.get(unit, unit) for unit in asked)
        found = decided(seen, may)
        known.update((pick.signal.name, found) for pick in some)


def _span(log: Log, pick: Pick) -> tuple[float, float]:
    """The least and largest number of a signal in all recordings."""
    values = [
        one.tracks[pick.signal.name].values
        for one in log.recordings
        if pick.signal.name in one.tracks
    ]
    finite: Array = np.concatenate(values)
    finite = finite[np.isfinite(finite)]
    if not len(finite):
        raise JodaError(f"{log.path}: column '{pick.signal.name}' has no numbers.")
    return float(finite.min()), float(finite.max())


def _scaled(
    log: Log,
    model: mujoco.MjModel,
    pick: Pick,
    told: tuple[str, str] | None,
    positions: Mapping[int, str],
    limits: Mapping[int, tuple[float, float] | None],
    zero: Mapping[str, float],
) -> Scaled:
    """One column; of what tells no unit itself, its joint's position does."""
    name, where = pick.signal.name, f"{log.path}, {pick.signal.name}"
    hinge = pick.joint < 0 or joint_type(model, pick.joint) == "hinge"
    gear = servo_gear(model, pick.actuator) if pick.role == "ctrl" else 1.0
    if told is None and pick.role == "force":
        told = (RAW, "N·m or N")
    if told is None and pick.role == "ctrl" and (gear is None or pick.joint < 0):
        told = (RAW, "no position servo: its own unit")
    if told is None and pick.joint in positions:
        told = (positions[pick.joint], "its position's")
    if told is None:
        raise JodaError(
            f"{where}: nothing tells its unit; say --unit '{name}=UNIT' (raw: as the model has it)."
        )
    unit, why = told
    if unit == MODEL:
        unit = "rad" if hinge else "m"
    if pick.role == "force" and unit.removeprefix("-") != RAW:
        raise JodaError(f"{where}: a force is in N·m or N; say --unit '{name}=raw' if it is.")
    if unit.removeprefix("-") == RAW:
        sign = -1.0 if unit != RAW else 1.0
        return Scaled(pick, unit, why, Linear(sign, -sign * zero[name]))
    if gear is None:
        actuator = model.actuator(pick.actuator).name
        raise JodaError(
            f"{where}: in {unit} it is a position, and actuator '{actuator}' of the model is no "
            f"position servo on a joint, so its control is none; say --unit '{name}=raw' if the "
            "log has its control as it is, or leave the column out with --joint or --without."
        )
    line = linear(unit, hinge, limits.get(pick.joint), zero[name], where)
    if pick.role == "velocity":
        line = Linear(line.scale)
        unit = f"{unit}/s"
    elif pick.role == "ctrl":
        line = Linear(gear * line.scale, gear * line.offset)
    return Scaled(pick, unit, why, line)


def servo_gear(model: mujoco.MjModel, actuator: int) -> float | None:
    """The gear of a position servo on a joint, whose control is gear times a position; else None.

    Its force is kp * ctrl - kp * length - kv * velocity (MuJoCo's `position` and alike), and its
    length is gear times the joint's position.
    """
    direct = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
    if int(model.actuator_trntype[actuator]) not in direct:
        return None
    if int(model.actuator_biastype[actuator]) != int(mujoco.mjtBias.mjBIAS_AFFINE):
        return None
    gain, bias = float(model.actuator_gainprm[actuator, 0]), model.actuator_biasprm[actuator]
    if gain <= 0 or bias[0] != 0 or not np.isclose(bias[1], -gain):
        return None
    return float(model.actuator_gear[actuator, 0])


def _limits(model: mujoco.MjModel, joint: int) -> tuple[float, float] | None:
    lo, hi = map(float, model.jnt_range[joint])
    return (lo, hi) if lo < hi else None
