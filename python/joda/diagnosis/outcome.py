"""Around a mended joint: its runs read, its scene, profile and picture written."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from joda.diagnosis.adding import Error
from joda.diagnosis.applied_corrections import AppliedCorrections
from joda.diagnosis.settings import SETTINGS
from joda.files import check_targets, named_like
from joda.measured.corrections_file import corrections_beside, corrections_text
from joda.measured.errors import MULTIPLE
from joda.measured.excerpts import excerpts
from joda.measured.maps import draw_models, draw_runs, shade
from joda.measured.measured_joint import Measured
from joda.measured.reading import read_measured
from joda.measured.runs import check_known
from joda.measured.sensing import RIGHT
from joda.measured.trust import trusting
from joda.measured.visited import unvisited
from joda.pictures.changes import draw_channels
from joda.pictures.style import house_style
from joda.profile import Profile
from joda.scenes.actuators import Servo
from joda.scenes.attaching import attached
from joda.scenes.limits import Stops
from joda.template import read_templates

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure

NO_TRUST: Mapping[str, float] = MappingProxyType({})
"""Nothing is told of how far off a number may be."""


def read_runs(
    model: str | Path,
    joint: str,
    runs: Sequence[str | Path],
    passive: bool = False,
    trust: Mapping[str, float] = NO_TRUST,
    templates: Sequence[str | Path] = (),
) -> Measured:
    """As `joda.measured.reading.read_measured`, but of long runs only parts.

    It is noted where that is so, and that curves beside runs say nothing. `trust`: how far off
    numbers may be (`joda.measured.trust`); `templates`: further folders of effect templates.

    Raises:
        JodaError: a file cannot be read, or what it holds cannot be of this joint; no such
            number may be off; or a folder holds no templates.
    """
    told, effects = trusting(trust), read_templates(templates)
    measured = read_measured(model, joint, runs, passive).trusting(told)
    check_known(measured.runs)
    ignored = tuple(
        f"{one.curve.name}: a quasi-static curve, not used as there are timed runs."
        for one in measured.curves
        if measured.runs
    )
    parts, of, cut = excerpts(measured.runs)
    return replace(
        measured.with_runs(parts, of), notes=(*measured.notes, *ignored, *cut), templates=effects
    )


def beside(
    scene: Path, force: bool, inputs: Sequence[str | Path], report: str | Path | None = None
) -> tuple[Path, Path]:
    """The profile's and the picture's file beside a scene, where corrections may be too.

    Raises:
        JodaError: one of them, or of the report, exists, is read (`inputs`) or cannot be made.
    """
    composed, picture = (named_like(scene, suffix) for suffix in (".composed.json", ".png"))
    more = [Path(report)] if report else []
    check_targets([scene, composed, picture, corrections_beside(scene), *more], force, inputs)
    return composed, picture


def scene_files(
    model: Path,
    profile: Profile,
    scene: Path,
    composed: Path,
    servo: Servo | None = None,
    right: AppliedCorrections | None = None,
    stops: Stops | None = None,
) -> tuple[dict[Path, bytes | str], list[str]]:
    """What a scene with a whole profile (`joda.scenes.native`) and the profile's file hold.

    Args:
        model: the scene as it was.
        profile: of its joint.
        scene, composed: to be written.
        servo: of the joint's actuators, with another gain or delay; None: as they are.
        right: what was set right of what the joint moves and of the measurement.
        stops: of the ends of its range; None: as they were.

    Returns:
        contents by path, and what is done there, a sentence each.
    """
    name, heavier = profile.joint.name, right.heavier if right else None
    content, notes, _ = attached(
        model, profile, scene, joint=name, servo=servo, heavier=heavier, stops=stops
    )
    files: dict[Path, bytes | str] = {scene: content, composed: profile.to_json()}
    if right and right.sensing != RIGHT:
        own = corrections_beside(scene)
        files[own] = corrections_text({name: right.sensing})
        notes.append(
            f"What the measurement has wrong is in {own}: joda compare --corrections reads it."
        )
    return files, notes


def parting(after: Error, noise: float, blocks: bool) -> list[str]:
    """A sentence where what was held out parts as a whole although segments of it do not."""
    if after.whole is None or after.window > MULTIPLE * noise:
        return []
    if after.whole < SETTINGS.whole_runs.parted * max(after.window, noise):
        return []
    return [
        f"Free runs{' of blocks' if blocks else ''} still part from the measured ones although "
        "segments of 0.4 s hardly do: a small error adds up over a run, or decides near a barrier "
        "or at rest where the joint goes."
    ]


def wholes(blocks: bool) -> str:
    """The error of what is replayed as a whole: runs that were held out, or blocks of them."""
    return "free-run error of blocks" if blocks else "free-run error"


def nearby(error: Error, blocks: bool) -> str:
    """What the error that every effect must lower is of; blocks may be shorter than a segment."""
    if error.whole is None:
        return "force"
    return f"segment error ({'up to ' if blocks else ''}0.4 s)"


def errors_described(before: Error, after: Error, noise: float, unit: str, blocks: bool) -> str:
    """Errors before and after for a person."""
    if before.whole is None:
        return (
            f"force {before.window:.3g} → {after.window:.3g} {unit} RMS (noise {noise:.2g} {unit})"
        )
    return (
        f"{wholes(blocks)} {before.whole:.3g} → {after.whole:.3g} {unit} RMS, "
        f"{nearby(before, blocks)} "
        f"{before.window:.3g} → {after.window:.3g} {unit} (noise {noise:.2g} {unit})"
    )


def draw_repaired(part: "Figure | SubFigure", held: Measured, after: Profile) -> None:
    """The profile before and after, and what was held out with both models.

    Args:
        part: of a figure.
        held: the joint with its profile before, and runs or curves.
        after: its profile afterwards.
    """
    joint, found = after.joint, held.context
    left, right = part.subfigures(1, 2, squeeze=False)[0]
    panels = left.subplots(3, 1, sharex=True, height_ratios=[2, 1, 1])
    gravity = np.array(found.positions), -np.array(found.gravity_force)
    draw_channels(panels, held.profile, after, gravity if np.any(gravity[1]) else None)
    lo, hi = joint.range
    away = [(lo + a * (hi - lo), lo + b * (hi - lo)) for a, b in unvisited(held)]
    for axes in panels:
        shade(axes, away)
        if not axes.dataLim.height:
            axes.set(ylim=(-1, 1), yticks=[0])
    panels[0].legend(frameon=False, fontsize=8, ncols=3)
    panels[-1].set_xlabel(f"joint position ({joint.unit})")
    effects = "".join(f"\n+ {effect.described()}" for effect in after.effects)
    title = f"{joint.name}: profile{effects}"
    left.suptitle(title, x=0.02, ha="left", fontsize=10, parse_math=False)
    if not held.runs:
        models = {"before, held out of the fit": held.profile, "after": after}
        draw_models(right, held, models)
        return
    paths = {"before": held.paths(), "after": held.changed(after).paths()}
    draw_runs(right, held.runs, paths, joint.unit)
    right.suptitle("held out of the fit", x=0.02, ha="left", fontsize=10)


def repaired_picture(held: Measured, after: Profile) -> "Figure":
    """`draw_repaired` as a figure."""
    from matplotlib.figure import Figure

    with house_style():
        figure = Figure(figsize=(12, 7), dpi=110, layout="constrained")
        draw_repaired(figure, held, after)
        return figure
