"""What a model lacks: the verdict on a ranking, with probabilities, sizes and sentences."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from joda import phrases
from joda.baseline import joined, usable, windows_for
from joda.comparison import Measured
from joda.experiments import Means, Model, next_experiment, there_and_back
from joda.findings import Diagnosis, Finding
from joda.guessing import Guess
from joda.holdout import Holdout
from joda.phrases import explained
from joda.profile import Profile
from joda.ranking import Ranking, Told, rank
from joda.weighing import LEFT, LITTLE, Verdict, Weighed, weigh

RIVAL = 0.35
"""Part of the excess that an effect may leave that counts as an alternative."""
LONGER, LONGEST = 9.0, 1.5
"""How much longer the windows of a second look are, and at most how long, s."""
STRICTLY, LOOSELY = 0.7, 3.0
"""Strictness of that second look; and where the joint went one way only, which tells little."""
ONE_WAY = 0.97
"""Part of the way, in one direction, from which the joint counts as moved in that one only."""
RESISTING = (
    *("position_dependent_friction", "position_dependent_damping", "constant_friction_hinge"),
    *("constant_damping_hinge", "asymmetric_friction", "direction_dependent_damping"),
)
DRIVING = (
    *("constant_positive_conservative_hinge", "constant_negative_conservative_hinge"),
    *("spring_return_to_low_end", "spring_return_to_high_end", "bistable_mechanism"),
    *("magnetic_return_to_low_end", "magnetic_return_to_high_end", "gravity_offset"),
    *("spring_loaded_snap_detent_to_low_end", "spring_loaded_snap_detent_to_high_end"),
    *("detent_internal", "bistable_mechanism_internal"),
)
"""What resists motion, and what is a force over position: the same where it goes one way only."""
ALIKE = 0.1
"""By how much of the misfit two effects may differ that the data cannot tell apart."""
SURE = 0.9
"""Probability from which no further experiment is proposed."""
TOO_SHORT = "The measurements are too short to tell anything."
MOST = 50.0
"""What of the misfit, %, an effect may leave that is said to be missing with something else."""
OFF = 0.05
"""By how much a strength must be off to be worth a word."""
GAUGE_BACK = "Measure the way back too, as slowly."
NAMED, WORTH_NAMING = 5, 0.01
"""How many effects are named, besides the first those of at least some probability."""
WINDOWS, MOVES = 4, 8.0
"""Fewest windows with motion that tell anything; and what is motion, in noises."""
SAMPLES = 15
"""Fewest samples of curves that do."""
VISITED = 0.02
"""Least part of the range that must be visited."""


def diagnosed(
    measured: Measured,
    exclude: Collection[str] = (),
    told: Told = lambda done, total, what: None,
) -> tuple[Diagnosis, Profile | None]:
    """Finds what a model lacks.

    Args:
        measured: the joint and its runs.
        exclude: effects that are not considered.
        told: how much is done, of how much, and what.

    Returns:
        the diagnosis, and the profile with the likeliest effect; None if there is none.
    """
    if not usable(windows_for(measured)).any():
        return _said(measured, "insufficient_data", TOO_SHORT, (), None), None
    ranking = rank(measured, exclude=exclude, heed=told)
    one_way = _one_way(measured)
    weighed = weigh(ranking, LOOSELY if one_way else 1.0)
    if weighed.verdict == "unexplained" and measured.runs:  # what is weak shows in longer windows
        length = min(LONGER * ranking.judge.windows.length, LONGEST)
        longer = rank(measured, length, exclude, told)
        again = weigh(longer, STRICTLY)
        if again.verdict == "missing_effect" or again.share < weighed.share:
            ranking, weighed = longer, again
    if weighed.verdict == "adequate" and (why := _too_little(measured)):
        return _said(measured, "insufficient_data", why, (), None), None
    if weighed.verdict == "adequate":
        summary = (
            f"The model is adequate: nothing beyond the noise ({_floor(measured):.2g} "
            f"{_unit(measured)}) that an effect would explain.{_off(ranking)}"
        )
        return _said(measured, "adequate", summary, (), None), None
    held = Holdout(ranking)
    named = range(min(NAMED, len(ranking.guesses)))
    findings = tuple(
        _finding(measured, ranking, held, k, weighed, _alike(ranking, weighed, k, one_way))
        for k in named
        if k == 0 or weighed.probabilities[k] > WORTH_NAMING
    )
    best, n = ranking.guesses[0], len(ranking.base.places)
    profile = best.hypothesis.write(ranking.base.written(best.fit.x[:n]), best.x)
    experiment = _next(measured, ranking, weighed, one_way)
    summary = _summary(findings[0], weighed, one_way)
    return _said(measured, weighed.verdict, summary, findings, experiment), profile


def _off(ranking: Ranking) -> str:
    """Which of the model's own strengths are off, as a further sentence."""
    factors = [
        f"{name} \N{MULTIPLICATION SIGN} {factor:.2f}"
        for (name, _), factor in zip(ranking.base.places, ranking.fit.x, strict=True)
        if abs(factor - 1) > OFF
    ]
    return f" Its own numbers are somewhat off: {', '.join(factors)}." if factors else ""


