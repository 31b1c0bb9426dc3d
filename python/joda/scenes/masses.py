"""Masses and inertias that cannot be: told from the size of what a joint moves.

Nothing in a house is lighter than foam for its volume, or than cardboard for its face; nothing is
heavier than lead. A part is only spoken of where every way to see its size says so: its collision
geoms by themselves, and those that are only seen.
"""

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from joda.scenes.model import joint_name, moves_with

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LIGHTEST, HEAVIEST = 20.0, 12000.0
"""Mean densities, kg/m³: of foam; a little above lead."""
THINNEST = 0.5
"""Mass per area of the largest faces, kg/m²: cardboard."""
WATER, SOLID = 1000.0, 30.0
"""MuJoCo's default density (kg/m³); from so many kg on a part of that density should be hollow."""
HOLLOW, ROUGHLY, LIGHT = 4.0, 0.1, 1.0
"""How many times what a mesh encloses MuJoCo counts of a thin hull, how near that the mass then is,
and what is too little (kg) to be worth a word."""
FAR, NEAR = 1.2, 0.02
"""Of the way from a hinge's axis to the farthest geom, how far a mass must seem to be from the axis
for a word: more than so much, as no geom reaches there, or less than so little."""
NEARLY = 0.01
"""How near that density a mean density is taken for it."""
ARMATURE = 0.5
"""Share of the joint's inertia from which armature dominates it."""


def implausible_mass(
    model: mujoco.MjModel, joint: int, inertia: float, driven: bool
) -> tuple[str, ...]:
    """What cannot be true of the mass and the inertia that a joint moves, a sentence each.

    Args:
        model: compiled.
        joint: its id.
        inertia: generalised, of the joint, with its armature; kg·m² or kg.
        driven: whether an actuator acts on it; then armature is a gear's and a rotor's.
    """
    name, body = joint_name(model, joint), int(model.jnt_bodyid[joint])
    mass = float(model.body_subtreemass[body])
    moving = moves_with(model, body)
    own = moving[model.geom_bodyid]
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    parts = [np.flatnonzero(part) for part in (own & collides, own & ~collides, own) if part.any()]
    sizes = np.array([[*_volumes(model, int(g)), *_box(model, int(g))] for p in parts for g in p])
    sums = np.add.reduceat(sizes, np.cumsum([0, *map(len, parts[:-1])])) if parts else None
    out = [] if sums is None else [_of_mass(name, mass, sums), misplaced(model, joint, moving)]
    out.append(_of_armature(model, joint, inertia) if not driven else "")
    return tuple(sentence for sentence in out if sentence)


def solid_volume(model: mujoco.MjModel, geoms: NDArray[np.intp]) -> float:
    """Of geoms, m³, as the smaller of what collides and what is only seen encloses."""
    collides = (model.geom_contype[geoms] != 0) | (model.geom_conaffinity[geoms] != 0)
    sets = [part for part in (geoms[collides], geoms[~collides]) if len(part)]
    return min(sum(_volumes(model, int(geom))[0] for geom in part) for part in sets)


def _of_mass(name: str, mass: float, sizes: Array) -> str:
    """A sentence where the mass does not fit the size; empty where it may.

    `sizes`: of each way to see the part, its volume, two that MuJoCo may count for its mass, its
    boxes' volume (m³) and their faces (m²).
    """
    volumes, legacy, hulls, boxes, faces = np.maximum(sizes, 1e-18).T
    density, most = mass / volumes.min(), mass / boxes.max()
    said = f"Joint '{name}' moves {mass:.3g} kg"
    if density < LIGHTEST or mass / faces.min() < THINNEST:
        what = (
            f"{1e3 * volumes.min():.3g} litres, {density:.2g} kg/m³, lighter than foam"
            if density < LIGHTEST
            else f"{faces.min():.2g} m², {mass / faces.min():.2g} kg/m², lighter than cardboard"
        )
        return (
            f"{said} of {what}: set the mass that was weighed (<inertial> or the geoms' mass), or "
            "have it estimated: joda weigh."
        )
    if most > HEAVIEST:
        return (
            f"{said} within {1e3 * boxes.max():.3g} litres, {most:.3g} kg/m³, heavier than lead: "
            "set the mass that was weighed (<inertial> or the geoms' mass), have it estimated "
            "(joda weigh), or mend the scale."
        )
    for counted in (legacy, hulls):
        more = (np.abs(mass / counted / WATER - 1) < ROUGHLY) & (counted > HOLLOW * volumes)
        if mass > LIGHT and np.any(more):
            return _counted_more(said, mass, volumes[more][0])
    if mass <= SOLID:
        return ""
    if np.any(np.abs(mass / volumes / WATER - 1) < NEARLY):
        return (
            f"{said}, its {mass:.3g} litres as solid as water (1000 kg/m³, MuJoCo's default "
            "density): if it is hollow, set the mass that was weighed, a density, or "
            'inertia="shell" on its mesh.'
        )
    for counted in (legacy, hulls):
        if np.any(more := np.abs(mass / counted / WATER - 1) < NEARLY):
            return _counted_more(said, mass, volumes[more][0])
    return ""


