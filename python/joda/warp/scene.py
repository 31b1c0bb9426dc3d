"""Scenes as mujoco_warp takes them: it refuses models that carry a plugin."""

from pathlib import Path

import mujoco
import warp as wp

from joda.errors import JodaError
from joda.profile import Profile
from joda.scenes.model import load
from joda.scenes.scene import profiles_of, strip_plugin


def open_scene(path: str | Path) -> tuple[mujoco.MjModel, dict[str, Profile]]:
    """A scene without the plugin, and the profiles that it carried.

    Args:
        path: MJCF file that `joda attach` wrote.

    Returns:
        the model, for `mujoco_warp.put_model`, and joint name to profile.

    Raises:
        JodaError: the file cannot be loaded, or carries no profile.
    """
    spec, model = load(Path(path))
    profiles = profiles_of(model)
    if not profiles:
        raise JodaError(f"{path}: carries no profile; attach one first with: joda attach")
    strip_plugin(spec)
    return spec.compile(), profiles


def take_profiles(spec: mujoco.MjSpec) -> dict[str, Profile]:
    """The profiles that a spec carries, which are no longer in it afterwards.

    Args:
        spec: of a scene that `joda attach` wrote; the plugin's instances are taken out.

    Returns:
        joint name to profile.

    Raises:
        JodaError: a profile cannot be read.
    """
    profiles = profiles_of(spec.compile())
    strip_plugin(spec)
    return profiles


def quiet() -> None:
    """Makes Warp say only what is wrong, not which kernels it loads."""
    wp.config.log_level = wp.LOG_ERROR
