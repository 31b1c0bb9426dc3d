"""The engine plugin `joda.joint_dynamics`: where it is, and loading it.

MuJoCo's structures change with every release, so there is one library for each version of it:
the release's, or else one that is made here once. MuJoCo 4 loads it by itself through the entry
point group `mujoco.plugins`; into an older one `import joda` loads it.
"""

import ctypes
import os
from collections.abc import Sequence
from functools import cache
from importlib import metadata
from pathlib import Path

from joda.errors import JodaError
from joda.files import cache_folder
from joda.making import make

PLUGIN = "joda.joint_dynamics"


def mujoco_version() -> str:
    """Of the MuJoCo that is installed, which is not imported; raises JodaError if none is."""
    try:
        return metadata.version("mujoco")
    except metadata.PackageNotFoundError:
        raise JodaError("MuJoCo is not installed; run: pip install mujoco") from None


def plugin_path() -> Path:
    """The plugin's library, for C++ hosts: mj_loadPluginLibrary(path).

    It is the one for the MuJoCo that is installed. Where joda has none for it, it is compiled, once
    for all.

    Raises:
        JodaError: no MuJoCo is installed, or there is no library for it and none can be made.
    """
    version = mujoco_version()
    folder = Path(__file__).resolve().parent
    found = sorted((folder / "plugins").glob(f"*joda_plugin-{version}.*"))
    return found[0] if found else make(folder / "cpp", version)


def made_here(path: Path) -> bool:
    """Whether a library was compiled into the user's cache, which outlives an installation."""
    return cache_folder() in path.parents


def load_into_older() -> None:
    """Loads the plugin if MuJoCo would not do so by itself, as before 4.0; raises as `load`."""
    if int(mujoco_version().partition(".")[0]) < 4:
        load()


def load() -> None:
    """Loads the plugin, once; raises JodaError if it is not there for this MuJoCo."""
    try:
        import mujoco  # if this is its first import, it calls us through the entry point
    except (AttributeError, ImportError, RuntimeError) as error:
        if not (backend := os.environ.get("MUJOCO_GL")):
            raise
        raise JodaError(
            f"MUJOCO_GL={backend} cannot be used here: {error}; unset it or install libosmesa6."
        ) from None
    _library(mujoco.mj_versionString())


@cache
def _library(running: str) -> ctypes.CDLL:
    """The plugin's library, whose loading registers it with the MuJoCo that runs."""
    if running != mujoco_version():
        raise JodaError(
            f"MuJoCo {running} runs and {mujoco_version()} is installed; run: "
            f"pip install --force-reinstall mujoco=={mujoco_version()}"
        )
    path = plugin_path()
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        remedy = "delete it, so that it is compiled anew" if made_here(path) else "reinstall joda"
        raise JodaError(f"{path}: cannot be loaded ({error}); {remedy}.") from None


def slot() -> int:
    """What `mjModel.plugin` has for the plugin's instances."""
    import mujoco

    return int(_library(mujoco.mj_versionString()).joda_slot())


def set_texts(
    model: int, data: int, joint: int, limits: tuple[float, float], texts: Sequence[str]
) -> None:
    """Replaces the profile of a joint in one mjData.

    Args:
        model, data: addresses of the mjModel and the mjData.
        joint: its id.
        limits: joint positions at s = 0 and s = 1.
        texts: components and combine of the three channels, then the effects.

    Raises:
        JodaError: one sentence of the plugin that says what does not fit.
    """
    import mujoco

    swap = _library(mujoco.mj_versionString()).joda_set_profile
    error = ctypes.create_string_buffer(1024)
    encoded = (ctypes.c_char_p * len(texts))(*(text.encode() for text in texts))
    if swap(
        ctypes.c_void_p(model),
        ctypes.c_void_p(data),
        ctypes.c_int(joint),
        *map(ctypes.c_double, limits),
        encoded,
        error,
        ctypes.c_int(len(error)),
    ):
        raise JodaError(error.value.decode(errors="replace"))
