"""SDFormat: a linear spring, damping and friction of a joint."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from xml.etree import ElementTree as ET

from joda.exporting.markup import angles, child, rendered, text
from joda.exporting.nearest import Nearest
from joda.exporting.tree import MIN_MASS, MIN_MOMENT, Array, Link, Shape, unique

VERSION = "1.9"
KINDS = {"fixed": "fixed", "slide": "prismatic"}


def sdf(
    name: str,
    links: Sequence[Link],
    constants: Mapping[str, Nearest],
    meshes: Mapping[int, str],
    notes: Sequence[str],
) -> str:
    """The file's text; arguments as of `urdf`."""
    links = _apart(links)
    root = ET.Element("sdf", version=VERSION)
    model = child(root, "model", name=name)
    child(model, "static", "false")
    for link in links:
        if link.parent >= 0 or link.shapes:
            _link(model, link, links, meshes)
    for link in links:
        if link.kind == "free" or (link.parent < 0 and not link.shapes):
            continue
        _joint(model, link, links, constants.get(link.joint))
    return rendered(root, notes)


def _apart(links: Sequence[Link]) -> list[Link]:
    """The links with names that neither a joint nor SDF's world has: all in a model are apart."""
    joints = [link.joint for link in links]
    plain = ["ground" if link.parent < 0 else link.name for link in links]
    names = unique([f"{name}_link" if name in joints else name for name in plain], joints)
    return [replace(link, name=name) for link, name in zip(links, names, strict=True)]


def _above(link: Link, links: Sequence[Link]) -> str:
    """Name of the link's parent; the world's where that has nothing in it."""
    parent = links[link.parent] if link.parent >= 0 else None
    return parent.name if parent and (parent.parent >= 0 or parent.shapes) else "world"


def _link(model: ET.Element, link: Link, links: Sequence[Link], meshes: Mapping[int, str]) -> None:
    element = child(model, "link", name=link.name)
    above = _above(link, links)
    relative = {} if above == "world" else {"relative_to": above}
    _pose(element, link.position, link.turn, **relative)
    inertial = child(element, "inertial")  # without it a link weighs 1 kg
    _pose(inertial, link.centre, link.principal)
    child(inertial, "mass", text(max(link.mass, MIN_MASS)))
    inertia = child(inertial, "inertia")
    for tag, moment in zip(("ixx", "iyy", "izz"), link.moments.tolist(), strict=True):
        child(inertia, tag, text(max(moment, MIN_MOMENT)))
    for number, shape in enumerate(link.shapes):
        for use in (*["visual"] * shape.seen, *["collision"] * shape.collides):
            part = child(element, use, name=f"{use}_{number}")
            _pose(part, shape.position, shape.turn)
            _geometry(child(part, "geometry"), shape, meshes)
            if use == "visual":
                child(child(part, "material"), "diffuse", text(shape.colour))


def _geometry(parent: ET.Element, shape: Shape, meshes: Mapping[int, str]) -> None:
    element = child(parent, shape.kind)
    if shape.kind == "box":
        child(element, "size", text(2 * shape.size))
    elif shape.kind == "ellipsoid":
        child(element, "radii", text(shape.size))
    elif shape.kind == "mesh":
        child(element, "uri", meshes[shape.mesh])
    elif shape.kind == "plane":
        child(element, "normal", "0 0 1")
        child(element, "size", text([2 * size if size > 0 else 100 for size in shape.size[:2]]))
    else:
        child(element, "radius", text(shape.size[0]))
        if shape.kind != "sphere":
            child(element, "length", text(2 * shape.size[1]))


def _joint(model: ET.Element, link: Link, links: Sequence[Link], constants: Nearest | None) -> None:
    kind = KINDS.get(link.kind) or ("revolute" if link.limits else "continuous")
    element = child(model, "joint", name=link.joint, type=kind)
    child(element, "parent", _above(link, links))
    child(element, "child", link.name)
    if link.kind not in ("hinge", "slide"):
        return
    axis = child(element, "axis")
    child(axis, "xyz", text(link.axis))
    if link.limits:
        limit = child(axis, "limit")
        child(limit, "lower", text(link.limits[0]))
        child(limit, "upper", text(link.limits[1]))
    if constants is not None:
        dynamics = child(axis, "dynamics")
        child(dynamics, "damping", text(constants.damping[0]))
        child(dynamics, "friction", text(constants.friction))
        child(dynamics, "spring_reference", text(constants.reference))
        child(dynamics, "spring_stiffness", text(constants.stiffness[0]))


def _pose(parent: ET.Element, position: Array, turn: Array, **attributes: str) -> None:
    child(parent, "pose", f"{text(position)} {text(angles(turn))}", **attributes)
