"""Profiles as they stand in a scene: the plugin's instances in MJCF, and in a running mjData."""

from pathlib import Path

import mujoco

from joda.errors import JodaError
from joda.plugin import PLUGIN, set_texts, slot
from joda.profile import ATTRIBUTES, Profile
from joda.scenes.engine import delete
from joda.scenes.model import describe_joint, find_joint, load_model

TRACE = "1e-12"
"""A frictionloss (N or N·m) that makes a solver row and is otherwise nothing."""

DAMPING_ROW = "joda_damping_"
"""Begins the name of the equality constraint whose row carries a joint's damping."""

MAX_JOINTS = 6
"""Hinges and slides that one body of MuJoCo can have."""

INERT = 'active="true" solref="-1e-12 -1e-12" solimp="1e-4 1e-4"'
"""Makes that constraint do nothing until the plugin sets its row."""


def find_instance(model: mujoco.MjModel, body: int) -> tuple[str, dict[str, str]] | None:
    """Name and attributes of the plugin's instance on the body, None if there is none.

    Args:
        model: any model.
        body: id.

    Returns:
        the name, empty where the attributes are written in the body itself, and the attributes;
        each has its joint's `prefix`.
    """
    instance = int(model.body_plugin[body])
    if instance < 0 or model.plugin[instance] != slot():
        return None
    name = bytes(model.names[model.name_pluginadr[instance] :]).partition(b"\0")[0].decode()
    alone = model.body_jntnum[body] == 1
    return name, {
        key.removeprefix("0.") if alone else key: text
        for key, text in _attributes(model, instance).items()
        if text
    }


def _attributes(model: mujoco.MjModel, instance: int) -> dict[str, str]:
    """All attributes of an instance of the plugin, in the order in which it declares them."""
    fronts = ["", *(f"{place}." for place in range(MAX_JOINTS))]
    texts = bytes(model.plugin_attr[model.plugin_attradr[instance] :]).split(b"\0")
    names = [front + name for front in fronts for name in ATTRIBUTES]
    return {name: text.decode() for name, text in zip(names, texts, strict=False)}


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
            delete(spec, plugin)


def read_profiles(path: str | Path) -> dict[str, Profile]:
    """The profiles that a scene carries.

    Args:
        path: MJCF file.

    Returns:
        joint name to profile, in the order of the model's joints.

    Raises:
        JodaError: the file cannot be loaded.
    """
    return profiles_of(load_model(Path(path)))


def open_scene(path: Path) -> tuple[mujoco.MjModel, dict[str, Profile]]:
    """A scene and its profiles, as `read_profiles`; raises JodaError also where there are none."""
    model = load_model(path)
    profiles = profiles_of(model)
    if not profiles:
        raise JodaError(f"{path}: carries no profile; attach one first with: joda attach")
    return model, profiles


def profiles_of(model: mujoco.MjModel) -> dict[str, Profile]:
    """Joint name to profile; raises JodaError."""
    out = {}
    for joint in range(model.njnt):
        found = find_instance(model, int(model.jnt_bodyid[joint]))
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
    number = joint if isinstance(joint, int) else find_joint(model, joint)
    attributes = profile.attributes()
    texts = [attributes.get(key, "") for key in ATTRIBUTES if key != "range"]
    set_texts(model._address, data._address, number, profile.joint.range, texts)
