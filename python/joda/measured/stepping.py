"""What of a model's error is its scene's timestep, which no effect can mend."""

import numpy as np

from joda.measured.misfit import missed, rms
from joda.measured.reading import Measured
from joda.measured.replay import Replayer

FINER = 4
"""Steps into which one of the scene's is divided."""
CLEARLY = 0.8
"""Part of the error that must be left with finer steps to be no fault of the timestep."""
BEYOND = 1.5
"""How much larger than the noise an error must be to be looked into."""


def timestep_note(measured: Measured, error: float) -> str | None:
    """A sentence, if shorter steps would make the error in windows clearly smaller.

    Args:
        measured: the joint and its runs.
        error: RMS in windows at the scene's timestep, rad or m.
    """
    if not error >= BEYOND * rms(np.array(measured.sigma)):  # nor if no window was replayed
        return None
    step = measured.timestep / FINER
    finer = Replayer(measured.context, measured.profile, measured.single, step)
    less = missed(finer, measured.runs, measured.sigma)
    if less > CLEARLY * error:
        return None
    unit = measured.profile.joint.unit
    return (
        f"At the scene's timestep of {measured.timestep:g} s windows are missed by {error:.2g} "
        f"{unit} RMS, at {step:g} s by {less:.2g} {unit}: this much is the timestep's, and no "
        "effect can mend it."
    )
