"""Profiles as they stand in a scene: the plugin's instances in MJCF, read back."""

from pathlib import Path

import mujoco

from joda.model import describe_joint, load_spec
from joda.plugin import PLUGIN
from joda.profile import ATTRIBUTES, Profile


def plugin_name(model: mujoco.MjModel, body: int) -> str | None:
    """Name of the plugin instance that the body refers to, None if there is none."""
    instance = int(model.body_plugin[body])
    name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_PLUGIN, instance) if instance >= 0 else None
    return str(name) if instance >= 0 else None


def prefix(model: mujoco.MjModel, joint: int) -> str:
    """What stands before the attributes of this joint: its place among several in its body."""
    body = model.jnt_bodyid[joint]
    alone = model.body_jntnum[body] == 1
    return "" if alone else f"{joint - model.body_jntadr[body]}."


def read_profiles(path: str | Path) -> dict[str, Profile]:
    """The profiles that a scene carries.

    Args:
        path: MJCF file.

    Returns:
        joint name to profile, in the order of the model's joints.

    Raises:
        JodaError: the file cannot be loaded.
    """
    spec = load_spec(Path(path))
    model = spec.compile()
    configs = {p.name: dict(p.config) for p in spec.plugins if p.plugin_name == PLUGIN}
    out = {}
    for joint in range(model.njnt):
        config = configs.get(plugin_name(model, int(model.jnt_bodyid[joint])) or "", {})
        front = prefix(model, joint)
        own = {key: config[front + key] for key in ATTRIBUTES if config.get(front + key)}
        if own:
            lo_hi = own["range"].split() if "range" in own else None
            limits = (float(lo_hi[0]), float(lo_hi[1])) if lo_hi else None
            described = describe_joint(model, joint, limits)
            out[described.name] = Profile.from_attributes(described, own)
    return out
