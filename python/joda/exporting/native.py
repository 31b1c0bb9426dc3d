"""MJCF without the plugin: MuJoCo's own spring, damping and frictionloss."""

from collections.abc import Mapping
from math import degrees
from pathlib import Path

import mujoco

from joda.exporting.nearest import Nearest
from joda.scenes.mjcf import Source
from joda.scenes.model import write_out
from joda.scenes.scene import DAMPING_ROW, strip_plugin


def native(
    path: Path, spec: mujoco.MjSpec, constants: Mapping[int, Nearest], folder: Path
) -> bytes:
    """The scene, as MuJoCo writes it out, with constants in place of the profiles.

    Args:
        path: of the scene.
        spec: it, compiled; is changed.
        constants: by the joint's id.
        folder: where the file will lie.
    """
    strip_plugin(spec)
    for equality in list(spec.equalities):
        if DAMPING_ROW.rstrip("_") in equality.name:
            spec.delete(equality)
    hinge = mujoco.mjtJoint.mjJNT_HINGE
    for number, own in constants.items():
        joint = spec.joints[number]
        joint.stiffness[:3] = own.stiffness
        joint.damping[:3] = (*own.damping, 0.0)
        joint.frictionloss = own.friction
        by_degree = spec.compiler.degree and joint.type == hinge
        joint.springref = degrees(own.reference) if by_degree else own.reference
    spec.compile()
    source = Source(path, write_out(spec, path))
    source.relocate(folder)
    return source.render()
