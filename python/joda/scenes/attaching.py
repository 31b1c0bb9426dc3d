"""Writes profiles into an existing scene: the file stays as it is, but for what the plugin needs.

Per joint that is: a named plugin instance with the profile's numbers, a reference to it in the body
that the joint moves, a trace of `frictionloss` (it makes the solver row that carries the dry
friction), and an equality constraint on the joint, inert by itself (the plugin makes its row the
damping).
"""

import os
import tempfile
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Literal, NamedTuple

import mujoco
import numpy as np

from joda.errors import JodaError
from joda.files import check_target, write_bytes
from joda.profile import Profile
from joda.scenes.actuators import Servo
from joda.scenes.editing import EditedScene
from joda.scenes.limits import Stops
from joda.scenes.mass_attributes import Heavier
from joda.scenes.model import find_joint, joint_name, load, sentence

SAME = (
    *("nq", "nu", "nbody", "ngeom", "nsensor", "jnt_type", "jnt_axis", "jnt_pos", "jnt_range"),
    *("qpos0", "body_mass", "dof_invweight0", "geom_size", "actuator_gainprm"),
)
"""What of the model must be the same afterwards."""


def attach(
    model: str | Path,
    profiles: str | Path | Profile | Sequence[str | Path | Profile],
    output: str | Path,
    *,
    joint: str | None = None,
    native: Literal["replace", "keep"] = "replace",
    also: Mapping[str, str] = MappingProxyType({}),
    force: bool = False,
) -> list[str]:
    """Writes a scene in which joints behave as their profiles say.

    Args:
        model: MJCF or URDF file. All that is not named below stays byte for byte; URDF, and joints
            that MuJoCo generates (replicate, attach), are first written out by MuJoCo.
        profiles: one or several profiles, or their `composed.json` files. A joint that carries one
            already gets the new one in its place.
        output: the scene to write. File references are adapted if its folder is another.
        joint: which joint gets the (only) profile, where that is not the profile's `joint.name`;
            see `joda.scenes.model.find_joint` for joints without a name.
        native: "replace" sets the joint's own damping, stiffness and frictionloss to zero; "keep"
            lets them act besides the profile.
        also: further MJCF attributes of the joint to set, with the (only) profile.
        force: overwrite `output`.

    Returns:
        What was done, one sentence each.

    Raises:
        JodaError: a file cannot be read or written, a joint does not exist or does not fit.
    """
    output = Path(output)
    check_target(output, force)
    made = attached(model, profiles, output, joint=joint, native=native, also=also)
    write_bytes(output, made.content)
    return made.notes


class Attached(NamedTuple):
    """A scene with profiles: the file's content, what was done, and the scene compiled."""

    content: bytes
    notes: list[str]
    model: mujoco.MjModel


def in_scene(model: Path, profile: Profile, joint: str | None = None) -> mujoco.MjModel:
    """The scene that `attach` would write, compiled, without a file; raises JodaError as that."""
    with tempfile.TemporaryDirectory() as folder:
        return attached(model, profile, Path(folder, "scene.xml"), joint=joint).model


def attached(
    model: str | Path,
    profiles: str | Path | Profile | Sequence[str | Path | Profile],
    output: Path,
    *,
    joint: str | None = None,
    native: Literal["replace", "keep"] = "replace",
    also: Mapping[str, str] = MappingProxyType({}),
    servo: Servo | None = None,
    heavier: Heavier | None = None,
    stops: Stops | None = None,
) -> Attached:
    """The scene that `attach`, with the same arguments, writes to `output`.

    Args:
        model, profiles, output, joint, native, also: as there.
        servo: of the actuators on the (only) joint, with another gain or delay; None: as they are.
        heavier: what the (only) joint moves is so much so; None: it is as it was.
        stops: of the (only) joint's ends of the range; None: as they were.
    """
    model = Path(model)
    items = [profiles] if isinstance(profiles, str | Path | Profile) else list(profiles)
    loaded = [item if isinstance(item, Profile) else Profile.read(item) for item in items]
    if joint is not None and len(loaded) != 1:
        raise JodaError("--joint goes with exactly one profile; each profile names its own joint.")
    spec, compiled = load(model)
    targets = [find_joint(compiled, joint or profile.joint.name) for profile in loaded]
    for target in targets:
        if targets.count(target) > 1:
            raise JodaError(f"joint '{joint_name(compiled, target)}' is given two profiles.")

    scene = EditedScene(model, spec, compiled, targets)
    for target, profile in zip(targets, loaded, strict=True):
        scene.add(target, profile, native, also, heavier, stops)
    if servo is not None:
        scene.drive(targets[0], servo)
    if heavier is not None:
        scene.weigh(targets[0], heavier)
    content = scene.finish(output.parent)
    changed = ["dof_invweight0"] * (scene.heavier or "armature" in also)
    changed += ["actuator_gainprm"] * (servo is not None)
    changed += ["body_mass"] * (heavier is not None)
    after = _verify(output, content, compiled, changed)
    return Attached(content, scene.notes, after)


def _verify(
    output: Path, content: bytes, before: mujoco.MjModel, changed: Collection[str]
) -> mujoco.MjModel:
    """Compiles the scene where it will lie; raises JodaError if it is not the model it was, but for
    what was changed."""
    trial = output.with_name(f".{output.stem}.{os.getpid()}.xml")
    try:
        trial.write_bytes(content)
        after = mujoco.MjModel.from_xml_path(str(trial))
        mujoco.MjData(after)
    except OSError as error:
        raise JodaError(f"{output}: cannot be written ({error.strerror}).") from None
    except (ValueError, mujoco.FatalError) as error:
        raise JodaError(f"{output}: the scene would not load: {sentence(error)}") from None
    finally:
        trial.unlink(missing_ok=True)
    for name in SAME:
        if name in changed:
            continue
        old, new = np.array(getattr(before, name)), np.array(getattr(after, name))
        if old.shape != new.shape or not np.allclose(old, new, rtol=1e-3, atol=1e-6):
            raise JodaError(
                f"{output}: written out by MuJoCo the model is another one ({name}); "
                "attach to the file in which the joint itself is written."
            )
    return after
