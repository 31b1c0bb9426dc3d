"""A formula for a learned law: few readable terms that do as well on unseen runs, or none.

Sparse regression (Brunton, Proctor and Kutz, PNAS 113 (2016) 3932) of the law's curves, where runs
have been: of all sets of a few terms those that leave least, the fewest first, each fitted again by
simulation.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from joda.diagnosis.adding import error
from joda.diagnosis.learning.ensemble import drawn, one_digit
from joda.diagnosis.learning.fitting import Learned, Learner
from joda.diagnosis.learning.law import Law
from joda.diagnosis.learning.library import DRY, Term, of_position, of_speed
from joda.diagnosis.settings import SETTINGS
from joda.measured.measured_joint import Measured

Array = NDArray[np.float64]
Terms = tuple[Term, ...]

WAVES = 600
"""Periods that are tried, up to that of a wave in two lengths of the law's."""
MAX_TERMS = 2
"""Terms of the position, and of the speed; a sine and its cosine count as one."""
BEST = 2
"""So many sets of as many terms are fitted by simulation."""
WIDE = 10.0
"""Standard deviation of a term before the data, in usual forces."""
FLOOR = 0.02
"""Of a curve's largest force: less is not told apart when terms are chosen."""


@dataclass(frozen=True)
class Coefficient:
    """A term with its factor in the unit said, and one standard deviation of that."""

    term: str
    factor: float
    error: float
    unit: str


@dataclass(frozen=True)
class Formula:
    """A formula that does as well as the law, beside what the law remembers.

    Attributes:
        terms: of the force, with their factors.
        unseen: its error on what was held out, in the learned law's.
    """

    terms: tuple[Coefficient, ...]
    unseen: float

    @property
    def text(self) -> str:
        """For a person."""
        signs = ("\N{MINUS SIGN}" if one.factor < 0 else "+" for one in self.terms)
        said = " ".join(
            f"{sign} {abs(one.factor):.3g} ({one_digit(one.error)}) {one.unit} {one.term}"
            for sign, one in zip(signs, self.terms, strict=True)
        )
        return f"F = {said.removeprefix('+ ')}"


@dataclass(frozen=True)
class Terse(Law):
    """A law whose parts are of few terms.

    Attributes:
        lo: position at the low end of the range, rad or m.
        made_of: its terms.
    """

    lo: float
    made_of: Terms

    @cached_property
    def position_modes(self) -> Array:
        """See Law."""
        if not self._of("position"):
            return np.zeros((0, 0))
        return self._columns("position", self.lo + self.span * self.places)

    @cached_property
    def friction_modes(self) -> Array:
        """See Law."""
        return WIDE * self.force * np.ones((2, sum(one.text == DRY for one in self.made_of)))

    @cached_property
    def table_modes(self) -> Array:
        """See Law."""
        return self._columns("speed", np.abs(self.speeds))

    def factors(self, x: Array) -> list[float]:
        """Of its terms, of the position first, in the terms' own units; those of the speed with the
        sign of a force, against it."""
        parts = np.split(x, np.cumsum(self._counts)[:-1])[:3]
        sizes = self._scales("position"), np.array([WIDE * self.force]), self._scales("speed")
        signs = 1, -1, -1
        return [
            float(f)
            for sign, size, part in zip(signs, sizes, parts, strict=True)
            for f in sign * size[: len(part)] * part
        ]

    @property
    def ordered(self) -> Terms:
        """Its terms as `factors` has them."""
        dry = tuple(one for one in self.made_of if one.text == DRY)
        return (*self._of("position"), *dry, *self._of("speed"))

    def _of(self, what: str) -> Terms:
        return tuple(one for one in self.made_of if one.of == what and one.text != DRY)

    def _at(self, what: str) -> Array:
        places = self.lo + self.span * np.linspace(*self.interval, 100)
        return places if what == "position" else np.linspace(0, self.fastest, 100)

    def _scales(self, what: str) -> Array:
        """Factors with which each term is as large as a law may be."""
        sizes = [np.sqrt(np.mean(one.function(self._at(what)) ** 2)) for one in self._of(what)]
        return WIDE * self.force / np.array(sizes)

    def _columns(self, what: str, at: Array) -> Array:
        columns = [one.function(at) for one in self._of(what)]
        return np.stack(columns, axis=1) * self._scales(what) if columns else np.zeros((len(at), 0))


def formula(
    learner: Learner, held: Measured, learned: Learned, draws: Array, unseen: float
) -> Formula | None:
    """A formula for a law; None if none does as well or is stable, or resistances differ along the
    way, or it only remembers.

    Args:
        learner: of the joint and the runs to fit.
        held: the joint with runs held out.
        learned: the law.
        draws: its ensemble, see `drawn`.
        unseen: its error on what was held out, in segments.
    """
    law = learned.law
    if law.terms.along or not (law.terms.position or law.terms.speed):
        return None
    curves, others = _curves(law, learner.numbers(learned)), [_curves(law, one) for one in draws]
    errors = [np.std(each, axis=0) for each in zip(*others, strict=True)]
    lo = learner.train.profile.joint.range[0]
    for made_of in _candidates(law, lo, curves, errors):
        if not _stable(law, lo, made_of, others, errors):
            continue
        terse = Terse(law.terms, law.interval, law.span, law.fastest, law.force, lo, made_of)
        for found in learner.learned(terse):
            ratio = error(held, found.profile).window / unseen
            if ratio <= SETTINGS.learning.formula_error:
                return Formula(_coefficients(learner, found, terse), ratio)
    return None


