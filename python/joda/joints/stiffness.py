"""What of a field must act implicitly for stability, in JAX: as in cpp/stiffness.h."""

import jax
import jax.numpy as jnp

Array = jax.Array

EXPLICIT_STIFFNESS = 1.0
"""As kExplicitStiffness in cpp/stiffness.h, and so on."""
STRIDE = 0.25
STIFF_ROW = 1e4
IDLE_ROW = 1e-12


def reach(v: Array, force: Array, inertia: Array, per_range: Array, h: Array | float) -> Array:
    """How far the joint may get within a step, in normalised position.

    Args:
        v: velocity, rad/s or m/s.
        force: the field's, N·m or N.
        inertia: kg·m² or kg.
        per_range: 1 / width of the range, 1/rad or 1/m.
        h: timestep, s.
    """
    return h * (jnp.abs(v) + h / inertia * jnp.abs(force)) * per_range


def stays_beyond(
    s: Array, v: Array, force: Array, inertia: Array, per_range: Array, h: Array | float
) -> Array:
    """Whether a step that begins beyond the range ends there too: the channel is constant there.

    Args:
        s: normalised position.
        v, force, inertia, per_range, h: as for `reach`.
    """
    landing = s + h * (v + h / inertia * force) * per_range
    return ((s < 0) & (landing < 0)) | ((s > 1) & (landing > 1))


def implicit_stiffness(
    force: Array,
    near: Array,
    descent: Array,
    constant: Array,
    inertia: Array,
    per_range: Array,
    h: Array | float,
) -> Array:
    """The stiffness that acts implicitly, N·m/rad or N/m.

    Args:
        force, inertia, per_range, h: as for `reach`.
        near: the channel's steepest descent within reach, N·m or N per range.
        descent: that of the gravity offset, N·m/rad or N/m.
        constant: whether the channel `stays_beyond` the range: it is not stiff there.
    """
    steepest = jnp.maximum(jnp.abs(force) * per_range / STRIDE, near * per_range + descent)
    soft = EXPLICIT_STIFFNESS * inertia / h**2
    return jnp.maximum(0.0, jnp.where(constant, descent, steepest) - soft)
