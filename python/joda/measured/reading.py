"""A joint of a model with what was measured of it, read from files and checked."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.joints.joint_model import JointModel, joint_model, weighing
from joda.measured import smoothing
from joda.measured.corrections_file import sensing_of
from joda.measured.data_checks import data_checks
from joda.measured.driven import read_logs
from joda.measured.misfit import missed
from joda.measured.obstructed import Clear, clear_of_contacts
from joda.measured.quasi_static import QuasiStaticComparison, gauged
from joda.measured.replay import WINDOW, Replayer
from joda.measured.runs import QuasiStatic, Run
from joda.measured.sensing import Sensing
from joda.measured.slow_runs import as_curve
from joda.measured.trust import USUAL, Trust
from joda.profile import Profile
from joda.scenes.actuators import Servo
from joda.scenes.angles import range_doubt
from joda.scenes.besides import acting_besides
from joda.scenes.contacts import Contact
from joda.scenes.context import Context, context
from joda.scenes.model import describe_joint, find_joint, joint_name, load_model
from joda.scenes.native import Row, own_friction_row, whole_profile
from joda.scenes.scene import profiles_of
from joda.template import Template, read_templates

Array = NDArray[np.float64]

CLEARLY = 0.9
"""Part of the error in windows to which another friction row must bring it."""
ENOUGH, BRIEFLY = 4, 15.0
"""Runs that tell which row that is, and how much of each, s."""
SURELY = 20.0
"""Squared misfits, in noises, by which MuJoCo's own row must be better to be the one replayed."""
YIELDS = (
    "MuJoCo's own friction row yields near rest (solreffriction, solimpfriction): by it windows of "
    "{0:g} s are missed by {2:.2g} {3}, by the same friction in a profile, which is what is "
    "replayed here, by {1:.2g} {3}."
)
FINEST = 1e-6
"""Least noise, in units of the range."""
STEPS = 5_000_000
"""Most timesteps of a run that are simulated."""
LEAST = 0.7
"""The same of a run, in units of the noise of all runs together: one encoder measured them all."""


