"""A scene as links and joints, the frames of which are where other formats want them."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from joda.errors import JodaError
from joda.files import file_name

Array = NDArray[np.float64]

MIN_MASS, MIN_MOMENT = 1e-9, 1e-12
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
    """A body, or what moves between two joints of a body. Its frame is in the joint that moves it.

    Attributes:
        name: of letters, digits, '_', '.' and '-'; no two have the same.
        parent: its place in the list, -1: it is the world.
        joint: name of the joint that moves it, or fixes it.
        number: id of that joint in the model, -1: it has none.
        kind: fixed, free, hinge or slide.
        axis: of the joint, in the link's frame.
        limits: rad or m, None: there are none.
        position, turn: of the frame in the parent's, where the joint is at 0.
        armature: kg·m² or kg.
        mass: kg.
        centre, principal, moments: centre of mass, quaternion of the principal axes, and the
            moments of inertia about them, kg·m².
        shapes: its geoms.
    """

    name: str
    parent: int
    joint: str
    number: int
    kind: str
    axis: Array
    limits: tuple[float, float] | None
    position: Array
    turn: Array
    armature: float
    mass: float = 0.0
    centre: Array = field(default_factory=lambda: np.zeros(3))
    principal: Array = field(default_factory=lambda: np.eye(4)[0])
    moments: Array = field(default_factory=lambda: np.zeros(3))
    shapes: tuple[Shape, ...] = ()


def links_of(model: mujoco.MjModel) -> tuple[list[Link], list[str]]:
    """The links of a scene, parents first, and what was left out, one sentence each.

    A body with several joints is a chain, as MuJoCo moves it: the links before its last joint have
    no mass and no shape.

    Raises:
        JodaError: a body has a ball joint.
    """
    moved = [_moved(model, body) for body in range(model.nbody)]
    bodies = [model.body(k).name or f"body_{k}" if k else "world" for k in range(model.nbody)]
    between = [
        f"{bodies[body]}_{model.joint(joint).name or number}"
        for body, joints in enumerate(moved)
        for number, joint in enumerate(joints[:-1])
    ]
    names = unique([*bodies, *between])
    spare = iter(names[model.nbody :])
    chains = [[*(next(spare) for _ in joints[1:]), names[k]] for k, joints in enumerate(moved)]
    called = iter(
        unique(
            [
                (model.joint(joint).name if joint >= 0 else "") or f"{link}_joint"
                for joints, chain in zip(moved, chains, strict=True)
                for joint, link in zip(joints, chain, strict=True)
            ]
        )
    )
    out: list[Link] = []
    left: list[str] = []
    ends: list[tuple[int, Array]] = []  # of each body: the link that it is, and its last anchor
    for body, (joints, chain) in enumerate(zip(moved, chains, strict=True)):
        parent, before = ends[model.body_parentid[body]] if body else (-1, np.zeros(3))
        for number, (joint, link) in enumerate(zip(joints, chain, strict=True)):
            anchor = _anchor(model, joint)
            position, turn = anchor - before, np.eye(4)[0]
            if number == 0:
                turn = model.body_quat[body].copy()
                position = model.body_pos[body] - before + rotated(turn, anchor)
            out.append(_joined(model, joint, parent, link, next(called), position, turn))
            parent, before = len(out) - 1, anchor
        if len(joints) > 1:
            left.append(
                f"{chain[-1]} has {len(joints)} joints, so it is a chain of links; without mass: "
                + ", ".join(chain[:-1])
            )
        out[-1] = _filled(model, body, out[-1], before, left)
        ends.append((parent, before))
    for what, amount in (
        ("equality constraint", _equalities(model)),
        ("actuator", model.nu),
        ("tendon", model.ntendon),
        ("gravity compensation", int(np.count_nonzero(model.body_gravcomp))),
    ):
        if amount:
            left.append(left_out(amount, what))
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


def _moved(model: mujoco.MjModel, body: int) -> list[int]:
    """The joints that move a body, in their order; [-1]: none does."""
    first = int(model.body_jntadr[body])
    joints = list(range(first, first + int(model.body_jntnum[body])))
    for joint in joints:
        if model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_BALL):
            raise JodaError(
                f"joint '{model.joint(joint).name or joint}' is a ball joint; only hinges, slides "
                "and free joints can be exported."
            )
    return joints or [-1]


def _anchor(model: mujoco.MjModel, joint: int) -> Array:
    free = joint >= 0 and model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_FREE)
    return np.zeros(3) if joint < 0 or free else model.jnt_pos[joint].copy()


def _joined(
    model: mujoco.MjModel,
    joint: int,
    parent: int,
    name: str,
    called: str,
    position: Array,
    turn: Array,
) -> Link:
    """A link without mass and shapes; it lies at the position and turn where the scene is made."""
    kind, axis, limits, armature = "fixed", np.array([1.0, 0, 0]), None, 0.0
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
    return Link(name, parent, called, joint, kind, axis, limits, position, turn, armature)


def _filled(model: mujoco.MjModel, body: int, link: Link, anchor: Array, left: list[str]) -> Link:
    """The link with the body's mass and geoms."""
    first = int(model.body_geomadr[body])
    geoms = range(first, first + int(model.body_geomnum[body])) if first >= 0 else ()
    shapes = [_shape(model, geom, anchor, link.name, left) for geom in geoms]
    return replace(
        link,
        mass=float(model.body_mass[body]),
        centre=model.body_ipos[body] - anchor,
        principal=model.body_iquat[body].copy(),
        moments=model.body_inertia[body].copy(),
        shapes=tuple(shape for shape in shapes if shape),
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
