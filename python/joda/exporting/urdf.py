"""URDF: damping and friction of a joint, no spring."""

from collections.abc import Mapping, Sequence
from xml.etree import ElementTree as ET

from joda.exporting.markup import angles, child, rendered, text
from joda.exporting.nearest import Nearest
from joda.exporting.tree import MIN_MASS, MIN_MOMENT, Array, Link, Shape, rotated

NO_LIMIT = "1e6"
"""Of effort and velocity, which URDF wants to be told."""
KINDS = {"fixed": "fixed", "free": "floating", "slide": "prismatic"}


def urdf(
    name: str,
    links: Sequence[Link],
    constants: Mapping[str, Nearest],
    meshes: Mapping[int, str],
    notes: Sequence[str],
) -> str:
    """The file's text.

    Args:
        name: of the robot.
        links: parents first.
        constants: by the joint's name in `links`.
        meshes: file names by id.
        notes: what is not in it.
    """
    root = ET.Element("robot", name=name)
    for link in links:
        _link(root, link, meshes)
    for link in links:
        if link.parent >= 0:
            _joint(root, link, links[link.parent].name, constants.get(link.joint))
    return rendered(root, notes)


def _link(root: ET.Element, link: Link, meshes: Mapping[int, str]) -> None:
    element = child(root, "link", name=link.name)
    if link.mass > 0 or link.kind != "fixed" or (link.parent >= 0 and link.shapes):
        # else its shapes are taken to weigh, and what moves must not weigh nothing
        inertial = child(element, "inertial")
        _origin(inertial, link.centre, link.principal)
        child(inertial, "mass", value=text(max(link.mass, MIN_MASS)))
        least = (text(max(moment, MIN_MOMENT)) for moment in link.moments)
        moments = dict(zip(("ixx", "iyy", "izz"), least, strict=True))
        child(inertial, "inertia", ixy="0", ixz="0", iyz="0", **moments)
    for number, shape in enumerate(link.shapes):
        for use in (*["visual"] * shape.seen, *["collision"] * shape.collides):
            for tag, attributes, place in _geometry(shape, meshes):
                part = child(element, use)
                _origin(part, place, shape.turn)
                child(child(part, "geometry"), tag, **attributes)
                if use == "visual":
                    material = child(part, "material", name=f"{link.name}_{number}")
                    child(material, "color", rgba=text(shape.colour))


def _geometry(shape: Shape, meshes: Mapping[int, str]) -> list[tuple[str, dict[str, str], Array]]:
    """Element, attributes and place of what the shape is made of; nothing for what URDF lacks."""
    radius, at = text(shape.size[0]), shape.position
    if shape.kind == "box":
        return [("box", {"size": text(2 * shape.size)}, at)]
    if shape.kind == "sphere":
        return [("sphere", {"radius": radius}, at)]
    if shape.kind == "mesh":
        return [("mesh", {"filename": meshes[shape.mesh]}, at)]
    if shape.kind not in ("cylinder", "capsule"):
        return []
    out: list[tuple[str, dict[str, str], Array]] = [
        ("cylinder", {"radius": radius, "length": text(2 * shape.size[1])}, at)
    ]
    if shape.kind == "capsule":
        along = rotated(shape.turn, [0, 0, shape.size[1]])
        out += [("sphere", {"radius": radius}, at + side * along) for side in (1, -1)]
    return out


def _joint(root: ET.Element, link: Link, parent: str, constants: Nearest | None) -> None:
    kind = KINDS.get(link.kind) or ("revolute" if link.limits else "continuous")
    element = child(root, "joint", name=link.joint, type=kind)
    child(element, "parent", link=parent)
    child(element, "child", link=link.name)
    _origin(element, link.position, link.turn)
    if link.kind not in ("hinge", "slide"):
        return
    child(element, "axis", xyz=text(link.axis))
    if kind != "continuous":
        lower, upper = link.limits or (-1e6, 1e6)
        ends = {"lower": text(lower), "upper": text(upper)}
        child(element, "limit", **ends, effort=NO_LIMIT, velocity=NO_LIMIT)
    if constants is not None:
        damping, friction = text(constants.damping[0]), text(constants.friction)
        child(element, "dynamics", damping=damping, friction=friction)


def _origin(parent: ET.Element, position: Array, turn: Array) -> None:
    child(parent, "origin", xyz=text(position), rpy=text(angles(turn)))
