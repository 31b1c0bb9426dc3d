"""USD: a drive as linear spring and damping; friction in the attributes that simulators read.

UsdPhysics itself has no dry friction. It is written as PhysX (Isaac) and as MuJoCo (Newton) read
it: `physxJointAxis:...:dynamicFrictionEffort`, which acts in articulations, and `mjc:frictionloss`.
"""

from collections.abc import Collection, Mapping, Sequence
from math import degrees, radians
from typing import Any

import mujoco
import numpy as np

from joda.errors import JodaError
from joda.exporting.nearest import Nearest
from joda.exporting.tree import (
    MIN_MASS,
    MIN_MOMENT,
    Array,
    Link,
    Shape,
    product,
    rotated,
    triangles,
    unique,
)


def usd(
    model: mujoco.MjModel,
    name: str,
    links: Sequence[Link],
    constants: Mapping[str, Nearest],
    notes: Sequence[str],
) -> str:
    """The file's text (usda); arguments as of `urdf`, and the model for its meshes.

    Raises:
        JodaError: usd-core is not installed.
    """
    try:
        from pxr import Usd, UsdGeom, UsdPhysics
    except ImportError:
        raise JodaError('export --to usd needs usd-core; run: pip install ".[export]"') from None

    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetMetadata("comment", "\n".join(["written by joda export", *notes]))
    root = UsdGeom.Xform.Define(stage, f"/{_valid([name])[0]}").GetPrim()
    stage.SetDefaultPrim(root)
    UsdPhysics.ArticulationRootAPI.Apply(root)
    paths = [root.GetPath().AppendChild(one) for one in _valid([link.name for link in links])]
    frames = _frames(links)
    for link, path, frame in zip(links, paths, frames, strict=True):
        _link(stage, model, link, path, frame)
    taken = [path.name for path in paths]
    joints = _valid([f"joint_{link.joint}" for link in links], taken)
    for link, path, called in zip(links, paths, joints, strict=True):
        if link.kind != "free" and link.parent >= 0:
            parent = paths[link.parent] if links[link.parent].parent >= 0 else None
            own = constants.get(link.joint)
            _joint(stage, link, parent, path, root.GetPath().AppendChild(called), own)
    return str(stage.GetRootLayer().ExportToString())


def _valid(names: Sequence[str], taken: Collection[str] = ()) -> list[str]:
    """The names as USD takes them, no two the same, none of those that are taken."""
    from pxr import Tf

    out: list[str] = []
    for name in unique(names):
        one, k = Tf.MakeValidIdentifier(name), 2
        while one in out or one in taken:
            one, k = f"{Tf.MakeValidIdentifier(name)}_{k}", k + 1
        out.append(one)
    return out


def _frames(links: Sequence[Link]) -> list[tuple[Array, Array]]:
    """Position and turn of each link in the world, all joints at 0."""
    out: list[tuple[Array, Array]] = []
    for link in links:
        position, turn = out[link.parent] if link.parent >= 0 else (np.zeros(3), np.eye(4)[0])
        out.append((position + rotated(turn, link.position), product(turn, link.turn)))
    return out


def _place(prim: Any, position: Array, turn: Array) -> None:
    from pxr import Gf, UsdGeom

    shape = UsdGeom.Xformable(prim)
    shape.AddTranslateOp().Set(Gf.Vec3d(*position.tolist()))
    shape.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(Gf.Quatd(*turn.tolist()))


def _link(
    stage: Any, model: mujoco.MjModel, link: Link, path: Any, frame: tuple[Array, Array]
) -> None:
    from pxr import Gf, UsdGeom, UsdPhysics

    prim = UsdGeom.Xform.Define(stage, path).GetPrim()
    _place(prim, *frame)
    if link.parent >= 0:  # else it is the world
        UsdPhysics.RigidBodyAPI.Apply(prim)
        mass = UsdPhysics.MassAPI.Apply(prim)  # without it the mass is that of the shapes
        mass.CreateMassAttr(max(link.mass, MIN_MASS))
        mass.CreateCenterOfMassAttr(Gf.Vec3f(*link.centre.tolist()))
        moments = np.maximum(link.moments, MIN_MOMENT)
        mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*moments.tolist()))
        mass.CreatePrincipalAxesAttr(Gf.Quatf(*link.principal.tolist()))
    for number, shape in enumerate(link.shapes):
        _shape(stage, model, shape, path.AppendChild(f"geom_{number}"))


