"""What a model lacks: the verdict on a ranking, with probabilities, sizes and sentences."""

import json
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from joda import phrases
from joda.comparison import Measured, rms
from joda.errors import JodaError
from joda.experiments import Means, Model, next_experiment
from joda.files import read_text
from joda.judge import BEND, NOTHING, Judge, Make, Unknowns
from joda.phrases import explained
from joda.profile import Profile
from joda.ranking import CALM, Guess, Ranking, Told, joined, rank, usable, windows_for
from joda.windows import Windows

Array = NDArray[np.float64]
Verdict = Literal["missing_effect", "adequate", "unexplained", "insufficient_data"]

SHARPNESS = 3.0
"""How fast an effect's probability falls with the misfit that it leaves; calibrated on simulated
joints with a hidden effect (docs/diagnose.md)."""
LEAST_GAIN = 60.0
"""Least gain in loss of an effect that is more than chance."""
NOTICEABLE = 0.02
"""The same, per sample."""
LEFT = 0.25
"""Excess per sample that any true effect may leave: noise is not known better."""
RIVAL = 0.35
"""Part of the excess that an effect may leave that counts as an alternative."""
LITTLE = 0.05
"""Excess per sample that is never worth a word."""
LONGER = 3.0
"""How much longer the windows of a second look are."""
MUCH = 0.5
"""Excess per sample that is, even if no effect lowers it."""
WORST = 1.3
"""Mean square residual that noise may make."""
ALIKE = 0.1
"""By how much of the misfit two effects may differ that the data cannot tell apart."""
SURE = 0.9
"""Probability from which no further experiment is proposed."""
NAMED = 5
"""How many effects are named."""
WINDOWS = 8
"""Fewest windows with motion that tell anything."""
VISITED = 0.02
"""Least part of the range that must be visited."""


@dataclass(frozen=True)
class Finding:
    """An effect that may be missing.

    Attributes:
        effect: its name.
        interval: where it acts, in normalised position.
        probability: that it is the missing one, 0 to 1.
        direction: both, positive or negative.
        magnitude: how large it is.
        magnitude_error: its standard deviation.
        unit: of the magnitude.
        explanation: for a person.
        held_out_error_before, held_out_error_after: RMS misfit of windows that were held out of the
            fit, rad or m.
        indistinguishable_from: effects that these data cannot tell from it.
    """

    effect: str
    interval: tuple[float, float]
    probability: float
    direction: Literal["both", "positive", "negative"]
    magnitude: float
    magnitude_error: float
    unit: str
    explanation: str
    held_out_error_before: float
    held_out_error_after: float
    indistinguishable_from: tuple[str, ...]


@dataclass(frozen=True)
class Diagnosis:
    """What a model lacks.

    Attributes:
        joint: its name.
        verdict: one effect is missing; the model is adequate; something is missing that no known
            effect explains; the data tell nothing.
        summary: the verdict in a sentence.
        effects: the most likely first.
        noise_floor: of the measured positions, rad or m.
        unit: of positions.
        next_experiment: that would decide what is open; None if nothing is.
        notes: what is suspicious about the data.
    """

    joint: str
    verdict: Verdict
    summary: str
    effects: tuple[Finding, ...]
    noise_floor: float
    unit: str
    next_experiment: str | None
    notes: tuple[str, ...]

    def to_json(self) -> str:
        """The diagnosis as JSON."""
        return json.dumps(asdict(self), indent=2, ensure_ascii=False) + "\n"


@dataclass(frozen=True)
class Weighed:
    """A ranking with its probabilities.

    Attributes:
        verdict: on the model.
        probabilities: of the guesses, in their order.
        excess: per sample, of the model as it is and of each guess.
    """

    verdict: Verdict
    probabilities: tuple[float, ...]
    excess: tuple[float, tuple[float, ...]]


def weigh(ranking: Ranking) -> Weighed:
    """The verdict on a ranking, and how likely each effect is the missing one."""
    judge, guesses = ranking.judge, ranking.guesses
    counts = judge.windows.count[judge.counts].astype(float)
    if not guesses or not len(counts):
        return Weighed("adequate", (), (0.0, ()))
    own = _per_sample(ranking.fit.squares, ranking)
    each = np.stack([_per_sample(g.fit.squares, ranking) for g in guesses])
    saved = np.array([ranking.fit.loss - g.fit.loss for g in guesses])
    cost = np.array([g.cost for g in guesses])
    knocking = np.array([g.hypothesis.effect == "end_stop_restitution" for g in guesses])
    return verdict(own, each, counts, saved, cost, guesses[0].hypothesis.remains, bool(knocking[0]))


def _per_sample(squares: Array, ranking: Ranking) -> Array:
    """Mean square residual of each window that counts."""
    judge = ranking.judge
    return np.asarray((squares / np.maximum(judge.windows.count, 1))[judge.counts])


