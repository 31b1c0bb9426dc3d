"""Profiles inside MuJoCo Warp: the law of the engine plugin in thousands of worlds at once.

`mujoco_warp.step` stays as it is. One kernel in its callback for passive forces sets the same two
rows per joint that the plugin sets (docs/physics.md).

    model, profiles = joda.warp.open_scene("scene.xml")
    m, d = mujoco_warp.put_model(model), mujoco_warp.make_data(model, nworld=4096)
    fields = joda.warp.put_fields(model, profiles, 4096)
    joda.warp.attach(m, d, fields)
    mujoco_warp.step(m, d)
"""

from importlib import import_module
from importlib.metadata import version

from joda.companions import WARP, minor
from joda.errors import JodaError

try:
    import_module("warp")
    import_module("mujoco_warp")
except ImportError as error:
    raise JodaError(
        f"joda.warp needs MuJoCo Warp (no module {error.name}); {WARP.remedy()}."
    ) from None
except AttributeError as error:  # of a MuJoCo that it was not made for
    raise JodaError(
        f"mujoco-warp {version('mujoco-warp')} does not go with mujoco {version('mujoco')} "
        f"({error}); {WARP.remedy()}."
    ) from None

if minor("mujoco-warp") != WARP.fitting(minor("mujoco")):  # arrays that the kernel knows
    raise JodaError(
        f"joda.warp does not take mujoco-warp {version('mujoco-warp')} beside mujoco "
        f"{version('mujoco')}; {WARP.remedy()}."
    )

from joda.warp.fields import Fields, attach, put_fields
from joda.warp.scene import open_scene, quiet, take_profiles

__all__ = ["Fields", "attach", "open_scene", "put_fields", "quiet", "take_profiles"]
