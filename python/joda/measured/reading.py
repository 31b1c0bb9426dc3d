"""What was measured of a joint, read from files and checked against its model."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.errors import JodaError
from joda.joints.joint_model import joint_model
from joda.measured import smoothing
from joda.measured.corrections_file import sensing_of
from joda.measured.data_checks import data_checks
from joda.measured.driven import read_logs
from joda.measured.measured_joint import Measured
from joda.measured.misfit import missed
from joda.measured.obstructed import Clear, clear_of_contacts
from joda.measured.quasi_static import beside_model
from joda.measured.replay import SEGMENT_LENGTH, Replayer
from joda.measured.runs import QuasiStatic, Run
from joda.measured.slow_runs import as_curve
from joda.profile import Profile
from joda.scenes.actuators import Servo
from joda.scenes.angles import implausible_range
from joda.scenes.context import Context, context
from joda.scenes.model import describe_joint, find_joint, joint_name, load_model
from joda.scenes.native import own_friction_row, whole_profile
from joda.scenes.scene import profiles_of
from joda.scenes.unmodelled import unmodelled_elements

Array = NDArray[np.float64]

CLEARLY = 0.9
"""Part of the segment error to which another friction row must bring it."""
ROW_RUNS, ROW_DURATION = 4, 15.0
"""Runs that tell which row that is, and how much of each, s."""
SURELY = 20.0
"""Squared misfits, in noises, by which MuJoCo's own row must be better to be the one replayed."""
YIELDS = (
    "MuJoCo's own friction row yields near rest (solreffriction, solimpfriction): with it the "
    "segment error ({0:g} s horizon) is {2:.2g} {3}, with the same friction in a profile, which is "
    "what is replayed here, {1:.2g} {3}."
)
FINEST = 1e-6
"""Least noise, in units of the range."""
STEPS = 5_000_000
"""Most timesteps of a run that are simulated."""
MIN_NOISE = 0.7
"""The same of a run, in units of the noise of all runs together: one encoder measured them all."""


def checked(read: Sequence[Run | QuasiStatic], found: Context, timestep: float) -> list[str]:
    """What is suspicious about measurements of a joint, a sentence each.

    Args:
        read: the measurements.
        found: the joint.
        timestep: of its scene, s.

    Raises:
        JodaError: they cannot be of this joint as they stand, or cannot be replayed.
    """
    checks = [check for run in read for check in data_checks(run, found)]
    for check in checks:
        if check.fatal:
            raise JodaError(
                " ".join(filter(None, (check.sentence, implausible_range(found.joint))))
            )
    for run in read:
        if isinstance(run, Run) and (steps := np.ptp(run.time) / timestep) > STEPS:
            raise JodaError(
                f"{run.name}: {np.ptp(run.time):.4g} s are {steps:.2g} of the scene's timesteps of "
                f"{timestep:g} s, which is too long to replay; cut the run into shorter ones."
            )
    return [*found.warnings, *(check.sentence for check in checks)]


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
    if unmodelled := unmodelled_elements(compiled, number):
        notes.append(
            f"In the scene more acts on joint '{name}' than itself, gravity and contacts: "
            f"{', '.join(unmodelled)}; a replay of the joint by itself leaves that out."
        )
    return taken(
        compiled, number, found, profile, clear, notes, whole=not unmodelled, servo=logs.servo
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
    least = max(FINEST * float(np.ptp(profile.joint.range)), MIN_NOISE * usual)
    sigma = tuple(max(smoothing.noise(run.time, run.position), least) for run in timed)
    row = own_friction_row(model, joint)
    own = replace(joint_model(found, profile, model, joint), servo=servo)
    replayer = Replayer(found, profile, own, step)
    if row and timed:
        yielding = replace(own, friction_row=row)
        other = Replayer(found, profile, yielding, step)
        some = [
            run.part(np.flatnonzero(run.time < run.time[0] + ROW_DURATION))
            for run in timed[:ROW_RUNS]
        ]
        errors = [missed(one, some, sigma[:ROW_RUNS], quickly=True) for one in (replayer, other)]
        samples = sum(len(run.time) for run in some)
        gain = samples * (errors[0] ** 2 - errors[1] ** 2) / float(np.mean(np.square(sigma)))
        if errors[1] < CLEARLY * errors[0] or gain > SURELY:
            own, replayer = yielding, other
        elif errors[0] < CLEARLY * errors[1]:
            notes.append(YIELDS.format(SEGMENT_LENGTH, *errors, found.joint.unit))
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
        beside, more = beside_model(curve, profile, found)
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
