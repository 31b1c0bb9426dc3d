"""One joint of a model by itself in C++: its profile is given each time, all else is fixed."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda._core import JointSimulator
from joda.effects import EndStopRestitution
from joda.joints.rig import gravity_factors
from joda.profile import CHANNELS, Profile
from joda.scenes.actuators import Servo
from joda.scenes.context import Context
from joda.scenes.limits import IMPEDANCES, SecondStop, Stops, limit_parameters, second_stop
from joda.scenes.native import Row

Array = NDArray[np.float64]

ONLY_SLIDES = 2
"""In `mjModel.body_simple`."""


@dataclass(frozen=True)
class JointModel:
    """A joint of a model but for its profile.

    Attributes:
        inertia: without added inertia, kg·m² or kg.
        row_inertia: what MuJoCo's rows take for it where the body only slides; 0: all of it.
        weight: hinge: factors of cos q and sin q of gravity's torque, N·m; slide: force, N, and 0.
        hinge: whether it is a hinge.
        solref, solimp: of the ends of the range.
        second: what one end has besides; None for nothing.
        friction_row: solref and solimp of MuJoCo's own friction row, which yields where the joint
            all but rests; None: the plugin's, which hardly does.
        servo: what the joint's actuators make of commands; None where none acted.
        integrator: of the scene (`mujoco.mjtIntegrator`), for what MuJoCo simulates by itself.
        trapezoidal: whether a simulator's steps are of second order, else they are MuJoCo's.
    """

    inertia: float
    row_inertia: float
    weight: tuple[float, float]
    hinge: bool
    solref: tuple[float, ...]
    solimp: tuple[float, ...]
    second: SecondStop | None = None
    friction_row: Row | None = None
    servo: Servo | None = None
    integrator: int = int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    trapezoidal: bool = False

    def simulator(self, profile: Profile, h: float) -> JointSimulator:
        """The joint with a profile, for steps of h (s)."""
        texts = []
        for name in CHANNELS:
            channel = getattr(profile.channels, name)
            texts += [channel.text(), channel.combine]
        texts.append("; ".join(effect.text() for effect in profile.effects))
        solref, solimp = self.limits(profile, h)
        lo, hi = profile.joint.range
        fixed = self.inertia, self.row_inertia, self.weight, self.hinge
        row = friction_row(*self.friction_row, h) if self.friction_row else (0.0, 0.0)
        own = self.servo or Servo()
        servo = own.gain, own.stiffness, own.drag, own.low, own.high, own.delay
        other = self.second or SecondStop(0, solref, solimp)
        second = other.end, other.solref, other.solimp
        how = row, servo, self.trapezoidal, second
        return JointSimulator(lo, hi, texts, *fixed, solref, solimp, *how)

    @property
    def with_plugin(self) -> "JointModel":
        """The same with the plugin's friction row."""
        return replace(self, friction_row=None)

    def stepped(self, h: float) -> "JointModel":
        """The same for steps of h (s) that stand for no steps, see `Servo.stepped`."""
        servo = self.servo.stepped(h) if self.servo else None
        return replace(self, servo=servo, trapezoidal=True)

    @property
    def stops(self) -> Stops:
        """Of the ends of the range."""
        return Stops(self.solref, self.solimp, self.second)

    def stopped(self, stops: Stops) -> "JointModel":
        """The same with other ends of the range."""
        return replace(self, solref=stops.solref, solimp=stops.solimp, second=stops.second)

    def heavier(self, inertia: float, gravity: float, turned: float = 0.0) -> "JointModel":
        """The same with factors of its inertia and of gravity's force, and with the centre of mass
        turned about a hinge by so much, rad."""
        a, b = self.weight
        cos, sin = float(np.cos(turned)), float(np.sin(turned))
        a, b = a * cos + b * sin, b * cos - a * sin
        return replace(
            self,
            inertia=inertia * self.inertia,
            row_inertia=inertia * self.row_inertia,
            weight=(gravity * a, gravity * b),
        )

    def weight_at(self, position: Array) -> Array:
        """Gravity's force at positions (rad or m), N·m or N; shape (n,)."""
        a, b = self.weight
        if not self.hinge:
            return np.full(len(position), a)
        return np.asarray(a * np.cos(position) + b * np.sin(position))

    def weight_slope(self, position: Array) -> Array:
        """Its derivative by the position, N·m/rad or N/m; shape (n,)."""
        a, b = self.weight if self.hinge else (0.0, 0.0)
        return np.asarray(b * np.cos(position) - a * np.sin(position))

    def limits(self, profile: Profile, h: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Solver parameters of the ends of the range, solref and solimp, for steps of h (s).

        An end with a restitution of its own has others, see cpp/end_stop.h.
        """
        for effect in profile.effects:
            if isinstance(effect, EndStopRestitution) and effect.end == "both":
                words = limit_parameters(round(effect.restitution, 3), h)
                solref, solimp = (tuple(map(float, text.split())) for text in words)
                return solref, (*solimp, *self.solimp[len(solimp) :])
        return self.solref, self.solimp


def friction_row(
    solref: tuple[float, ...], solimp: tuple[float, ...], h: float
) -> tuple[float, float]:
    """Of MuJoCo's own friction row, for steps of h (s): its damping, 1/s, and its stiffness over
    the inertia. Source: MuJoCo's documentation, Computation, Parameters."""
    least, most = np.clip(solimp[:2], *IMPEDANCES)
    time, ratio = solref
    damping = 2 / (most * max(time, 2 * h)) if time > 0 else -ratio / most
    return float(damping), float(least / (1 - least))


def joint_model(
    context: Context, profile: Profile, model: mujoco.MjModel, joint: int
) -> JointModel:
    """A joint of a compiled model.

    Args:
        context: of the joint, which may carry the profile.
        profile: that it carries.
        model: its scene.
        joint: its id there.
    """
    hinge = context.joint.type == "hinge"
    slides = model.body_simple[model.jnt_bodyid[joint]] == ONLY_SLIDES
    weight = gravity_factors(context) if hinge else (context.gravity_force[0], 0.0)
    return JointModel(
        inertia=context.equivalent_inertia - profile.added_inertia,
        row_inertia=float(1 / model.dof_invweight0[model.jnt_dofadr[joint]]) if slides else 0.0,
        weight=(float(weight[0]), float(weight[1])),
        hinge=hinge,
        solref=tuple(map(float, model.jnt_solref[joint])),
        solimp=tuple(map(float, model.jnt_solimp[joint])),
        second=second_stop(model, joint),
        integrator=int(model.opt.integrator),
    )


def weighing(context: Context, own: JointModel) -> Context:
    """The context where gravity pulls as on this joint."""
    force = own.weight_at(np.array(context.positions))
    return context.model_copy(update={"gravity_force": tuple(map(float, force))})
