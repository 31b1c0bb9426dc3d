"""MJCF without the plugin: MuJoCo's own spring, damping and frictionloss."""

from collections.abc import Mapping
from math import degrees, isclose
from pathlib import Path

import mujoco

from joda.exporting.nearest import Nearest
from joda.plugin import PLUGIN
from joda.scenes.engine import delete, set_strength
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
            delete(spec, equality)
    for number, own in constants.items():
        joint = spec.joints[number]
        set_strength(joint, "stiffness", *own.stiffness)
        set_strength(joint, "damping", *own.damping, 0.0)
        joint.frictionloss = own.friction
        joint.springref = own.reference
    model = spec.compile()
    for number, own in constants.items():  # a joint keeps the angle's unit of the file it is from
        if not isclose(model.qpos_spring[model.jnt_qposadr[number]], own.reference):
            spec.joints[number].springref = degrees(own.reference)
    spec.compile()
    source = Source(path, write_out(spec, path))
    _forget_plugin(source)
    source.relocate(folder)
    return source.render()


def _forget_plugin(source: Source) -> None:
    """Takes out that the scene needs the plugin, which MuJoCo writes though nothing has it."""
    for section in source.root.children:
        if section.tag == "extension":
            ours = [one for one in section.children if one.attributes.get("plugin") == PLUGIN]
            for element in [section] if len(ours) == len(section.own) else ours:
                element.replace("")
