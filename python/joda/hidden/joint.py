"""Joints at random, from a button to a heavy door, and the base model of each."""

import numpy as np

from joda.hidden.truth import Joint, Truth

GRAVITY = 9.81
WOOD = 600.0
"""Density of the cube that stands for the part in pictures, kg/m³."""
TIMESTEP = 0.002
"""Of a base model, s, unless its joint is fast."""
TIGHT = ' solreffriction="0.002 1" solimpfriction="0.99 0.9999 0.001 0.5 2"'
"""Of a base model whose dry friction does not creep."""
STEPS = 700
"""Steps of a base model in its joint's natural time, at least."""


def draw_truth(
    rng: np.random.Generator, heavy: bool, gravity: bool, friction: bool, damping: bool
) -> Truth:
    """Draws a joint with nothing hidden.

    Args:
        rng: of the draw.
        heavy: only from the slower half of the joints.
        gravity: whether it surely has gravity.
        friction, damping: whether it surely has these.

    Returns:
        the joint; the base model's friction and damping are wrong in half of the draws.
    """
    joint = _joint(rng, heavy, gravity)
    absent = rng.choice(["friction", "damping", "none"], p=[0.2, 0.2, 0.6])
    dry = joint.force * _between(rng, 0.03, 0.15)
    viscous = joint.force * joint.time / joint.span * _between(rng, 0.03, 0.15)
    if absent == "friction" and not friction:
        dry = 0.0
    if absent == "damping" and not damping:
        viscous = 0.0
    wrong = (1.0, 1.0) if rng.random() < 0.5 else tuple(rng.uniform(0.8, 1.25, 2))
    return Truth(
        joint,
        dry,
        viscous,
        friction_model=float(dry * wrong[0]),
        damping_model=float(viscous * wrong[1]),
    )


def _joint(rng: np.random.Generator, heavy: bool, gravity: bool) -> Joint:
    hinge = bool(rng.random() < 0.5)
    u = rng.uniform(0.5 if heavy else 0.0, 1.0)
    if hinge:
        inertia, span, time = 1e-5 * 1e6**u, rng.uniform(0.8, 2.8), 0.3 * (2 / 0.3) ** u
    else:
        inertia, span, time = 0.01 * 2000**u, 0.006 * 80**u * rng.uniform(0.7, 1.5), 0.3 * 5**u
    force = inertia * span / time**2 * _between(rng, 10, 30)
    lo = rng.uniform(-0.6, 0.2) * span if rng.random() < 0.5 else 0.0
    size, angle = force * _between(rng, 0.1, 0.6), rng.uniform(0, 2 * np.pi)
    if not (gravity or rng.random() < 1 / 3):
        size = 0.0
    if hinge:
        cos, sin = size * np.cos(angle), size * np.sin(angle)
    else:
        cos, sin = np.sign(np.cos(angle)) * min(size, 0.95 * inertia * GRAVITY), 0.0
    return Joint(
        "hinge" if hinge else "slide",
        float(lo),
        float(lo + span),
        float(inertia),
        float(cos),
        float(sin),
        float(time),
        float(force),
    )


def base_model(truth: Truth, name: str) -> str:
    """MJCF of the joint as its base model has it."""
    joint = truth.believed or truth.joint
    if joint.kind == "hinge":
        axis, inertial, mass = _hinge(joint)
    else:
        axis, inertial, mass = _slide(joint)
    half = 0.5 * (mass / WOOD) ** (1 / 3)
    stiffness, rest = truth.spring
    native = "".join(
        f' {key}="{value!r}"'
        for key, value in (
            ("damping", truth.damping_model),
            ("frictionloss", truth.friction_model),
            ("stiffness", stiffness),
            ("springref", rest),
        )
        if value
    )
    if truth.limit_model:
        native += ' solreflimit="{!r} {!r}"'.format(*truth.limit_model)
    if truth.tight:
        native += TIGHT
    return f"""<mujoco model="{name}">
  <compiler angle="radian"/>
  <option timestep="{_timestep(joint)!r}" gravity="0 0 -{GRAVITY!r}"/>
  <worldbody>
    <body name="part">
      <joint name="{name}" type="{joint.kind}" axis="{axis}" limited="true"
             range="{joint.lo!r} {joint.hi!r}"{native}/>
      {inertial}
      <geom type="box" size="{half!r} {half!r} {half!r}" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>
"""


def _timestep(joint: Joint) -> float:
    """A part of the usual one that is short for the joint, s."""
    return TIMESTEP / float(np.ceil(STEPS * TIMESTEP / joint.time))


def _hinge(joint: Joint) -> tuple[str, str, float]:
    """Axis, inertial element and mass (kg) of a hinge: horizontal if it has gravity.

    Turned by q about +y, a centre of mass at (x, 0, z) makes the torque m g (x cos q + z sin q).
    """
    torque = float(np.hypot(joint.gravity_cos, joint.gravity_sin))
    if torque == 0:
        x, z, share = 0.3, 0.0, 0.5
    else:
        share = min(0.6, torque * 0.5 / (joint.inertia * GRAVITY))
        arm = share * joint.inertia * GRAVITY / torque
        x, z = arm * joint.gravity_cos / torque, arm * joint.gravity_sin / torque
    mass = share * joint.inertia / (x * x + z * z)
    own = (1 - share) * joint.inertia
    inertial = (
        f'<inertial pos="{x!r} 0 {z!r}" mass="{mass!r}" diaginertia="{own!r} {own!r} {own!r}"/>'
    )
    return ("0 1 0" if torque else "0 0 1"), inertial, float(mass)


def _slide(joint: Joint) -> tuple[str, str, float]:
    """As _hinge, of a slide: inclined if it has gravity."""
    sine = -joint.gravity_cos / (joint.inertia * GRAVITY)
    own = 0.1 * joint.inertia * joint.span**2
    inertial = (
        f'<inertial pos="0 0 0" mass="{joint.inertia!r}" diaginertia="{own!r} {own!r} {own!r}"/>'
    )
    return f"{float(np.sqrt(1 - sine**2))!r} 0 {sine!r}", inertial, joint.inertia


def _between(rng: np.random.Generator, least: float, most: float) -> float:
    return float(np.exp(rng.uniform(np.log(least), np.log(most))))
