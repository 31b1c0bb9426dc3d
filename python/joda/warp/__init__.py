"""Profiles inside MuJoCo Warp: the law of the engine plugin in thousands of worlds at once.

`mujoco_warp.step` stays as it is. One kernel in its callback for passive forces sets the same two
rows per joint that the plugin sets (docs/physics.md).

    model, profiles = joda.warp.open_scene("scene.xml")
    m, d = mujoco_warp.put_model(model), mujoco_warp.make_data(model, nworld=4096)
    fields = joda.warp.put_fields(model, profiles, 4096)
    joda.warp.attach(m, d, fields)
    mujoco_warp.step(m, d)
"""

from joda.companions import WARP

WARP.load("joda.warp", "warp", "mujoco_warp")  # its versions have other arrays

from joda.warp.fields import Fields, attach, put_fields  # noqa: E402
from joda.warp.scene import open_scene, quiet, take_profiles  # noqa: E402

__all__ = ["Fields", "attach", "open_scene", "put_fields", "quiet", "take_profiles"]
