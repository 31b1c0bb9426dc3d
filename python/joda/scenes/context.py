"""What can be known of a joint from the model alone: the context in which dynamics are proposed."""

from pathlib import Path
from typing import Literal

import mujoco
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from joda.plain import line
from joda.profile import Joint
from joda.scenes.actuators import actuators_on
from joda.scenes.angles import implausible_range
from joda.scenes.elements import Elements, elements
from joda.scenes.engine import inertia_at
from joda.scenes.masses import implausible_mass
from joda.scenes.model import describe_joint, find_joint, load_model, moves_with
from joda.scenes.motion import gravity_force
from joda.scenes.outline import own_geoms, surface
from joda.scenes.shape import Shape, look

POSITIONS = 21
"""At how many positions, evenly over the range, inertia and gravity are sampled."""

Vector = tuple[float, float, float]
End = Literal["low_end", "high_end"]


class Context(BaseModel):
    """A joint's context: SI units, all other joints at their reference position.

    Attributes:
        joint: name, type, range and unit.
        parent, child: the bodies that it connects.
        axis_local: unit vector in the frame of the child body.
        axis_world: the same in the world, at the low end.
        anchor_world: a point on the axis (hinge), the body's origin (slide), at the low end; m.
        moving_mass: of the child and all below it; kg.
        positions: rad or m, evenly over the range.
        inertia: generalised inertia at each position, from the mass matrix; kg·m² or kg.
        gravity_force: generalised force of gravity at each position; N·m or N. Positive drives the
            joint towards larger positions.
        equivalent_inertia: the mean of `inertia`.
        gravity_scale: the largest magnitude of `gravity_force`.
        upper_end: the end at which the moving part lies higher, "level" if neither.
        closed_end: the end at which the part covers a cavity; else that at which the joint's
            reference position lies, or the part lies in its object; "unknown" if nothing tells.
            Opening is the motion away from it.
        lever_arm: where a hand would take hold. Hinge: distance from the axis to the grip, or where
            none is seen to the farthest point of what moves (of a body without geoms, its radius of
            gyration), m; slide: 1. Times a hand's force (N) it gives the generalised force.
        size: of the box around what moves, along the world's axes, at the low end; m.
        driven: whether an actuator acts on the joint.
        actuators: which ones do.
        native: MuJoCo's own elements on the joint, and what else acts on it. Where the joint gets
            a profile, that replaces its damping, frictionloss and stiffness; the rest stays.
        names: what the file calls the joint, the child and what moves with it, in this order.
        around: what it calls the bodies above, nearest first, and the model.
        shape: features of the part and its object; None of a part without geoms.
        twin: the first joint of the object whose part is of equal shape; else the joint itself.
            What is drawn for one is drawn for the other.
        warnings: what cannot be meant of its range, mass or inertia, a sentence each.
    """

    model_config = ConfigDict(frozen=True)

    joint: Joint
    parent: str
    child: str
    axis_local: Vector
    axis_world: Vector
    anchor_world: Vector
    moving_mass: float
    positions: tuple[float, ...]
    inertia: tuple[float, ...]
    gravity_force: tuple[float, ...]
    equivalent_inertia: float
    gravity_scale: float
    upper_end: End | Literal["level"]
    closed_end: End | Literal["unknown"]
    lever_arm: float
    size: Vector
    driven: bool
    actuators: tuple[str, ...] = ()
    native: Elements = Elements()
    names: tuple[str, ...]
    around: tuple[str, ...]
    shape: Shape | None = None
    twin: str = ""
    warnings: tuple[str, ...] = ()

    def describe(self) -> str:
        """The context in a few lines for a person."""
        joint, hinge = self.joint, self.joint.type == "hinge"
        lo, hi = joint.range
        degrees = f" ({np.rad2deg(lo):.1f} to {np.rad2deg(hi):.1f} degrees)" if hinge else ""
        force = joint.force_unit
        opens = {"low_end": "+q", "high_end": "-q", "unknown": "unknown"}[self.closed_end]
        rows = {
            "joint": f"{joint.name}, a {joint.type} between {self.parent} and {self.child}",
            "range": f"{lo:g} to {hi:g} {joint.unit}{degrees}",
            "axis": f"{_text(self.axis_local)} in the body, {_text(self.axis_world)} in the world",
            "moving mass": f"{self.moving_mass:.4g} kg",
            "moving part": " x ".join(f"{x:.3g}" for x in self.size) + " m (world x, y, z)",
            **({"lever arm": f"{self.lever_arm:.3g} m from the axis"} if hinge else {}),
            "inertia": f"{_span(self.inertia)} {'kg·m²' if hinge else 'kg'}",
            "gravity": f"{_span(self.gravity_force)} {force} (positive drives +q)",
            "upper end": self.upper_end.replace("_", " "),
            "closed end": f"{self.closed_end.replace('_', ' ')}; opening: {opens}",
            "own elements": self.native.describe(joint),
            **({"driven by": ", ".join(self.actuators)} if self.driven else {}),
            **(
                {"also acting": ", ".join(self.native.unmodelled)} if self.native.unmodelled else {}
            ),
            **({"contacts": self.native.touches()} if self.native.contacts else {}),
            "names": ", ".join(self.names[:12]),
            "part of": ", ".join(self.around),
        }
        return "\n".join(f"{name + ':':13} {line(text)}" for name, text in rows.items())


