"""What a model itself gives a joint: MuJoCo's elements on it, and what else acts on it."""

import mujoco
from pydantic import BaseModel, ConfigDict

from joda.profile import Joint
from joda.scenes.contacts import contacts_along
from joda.scenes.engine import polynomial
from joda.scenes.native import MIN_FRICTION
from joda.scenes.unmodelled import unmodelled_elements


class Touch(BaseModel):
    """A contact that resists the joint over a part of its range.

    Attributes:
        geom: of what the joint moves.
        other: of the rest of the scene.
        interval: where, in normalised position.
        force: the largest, N·m or N.
        stop: whether it is that of an end of the range.
    """

    model_config = ConfigDict(frozen=True)

    geom: str
    other: str
    interval: tuple[float, float]
    force: float
    stop: bool


class Elements(BaseModel):
    """MuJoCo's own elements on a joint, and what else acts on it.

    Attributes:
        damping: at rest, N·m·s/rad or N·s/m.
        frictionloss: N·m or N.
        stiffness: of the joint's spring near its rest, N·m/rad or N/m.
        springref: where that spring rests, rad or m.
        armature: inertia added to the joint, kg·m² or kg; it is part of the context's inertia.
        unmodelled: tendons, equality constraints and media that act on it, by kind and name.
        contacts: over its range, all other joints at their reference.
    """

    model_config = ConfigDict(frozen=True)

    damping: float = 0.0
    frictionloss: float = 0.0
    stiffness: float = 0.0
    springref: float = 0.0
    armature: float = 0.0
    unmodelled: tuple[str, ...] = ()
    contacts: tuple[Touch, ...] = ()

    def describe(self, joint: Joint) -> str:
        """Its own elements in a line; "none" if it has none."""
        force, position = joint.force_unit, joint.unit
        told = []
        if self.damping:
            told.append(f"damping {self.damping:.3g} {force}·s/{position}")
        if self.frictionloss:
            told.append(f"friction {self.frictionloss:.3g} {force}")
        if self.stiffness:
            told.append(
                f"a spring of {self.stiffness:.3g} {force}/{position} towards q = "
                f"{self.springref:.3g}"
            )
        if self.armature:
            unit = "kg·m²" if joint.type == "hinge" else "kg"
            told.append(f"armature {self.armature:.3g} {unit}")
        return ", ".join(told) or "none"

    def touches(self) -> str:
        """The contacts in a line; empty if there are none."""
        return ", ".join(
            f"{one.geom} meets {one.other} from s = {one.interval[0]:.2f} to "
            f"{one.interval[1]:.2f}{' (a stop)' if one.stop else ''}"
            for one in self.contacts
        )


def elements(model: mujoco.MjModel, joint: int, described: Joint) -> Elements:
    """What a compiled model gives a joint.

    Args:
        model: compiled.
        joint: id of a hinge or slide.
        described: the same joint, with its range.
    """
    dof = int(model.jnt_dofadr[joint])
    friction = float(model.dof_frictionloss[dof])
    return Elements(
        damping=polynomial(model, "dof_damping", dof)[0],
        frictionloss=friction if friction > MIN_FRICTION else 0.0,
        stiffness=polynomial(model, "jnt_stiffness", joint)[0],
        springref=float(model.qpos_spring[model.jnt_qposadr[joint]]),
        armature=float(model.dof_armature[dof]),
        unmodelled=unmodelled_elements(model, joint),
        contacts=tuple(
            Touch(
                geom=one.geom,
                other=one.other,
                interval=one.interval,
                force=one.force,
                stop=one.stop,
            )
            for one in contacts_along(model, joint, described, described.range)
        ),
    )
