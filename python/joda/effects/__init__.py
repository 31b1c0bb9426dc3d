"""Effects beyond the three channels: one file each, with law, source, parameters and units.

A profile lists them under `effects`; the plugin and the JAX twin execute them inside the step. Two
effects are no more than a free curve in a channel, and are written there (`in_channel`).
"""

from typing import Annotated

from pydantic import Field

from joda.effects.added_inertia import AddedInertia
from joda.effects.asymmetric_friction import AsymmetricFriction
from joda.effects.backlash import Backlash
from joda.effects.base import CurveEffect, Effect
from joda.effects.direction_dependent_damping import DirectionDependentDamping
from joda.effects.end_stop_restitution import EndStopRestitution
from joda.effects.gravity_offset import GravityOffset
from joda.effects.learned_force import LearnedForce
from joda.effects.load_dependent_friction import LoadDependentFriction
from joda.effects.presliding_friction import PreslidingFriction
from joda.effects.quadratic_damping import QuadraticDamping
from joda.effects.stribeck_friction import StribeckFriction

__all__ = [
    "CHANNEL_EFFECTS",
    "EFFECTS",
    "AddedInertia",
    "AnyEffect",
    "AsymmetricFriction",
    "Backlash",
    "CurveEffect",
    "DirectionDependentDamping",
    "Effect",
    "EndStopRestitution",
    "GravityOffset",
    "LearnedForce",
    "LoadDependentFriction",
    "PreslidingFriction",
    "QuadraticDamping",
    "StribeckFriction",
    "written_as",
]

AnyEffect = Annotated[
    AddedInertia
    | AsymmetricFriction
    | Backlash
    | DirectionDependentDamping
    | EndStopRestitution
    | GravityOffset
    | LearnedForce
    | LoadDependentFriction
    | PreslidingFriction
    | QuadraticDamping
    | StribeckFriction,
    Field(discriminator="effect"),
]

EFFECTS: dict[str, type[Effect]] = {
    cls.model_fields["effect"].default: cls
    for cls in (
        DirectionDependentDamping,
        AsymmetricFriction,
        StribeckFriction,
        QuadraticDamping,
        PreslidingFriction,
        LoadDependentFriction,
        AddedInertia,
        GravityOffset,
        EndStopRestitution,
        Backlash,
        LearnedForce,
    )
}
"""By name; those that a profile lists under `effects`."""


def written_as(effect: str) -> str:
    """The effect that a profile lists for one: itself, or what its card writes it as."""
    card = EFFECTS.get(effect)
    return (card and card.WRITTEN_AS) or effect


CHANNEL_EFFECTS = {
    "position_dependent_friction": "friction",
    "position_dependent_damping": "damping",
}
"""Effects that are a free curve in a channel, and that channel."""
