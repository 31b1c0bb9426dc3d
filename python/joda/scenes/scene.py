"""Profiles as they stand in a scene: the plugin's instances in MJCF, and in a running mjData."""

from pathlib import Path

import mujoco

from joda.errors import JodaError
from joda.plugin import PLUGIN
from joda.profile import ATTRIBUTES, Profile
from joda.scenes.model import describe_joint, find_joint, load

TRACE = "1e-12"
"""A frictionloss (N or N·m) that makes a solver row and is otherwise nothing."""

DAMPING_ROW = "joda_damping_"
"""Begins the name of the equality constraint whose row carries a joint's damping."""

INERT = 'active="true" solref="-1e-12 -1e-12" solimp="1e-4 1e-4"'
"""Makes that constraint do nothing until the plugin sets its row."""


def find_instance(
    spec: mujoco.MjSpec, model: mujoco.MjModel, body: int
) -> tuple[str, dict[str, str]] | None:
    """Name and attributes of the plugin's instance on the body, None if there is none.

    Args:
        spec: the compiled spec.
        model: what it compiled to.
        body: id.

    Returns:
        the name, empty where the attributes are written in the body itself, and the attributes;
        each has its joint's `prefix`.
    """
    reference = spec.bodies[body].plugin
    if not reference.active:
        return None
    if reference.plugin_name == PLUGIN:
        name, config = "", reference.config
    else:
        declared = {p.name: p.config for p in spec.plugins if p.plugin_name == PLUGIN}
        if reference.name not in declared:
            return None
        name, config = reference.name, declared[reference.name]
    alone = model.body_jntnum[body] == 1
    return name, {k.removeprefix("0.") if alone else k: text for k, text in config.items() if text}


def prefix(model: mujoco.MjModel, joint: int) -> str:
    """What stands before the attributes of this joint: its place among several in its body."""
    body = model.jnt_bodyid[joint]
    alone = model.body_jntnum[body] == 1
    return "" if alone else f"{joint - model.body_jntadr[body]}."


def damping_equality(model: mujoco.MjModel, joint: int) -> int:
    """Id of the equality constraint on the joint alone whose row carries its damping, -1: none."""
    for k in range(model.neq):
        if (
            model.eq_type[k] == int(mujoco.mjtEq.mjEQ_JOINT)
            and (model.eq_obj1id[k], model.eq_obj2id[k]) == (joint, -1)
            and DAMPING_ROW.rstrip("_") in model.equality(k).name
        ):
            return k
    return -1


def strip_plugin(spec: mujoco.MjSpec) -> None:
    """Takes the plugin's instances out of the spec; the rows of its joints stay."""
    own = {plugin.name for plugin in spec.plugins if plugin.plugin_name == PLUGIN} - {""}
    for body in spec.bodies:
        if body.plugin.plugin_name == PLUGIN or body.plugin.name in own:
            body.plugin.active = False
    for plugin in list(spec.plugins):
        if plugin.plugin_name == PLUGIN:
            spec.delete(plugin)


def read_profiles(path: str | Path) -> dict[str, Profile]:
    """The profiles that a scene carries.

    Args:
        path: MJCF file.

    Returns:
        joint name to profile, in the order of the model's joints.

    Raises:
        JodaError: the file cannot be loaded.
    """
    return profiles_of(*load(Path(path)))


def open_scene(path: Path) -> tuple[mujoco.MjModel, dict[str, Profile]]:
    """A scene and its profiles, as `read_profiles`; raises JodaError also where there are none."""
    spec, model = load(path)
    profiles = profiles_of(spec, model)
    if not profiles:
        raise JodaError(f"{path}: carries no profile; attach one first with: joda attach")
    return model, profiles


def profiles_of(spec: mujoco.MjSpec, model: mujoco.MjModel) -> dict[str, Profile]:
    """Joint name to profile, of a compiled spec and what it compiled to; raises JodaError."""
    out = {}
    for joint in range(model.njnt):
        found = find_instance(spec, model, int(model.jnt_bodyid[joint]))
        config = found[1] if found else {}
        front = prefix(model, joint)
        own = {key: config[front + key] for key in ATTRIBUTES if front + key in config}
        if own:
            limits = tuple(map(float, own["range"].split())) if "range" in own else None
            described = describe_joint(model, joint, limits)  # type: ignore[arg-type]
            out[described.name] = Profile.from_attributes(described, own)
    return out


def set_profile(
    model: mujoco.MjModel, data: mujoco.MjData, joint: int | str, profile: Profile
) -> None:
    """Replaces the profile of a joint in one mjData; neither the model nor other data change.

    Args:
        model: a model whose joint carries a profile already.
        data: the data to change.
        joint: id, or name or address as in `joda.scenes.model.find_joint`.
        profile: the new profile; its `joint.range` places it.

    Raises:
        JodaError: the joint does not exist or carries no profile.
    """
    import joda._core as core

    number = joint if isinstance(joint, int) else find_joint(model, joint)
    attributes = profile.attributes()
    texts = [attributes.get(key, "") for key in ATTRIBUTES if key != "range"]
    try:
        core.set_profile(model._address, data._address, number, *profile.joint.range, texts)
    except ValueError as error:
        raise JodaError(str(error)) from None
