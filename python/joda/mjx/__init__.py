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

from joda.companions import MJX

MJX.load("joda.mjx", "jax", "mujoco.mjx")  # its versions have other internals

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
