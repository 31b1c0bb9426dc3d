"""MuJoCo models from files, and the joints in them; every failure is one sentence."""

import re
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from joda.errors import JodaError
from joda.profile import Joint, describe
from joda.scenes.engine import FORGETS_INSTANCES
from joda.scenes.model_cache import Loaded, cached
from joda.scenes.plugin_copies import refuse_copied_plugins

_TYPES = {
    int(getattr(mujoco.mjtJoint, f"mjJNT_{name.upper()}")): name
    for name in ("free", "ball", "slide", "hinge")
}
_SCALAR = ("hinge", "slide")
LONGEST_NAME = 1000
"""Bytes of a name in a model."""
MASSLESS = (
    " A link without a mass, as PartNet-Mobility's helpers between two joints, needs a little: "
    'write <mujoco><compiler boundmass="1e-4" boundinertia="1e-7"/></mujoco> into the <robot>. '
    "One that is a part itself, and has visuals only, needs its <inertial>."
)
"""What to do about bodies without a mass; in MJCF the same attributes of its <compiler>."""


def load(path: Path) -> Loaded:
    """An MJCF or URDF file, parsed and compiled; raises JodaError."""
    return cached(path, _load)


def _load(path: Path) -> Loaded:
    if not path.is_file():
        raise JodaError(f"{path}: no such file; give an MJCF or URDF file.")
    refuse_copied_plugins(path)
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        model = spec.compile()
        bytes(model.names).decode()
    except UnicodeDecodeError:
        raise _not_utf8(path) from None
    except (ValueError, RuntimeError, mujoco.FatalError) as error:  # RuntimeError: out of memory
        said = sentence(error)
        remedy = MASSLESS if "mjMINVAL" in said else ""
        raise JodaError(f"{path}: MuJoCo cannot load it: {said}{remedy}") from None
    _check_bounds(path, model)
    return spec, model


def _check_bounds(path: Path, model: mujoco.MjModel) -> None:
    """Raises JodaError for names that nobody can read and masses that make all else NaN."""
    names = bytes(model.names).split(b"\0")
    longest = max(
        len(name) for name in names if not name.startswith(b"joda_")
    )  # longer than theirs
    if longest > LONGEST_NAME:
        raise JodaError(f"{path}: has a name of {longest} letters; give at most {LONGEST_NAME}.")
    heaviest = max(model.body_mass.max(), model.body_inertia.max())
    if heaviest > mujoco.mjMAXVAL:
        raise JodaError(
            f"{path}: has a mass or an inertia of {heaviest:.3g} kg or kg·m²; MuJoCo computes with "
            f"at most {mujoco.mjMAXVAL:g}."
        )


def write_out(spec: mujoco.MjSpec, path: Path) -> bytes:
    """The spec that was loaded from `path` as MuJoCo writes it, in one file; raises JodaError."""
    try:
        return str(spec.to_xml()).encode()
    except UnicodeDecodeError:
        raise _not_utf8(path) from None


def load_model(path: Path) -> mujoco.MjModel:
    """An MJCF or URDF file, compiled; raises JodaError."""
    return load(path)[1]


def _not_utf8(path: Path) -> JodaError:
    return JodaError(f"{path}: it, or a file that it includes, is not UTF-8; save it as UTF-8.")


def sentence(error: Exception) -> str:
    """MuJoCo's error in one line; the plugin's own sentence where it has one."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    own = [line for line in lines if line.startswith("joda.joint_dynamics:")]
    text = own[0] if own else "; ".join(dict.fromkeys(lines)).replace(":;", ":")
    text = re.sub(r"^((XML )?Error: )+", "", text).rstrip(".")
    if FORGETS_INSTANCES and "for plugin instance" in text:
        text += (
            f"; MuJoCo {mujoco.__version__} forgets instances behind a <replicate>: put that after "
            "the body, or install MuJoCo 3.16 or newer"
        )
    return f"{text}."


def joint_type(model: mujoco.MjModel, joint: int) -> str:
    """Its type: free, ball, slide or hinge."""
    return _TYPES[int(model.jnt_type[joint])]


def joint_name(model: mujoco.MjModel, joint: int) -> str:
    """Its name, or the address "#3" that `find_joint` takes for a joint without one."""
    return model.joint(joint).name or f"#{joint}"


def find_joint(model: mujoco.MjModel, address: str) -> int:
    """The hinge or slide that `address` means.

    Args:
        model: the compiled model.
        address: the joint's name; or "body:NAME" for the only hinge or slide of a body, or
            "body:NAME:K" for its joint K (from 0); or "#K" for joint K of the model (from 0).

    Raises:
        JodaError: there is none, or it is a ball or free joint; the joints that exist are listed.
    """
    joint = _find(model, address)
    if joint is None:
        scalar = [k for k in range(model.njnt) if joint_type(model, k) in _SCALAR]
        names = ", ".join(f"'{joint_name(model, k)}'" for k in scalar) or "none"
        raise JodaError(f"joint '{address}' not found; hinges and slides of the model: {names}.")
    kind = joint_type(model, joint)
    if kind not in _SCALAR:
        raise JodaError(f"joint '{address}' is a {kind} joint; a profile needs a hinge or a slide.")
    return joint


def _find(model: mujoco.MjModel, address: str) -> int | None:
    joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, address)
    if joint >= 0:
        return int(joint)
    if match := re.fullmatch(r"#(\d+)", address):
        return int(match[1]) if int(match[1]) < model.njnt else None
    match = re.fullmatch(r"body:(.*?)(?::(\d+))?", address)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, match[1]) if match else -1
    if not match or body < 0:
        return None
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    if match[2] is None:
        return first if count == 1 else None
    return first + int(match[2]) if int(match[2]) < count else None


def geom_name(model: mujoco.MjModel, geom: int) -> str:
    """A geom by its name or its body's."""
    body = int(model.geom_bodyid[geom])
    return str(
        model.geom(geom).name
        or model.body(body).name
        or ("the world" if body == 0 else f"body {body}")
    )


def moves_with(model: mujoco.MjModel, body: int) -> NDArray[np.bool_]:
    """Which bodies move with this one, itself included; shape (nbody,)."""
    inside = np.zeros(model.nbody, bool)
    inside[body] = True
    for k in range(body + 1, model.nbody):
        inside[k] = inside[model.body_parentid[k]]
    return inside


def describe_joint(
    model: mujoco.MjModel, joint: int, limits: tuple[float, float] | None = None
) -> Joint:
    """The joint as a profile knows it, over `limits` or else its own range.

    Raises:
        JodaError: it has no range, or a name or a range that no profile can have.
    """
    lo, hi = limits or map(float, model.jnt_range[joint])
    if not lo < hi:
        raise JodaError(
            f"joint '{joint_name(model, joint)}' has no range; add range=\"lo hi\" to it."
        )
    hinge = joint_type(model, joint) == "hinge"
    try:
        return Joint(
            name=joint_name(model, joint),
            type="hinge" if hinge else "slide",
            range=(lo, hi),
            unit="rad" if hinge else "m",
        )
    except ValidationError as error:
        raise JodaError(f"joint '{joint_name(model, joint)}': {describe(error)}") from None
