"""A scene as links and joints, the frames of which are where other formats want them."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from joda.errors import JodaError
from joda.files import file_name

Array = NDArray[np.float64]

LEAST_MASS, LEAST_MOMENT = 1e-9, 1e-12
"""Of a link in SDF and USD (kg, kg·m²), where what has no mass of its own is given one."""
SHOWN = 3
"""Geoms of lower groups are seen, as in MuJoCo's viewer."""
KINDS = {
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{name.upper()}")): name
    for name in ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
}


@dataclass(frozen=True)
class Shape:
    """A geom in its link's frame.

    Attributes:
        kind: plane, sphere, capsule, ellipsoid, cylinder, box or mesh.
        size: as MuJoCo's, half lengths in m.
        position, turn: its frame; the turn is a quaternion, w first.
        colour: red, green, blue, opacity.
        collides, seen: what it is for.
        mesh: id, -1: none.
    """

    kind: str
    size: Array
    position: Array
    turn: Array
    colour: Array
    collides: bool
    seen: bool
    mesh: int


@dataclass(frozen=True)
class Link:
    """A body. Its frame is in the joint that moves it.

    Attributes:
        name: of letters, digits, '_', '.' and '-'; no two have the same.
        parent: its place in the list, -1: it is the world.
        joint: name of the joint that moves it, or fixes it.
        kind: fixed, free, hinge or slide.
        axis: of the joint, in the link's frame.
        limits: rad or m, None: there are none.
        position, turn: of the frame in the parent's, where the joint is at 0.
        mass: kg.
        centre, principal, moments: centre of mass, quaternion of the principal axes, and the
            moments of inertia about them, kg·m².
        armature: kg·m² or kg.
        shapes: its geoms.
    """

    name: str
    parent: int
    joint: str
    kind: str
    axis: Array
    limits: tuple[float, float] | None
    position: Array
    turn: Array
    mass: float
    centre: Array
    principal: Array
    moments: Array
    armature: float
    shapes: tuple[Shape, ...]


def links_of(model: mujoco.MjModel) -> tuple[list[Link], list[str]]:
    """The links of a scene, parents first, and what was left out, one sentence each.

    Raises:
        JodaError: a body has several joints, or a ball joint.
    """
    names = unique(
        [model.body(k).name or f"body_{k}" if k else "world" for k in range(model.nbody)]
    )
    left: list[str] = []
    joints = unique([_joint_name(model, body, names[body]) for body in range(model.nbody)])
    anchors = [_anchor(model, body) for body in range(model.nbody)]
    out = [_link(model, k, names[k], joints[k], anchors, left) for k in range(model.nbody)]
    for what, number in (
        ("equality constraint", _equalities(model)),
        ("actuator", model.nu),
        ("tendon", model.ntendon),
    ):
        if number:
            left.append(left_out(number, what))
    return out, left


def left_out(number: int, what: str) -> str:
    """The sentence that so many of it are not in the file."""
    return f"{number} {what}{'s are' if number > 1 else ' is'} left out"


def unique(names: Sequence[str], taken: Collection[str] = ()) -> list[str]:
    """The names with nothing in them but what files and elements take, no two the same, none of
    those that are taken."""
    out: list[str] = []
    for name in map(file_name, names):
        one, k = name, 2
        while one in out or one in taken:
            one, k = f"{name}_{k}", k + 1
        out.append(one)
    return out


def rotated(turn: Array, vector: ArrayLike) -> Array:
    """The vector, turned by a quaternion."""
    out = np.empty(3)
    mujoco.mju_rotVecQuat(out, np.asarray(vector, float), turn)
    return out


def product(first: Array, second: Array) -> Array:
    """The turn by `second`, then by `first`."""
    out = np.empty(4)
    mujoco.mju_mulQuat(out, first, second)
    return out


def _equalities(model: mujoco.MjModel) -> int:
    """Constraints but for those that carry a profile's damping."""
    return sum("joda_damping" not in model.equality(k).name for k in range(model.neq))


def _joint(model: mujoco.MjModel, body: int) -> int:
    number = model.body_jntnum[body]
    if number > 1:
        raise JodaError(
            f"body '{model.body(body).name or body}' has {number} joints, which only MJCF can say "
            "of one body; put a body between them."
        )
    joint = int(model.body_jntadr[body]) if number else -1
    if joint >= 0 and model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_BALL):
        raise JodaError(
            f"joint '{model.joint(joint).name or joint}' is a ball joint; only hinges, slides and "
            "free joints can be exported."
        )
    return joint


