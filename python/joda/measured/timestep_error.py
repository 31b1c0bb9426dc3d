"""What of a model's error is its scene's timestep, which no effect can mend."""

import numpy as np

from joda.measured.measured_joint import Measured
from joda.measured.misfit import missed, missed_whole, rms
from joda.measured.replay import Replayer

FINER = 4
"""Steps into which one of the scene's is divided."""
MAX_FINER_SHARE = 0.8
"""Part of the error that must be left with finer steps to be no fault of the timestep."""
MIN_NOISES = 1.5
"""How much larger than the noise an error must be to be looked into."""


def timestep_note(measured: Measured, window: float, whole: float) -> str | None:
    """A sentence, if shorter steps would make the error clearly smaller.

    Args:
        measured: the joint and its runs.
        window, whole: segment and free-run errors, RMS, at the scene's timestep, rad or m; NaN
            where there is none.
    """
    least = MIN_NOISES * rms(np.array(measured.sigma))
    step, unit = measured.timestep / FINER, measured.profile.joint.unit
    if not max(window, whole) >= least:
        return None
    finer = Replayer(measured.context, measured.profile, measured.joint_model, step)
    # another fault may add up to less in other steps: whole runs must then be within the noise
    tried = (
        ("segment error", window, missed, MAX_FINER_SHARE * window),
        ("free-run error", whole, missed_whole, min(MAX_FINER_SHARE * whole, least)),
    )
    for what, error, of, most in tried:
        if error >= least and (less := of(finer, measured.runs, measured.sigma)) < most:
            return (
                f"At the scene's timestep of {measured.timestep:g} s the {what} is {error:.2g} "
                f"{unit} RMS, at {step:g} s {less:.2g} {unit}: this much is the timestep's, and "
                "no effect can mend it."
            )
    return None
