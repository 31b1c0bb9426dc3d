"""Profiles inside MJX: the law of the engine plugin, in JAX.

`step` is `mujoco.mjx.step` with the profiles that a scene carries. It solves the problem that the
plugin solves, through the same two rows per joint (docs/physics.md), and is differentiable in both
modes: at a solution of the constraint solver the derivatives are those of the implicit function
theorem, whatever the solver did to get there.

    profiles = joda.read_profiles("scene.xml")
    model = mujoco.MjModel.from_xml_path("scene.xml")
    fields = joda.mjx.put_fields(model, profiles)
    m, d = mjx.put_model(model), mjx.make_data(model)
    d = jax.jit(joda.mjx.step)(m, d, fields)

A joint's friction of the last step, which the plugin keeps in `plugin_state`, is read from
`d._impl.efc_force`, and what loaded it from `d.qfrc_constraint` and `d.qfrc_actuator`. Only
backlash and a learned force need state beyond `mjx.Data`: `put_state` makes room for it.
"""

from importlib import import_module
from importlib.metadata import version

from joda.errors import JodaError

try:
    import_module("jax")
    import_module("mujoco.mjx")
except ImportError as error:
    raise JodaError(
        f'joda.mjx needs JAX and MJX (no module {error.name}); run: pip install ".[mjx]"'
    ) from None

OLDEST, NEWEST = (3, 11), (3, 17)
"""Of mujoco-mjx: other versions may have other internals than `pipeline` is composed of."""

if not OLDEST <= tuple(map(int, version("mujoco-mjx").split(".")[:2])) <= NEWEST:
    raise JodaError(
        f"joda.mjx works with mujoco-mjx {OLDEST[0]}.{OLDEST[1]} to {NEWEST[0]}.{NEWEST[1]} and "
        f"found {version('mujoco-mjx')}; run: pip install 'mujoco-mjx=={NEWEST[0]}.{NEWEST[1]}.*'"
    )

from joda._core import stop_damping  # noqa: E402
from joda.mjx.fields import Field, Fields, Place, Prepared, prepare, put_fields  # noqa: E402
from joda.mjx.simulate import rollout, step  # noqa: E402
from joda.mjx.state import put_state  # noqa: E402

__all__ = [
    "Field",
    "Fields",
    "Place",
    "Prepared",
    "prepare",
    "put_fields",
    "put_state",
    "rollout",
    "step",
    "stop_damping",
]