def _coefficients(learner: Learner, found: Learned, terse: Terse) -> tuple[Coefficient, ...]:
    """The terms with their factors, and the errors of these over an ensemble."""
    joint, factors = learner.train.profile.joint, terse.factors(learner.numbers(found))
    errors = np.std([terse.factors(one) for one in drawn(learner, found)], axis=0)
    return tuple(
        Coefficient(one.text, factor, float(sd), joint.force_unit + one.unit.format(x=joint.unit))
        for one, factor, sd in zip(terse.ordered, factors, errors, strict=True)
    )


def _curves(law: Law, x: Array) -> tuple[Array, Array]:
    """The force over position, and the resistance over the speed in both directions."""
    force = law.force_at(x) if law.terms.position else np.zeros(0)
    resists = np.abs(law.resistance(x)) if law.terms.speed else np.zeros(0)
    return force, resists


def _candidates(
    law: Law, lo: float, curves: tuple[Array, Array], errors: Sequence[Array]
) -> Iterator[Terms]:
    """Sets of terms, the fewest first, of as many those that leave least of the curves."""
    position: list[list[Terms]] = [[()]]
    speed: list[list[Terms]] = [[()]]
    if law.terms.position:
        q = lo + law.span * law.places
        groups = of_position(_period(q, curves[0], law.terms.position * law.span))
        position = _sets(groups, q, curves[0], errors[0])
    if law.terms.speed:
        singles = [(one,) for one in of_speed(law.fastest)]
        speed = _sets(singles, np.abs(law.speeds), curves[1], errors[1])
    pairs = [(p, v) for p in range(len(position)) for v in range(len(speed))]
    for p, v in sorted(pairs, key=sum):
        for some in position[p]:
            for more in speed[v]:
                yield (*some, *more)


def _sets(groups: Sequence[Terms], at: Array, y: Array, errors: Array) -> list[list[Terms]]:
    """The best sets of one group of terms, of two, ...; shortest first."""
    out = []
    for count in range(1, MAX_TERMS + 1):
        every = [tuple(t for g in some for t in g) for some in combinations(groups, count)]
        left = [_left(terms, at, y, errors) for terms in every]
        out.append([every[k] for k in np.argsort(left)[:BEST]])
    return out


def _solved(terms: Terms, at: Array, y: Array, errors: Array) -> tuple[Array, Array, Array]:
    """Weighted columns, the factors that suit them best, and the weighted values."""
    weight = 1 / np.hypot(errors, FLOOR * np.abs(y).max(initial=1e-300))
    A = np.stack([one.function(at) for one in terms], axis=1) * weight[:, None]
    return A, np.linalg.lstsq(A, weight * y, rcond=None)[0], weight * y


def _left(terms: Terms, at: Array, y: Array, errors: Array) -> float:
    """What of a curve terms leave, squares in standard deviations; all of it where a resistance
    would drive."""
    A, factors, target = _solved(terms, at, y, errors)
    drives = terms[0].of == "speed" and bool(np.any(A @ factors < 0))
    return float(np.sum((A @ factors * (not drives) - target) ** 2))


def _stable(
    law: Law, lo: float, terms: Terms, others: Sequence[tuple[Array, Array]], errors: list[Array]
) -> bool:
    """Whether every term has about the same factor in all of the ensemble; a sine and its cosine
    as one."""
    places = lo + law.span * law.places if law.terms.position else np.zeros(0)
    for k, (what, at) in enumerate((("position", places), ("speed", np.abs(law.speeds)))):
        own = tuple(one for one in terms if one.of == what)
        if not own:
            continue
        found = np.array([_solved(own, at, each[k], errors[k])[1] for each in others])
        sizes = np.abs(found.mean(axis=0))
        waves = np.array(["q)" in one.text for one in own])
        if waves.any():
            sizes[waves] = np.linalg.norm(sizes[waves])
        if np.any(found.std(axis=0) > SETTINGS.learning.term_spread * sizes):
            return False
    return True


def _period(q: Array, y: Array, length: float) -> tuple[float, ...]:
    """n of the sin(n q) that suits a curve best, 1/rad or 1/m."""
    span = float(np.ptp(q))
    tried = np.linspace(np.pi / span, np.pi / length, WAVES)

    def left(n: float) -> float:
        A = np.stack([np.ones_like(q), np.sin(n * q), np.cos(n * q)], axis=1)
        return float(np.sum((A @ np.linalg.lstsq(A, y, rcond=None)[0] - y) ** 2))

    for _ in range(2):
        k = int(np.argmin([left(n) for n in tried]))
        step = tried[1] - tried[0]
        tried = np.linspace(tried[k] - step, tried[k] + step, WAVES // 10)
    return (float(tried[int(np.argmin([left(n) for n in tried]))]),)
