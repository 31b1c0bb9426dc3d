"""Writes a scene with profiles for who has no plugin, and says how near the constants come."""

import sys
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from joda.errors import JodaError
from joda.exporting.markup import meshes_of
from joda.exporting.native import native
from joda.exporting.nearest import Format, Nearest, nearest
from joda.exporting.plain import lacking, plain
from joda.exporting.sdf import sdf
from joda.exporting.tree import Link, left_out, links_of, obj
from joda.exporting.urdf import urdf
from joda.exporting.usd import usd
from joda.files import check_target, file_name, write_together
from joda.scenes.model import find_joint, load
from joda.scenes.native import whole_profile
from joda.scenes.scene import profiles_of
from joda.terminal import options
from joda.terminal.say import print_json, say


@dataclass(frozen=True)
class Exported:
    """What `joda export` has written.

    Attributes:
        files: the file, and the meshes beside it.
        joints: the constants of each joint that carried a profile, with their errors.
        notes: what is not in the file, one sentence each.
    """

    files: tuple[Path, ...]
    joints: tuple[Nearest, ...]
    notes: tuple[str, ...]


def export(scene: str | Path, to: Format, output: str | Path, *, force: bool = False) -> Exported:
    """Writes the nearest that a format can express of a scene with profiles.

    Args:
        scene: MJCF file that carries profiles.
        to: "native": MJCF without the plugin, with MuJoCo's polynomial spring and damping; "urdf":
            damping and friction; "sdf": a linear spring, damping and friction; "usd": a drive as
            linear spring and damping, and friction as PhysX and MuJoCo read it.
        output: the file; meshes lie beside it as OBJ, but for USD, which holds them, and MJCF.
        force: overwrite files.

    Returns:
        the files, and the constants with their errors.

    Raises:
        JodaError: the scene cannot be loaded, carries no profile or holds what the format cannot;
            a file cannot be written, or not under that name; usd-core is not installed.
    """
    scene, output = Path(scene), Path(output)
    if to == "usd" and output.suffix not in (".usda", ".usd"):
        raise JodaError(f"{output}: USD is written as text; let the file's name end in .usda.")
    check_target(output, force)
    spec, model = load(scene)
    profiles = profiles_of(model)
    if not profiles:
        raise JodaError(f"{scene}: carries no profile; attach one first with: joda attach")
    ids = {name: find_joint(model, name) for name in profiles}
    own = {
        ids[name]: nearest(whole_profile(model, ids[name], profile), to)
        for name, profile in profiles.items()
    }
    told = tuple(own.values())
    if to == "native":
        write_together({output: native(scene, spec, own, output.parent)})
        return Exported((output,), told, tuple(_lost(told)))

    links, left = links_of(model)
    moved = {link.number: link.joint for link in links if link.kind in ("hinge", "slide")}
    scene_own = [plain(model, joint, name) for joint, name in moved.items() if joint not in own]
    notes = [*left, *_lacking(links, to), *lacking(scene_own, to), *_lost(told)]
    by_name = {one.joint: one for one in scene_own}
    by_name |= {moved[joint]: one for joint, one in own.items()}
    name = file_name(output.stem)
    if to == "usd":
        write_together({output: usd(model, name, links, by_name, notes)})
        return Exported((output,), told, tuple(notes))
    meshes = {k: f"{name}.mesh_{k}.obj" for k in sorted(meshes_of(links))}
    write = urdf if to == "urdf" else sdf
    contents: dict[Path, bytes | str] = {
        output.with_name(file): obj(model, mesh) for mesh, file in meshes.items()
    }
    for path in contents:
        check_target(path, force)
    contents[output] = write(name, links, by_name, meshes, notes)
    write_together(contents)
    return Exported((output, *(path for path in contents if path != output)), told, tuple(notes))


def _lost(told: Sequence[Nearest]) -> list[str]:
    return [f"{one.joint}: not in it is {effect}" for one in told for effect in one.lost]


def _lacking(links: Sequence[Link], to: Format) -> list[str]:
    """Shapes and inertias that the format has no word for."""
    out = []
    armatures = sum(link.armature > 0 for link in links)
    if armatures and to != "usd":
        out.append(left_out(armatures, "joint armature"))
    if to == "urdf":
        kinds = [shape.kind for link in links for shape in link.shapes]
        counted = [(kinds.count(kind), kind) for kind in ("plane", "ellipsoid")]
        out += [f"URDF has no {kind}: {left_out(n, kind)}" for n, kind in counted if n]
    return out


def command(
    scene: Annotated[Path, typer.Argument(help="Scene with profiles.", show_default=False)],
    to: Annotated[
        Literal["native", "urdf", "sdf", "usd"],
        typer.Option(help="native: MJCF without the plugin; urdf; sdf; usd.", show_default=False),
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="File to write.", show_default=False)
    ],
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Write the nearest that URDF, SDF, USD or plain MJCF can say.

    Example:

        joda export scene.xml --to urdf -o scene.urdf
    """
    result = export(scene, to, output, force=force)
    if as_json:
        print_json({**asdict(result), "files": [str(path) for path in result.files]})
        return
    _say_nearest(result.joints)
    for note in result.notes:
        say(note)
    for path in result.files:
        say(path)


def _say_nearest(joints: Iterable[Nearest]) -> None:
    """The table of `joda export`."""
    from rich.console import Console
    from rich.table import Table

    table = Table("joint", "what", "error: rms", "largest", "of", box=None, pad_edge=False)
    for joint in joints:
        for error in joint.errors:
            least = 1e-9 * error.size  # rounding
            sizes = (
                f"{size:.3g}" if size > least else "0"
                for size in (error.rms, error.largest, error.size)
            )
            table.add_row(joint.joint, f"{error.what}, {error.unit}", *sizes)
    Console(width=None if sys.stdout.isatty() else 110).print(table)