def _summary(first: Finding, weighed: Weighed, one_way: bool) -> str:
    """The verdict in a sentence, where something is missing."""
    name = phrases.named(first.effect)
    if weighed.verdict == "unexplained":
        share = 100 * min(weighed.share, 1.0)
        if share < MOST:
            return (
                f"Missing is {name}, but not only that: it leaves {share:.0f} % of the misfit, "
                "which no known effect explains."
            )
        return (
            f"Something is missing that no known effect explains: the best of them, {name}, leaves "
            f"{share:.0f} % of the misfit."
        )
    others = " or ".join(map(phrases.named, first.indistinguishable_from))
    if one_way and others:
        return (
            f"Missing is {name} or {others}: the joint was moved in one direction only, where a "
            "resistance and a force over position are the same."
        )
    if others:
        return f"Missing is {name} or {others}: these data cannot tell which."
    return f"Missing is {name} (probability {100 * first.probability:.0f} %)."


def _one_way(measured: Measured) -> bool:
    """Whether the joint was moved in one direction only."""
    forth = back = 0.0
    for gauged in () if measured.runs else measured.curves:
        forth += float(np.sum(gauged.direction > 0))
        back += float(np.sum(gauged.direction < 0))
    for run, sigma in zip(measured.runs, measured.sigma, strict=True):
        turns = directed(run.position, 6 * sigma)
        forth, back = forth + turns[0], back + turns[1]
    return max(forth, back) > ONE_WAY * (forth + back)


def directed(position: NDArray[np.float64], noise: float) -> tuple[float, float]:
    """Ways in positive and in negative direction; what is within the noise is no way."""
    forth = back = 0.0
    at = position[0]
    for q in position[1:]:
        if abs(q - at) > noise:
            forth, back = forth + max(q - at, 0.0), back + max(at - q, 0.0)
            at = q
    return forth, back


def _alike(ranking: Ranking, weighed: Weighed, number: int, one_way: bool) -> tuple[str, ...]:
    """Effects that the data cannot tell from a guess."""
    own, left = weighed.excess
    names = [guess.hypothesis.effect for guess in ranking.guesses]
    alike = {
        name
        for k, name in enumerate(names)
        if abs(left[k] - left[number]) < ALIKE * (left[number] + LITTLE)
        and left[k] < max(RIVAL * own, LEFT)
    }
    if one_way:
        for mine, other in ((RESISTING, DRIVING), (DRIVING, RESISTING)):
            if names[number] in mine:
                alike |= set([name for name in names if name in other][:1])
    return tuple(name for name in names if name in alike and name != names[number])


def _said(
    measured: Measured,
    verdict: Verdict,
    summary: str,
    effects: tuple[Finding, ...],
    experiment: str | None,
) -> Diagnosis:
    joint = measured.profile.joint
    if verdict == "insufficient_data":
        experiment = (
            "Record more: move the joint through its whole range in both directions, slowly and "
            "fast, with the force if it can be measured, for some 20 s in all."
        )
    return Diagnosis(
        joint=joint.name,
        verdict=verdict,
        summary=summary,
        effects=effects,
        noise_floor=_floor(measured),
        unit=_unit(measured),
        next_experiment=experiment,
        notes=measured.notes,
    )


def _floor(measured: Measured) -> float:
    """Noise of the runs' positions, or of the curves' forces where there are no runs."""
    noises = measured.sigma or tuple(gauged.sigma for gauged in measured.curves)
    return float(np.sqrt(np.mean(np.square(noises))))


