"""Diagnoses and mends a model until the data support no more, and tells the story."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from joda.commands.add import FILES
from joda.diagnosis.end_stops import stops_described
from joda.diagnosis.improvement import INTERRUPTED, Step, improved
from joda.diagnosis.outcome import (
    NO_TRUST,
    beside,
    draw_repaired,
    nearby,
    read_runs,
    scene_files,
    wholes,
)
from joda.diagnosis.phrases import LEARN
from joda.diagnosis.split import held_out, in_blocks, parted
from joda.files import check_targets, file_name, named_like, write_together
from joda.measured.corrections_file import corrections_beside
from joda.measured.driven import ALL, named_joints
from joda.measured.maps import draw_maps, draw_models, replayed
from joda.measured.measured_joint import Measured
from joda.measured.trust import read_trust
from joda.measured.visited import unvisited
from joda.pictures.changes import changes
from joda.pictures.page import page, paragraph, table
from joda.pictures.page import picture as embedded
from joda.pictures.style import COLOURS, house_style, png
from joda.terminal import options
from joda.terminal.progress import spinner
from joda.terminal.say import print_json, say

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure


@dataclass(frozen=True)
class Improved:
    """What an improvement did.

    Attributes:
        scene, composed, picture: the files that were written; None where nothing was added or
            corrected: then only the report is.
        corrections: the file of what the measurement has wrong; None where nothing of it is.
        joint: its name.
        steps: the model as it was, then with one effect more each.
        why: it ended, a sentence.
        noise_floor: of what was held out.
        unit: of the errors and the noise: rad or m; N·m or N where there are only curves.
        held_out: what was held out of all fits, in words.
        blocks: whether that are blocks of runs, not whole runs.
        departures: where the last profile is not what the model gave, and effects act elsewhere
            than where they were diagnosed, in sentences.
        changes: a line per changed component, of the last profile against the first.
        notes: what the user should be told, a sentence each.
    """

    scene: Path | None
    composed: Path | None
    picture: Path | None
    corrections: Path | None
    joint: str
    steps: tuple[Step, ...]
    why: str
    noise_floor: float
    unit: str
    held_out: str
    blocks: bool
    departures: tuple[str, ...]
    changes: tuple[str, ...]
    notes: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """What was found and written, for JSON: of each step its effect and corrections, and the
        errors on what was held out, before and after it."""
        paths = {name: getattr(self, name) for name in FILES}
        errors = [asdict(step.error) for step in self.steps]
        steps = [
            {
                "effect": step.added and asdict(step.added),
                "corrections": [asdict(one) for one in step.corrections],
                "before": before,
                "after": after,
            }
            for step, before, after in zip(self.steps[1:], errors[:-1], errors[1:], strict=True)
        ]
        told = "joint", "why", "noise_floor", "unit", "held_out", "departures", "changes", "notes"
        return {
            **{name: path and str(path) for name, path in paths.items()},
            **{name: getattr(self, name) for name in told},
            "error": errors[0],
            "steps": steps,
        }


def improve(
    model: str | Path,
    joint: str,
    runs: Sequence[str | Path],
    output: str | Path,
    *,
    report: str | Path | None = None,
    passive: bool = False,
    trust: Mapping[str, float] = NO_TRUST,
    templates: Sequence[str | Path] = (),
    force: bool = False,
    progress: Callable[[str], None] = lambda what: None,
) -> Improved:
    """Diagnoses what a model lacks and adds it, again and again, while the data support it.

    Args:
        model: MJCF or URDF, with or without a profile on the joint.
        joint: its name or address, see `joda.scenes.model.find_joint`.
        runs: CSV files with time, position and perhaps force. Of four or more one of every three
            is held out of all fits, of fewer every fourth block in which the joint moves. Or
            quasi-static curves: of fewer than four every fourth stretch of each is held out.
        output: scene to write; beside it, with its name, go .composed.json and .png, and
            .corrections.json where something of the measurement was corrected.
        report: an HTML page to write that needs nothing else.
        passive: whether the actuators on the joint, if there are any, were off.
        trust: how far off numbers may be, as in `joda.diagnose`.
        templates: further folders of effect templates, as there.
        force: overwrite what exists.
        progress: told what is being done.

    Returns:
        what was written, and each step's error on what was held out.

    Raises:
        JodaError: a file cannot be read or written, or cannot be of this joint as it stands.
    """
    target = Path(output)
    composed, picture = beside(target, force, runs, report)
    measured = read_runs(model, joint, runs, passive, trust, templates)
    parts = parted(measured)
    steps, why = improved(measured, parts, progress)
    progress("drawing")
    last, right, held = steps[-1].profile, steps[-1].right, parts[1]
    there = len(steps) > 1
    files: dict[Path, bytes | str] = {}
    notes: list[str] = []
    moved = stops_described(measured.joint_model, steps[-1].stops)
    if there:
        files, notes = scene_files(
            Path(model), last, target, composed, steps[-1].servo, right, steps[-1].stops
        )
    own = corrections_beside(target)
    result = Improved(
        scene=target if there else None,
        composed=composed if there else None,
        picture=picture if there else None,
        corrections=own if own in files else None,
        joint=last.joint.name,
        steps=steps,
        why=why,
        noise_floor=held.floor,
        unit=held.unit,
        held_out=held_out(measured, held),
        blocks=in_blocks(measured, held),
        departures=_departures(steps),
        changes=(*changes(measured.profile, last), *moved),
        notes=(*measured.notes, *notes),
    )
    if there or report:
        shown = (right.of(one) if right else one for one in (measured, held))
        drawn = png(_picture(result, *shown))
        if there:
            files[picture] = drawn
        if report:
            files[Path(report)] = _page(result, drawn)
    write_together(files)
    return result


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
    target, names = Path(output), named_joints(model, runs, joints)
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


def _departures(steps: Sequence[Step]) -> tuple[str, ...]:
    """What the last step changes of the model as given, and where each one's effect acts."""
    found = [steps[-1].departs.changed, *(step.departs.elsewhere for step in steps)]
    return tuple(one for one in found if one)


