"""Diagnoses what a model lacks: the verdict as sentences, a picture, a page."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict
from json import dumps, loads
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from joda.diagnosis.findings import Diagnosis, Finding
from joda.diagnosis.outcome import NO_TRUST, read_runs
from joda.diagnosis.phrases import LEARN, check_effect, percent
from joda.diagnosis.verdict import diagnosed
from joda.files import check_targets, write_text, write_together
from joda.measured.driven import ALL, named_joints
from joda.measured.maps import draw_maps, draw_models, draw_runs, replayed
from joda.measured.measured_joint import Measured
from joda.measured.trust import read_trust
from joda.pictures.page import page, paragraph, table
from joda.pictures.page import picture as embedded
from joda.pictures.style import house_style, png
from joda.profile import Profile
from joda.terminal import options
from joda.terminal.progress import progress_bar
from joda.terminal.say import print_json, say

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def diagnose(
    model: str | Path,
    joint: str,
    runs: Sequence[str | Path],
    *,
    exclude: Collection[str] = (),
    passive: bool = False,
    trust: Mapping[str, float] = NO_TRUST,
    templates: Sequence[str | Path] = (),
    json: str | Path | None = None,
    report: str | Path | None = None,
    picture: str | Path | None = None,
    force: bool = False,
    progress: Callable[[int, int, str], None] = lambda done, total, what: None,
) -> Diagnosis:
    """Tells which physical effect a model lacks, where, and how much of it.

    Args:
        model: MJCF or URDF, with or without a profile on the joint.
        joint: its name or address, see `joda.scenes.model.find_joint`.
        runs: CSV files with time, position and perhaps force.
        exclude: effects that are not considered.
        passive: whether the actuators on the joint, if there are any, were off.
        trust: how far off numbers of the model and of the measurement may be, by name: standard
            deviations, relative ones but for center_of_mass (rad), force_offset (N·m or N),
            time_delay (s) and position_offset (rad or m); 0 trusts a number fully.
        templates: further folders of effect templates, which may be missing too.
        json, report, picture: files to write: all numbers, an HTML page that needs nothing else,
            a PNG.
        force: overwrite them.
        progress: told how much is done, of how much, and what.

    Returns:
        a verdict, and the effects that may be missing, the likeliest first.

    Raises:
        JodaError: a file cannot be read, what it holds cannot be of this joint as it stands, or
            there is no such effect.
    """
    targets = [Path(path) for path in (json, report, picture) if path]
    check_targets(targets, force, [model, *runs])
    measured = read_runs(model, joint, runs, passive, trust, templates)
    for name in exclude:
        check_effect(name, measured.templates)
    found = diagnosed(measured, exclude, progress)
    diagnosis, profile = found.diagnosis, found.profile
    files: dict[Path, bytes | str] = {}
    if json:
        files[Path(json)] = diagnosis.to_json()
    if report or picture:
        drawn = png(_picture(measured, profile, diagnosis))
        if picture:
            files[Path(picture)] = drawn
        if report:
            files[Path(report)] = _page(diagnosis, drawn)
    write_together(files)
    return diagnosis


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
    names = named_joints(model, runs, joints)
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


def sentences(diagnosis: Diagnosis) -> list[str]:
    """The diagnosis for a person: the verdict, the candidates, what to do next, notes."""
    return [diagnosis.summary, *_candidates(diagnosis), *_after(diagnosis)]


def _candidates(diagnosis: Diagnosis) -> list[str]:
    """What may be missing, and how likely it is none of these."""
    unknown = diagnosis.unexplained_probability
    none = [] if unknown is None else [f"{percent(unknown)} none of these."]
    return [*map(_candidate, diagnosis.effects), *none]


def _candidate(found: Finding) -> str:
    return f"{percent(found.probability)} {found.effect}: {found.explanation}"


def _after(diagnosis: Diagnosis) -> list[str]:
    """The next experiment, what to do about what has no name, and notes."""
    told = diagnosis.next_experiment
    parts = " and ".join(f"s = {a:.2f} to {b:.2f}" for a, b in diagnosis.unvisited)
    away = f"No run visited {parts}: nothing is known of the joint there."
    return [
        *[away] * bool(parts),
        *[f"Next experiment: {told}"] * bool(told),
        *[LEARN] * (diagnosis.verdict == "unexplained"),
        *diagnosis.notes,
    ]


def _page(diagnosis: Diagnosis, drawn: bytes) -> str:
    head = ("effect", "where", "how large", "probability", "error held out, before → after")
    parts = [paragraph(diagnosis.summary)]
    what = "measured and replayed runs, and the residual force"
    parts.append(embedded(drawn, what))
    if diagnosis.effects:
        parts.append(table(head, [_row(one, diagnosis.unit) for one in diagnosis.effects]))
    parts += map(paragraph, (*_candidates(diagnosis), *_after(diagnosis)))
    return page(f"{diagnosis.joint}: what the model lacks", *parts)


def _row(found: Finding, unit: str) -> tuple[str, ...]:
    a, b = found.interval
    of = "" if found.unit == "1" else f" {found.unit}"
    return (
        found.name,
        f"s = {a:.2f} to {b:.2f}",
        f"{found.magnitude:.3g} \u00b1 {found.magnitude_error:.2g}{of}",
        percent(found.probability),
        f"{found.held_out_error_before:.2g} → {found.held_out_error_after:.2g} {unit}",
    )


def _picture(measured: Measured, profile: Profile | None, diagnosis: Diagnosis) -> "Figure":
    """Runs and their replays, and the residual force, without and with the likeliest effect."""
    from matplotlib.figure import Figure

    with house_style():
        figure = Figure(figsize=(12, 7), dpi=110, layout="constrained")
        if not measured.runs:
            shown = {"model": measured.profile} | ({"with the effect": profile} if profile else {})
            draw_models(figure, measured, shown)
            return figure
        models = [replayed("model", measured)]
        if profile is not None:
            models.append(replayed("with the effect", measured.changed(profile)))
        left, right = figure.subfigures(1, 2, squeeze=False)[0]
        joint = measured.profile.joint
        draw_runs(left, measured.runs, {one.label: one.paths for one in models}, joint.unit)
        draw_maps(right, models, joint, diagnosis.unvisited)
        left.suptitle("measured runs and replays", x=0.02, ha="left", fontsize=10)
        what = "residual force: segments of 0.1 s, \u00b1 2 standard deviations"
        right.suptitle(what, x=0.02, ha="left", fontsize=10)
        figure.suptitle(diagnosis.summary, x=0.01, ha="left", fontsize=11, wrap=True)
    return figure


def command(
    model: options.Model,
    runs: options.Runs,
    joint: options.Joints = None,
    as_json: options.JsonFile = None,
    report: options.Report = None,
    output: options.Picture = None,
    exclude: Annotated[
        list[str] | None, typer.Option(help="An effect that is not considered.")
    ] = None,
    passive: options.Passive = False,
    trust: options.Trust = None,
    templates: options.Effects = None,
    force: options.Force = False,
) -> None:
    """Tell which effect a model lacks, where, and how much of it.

    What --json writes is for joda add. Example:

        joda diagnose hidden/model.xml hidden/run?.csv --joint joint --json diagnosis.json
    """
    written = None if as_json == options.STDOUT else as_json
    if options.several(joint):
        options.one_joint_only(report, output)
        with progress_bar() as bar:
            every = diagnose_all(
                model, runs, joint or (), exclude=exclude or (), passive=passive,
                trust=read_trust(trust or ()), templates=templates or (), json=written,
                force=force, progress=bar,
            )  # fmt: skip
        if as_json == options.STDOUT:
            print_json({"joints": {name: asdict(one) for name, one in every.items()}})
            return
        for name, one in every.items():
            say(f"{name}:")
            for sentence in sentences(one):
                say(f"  {sentence}")
        if as_json:
            say(as_json)
        return
    assert joint
    with progress_bar() as bar:
        found = diagnose(
            model, joint[0], runs, exclude=exclude or (), json=written, report=report,
            picture=output, passive=passive, trust=read_trust(trust or ()),
            templates=templates or (), force=force,
            progress=bar,
        )  # fmt: skip
    if as_json == options.STDOUT:
        print_json(asdict(found))
        return
    for sentence in sentences(found):
        say(sentence)
    for path in filter(None, (written, report, output)):
        say(path)