@dataclass(frozen=True)
class Measured:
    """A joint of a model with measured runs and quasi-static curves.

    Attributes:
        context: of the joint.
        profile: all that acts on it (`joda.scenes.native`).
        joint_model: all of the joint but its profile, as it is replayed.
        own_row: of friction that is MuJoCo's own in the scene, whichever is replayed; None if none
            is.
        timestep: of the model, s.
        replayer: of that profile.
        runs: measured.
        sigma: noise of each run's position, rad or m.
        curves: measured, each beside the model's.
        notes: what is suspicious about them.
        contacts: of the scene that resist the joint where it was measured.
        whole: whether all that acts on the joint there is replayed, and all of the runs.
        barred: the note on where the scene would not have let the joint; empty if there is none.
        trust: how far off its numbers, and those of the measurement, may be.
        templates: of effects that may be missing, by name.
        doubtful: numbers that have been set right, and the errors that are left of them.
    """

    context: Context
    profile: Profile
    joint_model: JointModel
    own_row: Row | None
    timestep: float
    replayer: Replayer
    runs: tuple[Run, ...]
    sigma: tuple[float, ...]
    curves: tuple[QuasiStaticComparison, ...]
    notes: tuple[str, ...]
    contacts: tuple[Contact, ...]
    whole: bool
    barred: str
    trust: Trust = USUAL
    templates: Mapping[str, Template] = field(default_factory=read_templates)
    doubtful: Mapping[str, float] = field(default_factory=dict)

    def trusting(self, trust: Trust) -> "Measured":
        """The same joint and runs, whose numbers may be so far off."""
        return replace(self, trust=trust)

    def sensed(self, sensing: Sensing) -> "Measured":
        """The same joint with runs as they would be if what is wrong with them were right."""
        return replace(self, runs=tuple(map(sensing.of, self.runs)))

    def changed(
        self,
        profile: Profile | None = None,
        runs: Sequence[int] | None = None,
        joint_model: JointModel | None = None,
    ) -> "Measured":
        """The same joint with another profile, another body, or with some of its runs only."""
        numbers = range(len(self.runs)) if runs is None else runs
        new = self.profile if profile is None else profile
        own = joint_model or (self.joint_model if profile is None else self.joint_model.with_plugin)
        found = self.context if joint_model is None else weighing(self.context, joint_model)
        return replace(
            self,
            context=found,
            profile=new,
            joint_model=own,
            replayer=self.replayer
            if profile is None and joint_model is None
            else Replayer(found, new, own, self.timestep),
            runs=tuple(self.runs[k] for k in numbers),
            sigma=tuple(self.sigma[k] for k in numbers),
            curves=self.curves
            if profile is None
            else tuple(curve.against(new, found) for curve in self.curves),
        )

    @property
    def floor(self) -> float:
        """Noise of the runs' positions, rad or m; of the curves' forces where there are no runs."""
        noises = self.sigma or tuple(curve.sigma for curve in self.curves)
        return float(np.sqrt(np.mean(np.square(noises))))

    @property
    def unit(self) -> str:
        """Of what a model misses: position, or force where there are only curves."""
        joint = self.profile.joint
        return joint.unit if self.runs else joint.force_unit

    @property
    def doubtful_unit(self) -> float:
        """How many times the model's largest force that of a curve is, where that is so much or so
        little that its unit is in doubt; else 0, and where there are runs, beside which curves are
        not used."""
        return next((c.doubtful for c in self.curves if c.doubtful and not self.runs), 0.0)

    def load(self, run: Run) -> Array:
        """What loads the joint at a run's samples, N·m or N, shape (n,): gravity and what is
        applied, and with an actuator how far its force is beyond these: what its gear transmits."""
        gravity = np.interp(run.position, self.context.positions, self.context.gravity_force)
        return self.exerted(run) - run.force - gravity if self._driven(run) else run.force + gravity

    def exerted(self, run: Run) -> Array:
        """By the actuators on the joint, N·m or N, shape (n,)."""
        servo = self.joint_model.servo
        if servo is None or run.command is None:
            return np.zeros(len(run.time))
        at = run.time - servo.delay
        command = run.command[np.maximum(np.searchsorted(run.time, at, side="right") - 1, 0)]
        velocity = np.gradient(run.position, run.time)
        return servo.force(command, run.position, velocity)

    def _driven(self, run: Run) -> bool:
        return self.joint_model.servo is not None and run.command is not None

    def paths(self) -> list[Array]:
        """Predicted positions of all runs, rad or m; NaN from where the force is not known."""
        replayer, pairs = self.replayer, zip(self.runs, self.sigma, strict=True)
        return [replayer.whole(run, replayer.start(run, sigma)) for run, sigma in pairs]

    def with_runs(self, parts: Sequence[Run], of: Sequence[int]) -> "Measured":
        """The same joint with parts of its runs, and of each the number of its run."""
        return replace(self, runs=tuple(parts), sigma=tuple(self.sigma[k] for k in of))

    def with_curves(self, curves: Sequence[QuasiStaticComparison]) -> "Measured":
        """The same joint with some of its curves, or with parts of them."""
        return replace(self, curves=tuple(curves))


def checked(read: Sequence[Run | QuasiStatic], found: Context, timestep: float) -> list[str]:
    """What is suspicious about measurements of a joint, a sentence each.

    Args:
        read: the measurements.
        found: the joint.
        timestep: of its scene, s.

    Raises:
        JodaError: they cannot be of this joint as they stand, or cannot be replayed.
    """
    doubts = [doubt for run in read for doubt in data_checks(run, found)]
    for doubt in doubts:
        if doubt.fatal:
            raise JodaError(" ".join(filter(None, (doubt.sentence, range_doubt(found.joint)))))
    for run in read:
        if isinstance(run, Run) and (steps := np.ptp(run.time) / timestep) > STEPS:
            raise JodaError(
                f"{run.name}: {np.ptp(run.time):.4g} s are {steps:.2g} of the scene's timesteps of "
                f"{timestep:g} s, which is too long to replay; cut the run into shorter ones."
            )
    return [*found.doubts, *(doubt.sentence for doubt in doubts)]


