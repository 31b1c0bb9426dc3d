"""The diagnostic picture of a file: a profile, or a profile as it stands in a scene."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from joda.errors import JodaError
from joda.files import file_name
from joda.pictures.draw import draw
from joda.pictures.style import write_png
from joda.profile import Profile
from joda.scenes.model import find_joint
from joda.scenes.motion import gravity_force
from joda.scenes.scene import open_scene
from joda.terminal import options
from joda.terminal.say import say


def plot(
    source: str | Path,
    output: str | Path | None = None,
    *,
    joint: str | None = None,
    force: bool = False,
) -> Path:
    """Draws a profile, for a scene with the force that would balance gravity.

    Args:
        source: `composed.json`, or a scene (.xml) that carries profiles.
        output: PNG to write; by default beside the source with its name, in a scene of several
            profiles the joint's too.
        joint: which joint of a scene; needed if several carry a profile.
        force: overwrite the output.

    Returns:
        the PNG's path.

    Raises:
        JodaError: a file cannot be read or written, or the joint carries no profile.
    """
    source = Path(source)
    if source.suffix.lower() == ".json":
        if joint is not None:
            raise JodaError(f"{source}: --joint is for scenes; a profile is for one joint.")
        target = Path(output) if output else source.with_suffix(".png")
        write_png(draw(Profile.read(source)), target, force)
        return target
    model, profiles = open_scene(source)
    listed = ", ".join(f"'{name}'" for name in profiles)
    if joint is None and len(profiles) > 1:
        raise JodaError(f"{source}: several joints carry a profile; choose with --joint: {listed}.")
    name = next(iter(profiles)) if joint is None else joint
    if name not in profiles:
        raise JodaError(f"{source}: joint '{name}' carries no profile; these do: {listed}.")
    profile = profiles[name]
    positions = np.linspace(*profile.joint.range, 201)
    balance = -gravity_force(model, find_joint(model, name), positions)
    suffix = f".{file_name(name)}.png" if len(profiles) > 1 else ".png"
    target = Path(output) if output else source.with_suffix(suffix)
    write_png(draw(profile, (positions, balance)), target, force)
    return target


def command(
    source: Annotated[Path, typer.Argument(help="composed.json, or a scene.", show_default=False)],
    joint: Annotated[
        str | None, typer.Option("--joint", help="Which joint of a scene with several profiles.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="PNG to write [default: beside SOURCE].")
    ] = None,
    force: options.Force = False,
) -> None:
    """Draw a profile: its components, gravity's equilibrium.

    Gravity is drawn for a scene. Example:

        joda plot scene.xml -o profile.png
    """
    say(plot(source, output, joint=joint, force=force))
