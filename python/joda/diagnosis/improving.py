"""Diagnoses and mends a model until the data support nothing more."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from joda.diagnosis.findings import Diagnosis
from joda.diagnosis.mending import Error, Mended, error, mend, parted
from joda.diagnosis.verdict import diagnosed
from joda.measured.reading import Measured
from joda.profile import Profile

MOST = 5
"""Effects that are added at most."""
TRIED = 3
"""How many effects of a diagnosis are tried, the most likely first."""
LIKELY = 0.1
"""Least probability of an effect, besides the first, that is tried."""
NOTHING_HELPS = "No likely effect lowers the error on the runs that were held out."
WORTH, MUCH = 0.95, 0.8
"""Part of the error before, on runs held out, to which an effect must bring it: one that explains
what is missing; one that explains only a part, where perhaps several are missing."""


@dataclass(frozen=True)
class Step:
    """A stair of the falling error.

    Attributes:
        effect: that was added; None at the beginning.
        profile: with all effects so far.
        error: on runs held out of every fit.
        diagnosis: of the model with this profile; None if it was not made.
    """

    effect: str | None
    profile: Profile
    error: Error
    diagnosis: Diagnosis | None


def improved(
    measured: Measured, told: Callable[[str], None] = lambda what: None
) -> tuple[tuple[Step, ...], str]:
    """Adds effects while the data support them.

    Args:
        measured: the joint, its profile as it is, and its runs; some are held out of every fit.
        told: what is being done.

    Returns:
        the stairs, the first one the model as it was; and why there are no more, a sentence.
    """
    train, held = parted(measured)
    steps = [Step(None, measured.profile, error(held), None)]
    why = f"{MOST} effects were added; that is as many as are tried."
    try:
        for _ in range(MOST):
            told("diagnose")
            diagnosis, _ = diagnosed(train)
            steps[-1] = replace(steps[-1], diagnosis=diagnosis)
            mended = _added(train, held, diagnosis, told)
            if mended is None:
                known = diagnosis.verdict == "missing_effect"
                why = NOTHING_HELPS if known else diagnosis.summary
                break
            train, held = (part.changed(mended.profile) for part in (train, held))
            steps.append(Step(mended.effect, mended.profile, mended.after, None))
    except KeyboardInterrupt:
        why = "Interrupted; what was found until then is kept."
    return tuple(steps), why


def _added(
    train: Measured, held: Measured, diagnosis: Diagnosis, told: Callable[[str], None]
) -> Mended | None:
    """The first effect of the diagnosis that clearly lowers the error held out; None if none does.

    Where no effect explains what is missing, perhaps several are: then one that explains a good
    part is taken.
    """
    known = diagnosis.verdict == "missing_effect"
    for number, finding in enumerate(diagnosis.effects[:TRIED]):
        if known and number and finding.probability < LIKELY:
            return None
        told(f"add {finding.effect}")
        found = finding.effect, finding.direction, finding.interval
        mended = mend(train, held, *found, told)
        if (
            mended.effect
            and mended.after.window < (WORTH if known else MUCH) * mended.before.window
        ):
            return mended
    return None
