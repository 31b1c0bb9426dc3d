"""What was understood of a column, for the table and for scripts, and what looks wrong with it."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco

from joda.importing.checks import follows, outside, span, velocity_fits
from joda.importing.rows import Rows
from joda.importing.scaling import Scaled, servo_gear
from joda.importing.units import RANGES

FAR = 0.02
"""Share of a range, beyond which a position outside it is said."""
RATIO = 1.25
"""How many times the differentiated position's a logged velocity may be, or the reverse."""
LATE = 1.5
"""Sampling intervals by which a position may seem to be ahead of its command."""


@dataclass(frozen=True)
class Understood:
    """A column of the runs, and how the log has it.

    Attributes:
        column: of the log.
        target: in the runs, such as "position:elbow".
        unit: in which the log has it.
        why: how that is known.
        range: its least and largest number in the runs, in the model's units.
        model_range: of the joint, or of the actuator's control; None where there is none.
        outside: share of its samples beyond that.
        sign: whether the joint goes the way of the command, or the logged velocity that of the
            position: "same", "opposite", or "" where too little moves to tell.
        correlation: of the two speeds; None where it tells nothing.
        delay: of the position behind this command, s; None where it is no command or cannot be
            told. The wire's and the servo's own lag together.
        delay_resolution: the sampling interval, s.
        offset: median of position minus command, rad or m.
    """

    column: str
    target: str
    unit: str
    why: str
    range: tuple[float, float]
    model_range: tuple[float, float] | None
    outside: float
    sign: str = ""
    correlation: float | None = None
    delay: float | None = None
    delay_resolution: float | None = None
    offset: float | None = None


def understood(
    model: mujoco.MjModel, made: Sequence[Rows], columns: Sequence[Scaled]
) -> tuple[list[Understood], list[str]]:
    """What was understood of each column of the runs, and a sentence for what looks wrong."""
    positions = {one.pick.joint: one.pick.target for one in columns if one.pick.role == "position"}
    found, warnings = [], []
    for one in columns:
        row, more = _column(model, made, one, positions.get(one.pick.joint))
        found.append(row)
        warnings += more
    return found, warnings


def _column(
    model: mujoco.MjModel, made: Sequence[Rows], one: Scaled, position: str | None
) -> tuple[Understood, list[str]]:
    pick, warnings = one.pick, []
    name, target = pick.signal.name, pick.target
    limits, beyond, far = _limits(model, one), 0.0, 0.0
    if limits:
        beyond, far = outside(made, target, limits)
        lo, hi = limits
        if pick.role == "position" and far > FAR * (hi - lo):
            warnings.append(
                f"{target}: {100 * beyond:.3g} % of it is outside the model's range, by up to "
                f"{far:.3g}; if the log has another zero say --zero '{name}=WHAT IT HAS AT THE "
                f"MODEL'S ZERO', if another direction --unit '{name}=-{_bare(one.unit)}'."
            )
    row = {
        "column": name, "target": target, "unit": one.unit, "why": one.why,
        "range": span(made, target), "model_range": limits, "outside": beyond,
    }  # fmt: skip
    if pick.role == "velocity" and position and (fit := velocity_fits(made, position, target)):
        correlation, ratio = fit
        row |= {"sign": "same" if correlation > 0 else "opposite", "correlation": correlation}
        if ratio < 0:
            warnings.append(
                f"{target}: goes against the position of its joint; one of the two has another "
                f"sign, or leave it out with --without '{name}'."
            )
        elif not 1 / RATIO < ratio < RATIO:
            warnings.append(
                f"{target}: is {ratio:.3g} times the differentiated position; check its unit, or "
                f"leave it out with --without '{name}'."
            )
    gear = servo_gear(model, pick.actuator) if pick.role == "ctrl" else None
    if gear and position and (seen := follows(made, position, target, gear)):
        row |= {
            "sign": seen.sign, "correlation": seen.correlation, "delay": seen.delay,
            "delay_resolution": seen.resolution, "offset": seen.offset,
        }  # fmt: skip
        if seen.sign == "opposite":
            warnings.append(
                f"{target}: the joint goes against its command; one of the two has another sign: "
                f"say --unit '{name}=-{_bare(one.unit)}', or the same of the position."
            )
        elif seen.delay < -LATE * seen.resolution:
            warnings.append(
                f"{target}: the joint moves {-1e3 * seen.delay:.3g} ms before its command, as if "
                "another column were the command, or two clocks were mixed."
            )
    return Understood(**row), warnings  # type: ignore[arg-type]


def _bare(unit: str) -> str:
    """A unit as --unit takes it for a position."""
    bare = unit.removesuffix("/s")
    return bare if bare in RANGES else bare.removeprefix("-")


def _limits(model: mujoco.MjModel, one: Scaled) -> tuple[float, float] | None:
    pick = one.pick
    if pick.role == "position":
        lo, hi = map(float, model.jnt_range[pick.joint])
    elif pick.role == "ctrl" and model.actuator_ctrllimited[pick.actuator]:
        lo, hi = map(float, model.actuator_ctrlrange[pick.actuator])
    else:
        return None
    return (lo, hi) if lo < hi else None