def _joint_name(model: mujoco.MjModel, body: int, link: str) -> str:
    joint = _joint(model, body)
    return (model.joint(joint).name if joint >= 0 else "") or f"{link}_joint"


def _anchor(model: mujoco.MjModel, body: int) -> Array:
    joint = _joint(model, body)
    free = joint >= 0 and model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_FREE)
    return np.zeros(3) if joint < 0 or free else model.jnt_pos[joint].copy()


def _link(
    model: mujoco.MjModel, body: int, name: str, called: str, anchors: list[Array], left: list[str]
) -> Link:
    joint, anchor, parent = _joint(model, body), anchors[body], int(model.body_parentid[body])
    kind, axis, limits, armature = "fixed", np.array([1.0, 0, 0]), None, 0.0
    turn = model.body_quat[body].copy()
    position = model.body_pos[body] - anchors[parent] + rotated(turn, anchor)
    if joint >= 0:
        kinds = {int(mujoco.mjtJoint.mjJNT_FREE): "free", int(mujoco.mjtJoint.mjJNT_SLIDE): "slide"}
        kind = kinds.get(int(model.jnt_type[joint]), "hinge")
        armature = float(model.dof_armature[model.jnt_dofadr[joint]])
    if kind in ("hinge", "slide"):
        axis = model.jnt_axis[joint].copy()
        at = float(model.qpos0[model.jnt_qposadr[joint]])  # where the scene shows it
        if kind == "slide":
            position = position - at * rotated(turn, axis)
        else:
            back = np.empty(4)
            mujoco.mju_axisAngle2Quat(back, axis, -at)
            turn = product(turn, back)
        if model.jnt_limited[joint]:
            limits = (float(model.jnt_range[joint][0]), float(model.jnt_range[joint][1]))
    first = int(model.body_geomadr[body])
    geoms = range(first, first + int(model.body_geomnum[body])) if first >= 0 else ()
    shapes = [_shape(model, geom, anchor, name, left) for geom in geoms]
    return Link(
        name,
        parent if body else -1,
        called,
        kind,
        axis,
        limits,
        position,
        turn,
        float(model.body_mass[body]),
        model.body_ipos[body] - anchor,
        model.body_iquat[body].copy(),
        model.body_inertia[body].copy(),
        armature,
        tuple(shape for shape in shapes if shape),
    )


def _shape(
    model: mujoco.MjModel, geom: int, anchor: Array, link: str, left: list[str]
) -> Shape | None:
    kind = KINDS.get(int(model.geom_type[geom]))
    if kind is None:
        left.append(f"a geom of {link} is left out: a kind that only MuJoCo has")
        return None
    return Shape(
        kind,
        model.geom_size[geom].copy(),
        model.geom_pos[geom] - anchor,
        model.geom_quat[geom].copy(),
        _colour(model, geom),
        bool(model.geom_contype[geom] or model.geom_conaffinity[geom]),
        bool(model.geom_group[geom] < SHOWN),
        int(model.geom_dataid[geom]) if kind == "mesh" else -1,
    )


def _colour(model: mujoco.MjModel, geom: int) -> Array:
    material = int(model.geom_matid[geom])
    return np.array(model.geom_rgba[geom] if material < 0 else model.mat_rgba[material], float)


def triangles(model: mujoco.MjModel, mesh: int) -> tuple[Array, NDArray[np.int64]]:
    """Corners (n, 3) and faces (m, 3) of a mesh."""
    vertices = slice(model.mesh_vertadr[mesh], model.mesh_vertadr[mesh] + model.mesh_vertnum[mesh])
    faces = slice(model.mesh_faceadr[mesh], model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    return np.array(model.mesh_vert[vertices], float), np.array(model.mesh_face[faces], np.int64)


def obj(model: mujoco.MjModel, mesh: int) -> str:
    """A mesh as a Wavefront OBJ file, which all of Gazebo, Drake, PyBullet and MuJoCo take."""
    corners, faces = triangles(model, mesh)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in corners.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    return "\n".join(lines) + "\n"
