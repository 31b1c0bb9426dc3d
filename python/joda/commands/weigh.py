"""Gives what a joint moves the mass that its size suggests, where the model's own cannot be."""

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import mujoco
import numpy as np
import typer

from joda.errors import JodaError
from joda.files import check_target, write_bytes
from joda.scenes.masses import implausible_mass, misplaced
from joda.scenes.materials import Weight, estimate_weight
from joda.scenes.model import find_joint, joint_name, load, load_model, moves_with, write_out
from joda.terminal import options
from joda.terminal.say import say


@dataclass(frozen=True)
class Weighed:
    """What was made of a part's mass.

    Attributes:
        before: of what the joint moves in the model, kg.
        estimate: from its size and material.
        warnings: why the mass before cannot be, a sentence each; empty where it can.
        output: the model with the estimate.
    """

    before: float
    estimate: Weight
    warnings: tuple[str, ...]
    output: Path

    def describe(self) -> str:
        """The change in a line."""
        return f"{self.before:.3g} kg became {self.estimate.mass:.3g} kg ({self.estimate.material})"


def weigh(
    model: str | Path,
    joint: str,
    output: str | Path,
    *,
    force: bool = False,
) -> Weighed:
    """Writes a model in which what a joint moves has an estimated mass.

    Masses and inertias of all bodies that the joint moves are multiplied by one factor; centres of
    mass stay. Where mass or inertia lies where nothing of the part is, centres and inertias become
    those of the bodies' geoms. The estimate is rough: within a factor of two or three of what a
    scale would say.

    Args:
        model: MJCF or URDF file.
        joint: its name or address, see `joda.scenes.model.find_joint`.
        output: MJCF to write; MuJoCo writes it out, file references are adapted.
        force: overwrite `output`; and replace a mass that can be.

    Returns:
        what was changed.

    Raises:
        JodaError: a file cannot be read or written, the joint does not exist, moves no geoms,
            or its mass can be (without `force`).
    """
    source, target = Path(model), Path(output)
    check_target(target, force)
    spec, compiled = load(source)
    number = find_joint(compiled, joint)
    name, body = joint_name(compiled, number), int(compiled.jnt_bodyid[number])
    before, estimate = float(compiled.body_subtreemass[body]), estimate_weight(compiled, number)
    if estimate is None:
        raise JodaError(f"{source}: joint '{name}' moves no geoms, so nothing tells its size.")
    warnings = implausible_mass(compiled, number, 1.0, True)
    if not warnings and not force:
        raise JodaError(
            f"{source}: joint '{name}' moves {before:.3g} kg, which can be (by its size about "
            f"{estimate.mass:.3g} kg); add --force to replace it all the same."
        )
    factor = estimate.mass / before
    shaped = (
        _by_geoms(spec) if misplaced(compiled, number, moves_with(compiled, body)) else compiled
    )
    for index in np.flatnonzero(moves_with(compiled, body)):
        part, like = spec.bodies[index], shaped if shaped.body_mass[index] > 0 else compiled
        part.explicitinertial = True
        part.mass = float(compiled.body_mass[index]) * factor
        part.inertia = like.body_inertia[index] * part.mass / max(like.body_mass[index], 1e-12)
        part.ipos, part.iquat = like.body_ipos[index], like.body_iquat[index]
        part.fullinertia = [np.nan] * 6
    spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_AUTO
    text = _written(spec, source, target.parent)
    write_bytes(target, text)
    after = load_model(target)
    found = float(after.body_subtreemass[after.jnt_bodyid[find_joint(after, joint)]])
    if not np.isclose(found, estimate.mass, rtol=1e-3):
        raise JodaError(f"{target}: MuJoCo wrote {found:.3g} kg, not {estimate.mass:.3g} kg.")
    return Weighed(before, estimate, warnings, target)


def _by_geoms(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """The model whose bodies have the masses and inertias of their geoms."""
    copy = spec.copy()
    copy.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    return copy.compile()


def _written(spec: mujoco.MjSpec, source: Path, folder: Path) -> bytes:
    """The spec as MuJoCo writes it, for a file that will lie in a folder."""
    found = {}
    for kind in ("meshdir", "texturedir"):
        absolute = (source.parent / (getattr(spec, kind) or "")).resolve()
        setattr(spec, kind, str(absolute))  # while it is written, MuJoCo opens the files
        found[kind] = absolute
    text = write_out(spec, source).decode()
    for kind, absolute in found.items():
        near = Path(os.path.relpath(absolute, folder.resolve())).as_posix()
        text = re.sub(rf'{kind}="[^"]*"', f'{kind}="{near}/"'.replace("\\", "/"), text)
    return text.encode()


def command(
    model: options.Model,
    joint: options.Joint,
    output: options.Scene,
    force: Annotated[
        bool,
        typer.Option("--force", help="Overwrite the output; replace a plausible mass too."),
    ] = False,
) -> None:
    """Give what a joint moves a mass estimated from its size.

    For models whose mass is not plausible, as `joda context` and `joda generate` say. Rough,
    within a factor of three; a scale is better. Example:

        joda weigh out/oven.xml --joint door -o weighed.xml --force
    """
    done = weigh(model, joint, output, force=force)
    for warning in done.warnings:
        say(warning)
    say(f"{done.describe()}; weigh it if you can.", output)
