"""The engine plugin `joda.joint_dynamics`: where it is, and loading it.

`import mujoco` loads it by itself, through the entry point group `mujoco.plugins`; every use of
joda makes sure of it.
"""

import os
from pathlib import Path

from joda._build import MUJOCO_VERSION
from joda.errors import JodaError

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
    try:
        import mujoco  # if this is its first import, it calls us through the entry point
    except (AttributeError, ImportError, RuntimeError) as error:
        if not (backend := os.environ.get("MUJOCO_GL")):
            raise
        raise JodaError(
            f"MUJOCO_GL={backend} cannot be used here: {error}; unset it or install libosmesa6."
        ) from None

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
