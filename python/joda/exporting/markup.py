"""What URDF and SDF have in common: XML elements, numbers as text, angles of a frame."""

from collections.abc import Iterable
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from joda.exporting.tree import Array, Link


def text(values: ArrayLike) -> str:
    """Numbers of nine digits, separated by spaces."""
    return " ".join(f"{float(value) + 0.0:.9g}" for value in np.atleast_1d(values))


def angles(turn: Array) -> Array:
    """Roll, pitch and yaw, rad: turns about the fixed axes x, y, z in this order."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, turn)
    m = matrix.reshape(3, 3)
    pitch = np.arctan2(-m[2, 0], np.hypot(m[0, 0], m[1, 0]))
    if abs(np.cos(pitch)) < 1e-9:  # roll and yaw turn about the same axis
        return np.array([0.0, pitch, np.arctan2(-m[0, 1], m[1, 1])])
    return np.array([np.arctan2(m[2, 1], m[2, 2]), pitch, np.arctan2(m[1, 0], m[0, 0])])


def child(parent: ET.Element, tag: str, content: str = "", **attributes: str) -> ET.Element:
    """A new last child."""
    out = ET.SubElement(parent, tag, attributes)
    out.text = content or None
    return out


def rendered(root: ET.Element, notes: Iterable[str]) -> str:
    """The document, indented, with a comment that says what it is not."""
    told = "".join(f"\n  {note.replace('--', '- -')}" for note in notes)
    root.insert(0, ET.Comment(f" written by joda export{told} "))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def meshes_of(links: Iterable[Link]) -> set[int]:
    """Ids of the meshes that are used."""
    return {shape.mesh for link in links for shape in link.shapes if shape.mesh >= 0}
