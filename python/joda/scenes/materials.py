"""What a part would weigh, from its size and what it seems to be made of."""

import re
from dataclasses import dataclass

import mujoco
import numpy as np

from joda.scenes.masses import solid_volume
from joda.scenes.outline import box_along, own_geoms, surface

NAMED: tuple[tuple[str, str, float], ...] = (
    ("glass", r"glass|glas|verre|vidrio|vetro", 2500.0),
    ("stone", r"stone|marble|granite|ceramic|porcelain|stein|keramik", 2500.0),
    ("aluminium", r"alumin|\balu\b", 2700.0),
    ("steel", r"steel|metal|iron|stahl|acier|acero|chrome|inox", 7850.0),
    ("wood", r"wood|oak|pine|birch|walnut|plywood|mdf|holz|bois|madera|legno|timber", 650.0),
    ("plastic", r"plastic|abs\b|kunststoff|plastique|plastico|rubber|nylon", 1050.0),
)
"""Materials, how names speak of them, and their densities in kg/m³: of the usual kinds."""
WOOD, PLASTIC, HOLLOW = 650.0, 1050.0, 400.0
"""Densities of furniture boards and of ABS, and of the doors of appliances, which are sheet, foam
and glass; kg/m³."""
SHEET, HEAVY = 0.003, 2600.0
"""Metal is sheet of 3 mm in all, where a part is thicker; metals are denser than this, kg/m³."""
THIN, FINGERS = 0.03, 0.12
"""A part so thin (m) is a board; one of that size (m) is worked by fingers and moulded."""


@dataclass(frozen=True)
class Weight:
    """An estimate: kg, and what of."""

    mass: float
    material: str


def estimate_weight(model: mujoco.MjModel, joint: int) -> Weight | None:
    """What a joint's part would weigh; None of a part without geoms.

    The material that the largest geom is named after counts, metal as sheet; without one a part
    worked by fingers is moulded of plastic, a thin one is a board, any other is hollow.
    """
    body = int(model.jnt_bodyid[joint])
    geoms = own_geoms(model, body)
    if not len(geoms):
        return None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    box = box_along(surface(model, data, geoms), data.xaxis[joint])
    volume = min(float(np.prod(box.size)), solid_volume(model, geoms))
    largest = int(geoms[int(np.argmax(np.prod(model.geom_aabb[geoms, 3:], axis=1)))])
    thick, size = float(2 * model.geom_aabb[largest, 3:].min()), float(box.size.max())
    for material, pattern, density in NAMED:
        if re.search(pattern, _names(model, largest)):
            share = min(1.0, SHEET / thick) if density > HEAVY else 1.0
            return Weight(density * volume * share, material)
    if size <= FINGERS:
        return Weight(PLASTIC * volume, "plastic, by its size")
    if thick <= THIN:
        return Weight(WOOD * volume, "a board, by its thickness")
    return Weight(HOLLOW * volume, "hollow, by its size")


def _names(model: mujoco.MjModel, geom: int) -> str:
    """What a geom, its mesh and its material are called."""
    out = [model.geom(geom).name]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH and model.geom_dataid[geom] >= 0:
        out.append(model.mesh(int(model.geom_dataid[geom])).name)
    if model.geom_matid[geom] >= 0:
        out.append(model.mat(int(model.geom_matid[geom])).name)
    return " ".join(out).lower()