def _unit(measured: Measured) -> str:
    """Of what is missed: position, or force where there are only curves."""
    joint = measured.profile.joint
    if measured.runs:
        return joint.unit
    return "N·m" if joint.type == "hinge" else "N"


def _too_little(measured: Measured) -> str:
    """Why a model that misses nothing may lack much, as a sentence; nothing if that is not so."""
    windows = windows_for(measured)
    if not measured.runs:
        told = len(windows.position)
        return f"{told} samples are too few; record {SAMPLES}." if told < SAMPLES else ""
    span = float(np.ptp(measured.profile.joint.range))
    visited = float(np.ptp(windows.position)) / span
    if visited < VISITED:
        return f"The runs visit only {100 * visited:.1g} % of the joint's range."
    own = [windows.position[row[row >= 0]] for row in windows.rows[usable(windows)]]
    moving = sum(bool(np.ptp(position) > MOVES * max(measured.sigma)) for position in own)
    if moving < WINDOWS:
        return (
            f"The joint moves in {moving} windows of {windows.length:.2g} s; {WINDOWS} are needed."
        )
    return ""


def _finding(
    measured: Measured,
    ranking: Ranking,
    held: Holdout,
    number: int,
    weighed: Weighed,
    alike: tuple[str, ...],
) -> Finding:
    guess = ranking.guesses[number]
    hypothesis, x = guess.hypothesis, guess.x
    after = held.error(guess)
    magnitude = hypothesis.magnitude(x)
    doubt = _doubt(ranking, guess)
    interval = hypothesis.interval(x)
    joint = measured.profile.joint
    return Finding(
        effect=hypothesis.effect,
        interval=interval,
        probability=weighed.probabilities[number],
        direction=hypothesis.direction,
        magnitude=magnitude,
        magnitude_error=doubt,
        unit=hypothesis.unit,
        explanation=explained(
            hypothesis.effect,
            hypothesis.direction,
            interval,
            (magnitude, doubt, hypothesis.unit),
            (held.before, after, _floor(measured)),
            _unit(measured),
            joint,
        ),
        held_out_error_before=held.before,
        held_out_error_after=after,
        indistinguishable_from=alike,
    )


def _doubt(ranking: Ranking, found: Guess) -> float:
    """Standard deviation of an effect's magnitude, from the curvature of the loss."""
    make, unknowns = joined(ranking.base, found.hypothesis)
    x = found.fit.x
    H = ranking.judge.linear(make, unknowns, x, found.fit.start).normal()[0]
    H = H + np.diag(unknowns.doubt**-2.0) + 1e-9 * np.diag(np.maximum(np.diag(H), 1e-12))
    covariance = np.linalg.pinv(H)
    n = len(ranking.base.places)
    slope = np.zeros(len(x))
    for k in range(n, len(x)):
        step = 1e-4 * (np.arange(len(x)) == k)
        ends = (found.hypothesis.magnitude((x + way)[n:]) for way in (step, -step))
        slope[k] = (next(ends) - next(ends)) / 2e-4
    samples = max(float(ranking.judge.windows.count[ranking.judge.counts].sum()), 1.0)
    worse = max(float(found.fit.squares[ranking.judge.counts].sum()) / samples, 1.0)
    return float(np.sqrt(max(float(slope @ covariance @ slope), 0.0) * worse))


def _next(measured: Measured, ranking: Ranking, weighed: Weighed, one_way: bool) -> str | None:
    """The experiment that tells the likeliest two apart; None if the first is sure."""
    if not measured.runs:
        return GAUGE_BACK if one_way else None
    velocity = ranking.judge.windows.start[:, 1]
    means = Means(
        joint=measured.profile.joint,
        inertia=measured.single.inertia,
        speed=float(np.sqrt(np.mean(velocity**2))),
        h=ranking.base.h,
        sigma=_floor(measured),
        forced=any(run.forced for run in measured.runs),
    )
    if one_way:
        return there_and_back(means).sentence
    if weighed.verdict == "unexplained":
        return (
            "Repeat one slow motion three times, to and fro, then the same fast: what differs "
            "between repeats depends on time or on what was before, what differs with speed is a "
            "resistance, what does neither is a force over position."
        )
    if weighed.probabilities[0] > SURE or len(ranking.guesses) < 2:
        return None
    first, second = (
        Model(*joined(ranking.base, g.hypothesis), g.fit.x) for g in ranking.guesses[:2]
    )
    return next_experiment(first, second, means)
