"""The engine plugin `joda.joint_dynamics`: where it is, loading it, profiles in a running mjData.

`import mujoco` loads it by itself, through the entry point group `mujoco.plugins`.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from joda._build import MUJOCO_VERSION
from joda.errors import JodaError

if TYPE_CHECKING:
    import mujoco

    from joda.profile import Profile

PLUGIN = "joda.joint_dynamics"

_loaded = False


def plugin_path() -> Path:
    """The plugin's shared library, for C++ hosts: mj_loadPluginLibrary(path)."""
    folder = Path(__file__).resolve().parent
    found = sorted(folder.glob("libjoda_plugin.*"))
    if not found:
        raise JodaError(
            f"{folder}: the plugin library libjoda_plugin is missing; reinstall joda with pip."
        )
    return found[0]


def load() -> None:
    """Loads the plugin, once; raises JodaError if it was built for another MuJoCo."""
    import mujoco  # if this is its first import, it calls us through the entry point

    global _loaded
    if _loaded:
        return
    if mujoco.mj_versionString() != MUJOCO_VERSION:
        raise JodaError(
            f"joda was built for MuJoCo {MUJOCO_VERSION} and found {mujoco.mj_versionString()}; "
            f"run: pip install mujoco=={MUJOCO_VERSION}"
        )
    mujoco.mj_loadPluginLibrary(str(plugin_path()))
    _loaded = True


def set_profile(
    model: "mujoco.MjModel", data: "mujoco.MjData", joint: int | str, profile: "Profile"
) -> None:
    """Replaces the profile of a joint in one mjData; neither the model nor other data change.

    Args:
        model: a model whose joint carries a profile already.
        data: the data to change.
        joint: id or name.
        profile: the new profile; its `joint.range` places it.

    Raises:
        JodaError: the joint does not exist or carries no profile.
    """
    import joda._core as core

    number = joint if isinstance(joint, int) else model.joint(joint).id
    attributes = profile.attributes()
    texts = [
        attributes.get(f"{channel}{part}", "")
        for channel in ("conservative", "friction", "damping")
        for part in ("", "_combine")
    ]
    lo, hi = profile.joint.range
    try:
        core.set_profile(model._address, data._address, number, lo, hi, texts)
    except ValueError as error:
        raise JodaError(str(error)) from None