def context(model: str | Path, joint: str) -> Context:
    """Extracts the context of a joint.

    Args:
        model: MJCF or URDF file.
        joint: its name or address, see `joda.scenes.model.find_joint`.

    Returns:
        the context.

    Raises:
        JodaError: the file cannot be loaded, the joint does not exist, is no hinge or slide, or has
            no range.
    """
    m = load_model(Path(model))
    j = find_joint(m, joint)
    described = describe_joint(m, j)
    data = mujoco.MjData(m)
    dof, body = m.jnt_dofadr[j], int(m.jnt_bodyid[j])
    positions = np.linspace(*described.range, POSITIONS)
    inertia, height = np.empty(POSITIONS), np.empty(POSITIONS)
    for k in reversed(range(POSITIONS)):  # ends with the data at the low end
        data.qpos[m.jnt_qposadr[j]] = positions[k]
        inertia[k], height[k] = _inertia_and_height(m, data, int(dof), body)
    gravity = gravity_force(m, j, positions)
    weight = float(m.body_subtreemass[body] * np.linalg.norm(m.opt.gravity))
    gravity[np.abs(gravity) <= 1e-9 * weight] = 0  # rounding
    parent = int(m.body_parentid[body])
    points = surface(m, data, own_geoms(m, body))
    if not len(points):
        points = data.subtree_com[body][None]
    seen = look(m, j, described, _closed_end(described, float(m.qpos0[m.jnt_qposadr[j]])))
    acting = actuators_on(m, j)
    return Context(
        joint=described,
        parent=_body_name(m, parent),
        child=_body_name(m, body),
        axis_local=_vector(m.jnt_axis[j]),
        axis_world=_vector(data.xaxis[j]),
        anchor_world=_vector(data.xanchor[j]),
        moving_mass=float(m.body_subtreemass[body]),
        positions=tuple(positions.tolist()),
        inertia=tuple(inertia.tolist()),
        gravity_force=tuple(gravity.tolist()),
        equivalent_inertia=float(inertia.mean()),
        gravity_scale=float(np.abs(gravity).max()),
        upper_end=_upper_end(height),
        closed_end=seen.closed_end,
        lever_arm=seen.grip
        or _lever_arm(described, points, data.xanchor[j], data.xaxis[j])
        or float(np.sqrt(inertia.mean() / m.body_subtreemass[body])),
        size=_vector(np.ptp(points, axis=0)),
        driven=bool(acting),
        actuators=acting,
        native=elements(m, j, described),
        names=_names(m, j),
        around=_around(m, j),
        shape=seen.shape,
        twin=seen.twin,
        warnings=(
            *filter(None, [implausible_range(described)]),
            *implausible_mass(m, j, float(inertia.mean()), bool(acting)),
        ),
    )


def _inertia_and_height(
    m: mujoco.MjModel, data: mujoco.MjData, dof: int, body: int
) -> tuple[float, float]:
    """Generalised inertia of the dof, and the height (m) of what it moves."""
    mujoco.mj_fwdPosition(m, data)
    up = -np.asarray(m.opt.gravity)
    length = float(np.linalg.norm(up))
    height = float(data.subtree_com[body] @ up) / length if length else 0.0
    return inertia_at(m, data, dof), height


def _lever_arm(
    joint: Joint,
    points: NDArray[np.float64],
    anchor: NDArray[np.float64],
    axis: NDArray[np.float64],
) -> float:
    if joint.type == "slide":
        return 1.0
    away = points - anchor
    away -= np.outer(away @ axis, axis)
    return float(np.linalg.norm(away, axis=1).max())


def _names(m: mujoco.MjModel, joint: int) -> tuple[str, ...]:
    body = int(m.jnt_bodyid[joint])
    names = [m.joint(joint).name, m.body(body).name]
    for geom in np.flatnonzero(moves_with(m, body)[m.geom_bodyid]):
        names.append(m.body(m.geom_bodyid[geom]).name)
        names.append(m.geom(geom).name)
        if m.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH and m.geom_dataid[geom] >= 0:
            names.append(m.mesh(m.geom_dataid[geom]).name)
        if m.geom_matid[geom] >= 0:
            names.append(m.mat(m.geom_matid[geom]).name)
    return tuple(dict.fromkeys(filter(None, names)))


def _around(m: mujoco.MjModel, joint: int) -> tuple[str, ...]:
    names, body = [], int(m.body_parentid[m.jnt_bodyid[joint]])
    while body:
        names.append(m.body(body).name)
        body = int(m.body_parentid[body])
    names.append(bytes(m.names).split(b"\0")[0].decode())  # the model's own name comes first
    return tuple(dict.fromkeys(filter(None, names)))


def _upper_end(height: NDArray[np.float64]) -> End | Literal["level"]:
    rise = height[-1] - height[0]
    if abs(rise) < 1e-6:
        return "level"
    return "high_end" if rise > 0 else "low_end"


def _closed_end(joint: Joint, reference: float) -> End | Literal["unknown"]:
    lo, hi = joint.range
    s = (reference - lo) / (hi - lo)
    if s < 0.1:
        return "low_end"
    return "high_end" if s > 0.9 else "unknown"


def _text(vector: Vector) -> str:
    return "(" + " ".join(f"{value:.3g}" for value in vector) + ")"


def _span(values: tuple[float, ...]) -> str:
    """One number where it hardly varies, else the extremes and the values at the ends."""
    low, high = min(values), max(values)
    if high - low <= 1e-3 * max(abs(low), abs(high), 1e-12):
        return f"{values[0]:.4g}"
    return f"{low:.4g} to {high:.4g}, at the ends {values[0]:.4g} and {values[-1]:.4g}"


def _body_name(m: mujoco.MjModel, body: int) -> str:
    return m.body(body).name or f"body {body}"


def _vector(values: NDArray[np.float64]) -> Vector:
    x, y, z = (float(round(value, 12)) + 0.0 for value in values)
    return x, y, z