def sentences(result: Improved) -> list[str]:
    """The stairs, and why there are no more, for a person."""
    rows = _rows(result)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    stairs = [
        "  "
        + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
    head = (
        f"Error on what was held out of all fits ({result.held_out}); noise "
        f"{result.noise_floor:.2g} {result.unit}:"
    )
    return [head, *stairs, *_ending(result)]


def _ending(result: Improved) -> list[str]:
    """Why each effect was added, why no more, what to do next, what changed, notes."""
    last = result.steps[-1].diagnosis
    told = last and last.next_experiment
    unchanged = len(result.steps) == 1
    return [
        *_explanations(result),
        *["Nothing was added or corrected, and no scene was written."] * unchanged,
        result.why,
        *[f"Next experiment: {told}"] * bool(told),
        *[LEARN] * bool(last and last.verdict == "unexplained"),
        *result.departures,
        *result.changes,
        *result.notes,
    ]


def _rows(result: Improved) -> list[tuple[str, ...]]:
    """Effect and errors, the head first."""
    stairs = _errors(result)
    rows = [
        tuple(f"{value:.3g} {result.unit}" if isfinite(value) else "unknown" for value in values)
        for values in zip(*stairs.values(), strict=True)
    ]
    names = map(_step, result.steps)
    return [("model", *stairs), *((name, *row) for name, row in zip(names, rows, strict=True))]


def _errors(result: Improved) -> dict[str, list[float]]:
    """The errors of all steps by what they are of."""
    errors = [step.error for step in result.steps]
    out = {nearby(errors[0], result.blocks): [error.window for error in errors]}
    whole = [error.whole for error in errors if error.whole is not None]
    return out | ({wholes(result.blocks): whole} if whole else {})


def _step(step: Step) -> str:
    if step.effect:
        return f"+ {step.effect}"
    return "corrected" if step.corrections or step.stops else "as it was"


def _explanations(result: Improved) -> list[str]:
    """Why each effect was added, and each number corrected."""
    out = []
    for step in result.steps:
        out += [step.added.explanation] if step.added else []
        out += [one.explanation for one in step.corrections]
    return out


def _page(result: Improved, drawn: bytes) -> str:
    head, *rows = _rows(result)
    count = sum(step.effect is not None for step in result.steps)
    first, last = result.steps[0].error.window, result.steps[-1].error.window
    added = ", ".join(step.added.name for step in result.steps if step.added)
    what = nearby(result.steps[0].error, result.blocks)
    noise = f"the measurement's noise is {result.noise_floor:.2g} {result.unit}."
    done = ["The model's own numbers corrected"] if len(rows) - 1 > count else []
    done += [f"{count} effect{'s' * (count > 1)} added: {added}"] if count else []
    story = (
        f"{'. '.join(done)}. On what was held out of all fits ({result.held_out}) the "
        f"{what} is {last:.3g} instead of {first:.3g} {result.unit}; {noise}"
        if done
        else f"The {what} is {first:.3g} {result.unit}; {noise}"
    )
    return page(
        f"{result.joint}: what the model lacked",
        paragraph(story),
        embedded(drawn, "the falling error, the residual force, the profile, the runs held out"),
        table(head, rows),
        *map(paragraph, _ending(result)),
    )


def _picture(result: Improved, measured: Measured, held: Measured) -> "Figure":
    """The stairs and the maps above, the profile and the runs held out below."""
    from matplotlib.figure import Figure

    last = result.steps[-1].profile
    with house_style():
        figure = Figure(figsize=(12, 13), dpi=110, layout="constrained")
        above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=[6, 7])[:, 0]
        left, right = above.subfigures(1, 2, squeeze=False)[0]
        _stairs(left, result)
        models = {"before": measured.profile} | ({"after": last} if len(result.steps) > 1 else {})
        if measured.runs:
            maps = [replayed(label, measured.changed(own)) for label, own in models.items()]
            draw_maps(right, maps, last.joint, unvisited(measured))
            what = "residual force: segments of 0.1 s, \u00b1 2 standard deviations"
            right.suptitle(what, x=0.02, ha="left", fontsize=10)
        else:
            draw_models(right, measured, models)
        draw_repaired(below, held, last)
    return figure