def _shape(stage: Any, model: mujoco.MjModel, shape: Shape, path: Any) -> None:
    from pxr import Gf, UsdGeom, UsdPhysics, Vt

    kinds = {"box": "Cube", "sphere": "Sphere", "ellipsoid": "Sphere", "plane": "Plane"}
    kind = kinds.get(shape.kind, shape.kind.capitalize())
    prim = getattr(UsdGeom, kind).Define(stage, path)
    _place(prim.GetPrim(), shape.position, shape.turn)
    radius, half = float(shape.size[0]), float(shape.size[1])
    if shape.kind in ("box", "ellipsoid"):
        prim.CreateSizeAttr(2.0) if shape.kind == "box" else prim.CreateRadiusAttr(1.0)
        UsdGeom.Xformable(prim).AddScaleOp().Set(Gf.Vec3f(*shape.size.tolist()))
    elif shape.kind == "sphere":
        prim.CreateRadiusAttr(radius)
    elif shape.kind == "plane":
        prim.CreateAxisAttr("Z")
    elif shape.kind == "mesh":
        corners, faces = triangles(model, shape.mesh)
        prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(corners.astype(np.float32)))
        prim.CreateFaceVertexCountsAttr([3] * len(faces))
        prim.CreateFaceVertexIndicesAttr(faces.ravel().tolist())
        prim.CreateSubdivisionSchemeAttr("none")
    else:
        prim.CreateRadiusAttr(radius)
        prim.CreateHeightAttr(2 * half)
        prim.CreateAxisAttr("Z")
    UsdGeom.Gprim(prim).CreateDisplayColorAttr([Gf.Vec3f(*shape.colour[:3].tolist())])
    if not shape.seen:
        UsdGeom.Imageable(prim).CreatePurposeAttr(UsdGeom.Tokens.guide)
    if shape.collides:
        UsdPhysics.CollisionAPI.Apply(prim.GetPrim())


def _joint(
    stage: Any, link: Link, parent: Any, path: Any, where: Any, constants: Nearest | None
) -> None:
    from pxr import Gf, UsdPhysics

    kinds = {"hinge": "RevoluteJoint", "slide": "PrismaticJoint"}
    joint = getattr(UsdPhysics, kinds.get(link.kind, "FixedJoint")).Define(stage, where)
    if parent is not None:
        joint.CreateBody0Rel().SetTargets([parent])
    joint.CreateBody1Rel().SetTargets([path])
    onto = np.eye(4)[0]
    if link.kind != "fixed":
        mujoco.mju_quatZ2Vec(onto, link.axis)
        joint.CreateAxisAttr("Z")
    joint.CreateLocalPos0Attr(Gf.Vec3f(*link.position.tolist()))
    joint.CreateLocalRot0Attr(Gf.Quatf(*product(link.turn, onto).tolist()))
    joint.CreateLocalPos1Attr(Gf.Vec3f(0.0))
    joint.CreateLocalRot1Attr(Gf.Quatf(*onto.tolist()))
    if link.kind == "fixed":
        return
    hinge = link.kind == "hinge"
    if link.limits:
        lower, upper = map(degrees, link.limits) if hinge else link.limits
        joint.CreateLowerLimitAttr(lower)
        joint.CreateUpperLimitAttr(upper)
    if constants is not None:
        _dynamics(joint.GetPrim(), hinge, constants, link.armature)


def _dynamics(prim: Any, hinge: bool, constants: Nearest, armature: float) -> None:
    """Drive and friction; of a hinge, USD's stiffness and damping are per degree."""
    from pxr import Sdf, UsdPhysics

    axis = "angular" if hinge else "linear"
    per = radians(1) if hinge else 1.0
    drive = UsdPhysics.DriveAPI.Apply(prim, axis)
    drive.CreateTypeAttr("force")
    drive.CreateStiffnessAttr(constants.stiffness[0] * per)
    drive.CreateDampingAttr(constants.damping[0] * per)
    drive.CreateTargetPositionAttr(constants.reference / per)
    drive.CreateTargetVelocityAttr(0.0)
    prim.AddAppliedSchema(f"PhysxJointAxisAPI:{axis}")
    prim.AddAppliedSchema("MjcJointAPI")
    for name, kind, value in (
        (f"physxJointAxis:{axis}:staticFrictionEffort", "Float", constants.static_friction),
        (f"physxJointAxis:{axis}:dynamicFrictionEffort", "Float", constants.friction),
        (f"physxJointAxis:{axis}:armature", "Float", armature),
        ("mjc:frictionloss", "Double", constants.friction),
        ("mjc:armature", "Double", armature),
    ):
        prim.CreateAttribute(name, getattr(Sdf.ValueTypeNames, kind), False).Set(value)
