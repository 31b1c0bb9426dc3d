"""Adds a diagnosed effect to a joint's profile, if that lowers the error on runs held out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

import typer

from joda.diagnosis.adding import AddedEffect, Error, add_effect, by_all, error, with_stop
from joda.diagnosis.applied_corrections import from_report
from joda.diagnosis.end_stops import stops_described
from joda.diagnosis.findings import read_diagnosis
from joda.diagnosis.learning.fitting import Learned
from joda.diagnosis.learning.law import LABEL
from joda.diagnosis.learning.report import Account, account, learned_picture
from joda.diagnosis.learning.report import sentences as law_sentences
from joda.diagnosis.learning.term_selection import learn
from joda.diagnosis.outcome import (
    NO_TRUST,
    beside,
    errors_described,
    nearby,
    parting,
    read_runs,
    repaired_picture,
    scene_files,
)
from joda.diagnosis.overlap import places
from joda.diagnosis.phrases import check_effect, extrapolated, named
from joda.diagnosis.split import held_out, in_blocks, parted
from joda.errors import JodaError
from joda.files import write_together
from joda.measured.corrections_file import corrections_beside
from joda.measured.trust import read_trust
from joda.measured.visited import unvisited_part
from joda.pictures.changes import changes
from joda.pictures.style import png
from joda.terminal import options
from joda.terminal.progress import spinner
from joda.terminal.say import print_json, say

FILES = ("scene", "composed", "picture", "corrections")


@dataclass(frozen=True)
class Added:
    """What came of adding an effect.

    Attributes:
        scene, composed, picture: the files that were written; None where nothing was added: then
            nothing is written.
        corrections: the file of what the diagnosis says that the measurement has wrong; None where
            nothing of it is.
        effect: its name.
        name: the same in words.
        added: whether the scene has it.
        reason: why it has not, a clause; None if it has.
        before, after: errors on what was held out of the fit.
        noise_floor: of what was measured there.
        unit: of the errors and the noise: rad or m; N·m or N where there are only curves.
        held_out: what was held out, in words.
        blocks: whether that are blocks of runs, not whole runs.
        departures: where what was added is not what the model gave or where it was diagnosed, in
            sentences.
        changes: a line per changed component.
        notes: what the user should be told, a sentence each.
        learned: the law, where one was learned.
    """

    scene: Path | None
    composed: Path | None
    picture: Path | None
    corrections: Path | None
    effect: str
    name: str
    added: bool
    reason: str | None
    before: Error
    after: Error
    noise_floor: float
    unit: str
    held_out: str
    blocks: bool
    departures: tuple[str, ...]
    changes: tuple[str, ...]
    notes: tuple[str, ...]
    learned: Account | None = None

    def as_json(self) -> dict[str, Any]:
        """The same for JSON, which has no paths."""
        content = asdict(self)
        paths = {key: content[key] for key in FILES}
        return content | {key: path and str(path) for key, path in paths.items()}


def add(
    model: str | Path,
    joint: str,
    diagnosis: str | Path,
    runs: Sequence[str | Path],
    output: str | Path,
    *,
    effect: str | None = None,
    passive: bool = False,
    trust: Mapping[str, float] = NO_TRUST,
    templates: Sequence[str | Path] = (),
    force: bool = False,
    progress: Callable[[str], None] = lambda what: None,
) -> Added:
    """Adds an effect to a joint's profile and fits everything together.

    Of four or more runs one of every three is held out of the fit, of fewer every fourth block in
    which the joint moves (`joda.diagnosis.split`); of fewer quasi-static curves, where there are no
    runs, every fourth stretch. The effect is added only if it is plausible and clearly lowers the
    error there; else nothing is written. With the effect learned_force a law that no catalogue has
    is learned from the runs.

    Args:
        model: MJCF or URDF, with or without a profile on the joint.
        joint: its name or address, see `joda.scenes.model.find_joint`.
        diagnosis: what `joda.diagnose` wrote as JSON.
        runs: CSV files with time, position and perhaps force, or quasi-static curves.
        output: scene to write; beside it, with its name, go .composed.json and .png, and
            .corrections.json where the diagnosis says that something of the measurement is wrong.
        effect: which one; None: the diagnosis' first.
        passive: whether the actuators on the joint, if there are any, were off.
        trust: how far off numbers may be, as in `joda.diagnose`.
        templates: further folders of effect templates, as there.
        force: overwrite what exists.
        progress: told what is being done.

    Returns:
        what was written, and the errors before and after.

    Raises:
        JodaError: a file cannot be read or written, is no diagnosis of this joint or names no
            effect.
    """
    target = Path(output)
    composed, picture = beside(target, force, [*runs, diagnosis])
    told = read_diagnosis(Path(diagnosis))
    name, direction, near = _chosen(told, Path(diagnosis), effect)
    measured = read_runs(model, joint, runs, passive, trust, templates)
    check_effect(name, measured.templates)
    driven = measured.joint_model.servo is not None
    if right := from_report(told.get("corrections", ()), driven):
        measured = right.of(measured)
    own = measured.profile.joint
    if told.get("joint", own.name) != own.name:
        raise JodaError(
            f"{diagnosis}: the diagnosis is for joint '{told['joint']}', "
            f"but --joint is '{own.name}'."
        )
    train, held = parted(measured)
    law: Learned | None = None
    if reason := _no_help(told, name) or (None if effect else _confounded(told)):
        before = error(held)
        added_effect = AddedEffect(train.profile, None, before, before, reason)
    elif name == LABEL:
        added_effect, law = learn(train, held, progress)
    else:
        added_effect = add_effect(train, held, name, direction, near, progress)
        if added_effect.effect:
            progress("the ends of the range")
            added_effect = with_stop(added_effect, train, held)
            progress("all numbers once more, to all runs")
            known = added_effect.profile, name, added_effect.departs
            added_effect = replace(added_effect, profile=by_all(measured, *known, near))
    nearest = next((one["effect"] for one in told["effects"] if one["effect"] != LABEL), None)
    law_account = account(train, held, law, added_effect.after.window, nearest) if law else None
    notes: list[str] = []
    stops = added_effect.stops
    moved = stops_described(measured.joint_model, stops)
    corrections: Path | None = corrections_beside(target)
    if added_effect.effect:
        if not law_account:  # of a learned law nothing is where no run was
            there = places(added_effect.profile, name, measured.profile)[0]
            notes += filter(None, [extrapolated(unvisited_part(measured, there)).strip()])
        progress("drawing")
        files, more = scene_files(
            Path(model), added_effect.profile, target, composed, right=right, stops=stops
        )
        corrections = corrections if corrections in files else None
        notes += more
        drawn = (
            learned_picture(held, added_effect.profile, law_account)
            if law_account
            else repaired_picture(held, added_effect.profile)
        )
        write_together(files | {picture: png(drawn)})
    added = added_effect.effect is not None
    return Added(
        scene=target if added else None,
        composed=composed if added else None,
        picture=picture if added else None,
        corrections=corrections if added else None,
        effect=name,
        name=named(name, measured.templates),
        added=added,
        reason=added_effect.reason,
        before=added_effect.before,
        after=added_effect.after,
        noise_floor=held.floor,
        unit=held.unit,
        held_out=held_out(measured, held),
        blocks=in_blocks(measured, held),
        departures=added_effect.departs.sentences,
        changes=(*changes(measured.profile, added_effect.profile), *moved),
        notes=(*measured.notes, *notes),
        learned=law_account,
    )


def sentences(added: Added) -> list[str]:
    """What came of it, for a person."""
    what = added.name
    errors = errors_described(
        added.before, added.after, added.noise_floor, added.unit, added.blocks
    )
    if added.added:
        out = [f"Added {what}. On what was held out of the fit ({added.held_out}): {errors}."]
    else:
        near, error = nearby(added.before, added.blocks), added.before.window
        missed = f"{near} {error:.3g} {added.unit}, " if isfinite(error) else ""
        out = [
            f"Not added: {what}, as {added.reason} ({added.held_out}; {missed}"
            f"noise {added.noise_floor:.2g} {added.unit}). Nothing was written."
        ]
    told = parting(added.after, added.noise_floor, added.blocks) if added.added else []
    law = law_sentences(added.learned) if added.learned else []
    return [*out, *law, *told, *added.departures, *added.changes, *added.notes]


def _chosen(
    told: dict[str, Any], path: Path, effect: str | None
) -> tuple[str, str | None, tuple[float, float] | None]:
    """Name, direction and place of the effect to add; None for what the diagnosis does not say."""
    found = {one["effect"]: one for one in reversed(told["effects"])}
    if effect is None:
        if told.get("verdict") in ("adequate", "unexplained") or not found:
            verdict = told.get("verdict", "no effect")
            raise JodaError(
                f"{path}: names no effect to add (verdict: {verdict}); choose one with --effect "
                f"({LABEL} learns a law from the runs)."
            )
        effect = told["effects"][0]["effect"]
    said = found.get(effect, {})
    return effect, said.get("direction"), _interval(said.get("interval"), path)


def _no_help(told: dict[str, Any], effect: str) -> str | None:
    """Why an effect need not be tried, a clause: the diagnosis itself found it no better."""
    for one in told["effects"]:
        before, after = one.get("held_out_error_before"), one.get("held_out_error_after")
        known = isinstance(before, float) and isinstance(after, float)
        if one["effect"] == effect and known and after >= before:
            return (
                "the diagnosis found the held-out segment error of its fit no smaller with it "
                f"({before:.2g} → {after:.2g})"
            )
    return None


def _confounded(told: dict[str, Any]) -> str | None:
    """Why nothing is added before somebody asks for it by name, a clause; None if nothing is in
    doubt."""
    doubt = told.get("confounder")
    return f"{doubt}; --effect adds it all the same" if isinstance(doubt, str) else None


def _interval(said: Any, path: Path) -> tuple[float, float] | None:
    if said is None:
        return None
    numbers = isinstance(said, list) and all(isinstance(end, int | float) for end in said)
    if not numbers or len(said) != 2 or not 0 <= said[0] < said[1] <= 1:
        raise JodaError(f"{path}: interval must be two increasing numbers from 0 to 1, not {said}.")
    return said[0], said[1]


def command(
    model: options.Model,
    runs: options.Runs,
    joint: options.Joint,
    diagnosis: Annotated[
        Path, typer.Option(help="What joda diagnose --json wrote.", show_default=False)
    ],
    output: options.Scene,
    effect: Annotated[
        str | None, typer.Option(help="Which effect [default: the diagnosis' first].")
    ] = None,
    passive: options.Passive = False,
    trust: options.Trust = None,
    templates: options.Effects = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Add the effect that a diagnosis names, if that helps.

    It helps if it is plausible and clearly lowers the error on runs held out; else nothing is
    written. Leaves, beside the scene, its .composed.json and .png, and .corrections.json where the
    diagnosis says that the runs' force, clock or zero is wrong. Example:

        joda add hidden/model.xml hidden/run?.csv --joint joint --diagnosis diagnosis.json -o new.xml
    """  # noqa: E501
    with spinner("add") as progress:
        added = add(
            model, joint, diagnosis, runs, output, effect=effect, passive=passive,
            trust=read_trust(trust or ()), templates=templates or (), force=force,
            progress=progress,
        )  # fmt: skip
    if as_json:
        print_json(added.as_json())
        return
    for sentence in sentences(added):
        say(sentence)
    for path in filter(None, (added.scene, added.composed, added.picture, added.corrections)):
        say(path)