def _stairs(part: "Figure | SubFigure", result: Improved) -> None:
    """The held-out error falling towards the noise."""
    axes = part.subplots()
    count = len(result.steps)
    stairs = _errors(result).items()
    for (label, values), colour in zip(stairs, ("conservative", "friction"), strict=False):
        axes.stairs(values, np.arange(count + 1) - 0.5, baseline=None, lw=2, color=COLOURS[colour])
        axes.plot(range(count), values, "o", color=COLOURS[colour], label=label)
        for k, value in enumerate(values):
            axes.annotate(
                f"{value:.2g}", (k, value), (0, 6), textcoords="offset points", ha="center",
                fontsize=8, color=COLOURS[colour],
            )  # fmt: skip
    axes.axhline(result.noise_floor, ls="--", color="#888888", lw=1.2, label="noise")
    axes.set_yscale("log")
    axes.set_xticks(range(count), map(_step, result.steps), fontsize=8)
    if count > 2:
        for tick in axes.get_xticklabels():
            tick.set(rotation=20, ha="right")
    axes.set_ylabel(f"RMS error held out ({result.unit})")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, fontsize=8)
    part.suptitle("what each effect brought", x=0.02, ha="left", fontsize=10)


def command(
    model: options.Model,
    runs: options.Runs,
    output: options.Scene,
    joint: options.Joints = None,
    report: options.Report = None,
    passive: options.Passive = False,
    trust: options.Trust = None,
    templates: options.Effects = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Diagnose and add until the data support nothing more.

    Leaves, beside the scene, its .composed.json and .png, and .corrections.json where the runs'
    force, clock or zero was wrong; without anything to add or correct, nothing but the report.
    Example:

        joda improve hidden/model.xml hidden/run?.csv --joint joint -o improved.xml
    """
    if options.several(joint):
        options.one_joint_only(report, None)
        with spinner("improve") as progress:
            every = improve_all(
                model, runs, output, joint or (), passive=passive,
                trust=read_trust(trust or ()), templates=templates or (),
                force=force, progress=progress,
            )  # fmt: skip
        if as_json:
            print_json({"joints": {name: one.as_json() for name, one in every.items()}})
            return
        for name, one in every.items():
            say(f"{name}:")
            for sentence in sentences(one):
                say(f"  {sentence}")
            for path in filter(None, (one.scene, one.composed, one.picture, one.corrections)):
                say(path)
        return
    assert joint
    with spinner("improve") as progress:
        result = improve(
            model, joint[0], runs, output, report=report, passive=passive,
            trust=read_trust(trust or ()), templates=templates or (), force=force,
            progress=progress,
        )  # fmt: skip
    if as_json:
        print_json(result.as_json())
        return
    for sentence in sentences(result):
        say(sentence)
    written = result.scene, result.composed, result.picture, result.corrections, report
    for path in filter(None, written):
        say(path)
