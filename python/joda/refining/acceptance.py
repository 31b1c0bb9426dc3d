"""Whether a fitted profile is to be written: better than it was, and nothing absurd."""

import numpy as np

from joda.diagnosis.adding import Error
from joda.diagnosis.plausible import Needs, implausible
from joda.field import evaluate
from joda.measured.errors import MULTIPLE
from joda.profile import CHANNELS, Profile

MAX_INCREASE = 1.05
"""How much more what is held out may be missed by after a fit, as a factor."""
MAX_REMAINING = 0.999
"""What is left of an error, as a factor, that has fallen."""
FAR = 3.0
"""By which factor a channel must have changed to be another joint's."""
SOME, PART = 0.3, 0.25
"""Where a channel was at least so large, in units of its largest, and over what part of that it has
become so much smaller."""
MAX_NOISES, MAX_CURVE_SHARE = 10.0, 0.2
"""Error in units of the noise, and of curves of that before, from which such a change explains too
little."""
MAX_ERROR_RATIO = 0.3
"""Part of segments' error before that a fit may leave beyond that."""
CAUSES = (
    "the unit, clock, sign or joint of the measurement may be another, a mass or an effect of the "
    "model be wrong or missing (joda diagnose), or the fit have stuck on its way from a start that "
    "is far off"
)
GRID = np.linspace(0, 1, 201)
PARTS = {"whole": "free-run error", "window": "segment error (0.4 s)"}


def refused(
    fitted: tuple[Error, Error],
    held: tuple[Error, Error] | None,
    noise: float,
    profiles: tuple[Profile, Profile],
    needs: Needs,
) -> str | None:
    """Why a fitted profile is not written, as a clause; None if it is.

    Args:
        fitted: errors of what was fitted, before and after.
        held: of what was held out; None without such.
        noise: of the measurement, in the same unit.
        profiles: before and after.
        needs: what the measurements can need of the joint.
    """
    return (
        (held and _held_out(*held, noise))
        or _no_better(*fitted, noise)
        or _hardly_better(*fitted, noise)
        or _hopeless(*fitted, noise, *profiles)
        or implausible(needs, profiles[1])
    )


def _held_out(before: Error, after: Error, noise: float) -> str | None:
    for part, was, now in _parts(before, after):
        if now > MAX_INCREASE * max(was, noise):
            return (
                f"the {_of(after, part)} of what was held out (--check) is {now:.3g} with it "
                f"instead of {was:.3g}"
            )
    return None


def _no_better(before: Error, after: Error, noise: float) -> str | None:
    """Near a barrier either kind of error may grow by chance: both together must not, and what is
    more than noise must fall."""
    parts = _parts(before, after)
    ratio = np.prod([max(now, noise) / max(was, noise) for _, was, now in parts])
    if ratio < MAX_REMAINING or (ratio <= 1.0 and after.window <= MULTIPLE * noise):
        return None
    what = " and ".join(
        f"the {_of(after, part)} is {now:.3g} instead of {was:.3g}" for part, was, now in parts
    )
    return f"of what was fitted {what}"


def _hardly_better(before: Error, after: Error, noise: float) -> str | None:
    """Runs that are still missed by far: only another model than this one follows them."""
    if after.whole is None or after.window <= MAX_NOISES * noise:
        return None
    for part, was, now in _parts(before, after):
        if now > (MAX_INCREASE if part == "whole" else MAX_ERROR_RATIO) * was:
            return (
                f"the {_of(after, part)} of what was fitted would still be {now:.3g} instead of "
                f"{was:.3g}, {now / noise:.0f} times the noise: {CAUSES}"
            )
    return None


def _hopeless(before: Error, after: Error, noise: float, old: Profile, new: Profile) -> str | None:
    left, enough = after.window, MAX_NOISES * noise
    if after.whole is None:  # what a hand does to a curve is more than its gauge's noise
        enough = max(enough, MAX_CURVE_SHARE * before.window)
    if left <= enough:
        return None
    for name in CHANNELS:
        changed, where = (_grown, "") if after.whole is None else (_changed, " at some places")
        if (times := changed(old, new, name)) and not 1 / FAR < times < FAR:
            return (
                f"its {name} would be {times:.2g} times what it was{where}, and the "
                f"{_of(after, 'window')} of what was fitted would still be {left / noise:.0f} "
                f"times the noise: {CAUSES}"
            )
    return None


def _parts(before: Error, after: Error) -> list[tuple[str, float, float]]:
    pairs = [(part, getattr(before, part), getattr(after, part)) for part in PARTS]
    return [(part, was, now) for part, was, now in pairs if was is not None and now is not None]


def _of(error: Error, part: str) -> str:
    """What the error is called; of curves that of the force."""
    return "force error" if error.whole is None else PARTS[part]


def _grown(old: Profile, new: Profile, name: str) -> float:
    """How many times as large a channel has become all in all; 0 where there was none."""
    curves = (evaluate(getattr(one.channels, name), GRID)[0] for one in (old, new))
    was, now = (float(np.sqrt(np.mean(curve**2))) for curve in curves)
    return now / was if was > 0 else 0.0


def _changed(old: Profile, new: Profile, name: str) -> float:
    """How many times as large a channel has become: at its largest, else over a quarter of where it
    was of some size; 0 where there was none."""
    was, now = (np.abs(evaluate(getattr(one.channels, name), GRID)[0]) for one in (old, new))
    if not was.max() > 0:
        return 0.0
    if (times := float(now.max() / was.max())) >= FAR:
        return times
    large = was > SOME * was.max()
    return float(np.quantile(now[large] / was[large], PART))
