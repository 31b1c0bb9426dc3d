"""Profiles of many worlds on a device, and letting them act in mujoco_warp's step."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import warp as wp

from joda.effects import Backlash
from joda.errors import JodaError
from joda.profile import Profile
from joda.scenes.model import find_joint, joint_type
from joda.scenes.scene import damping_equality
from joda.warp.law import Profiles, forget, launch
from joda.warp.learned import make_tables
from joda.warp.numbers import Number, Place, Row, State
from joda.warp.table import make_curves, numbers_of, rebounds

INTEGRATORS = ("EULER", "IMPLICIT", "IMPLICITFAST")
"""That keep the rows as they are set."""
HEAVIEST_HANDLE, HEAVIEST_LOAD = 0.5, 0.95
"""Share of the joint's inertia: as the plugin's."""


@dataclass(frozen=True)
class Fields:
    """Profiles of the same joints in each of many worlds.

    Attributes:
        joints: their names, in the order of the arrays.
        nworld: number of worlds.
        numbers: arrays on the device, shape (nworld, joints), by name; what is written into them
            acts from the next step on. `conservative.strength` and all other strengths are factors
            on the curve of that name, at least 0; `range.lo` and `range.hi` are the joint's
            position at s = 0 and s = 1; the others are the effects' numbers, in their units: see
            docs/warp.md.
        friction: that of the last step, N·m or N, shape (nworld, joints); not to be written.
        size: nv and njnt of the model.
    """

    joints: tuple[str, ...]
    nworld: int
    numbers: dict[str, Any]
    friction: Any
    size: tuple[int, int]
    _profiles: Any

    def reset(self, mask: Any = None) -> None:
        """Makes joints begin anew: no friction yet, handles in the middle of their play.

        A world whose time goes back, as by `mujoco_warp.reset_data`, is reset by itself.

        Args:
            mask: which worlds, booleans of shape (nworld,); by default all. A Warp array is read
                on its device, so that this can be captured in a graph.

        Raises:
            JodaError: the mask is another one.
        """
        device = self.friction.device
        if mask is None:
            mask = np.ones(self.nworld, bool)
        if not isinstance(mask, wp.array):
            mask = wp.array(np.asarray(mask), device=device)
        if mask.dtype != wp.bool or mask.shape != (self.nworld,):
            raise JodaError(
                f"mask is of {mask.dtype.__name__} and has the shape {mask.shape}; give booleans "
                f"of the shape ({self.nworld},), one for each world."
            )
        dim = (self.nworld, len(self.joints))
        wp.launch(forget, dim=dim, inputs=[mask, self._profiles], device=device)


def put_fields(
    model: mujoco.MjModel,
    profiles: Mapping[str, Profile] | Sequence[Mapping[str, Profile]],
    nworld: int,
    *,
    device: Any = None,
) -> Fields:
    """The profiles of a scene's joints, for `attach`.

    Args:
        model: the scene, with or without the plugin's instances.
        profiles: joint name to profile; or several such, of the same joints, of which world w has
            number w modulo how many there are: other curves in other places.
        nworld: number of worlds.
        device: of Warp, by default the current one.

    Returns:
        the fields; all worlds with strengths of 1.

    Raises:
        JodaError: there is no profile or no world, a joint does not exist, is of another type or
            lacks what its profile needs, or the variants are not of the same joints.
    """
    variants = [profiles] if isinstance(profiles, Mapping) else list(profiles)
    if not isinstance(nworld, int | np.integer) or isinstance(nworld, bool) or nworld < 1:
        raise JodaError(f"nworld is {nworld}; give a whole number, at least 1.")
    if not variants or not variants[0]:
        raise JodaError("there is no profile; give that of at least one joint.")
    joints = tuple(variants[0])
    for variant in variants:
        if tuple(variant) != joints:
            raise JodaError(
                f"the variants have the joints {', '.join(joints)} and {', '.join(variant)}; give "
                "all of them the same joints in the same order."
            )
    ids = [find_joint(model, name) for name in joints]
    for variant in variants:
        for joint, (name, profile) in zip(ids, variant.items(), strict=True):
            _check(model, joint, name, profile)

    shape = (nworld, len(joints))
    by_variant = np.array([[numbers_of(p) for p in v.values()] for v in variants])
    by_variant = by_variant.reshape(len(variants), len(joints), len(Number))
    by_world = by_variant[np.arange(nworld) % len(variants)].transpose(2, 0, 1)
    places = np.zeros((len(joints), len(Place)), np.int32)
    for place, joint in zip(places, ids, strict=True):
        place[Place.JOINT] = joint
        place[Place.DOF] = model.jnt_dofadr[joint]
        place[Place.QPOS] = model.jnt_qposadr[joint]
        place[Place.BODY] = model.jnt_bodyid[joint]
        place[Place.LAST_BODY] = _last_body(model, place[Place.BODY])
        place[Place.EQUALITY] = damping_equality(model, joint)
        place[Place.HINGE] = model.jnt_type[joint] == int(mujoco.mjtJoint.mjJNT_HINGE)
    out = Profiles()
    out.curves = make_curves(variants, device)
    out.tables = make_tables(variants, device)
    out.numbers = wp.array(np.ascontiguousarray(by_world), dtype=float, device=device)
    state = np.zeros((len(State), *shape), np.float32)
    state[State.TIME] = -1
    out.state = wp.array(state, dtype=float, device=device)
    out.rows = wp.full((len(Row), *shape), -1, dtype=int, device=device)
    out.places = wp.array(places, dtype=int, device=device)
    out.rebounds = wp.array(rebounds(), dtype=float, device=device)
    inertia = [model.dof_M0[model.jnt_dofadr[joint]] for joint in ids]
    out.inertia = wp.array(np.array(inertia, np.float32), dtype=float, device=device)
    named = {number.title: out.numbers[int(number)] for number in Number}
    friction = out.state[int(State.FRICTION)]
    return Fields(joints, nworld, named, friction, (model.nv, model.njnt), out)


def attach(m: Any, d: Any, fields: Fields) -> None:
    """Lets the profiles act in `mujoco_warp.step(m, d)`, as the plugin does in `mj_step`.

    They act through `m.callback.passive`; one that is there already is called before them. The
    fields belong to this data; attaching others to the model replaces them.

    Args:
        m: of `mujoco_warp.put_model`.
        d: the data.
        fields: of `put_fields`, for the same model and number of worlds.

    Raises:
        JodaError: they do not fit, or the model has an option with which the rows would not act.
    """
    _check_options(m)
    _check_fit(m, d, fields)
    before = m.callback.passive
    if isinstance(before, _Acting):
        before = before.before
    fields.reset()
    m.callback.passive = _Acting(fields, before)


@dataclass(frozen=True)
class _Acting:
    """The callback of a model: what was there before, then the profiles."""

    fields: Fields
    before: Callable[[Any, Any], None] | None

    def __call__(self, m: Any, d: Any) -> None:
        if self.before is not None:
            self.before(m, d)
        if d.nworld != self.fields.nworld:
            _check_fit(m, d, self.fields)
        launch(m, d, self.fields._profiles)


def _last_body(model: mujoco.MjModel, body: int) -> int:
    """The last of the bodies that move with a body: they follow it."""
    last = int(body)
    while last + 1 < model.nbody and model.body_parentid[last + 1] >= body:
        last += 1
    return last


def _check_fit(m: Any, d: Any, fields: Fields) -> None:
    if d.nworld != fields.nworld:
        raise JodaError(
            f"the data have {d.nworld} worlds and the fields {fields.nworld}; give put_fields "
            "the data's nworld."
        )
    if (m.nv, m.njnt) != fields.size:
        raise JodaError("the fields are those of another model; give put_fields this one's.")
    if d.qpos.device != fields.friction.device:
        raise JodaError(
            f"the data are on {d.qpos.device} and the fields on {fields.friction.device}; give "
            "put_fields the data's device."
        )


def _check_options(m: Any) -> None:
    name = mujoco.mjtIntegrator(int(m.opt.integrator)).name.removeprefix("mjINT_")
    if name not in INTEGRATORS:
        raise JodaError(
            f"joda.warp steps with the integrators Euler, implicit and implicitfast, not {name}; "
            "set option/integrator."
        )
    if getattr(m.opt, "noslip_iterations", 0):  # MuJoCo Warp 3.11 refuses them itself
        raise JodaError(
            "noslip drops the compliance of friction rows, without which joints do not come to "
            "rest; set option/noslip_iterations to 0."
        )
    if m.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_SLEEP):
        raise JodaError(
            "joda.warp does not know which joints are asleep; switch option/flag sleep off."
        )


def _check(model: mujoco.MjModel, joint: int, name: str, profile: Profile) -> None:
    """Raises JodaError where the plugin would refuse the profile."""
    if (kind := joint_type(model, joint)) != profile.joint.type:
        raise JodaError(
            f"joint '{name}' is a {kind} and its profile that of a {profile.joint.type}; give it "
            f"the profile of a {kind}."
        )
    dof = int(model.jnt_dofadr[joint])
    rubs = profile.channels.friction.components or any(
        effect.ON_FRICTION for effect in profile.effects
    )
    if rubs and not model.dof_frictionloss[dof] > 0:
        raise JodaError(
            f"joint '{name}' has friction in its profile and no friction row; "
            'add frictionloss="1e-12" to the joint.'
        )
    if model.dof_armature[dof] < 0.999999 * profile.added_inertia:
        raise JodaError(
            f"joint '{name}' has armature {model.dof_armature[dof]:g}, less than its effect "
            f'added_inertia; write armature="{profile.added_inertia:g}" on the joint.'
        )
    for effect in profile.effects:
        if not isinstance(effect, Backlash):
            continue
        most = HEAVIEST_HANDLE / model.dof_invweight0[dof]
        if effect.load:
            most = HEAVIEST_LOAD * model.dof_M0[dof]
        if effect.inertia > most:
            raise JodaError(
                f"joint '{name}' has a backlash with an inertia of {effect.inertia:g}; at most "
                f"{most:g} is possible."
            )
