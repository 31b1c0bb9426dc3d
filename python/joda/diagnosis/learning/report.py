"""A learned law told: its curves with their bands, its memory, in numbers, words and a picture."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from joda.diagnosis.learning.ensemble import (
    Band,
    Number,
    drawn,
    of_memory,
    over_position,
    over_speed,
)
from joda.diagnosis.learning.experiment_design import narrowing
from joda.diagnosis.learning.fitting import Learned, Learner
from joda.diagnosis.learning.formula import Formula, formula
from joda.diagnosis.learning.law import Memory
from joda.diagnosis.learning.nearest import Nearest, nearest
from joda.diagnosis.outcome import draw_repaired
from joda.measured.measured_joint import Measured
from joda.pictures.style import COLOURS, EFFECTS, house_style, note
from joda.profile import Profile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

REMEMBERS = {
    "position": (
        "a spring whose far end follows: stiffness {gain} {force}/{unit}, "
        "{time} s until 63 % of its pull are gone"
    ),
    "speed": (
        "a memory of speed: the resistance over the speed changes by {percent:+.0f} % for each "
        "{fastest:.2g} {unit}/s of the mean speed over {time} s"
    ),
}


@dataclass(frozen=True)
class Account:
    """What a learned law is.

    Attributes:
        position: its force over position; None if it has none.
        speed: what resists over the velocity, in the mean along the way; None if nothing does.
        along: whether that differs along the way.
        memory: what it remembers.
        gain, time: of the memory, see `joda.effects.LearnedForce`; None without one.
        formula: few terms that do as well, beside the memory; None if none do.
        nearest: the known effect that a diagnosis found likeliest; None if it found none.
        next_experiment: that would make the bands narrowest; None if none would by much.
        unit, force_unit: of the joint's position, and of a force on it.
    """

    position: Band | None
    speed: Band | None
    along: bool
    memory: Memory
    gain: Number | None
    time: Number | None
    formula: Formula | None
    nearest: Nearest | None
    next_experiment: str | None
    unit: str
    force_unit: str


def account(
    train: Measured, held: Measured, learned: Learned, unseen: float, known: str | None = None
) -> Account:
    """What a law is that was learned from runs.

    Args:
        train: the joint and runs that were fitted.
        held: the same with runs held out.
        learned: the law.
        unseen: its error on these, in segments.
        known: the effect that a diagnosis found likeliest.
    """
    learner, law = Learner(train), learned.law
    x, draws = learner.numbers(learned), drawn(learner, learned)
    remembers = law.terms.memory != "none"
    h = learned.estimator.segments.h
    gain, time = of_memory(law, x, draws, h) if remembers else (None, None)
    return Account(
        position=over_position(law, x, draws),
        speed=over_speed(law, x, draws),
        along=law.terms.along,
        memory=law.terms.memory,
        gain=gain,
        time=time,
        formula=formula(learner, held, learned, draws, unseen),
        nearest=nearest(train, held, known, unseen) if known else None,
        next_experiment=narrowing(learner, learned),
        unit=train.profile.joint.unit,
        force_unit=train.profile.joint.force_unit,
    )


def sentences(told: Account) -> list[str]:
    """A law for a person."""
    parts = []
    if told.position:
        size, error, _ = told.position.largest
        a, b = told.position.at[0], told.position.at[-1]
        parts.append(
            f"a force over position, up to {Number(size, error)} {told.force_unit}, from "
            f"s = {a:.2f} to {b:.2f}"
        )
    if told.speed:
        size, error, at = told.speed.largest
        way = ", different along the way" if told.along else ""
        parts.append(
            f"a resistance up to {Number(size, error)} {told.force_unit} at "
            f"{at:.2g} {told.unit}/s{way}"
        )
    if remembered := _remembered(told):
        parts.append(remembered)
    out = [f"Learned: {'; '.join(parts)}. Where no run was there is none of it."]
    if found := told.formula:
        beside = " beside this memory" if told.gain else ""
        out.append(
            f"In a formula{beside}: {found.text}; its held-out error is "
            f"{found.unseen:.2f} times that of the learned curves."
        )
    elif told.position or told.speed:
        out.append("No formula of few terms is as good and stable.")
    if told.nearest:
        out.append(
            f"Nearest of what has a name: {told.nearest.name}; with it the held-out error "
            f"is {told.nearest.times:.2g} times that of the law."
        )
    if told.next_experiment:
        out.append(f"Next experiment: {told.next_experiment}")
    return out


def _remembered(told: Account) -> str:
    """The memory in words; nothing without one."""
    if not told.gain or not told.time:
        return ""
    fastest = max(told.speed.at) if told.speed else 1.0
    return REMEMBERS[told.memory].format(
        gain=told.gain,
        time=told.time,
        percent=100 * told.gain.value * fastest,
        fastest=fastest,
        force=told.force_unit,
        unit=told.unit,
    )


def learned_picture(held: Measured, after: Profile, told: Account) -> "Figure":
    """The joint before and after, and the law with its band."""
    from matplotlib.figure import Figure

    joint = after.joint
    with house_style():
        figure = Figure(figsize=(12, 10), dpi=110, layout="constrained")
        above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=[7, 3])[:, 0]
        draw_repaired(above, held, after)
        left, right = below.subplots(1, 2)
        lo, hi = joint.range
        _band(left, told.position, lo, hi - lo, COLOURS["conservative"])
        left.set(xlabel=f"joint position ({joint.unit})", ylabel=f"force ({joint.force_unit})")
        _band(right, told.speed, 0.0, 1.0, EFFECTS)
        right.set(xlabel=f"velocity ({joint.unit}/s)", ylabel=f"resists with ({joint.force_unit})")
        what = ["what was learned, ± 2 standard deviations of an ensemble", _remembered(told)]
        below.suptitle("\n+ ".join(filter(None, what)), x=0.02, ha="left", fontsize=10)
        return figure


def _band(axes: "Axes", band: Band | None, begin: float, span: float, colour: str) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.axhline(0, color="#cccccc", lw=0.8)
    if band is None:
        axes.set(xticks=[], yticks=[])
        note(axes, "nothing that the runs support")
        return
    at, force, error = (np.array(x) for x in (band.at, band.force, band.error))
    at = begin + span * at
    axes.fill_between(at, force - 2 * error, force + 2 * error, color=colour, alpha=0.2, lw=0)
    axes.plot(at, force, color=colour, lw=1.6)
