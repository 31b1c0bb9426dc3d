"""Effects beyond the three channels: one class each, with law, source, parameters and units.

A profile lists them under `effects`; the plugin and the JAX twin execute them inside the step. Two
effects are no more than a free curve in a channel, and are written there (`in_channel`).
"""

from typing import Annotated

from pydantic import Field

from joda.effects.base import CurveEffect, Effect
from joda.effects.damping import DirectionDependentDamping, QuadraticDamping
from joda.effects.friction import (
    AsymmetricFriction,
    LoadDependentFriction,
    PreslidingFriction,
    StribeckFriction,
)
from joda.effects.learned import LearnedForce
from joda.effects.mechanics import AddedInertia, Backlash, EndStopRestitution, GravityOffset

__all__ = [
    "CHANNEL_EFFECTS",
    "EFFECTS",
    "ON_FRICTION",
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

CHANNEL_EFFECTS = {
    "position_dependent_friction": "friction",
    "position_dependent_damping": "damping",
}
"""Effects that are a free curve in a channel, and that channel."""

ON_FRICTION = (
    *("asymmetric_friction", "stribeck_friction"),
    *("load_dependent_friction", "presliding_friction"),
)
"""Effects that act through the solver's friction row."""
