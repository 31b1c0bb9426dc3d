"""A joint by itself on a test rig: one body, one joint, its inertia, its gravity, its profile.

With all other joints held, whatever a hinge or slide moves is one rigid body. Its motion is that of
a point mass and an inertia about the same axis, which is exact and a hundred times cheaper than the
scene, and nothing else in the scene can get in the way.
"""

import tempfile
from math import isfinite
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.profile import Profile
from joda.scenes.actuators import Servo
from joda.scenes.attaching import in_scene
from joda.scenes.context import Context
from joda.scenes.limits import SecondStop
from joda.scenes.native import Row, native_attributes

GRAVITY = 9.81
TIMESTEP = 0.002
FARTHEST = 1e30
"""A force limit that is none, N·m or N."""

XML = """
<mujoco model="rig">
  <compiler angle="radian"/>
  <option timestep="{timestep}" gravity="0 0 {gravity}" integrator="implicitfast"/>
  <worldbody>
    <body>
      <joint name="joint" type="{kind}" axis="{axis}" range="{lo} {hi}" limited="true" {own}/>
      <inertial pos="{x} 0 {z}" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
    </body>
  </worldbody>
  {servo}
  {second}
</mujoco>
"""
SERVO = """<actuator>
    <general name="servo" joint="joint" gainprm="{gain}" biastype="affine"
      biasprm="0 {bias}" {limits}/>
  </actuator>"""


def rig(
    context: Context,
    profile: Profile,
    friction_row: Row | None = None,
    servo: Servo | None = None,
    second: SecondStop | None = None,
) -> mujoco.MjModel:
    """The joint alone, with a profile.

    Args:
        context: the joint.
        profile: of that joint.
        friction_row: solref and solimp of MuJoCo's own friction row: a profile of nothing but
            native elements is then the joint's own, without the plugin.
        servo: on the joint; its signal is the command, N·m or N.
        second: what stops the joint at one end besides its limit.

    Returns:
        a model whose only joint has the same range, generalised inertia and gravity force.
    """
    inertia, (lo, hi) = context.equivalent_inertia, context.joint.range
    numbers = _hinge(context) if context.joint.type == "hinge" else _slide(context)
    native = native_attributes(profile) if friction_row else {}
    if friction_row and native:
        native["solreffriction"], native["solimpfriction"] = friction_row
    text = XML.format(
        timestep=TIMESTEP,
        kind=context.joint.type,
        lo=lo,
        hi=hi,
        servo=_actuator(servo) if servo else "",
        second=f"<tendon>{second.element('stop', 'joint', (lo, hi))}</tendon>" if second else "",
        own=" ".join(f'{key}="{" ".join(map(repr, x))}"' for key, x in native.items()),
        **{"gravity": -GRAVITY, "inertia": inertia, **numbers},
    )
    if native:
        return mujoco.MjModel.from_xml_string(text)
    on_rig = profile.model_copy(
        update={"joint": profile.joint.model_copy(update={"name": "joint"})}
    )
    with tempfile.TemporaryDirectory() as folder:
        bare = Path(folder, "bare.xml")
        bare.write_text(text)
        return in_scene(bare, on_rig)


def _actuator(servo: Servo) -> str:
    """The servo as an element, its delay left to who gives the commands."""
    limits = ""
    if isfinite(servo.low) or isfinite(servo.high):
        low, high = max(servo.low, -FARTHEST), min(servo.high, FARTHEST)
        limits = f'forcerange="{low!r} {high!r}" forcelimited="true"'
    bias = f"{-servo.gain * servo.stiffness!r} {-servo.drag!r}"
    return SERVO.format(gain=repr(servo.gain), bias=bias, limits=limits)


def gravity_factors(context: Context) -> NDArray[np.float64]:
    """Of a hinge: the factors of cos q and sin q that gravity's torque consists of, N·m."""
    q = np.array(context.positions)
    shape = np.stack([np.cos(q), np.sin(q)], axis=1)
    return np.asarray(np.linalg.lstsq(shape, np.array(context.gravity_force), rcond=None)[0])


def _hinge(context: Context) -> dict[str, float | str]:
    """A mass on an arm: m g (x cos q + z sin q) is gravity's torque about the y axis."""
    torque = gravity_factors(context)
    # Heavy enough for its m r^2 to be a tenth of the inertia.
    inertia = context.equivalent_inertia
    mass = max(float(10 * torque @ torque / (inertia * GRAVITY**2)), inertia)
    x, z = (float(part) for part in torque / (mass * GRAVITY))
    rest = inertia - mass * (x * x + z * z)
    return {"axis": "0 1 0", "x": x, "z": z, "mass": mass, "inertia": rest}


def _slide(context: Context) -> dict[str, float | str]:
    mass = context.equivalent_inertia
    fall = context.gravity_force[0] / mass
    return {"axis": "0 0 -1", "gravity": -fall, "x": 0.0, "z": 0.0, "mass": mass}