def verdict(
    base: Array,
    each: Array,
    counts: Array,
    saved: Array,
    cost: Array,
    remains: float,
    knocks: bool = False,
) -> Weighed:
    """From misfits to a verdict.

    What counts as noise is at least what the best guess leaves in its better windows: recorded
    noise is often less than all that a simulation cannot follow.

    Args:
        base: mean square residual of each window, of the model as it is, shape (m,).
        each: the same of the guesses, the best first, shape (guesses, m).
        counts: samples of each window, shape (m,).
        saved: what each guess lowers the loss by, shape (guesses,).
        cost: what its numbers cost, shape (guesses,).
        remains: part of the excess that the first may leave.
        knocks: whether the first is told by knocks at the ends, which these windows have none of.
    """
    samples = float(counts.sum())
    level = max(float(np.quantile(each[0], CALM)), 0.5)

    def excess(squares: Array, level: float = level) -> Array:
        """Robust mean square residual beyond the noise, in units of the noise."""
        robust = BEND * (np.log1p(squares / level / BEND) - np.log1p(1 / BEND))
        return np.asarray((robust * counts).sum(axis=-1) / samples)

    own = max(float(excess(base)), 0.0)
    left = np.maximum(excess(each) + cost / (samples * level), 0.0)
    if knocks:
        left[0] = 0.0
    gain = saved[0] - cost[0]
    if gain < max(LEAST_GAIN, NOTICEABLE * samples):
        said: Verdict = "adequate" if excess(base, min(level, WORST)) < MUCH else "unexplained"
    elif left[0] > max(remains * own, LEFT):
        said = "unexplained"
    else:
        said = "missing_effect"
    weights = (left + LITTLE) ** -SHARPNESS
    unknown = (remains * own + LITTLE) ** -SHARPNESS
    likely = weights / (weights.sum() + unknown)
    return Weighed(said, tuple(map(float, likely)), (own, tuple(map(float, left))))


def read_diagnosis(path: Path) -> dict[str, Any]:
    """A diagnosis that was written before; raises JodaError if it is none."""
    try:
        content = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise JodaError(f"{path}, line {error.lineno}: not JSON ({error.msg}).") from None
    effects = content.get("effects") if isinstance(content, dict) else None
    if not isinstance(effects, list) or not all(
        isinstance(one, dict) and isinstance(one.get("effect"), str) for one in effects
    ):
        raise JodaError(f"{path}: key 'effects' is missing; give what joda diagnose --json wrote.")
    return dict(content)


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
    if missing := _too_little(measured):
        return _said(measured, "insufficient_data", missing, (), None), None
    ranking = rank(measured, exclude=exclude, told=told)
    weighed = weigh(ranking)
    if weighed.verdict == "unexplained":  # what is weak shows in longer windows
        length = LONGER * ranking.judge.windows.length
        longer = rank(measured, length, exclude, told)
        if (again := weigh(longer)).verdict == "missing_effect":
            ranking, weighed = longer, again
    own, left = weighed.excess
    if weighed.verdict == "adequate":
        summary = (
            f"The model is adequate: nothing beyond the noise ({_floor(measured):.2g} "
            f"{measured.profile.joint.unit}) that an effect would explain."
        )
        return _said(measured, "adequate", summary, (), None), None
    held = Holdout(ranking)
    named = range(min(NAMED, len(ranking.guesses)))
    findings = tuple(
        _finding(measured, ranking, held, k, weighed, left, own)
        for k in named
        if k == 0 or weighed.probabilities[k] > 0.01
    )
    first = findings[0]
    if weighed.verdict == "unexplained":
        summary = (
            "Something is missing that no known effect explains: the best of them, "
            f"{phrases.named(first.effect)}, leaves {100 * left[0] / max(own, 1e-9):.0f} % of the "
            "misfit."
        )
    elif first.indistinguishable_from:
        others = " or ".join(phrases.named(name) for name in first.indistinguishable_from)
        summary = (
            f"Missing is {phrases.named(first.effect)} or {others}: these data cannot tell which."
        )
    else:
        summary = (
            f"Missing is {phrases.named(first.effect)} (probability "
            f"{100 * first.probability:.0f} %)."
        )
    best, n = ranking.guesses[0], len(ranking.base.places)
    profile = best.hypothesis.write(ranking.base.written(best.fit.x[:n]), best.x)
    experiment = _next(measured, ranking, weighed)
    return _said(measured, weighed.verdict, summary, findings, experiment), profile


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
        unit=joint.unit,
        next_experiment=experiment,
        notes=measured.notes,
    )


def _floor(measured: Measured) -> float:
    return float(np.sqrt(np.mean(np.square(measured.sigma)))) if measured.sigma else 0.0