def read_measured(
    model: str | Path,
    joint: str,
    runs: Sequence[str | Path],
    passive: bool = False,
    corrections: str | Path | None = None,
) -> Measured:
    """Reads a joint and what was measured; raises JodaError, also for what cannot be of it.

    Args:
        model: MJCF or URDF.
        joint: its name or address.
        runs: CSV files.
        passive: whether the actuators on the joint were off.
        corrections: a file of what is wrong with the runs (`joda.measured.corrections_file`).
    """
    if not runs:
        raise JodaError("no runs; give at least one CSV file with time and position.")
    source = Path(model)
    compiled = load_model(source)
    number = find_joint(compiled, joint)
    name = joint_name(compiled, number)
    found = context(source, name)
    bare = Profile(joint=describe_joint(compiled, number))
    profile = whole_profile(compiled, number, profiles_of(compiled).get(name, bare))
    logs = read_logs(compiled, number, runs, passive, sensing_of(corrections, name))
    notes = [*checked(logs.read, found, float(compiled.opt.timestep)), *logs.notes]
    clear = clear_of_contacts(compiled, number, found, profile, logs.read)
    notes += clear.notes
    if besides := acting_besides(compiled, number):
        notes.append(
            f"In the scene more acts on joint '{name}' than itself, gravity and contacts: "
            f"{', '.join(besides)}; a replay of the joint by itself leaves that out."
        )
    return taken(
        compiled, number, found, profile, clear, notes, whole=not besides, servo=logs.servo
    )


def taken(
    model: mujoco.MjModel,
    joint: int,
    found: Context,
    profile: Profile,
    clear: Clear,
    notes: Sequence[str] = (),
    whole: bool = True,
    servo: Servo | None = None,
) -> Measured:
    """A joint with measurements that are read, checked, and clear of contacts; raises JodaError.

    Args:
        model: the compiled scene.
        joint: its id.
        found: the joint.
        profile: all that acts on it (`joda.scenes.native`).
        clear: the measurements.
        notes: what is suspicious about them.
        whole: whether all that acts on the joint, but for contacts, is replayed.
        servo: what the joint's actuators make of the runs' commands.
    """
    notes, step = list(notes), float(model.opt.timestep)
    timed = tuple(run for run in clear.measured if isinstance(run, Run))
    usual = smoothing.pooled_noise([(run.time, run.position) for run in timed])
    least = max(FINEST * float(np.ptp(profile.joint.range)), LEAST * usual)
    sigma = tuple(max(smoothing.noise(run.time, run.position), least) for run in timed)
    row = own_friction_row(model, joint)
    own = replace(joint_model(found, profile, model, joint), servo=servo)
    replayer = Replayer(found, profile, own, step)
    if row and timed:
        yielding = replace(own, friction_row=row)
        other = Replayer(found, profile, yielding, step)
        some = [
            run.part(np.flatnonzero(run.time < run.time[0] + BRIEFLY)) for run in timed[:ENOUGH]
        ]
        errors = [missed(one, some, sigma[:ENOUGH]) for one in (replayer, other)]
        samples = sum(len(run.time) for run in some)
        gain = samples * (errors[0] ** 2 - errors[1] ** 2) / float(np.mean(np.square(sigma)))
        if errors[1] < CLEARLY * errors[0] or gain > SURELY:
            own, replayer = yielding, other
        elif errors[0] < CLEARLY * errors[1]:
            notes.append(YIELDS.format(WINDOW, *errors, found.joint.unit))
    static = [curve for curve in clear.measured if isinstance(curve, QuasiStatic)]

    def replay(run: Run, sigma: float) -> Array:
        return replayer.whole(run, replayer.start(run, sigma))

    if len(timed) == 1 and (slow := as_curve(timed[0], sigma[0], profile, own.inertia, replay)):
        timed, sigma, static = (), (), [*static, slow]
        notes.append(
            f"{slow.name}: taken as a quasi-static curve, as it goes one way only and so slowly "
            "that inertia and the model's damping take little of the force, and the model does not "
            "follow."
        )
    curves = []
    for curve in static:
        beside, more = gauged(curve, profile, found)
        curves.append(beside)
        notes += more
    return Measured(
        context=found,
        profile=profile,
        joint_model=own,
        own_row=row,
        timestep=step,
        replayer=replayer,
        runs=timed,
        sigma=sigma,
        curves=tuple(curves),
        notes=tuple(notes),
        contacts=clear.contacts,
        whole=whole and not any(contact.hinders for contact in clear.contacts),
        barred=clear.barred,
    )