def _counted_more(said: str, mass: float, volume: float) -> str:
    return (
        f"{said}, as MuJoCo counts {mass:.3g} litres of its default density (1000 kg/m³) for "
        f"meshes that enclose {1e3 * volume:.3g}: set the mass that was weighed, or "
        'inertia="exact" or "shell" on the mesh.'
    )


def misplaced(model: mujoco.MjModel, joint: int, moving: Mask) -> str:
    """A sentence where the mass, or what resists turning, lies where nothing of the part is; empty
    where it does not."""
    data, body = mujoco.MjData(model), int(model.jnt_bodyid[joint])
    mujoco.mj_fwdPosition(model, data)
    mass, geoms = float(model.body_subtreemass[body]), moving[model.geom_bodyid]
    centres, reach = data.geom_xpos[geoms], model.geom_rbound[geoms]
    if mass <= 0 or not np.all(reach > 0):  # a plane
        return ""
    lo, hi = (centres - reach[:, None]).min(axis=0), (centres + reach[:, None]).max(axis=0)
    centre, across = data.subtree_com[body], float(np.linalg.norm(hi - lo))
    outside = float(np.linalg.norm(centre - np.clip(centre, lo, hi)))
    said = f"Joint '{joint_name(model, joint)}' moves {mass:.3g} kg"
    if outside > across:
        return (
            f"{said} whose centre lies {outside:.3g} m outside of its geoms, which are "
            f"{across:.3g} m across: correct the pos of <inertial>."
        )
    if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
        return ""
    axis, anchor = data.xaxis[joint], data.xanchor[joint]
    away = np.linalg.norm(np.cross(data.xipos[moving] - anchor, axis), axis=1)
    along = data.ximat[moving].reshape(-1, 3, 3).transpose(0, 2, 1) @ axis
    about_own = np.sum(model.body_inertia[moving] * along**2, axis=1)
    inertia = float(np.sum(about_own + model.body_mass[moving] * away**2))
    gyration = np.sqrt(inertia / mass)
    farthest = float((np.linalg.norm(np.cross(centres - anchor, axis), axis=1) + reach).max())
    if NEAR * farthest <= gyration <= FAR * farthest:
        return ""
    return (
        f"{said} with an inertia of {inertia:.3g} kg·m², as if all of it were {gyration:.3g} m "
        f"from the axis, though its geoms reach {farthest:.3g} m: correct the inertia in "
        "<inertial>."
    )


def _of_armature(model: mujoco.MjModel, joint: int, inertia: float) -> str:
    armature = float(model.dof_armature[model.jnt_dofadr[joint]])
    if armature <= ARMATURE * inertia:
        return ""
    hinge = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE
    unit = "kg·m²" if hinge else "kg"
    return (
        f"Joint '{joint_name(model, joint)}': {100 * armature / inertia:.0f} % of its inertia, "
        f"{armature:.3g} of {inertia:.3g} {unit}, is armature and belongs to no body: give the "
        "bodies their masses and leave armature to a gear's rotor."
    )


def _box(model: mujoco.MjModel, geom: int) -> tuple[float, float]:
    """Volume (m³) and largest face (m²) of the box around a geom, along its own axes."""
    x, y, z = sorted(2 * model.geom_aabb[geom][3:])
    return float(x * y * z), float(y * z)


def _volumes(model: mujoco.MjModel, geom: int) -> tuple[float, float, float]:
    """Of a geom, m³, and what MuJoCo may count of it for its mass.

    A mesh encloses the sum of the tetrahedra that its faces make with a point; MuJoCo's
    inertia="legacy" counts those that are outside as inside too, "convex" all of the hull.
    """
    kind, size, box = int(model.geom_type[geom]), model.geom_size[geom], _box(model, geom)[0]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        vertices = model.mesh_vert[first : first + count].astype(float)
        first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
        a, b, c = corners = vertices[model.mesh_face[first : first + count].T]
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
        centre = np.average(corners.mean(axis=0), axis=0, weights=np.maximum(areas, 1e-18))
        parts = np.sum((a - centre) * np.cross(b - centre, c - centre), axis=1) / 6
        return min(float(abs(parts.sum())), box), float(np.abs(parts).sum()), _hull(vertices)
    round = np.pi * size[0] ** 2
    volume = {
        int(mujoco.mjtGeom.mjGEOM_SPHERE): 4 / 3 * round * size[0],
        int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): 4 / 3 * np.pi * np.prod(size),
        int(mujoco.mjtGeom.mjGEOM_CYLINDER): 2 * round * size[1],
        int(mujoco.mjtGeom.mjGEOM_CAPSULE): 2 * round * (size[1] + 2 / 3 * size[0]),
    }.get(kind, box)
    return float(volume), float(volume), float(volume)


def _hull(points: Array) -> float:
    """Volume of their convex hull, m³; zero where they are flat."""
    try:
        return float(ConvexHull(points).volume)
    except QhullError:
        return 0.0