def _too_little(measured: Measured) -> str:
    """Why the runs cannot tell anything, as a sentence; nothing if they can."""
    if not measured.runs:
        return "There is no timed run; a diagnosis needs at least one CSV file with time."
    windows = windows_for(measured)
    span = float(np.ptp(measured.profile.joint.range))
    moving = 0
    for row in windows.rows[usable(windows)]:
        own = windows.position[row[row >= 0]]
        noise = max(measured.sigma)
        moving += bool(np.ptp(own) > 8 * noise)
    visited = float(np.ptp(windows.position)) / span
    if visited < VISITED:
        return f"The runs visit only {100 * visited:.1g} % of the joint's range."
    if moving < WINDOWS:
        return (
            f"The joint moves in only {moving} windows of "
            f"{windows.h * float(np.median(np.diff(windows.at))):.2g} s; {WINDOWS} are needed."
            if len(windows.at) > 1
            else "The runs are too short to tell anything."
        )
    return ""


class Holdout:
    """Fits on a part of the runs, judged on the rest."""

    def __init__(self, ranking: Ranking) -> None:
        """Holds out a quarter of the runs; of fewer than four, a quarter of the windows."""
        self.ranking = ranking
        windows = ranking.judge.windows
        runs = np.unique(windows.run)
        if len(runs) >= 4:
            self.held = windows.of_runs(list(runs[3::4]))
        else:
            self.held = np.arange(len(windows.at)) % 4 == 3
        counts = ranking.judge.counts
        if not (counts & self.held).any():
            self.held = counts
        self.train = Judge(windows, counts & ~self.held)
        self.before = self._error(ranking.base.solo, ranking.base.unknowns, ranking.fit.x)

    def error(self, found: Guess) -> float:
        """RMS misfit of the windows held out, rad or m, with the effect."""
        if found.hypothesis.effect == "end_stop_restitution":
            return self._knocking(found)
        make, unknowns = joined(self.ranking.base, found.hypothesis)
        return self._error(make, unknowns, found.fit.x)

    def _error(self, make: Make, unknowns: Unknowns, x: Array) -> float:
        judge = self.ranking.judge
        near = self.train.fit(make, unknowns, x, self.ranking.fit.start, 6)
        return _misfit(judge.windows, make, near.x, judge.counts & self.held)

    def _knocking(self, found: Guess) -> float:
        make, _ = joined(self.ranking.base, found.hypothesis)
        windows = self.ranking.judge.windows
        knocks = windows.knocks & (windows.count > 0)
        base = self.ranking.base
        self.before = _misfit(windows, base.solo, self.ranking.fit.x, knocks)
        return _misfit(windows, make, found.fit.x, knocks)


def _misfit(windows: Windows, make: Make, x: Array, counts: NDArray[np.bool_]) -> float:
    """RMS misfit of some windows from their best starts, rad or m."""
    own = Judge(windows, counts)
    fit = own.fit(lambda _: make(x), NOTHING, np.zeros(0), windows.start, 5)
    misfit = windows.misfit(make(x), fit.start)
    rows = windows.rows[counts]
    return rms(misfit[rows[rows >= 0]])


def _finding(
    measured: Measured,
    ranking: Ranking,
    held: Holdout,
    number: int,
    weighed: Weighed,
    left: Sequence[float],
    own: float,
) -> Finding:
    guess = ranking.guesses[number]
    hypothesis, x = guess.hypothesis, guess.x
    after = held.error(guess)
    alike = tuple(
        other.hypothesis.effect
        for k, other in enumerate(ranking.guesses)
        if k != number and abs(left[k] - left[number]) < ALIKE * (left[number] + LITTLE)
        and left[k] < max(RIVAL * own, LEFT)
    )  # fmt: skip
    magnitude = hypothesis.magnitude(x)
    doubt = _doubt(ranking, guess)
    interval = hypothesis.interval(x)
    joint = measured.profile.joint
    return Finding(
        effect=hypothesis.effect,
        interval=interval,
        probability=weighed.probabilities[number],
        direction=hypothesis.direction,  # type: ignore[arg-type]
        magnitude=magnitude,
        magnitude_error=doubt,
        unit=hypothesis.unit,
        explanation=explained(
            hypothesis.effect,
            hypothesis.direction,
            interval,
            (magnitude, doubt, hypothesis.unit),
            (held.before, after, _floor(measured)),
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
        for sign in (1, -1):
            moved = x.copy()
            moved[k] += sign * 1e-4
            slope[k] += sign * found.hypothesis.magnitude(moved[n:]) / 2e-4
    samples = max(float(ranking.judge.windows.count[ranking.judge.counts].sum()), 1.0)
    worse = max(float(found.fit.squares[ranking.judge.counts].sum()) / samples, 1.0)
    return float(np.sqrt(max(slope @ covariance @ slope, 0.0) * worse))


def _next(measured: Measured, ranking: Ranking, weighed: Weighed) -> str | None:
    """The experiment that tells the likeliest two apart; None if the first is sure."""
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
    velocity = ranking.judge.windows.start[:, 1]
    means = Means(
        joint=measured.profile.joint,
        inertia=measured.single.inertia,
        speed=float(np.sqrt(np.mean(velocity**2))),
        h=ranking.base.h,
        sigma=_floor(measured),
        forced=any(run.forced for run in measured.runs),
    )
    return next_experiment(first, second, means)
