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

from joda.errors import JodaError

TESTED = ("3.11", "3.17", "4.0")
"""Of mujoco-warp: other versions may have other arrays than the kernel reads and writes."""

try:
    import_module("warp")
    import_module("mujoco_warp")
except ImportError as error:
    raise JodaError(
        f'joda.warp needs MuJoCo Warp (no module {error.name}); run: pip install ".[warp]"'
    ) from None
except AttributeError as error:  # of a MuJoCo that it was not made for
    raise JodaError(
        f"mujoco-warp {version('mujoco-warp')} does not go with mujoco {version('mujoco')} "
        f"({error}); give both the same of the versions {', '.join(TESTED[:-1])} and {TESTED[-1]}, "
        f"e.g. run: pip install 'mujoco=={TESTED[-1]}.*' 'mujoco-warp=={TESTED[-1]}.*'"
    ) from None

if ".".join(version("mujoco-warp").split(".")[:2]) not in TESTED:
    raise JodaError(
        f"joda.warp works with mujoco-warp {', '.join(TESTED[:-1])} and {TESTED[-1]} and found "
        f"{version('mujoco-warp')}; run: pip install 'mujoco-warp=={TESTED[-1]}.*'"
    )

from joda.warp.fields import Fields, attach, put_fields  # noqa: E402
from joda.warp.scene import open_scene, quiet, take_profiles  # noqa: E402

__all__ = ["Fields", "attach", "open_scene", "put_fields", "quiet", "take_profiles"]
