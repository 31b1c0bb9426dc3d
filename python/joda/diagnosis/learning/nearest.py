"""The known effect that comes nearest to a learned law, and how much worse it is."""

from dataclasses import dataclass

from joda.diagnosis.adding import error, starts
from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.phrases import named
from joda.measured.measured_joint import Measured


@dataclass(frozen=True)
class Nearest:
    """A known effect beside a learned law.

    Attributes:
        effect: its name.
        name: the same in words.
        times: its error on what was held out, in segments, in the learned law's.
    """

    effect: str
    name: str
    times: float


def nearest(train: Measured, held: Measured, effect: str, unseen: float) -> Nearest | None:
    """How much worse a known effect is than a learned law, its numbers fitted to the same runs;
    None if these tell nothing of it.

    Args:
        train: the joint and runs to fit.
        held: the same with runs held out.
        effect: its name.
        unseen: the learned law's error on what was held out, in segments.
    """
    profiles = starts(fit_baseline(train), effect, None, None)
    if not profiles or not unseen:
        return None
    name = named(effect, train.templates)
    return Nearest(effect, name, error(held, profiles[0]).window / unseen)
