"""The effects beyond the templates as hypotheses, as their cards (`joda.effects`) begin them."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import get_args

import numpy as np
from pydantic import ValidationError

from joda.component import Component
from joda.diagnosis.hypotheses.base import Array, Hypothesis, everywhere, unknowns_of
from joda.diagnosis.hypotheses.intervals import GRID, felt
from joda.diagnosis.settings import SETTINGS
from joda.effects import CHANNEL_EFFECTS, EFFECTS, CurveEffect, Effect, written_as
from joda.effects.base import Kind
from joda.effects.guesses import STRENGTH, TINY, TRIAL, AnyDirection, InitialGuess, Units
from joda.errors import JodaError
from joda.estimation.unknowns import Unknowns
from joda.profile import Profile

Interval = tuple[float, float]

KNOTS = 9
"""Control points of a free curve."""
CURVATURE_STD = 2.0
"""How much a free curve bends at a control point (one standard deviation), in usual forces: where
no segment has been, what is beside tells it."""
FACTOR, UNEVEN = (-1.5, 1.5, 0.05), 0.3
"""Logarithms by which a size differs along the way: bounds and step, and by how much it usually
does (one standard deviation)."""
FINER = (KNOTS, 17, 33)
"""Control points of such a size: where it leaves more than noise, more."""
ONE_OF_TWO = 2 * float(np.log(2))
"""How much rarer each direction of an effect is than the effect, see `neg_log_prior`."""


def free_curves(units: Units) -> Iterator[Hypothesis]:
    """Friction and damping that differ along the way, level where no run has been."""
    for effect, channel in CHANNEL_EFFECTS.items():
        yield _curve(units, effect, channel)


def _curve(units: Units, effect: str, channel: str) -> Hypothesis:
    power = int(channel == "damping")
    unit = units.force / units.speed**power
    knots, padded = _knots(units)

    def write(profile: Profile, x: Array) -> Profile:
        y = tuple(unit * padded(x))
        return profile.with_component(
            channel, Component(label=effect, interval=(0, 1), x=knots, y=y)
        )

    def raised(x: Array) -> tuple[float, float]:
        """Where the curve is above its least value."""
        y = tuple(padded(x - np.min(x) + TINY))
        return felt(
            Component(label=effect, interval=(0, 1), x=knots, y=y),
            SETTINGS.naming.min_rise,
            to_ends=False,
        )

    def level(x: Array) -> bool:
        """Whether it is the same on so much of the range that it is called constant."""
        y = np.interp(np.linspace(0, 1, GRID), knots, padded(x))
        usual = float(np.median(y))
        near = np.abs(y - usual) <= SETTINGS.naming.level_deviation * usual
        return usual > SETTINGS.naming.min_variation * float(y.max()) and bool(
            np.mean(near) >= SETTINGS.naming.whole_range
        )

    return Hypothesis(
        effect,
        "both",
        replace(
            unknowns_of(*[STRENGTH] * KNOTS),
            rough=np.diff(np.eye(KNOTS), 2, axis=0) / CURVATURE_STD,
        ),
        np.full((1, KNOTS), 0.5 * TRIAL),
        write,
        raised,
        lambda x: unit * float(np.ptp(x)),
        units.of_force(power),
        misfit_tolerance=SETTINGS.tolerances.free_curve,
        itself=lambda x: (
            bool(np.ptp(x) > SETTINGS.naming.min_variation * np.mean(x)) and not level(x)
        ),
    )


def _knots(units: Units, count: int = KNOTS) -> tuple[tuple[float, ...], Callable[[Array], Array]]:
    """Control points of a curve that is level where no run has been, and how its values there
    follow from those where runs were."""
    at = np.linspace(*units.visited, count)
    beyond = int(at[0] > 0), int(at[-1] < 1)
    return tuple(map(float, np.unique([0.0, *at, 1.0]))), lambda x: np.pad(x, beyond, mode="edge")


def from_effects(units: Units) -> Iterator[Hypothesis]:
    """The effects beyond the channels that can show in such a joint's motion."""
    for name, card in EFFECTS.items():
        for guess in card.guesses(units):
            _check(name, card, guess)
            found = _hypothesis(name, card, guess)
            yield _along(units, found, guess) if issubclass(card, CurveEffect) else found


def _check(name: str, card: type[Effect], guess: InitialGuess) -> None:
    """Raises JodaError if a card, or what its guess makes, is not what the diagnosis needs."""
    if why := _wrong(card, guess):
        raise JodaError(f"effect '{name}': {why}.")
    for trial in guess.trials:
        try:
            made = guess.effect(list(trial))
        except ValidationError as error:
            said = error.errors()[0]["msg"].removeprefix("Value error, ")
            raise JodaError(
                f"effect '{name}': a trial of its guesses makes no effect: {said}."
            ) from None
        if made.effect != (listed := written_as(name)):
            raise JodaError(
                f"effect '{name}': its guesses make '{made.effect}', but a profile lists it as "
                f"'{listed}'; give its card WRITTEN_AS = '{made.effect}'."
            )


def _wrong(card: type[Effect], guess: InitialGuess) -> str | None:
    """What is wrong with a card, a clause."""
    if missing := [key for key in ("NAME", "SHOWS") if not hasattr(card, key)]:
        return f"its card has no {missing[0]}"
    for key, value, choices in (
        ("KIND", card.KIND, (*get_args(Kind), None)),
        ("direction of a guess", guess.direction, get_args(AnyDirection)),
    ):
        if value not in choices:
            return f"the {key} on its card is '{value}', not one of {', '.join(map(str, choices))}"
    if not len(guess.trials) or any(len(trial) != len(guess.numbers) for trial in guess.trials):
        return f"each trial of a guess needs {len(guess.numbers)} values, and there must be one"
    return None


def _hypothesis(name: str, card: type[Effect], guess: InitialGuess) -> Hypothesis:
    """An effect as its card begins it."""
    return Hypothesis(
        name,
        guess.direction,
        unknowns_of(*guess.numbers),
        np.array(guess.trials, float),
        lambda profile, x: profile.with_effect(guess.effect(x.tolist())),
        _place(guess.interval),
        lambda x: guess.magnitude(x.tolist()),
        guess.unit,
        neg_log_prior=0.0 if guess.direction == "both" else ONE_OF_TWO,
        misfit_tolerance=SETTINGS.tolerances.known_law
        if guess.exact
        else SETTINGS.tolerances.known_shape,
        like_a_number=card.LIKE_A_NUMBER,
        shape_error=card.SHAPE_ERROR,
        itself=lambda x: guess.itself(x.tolist()),
        kept=guess.kept,
    )


def _place(interval: Interval | None) -> Callable[[Array], Interval]:
    """Where it acts, whatever its numbers."""
    return everywhere if interval is None else lambda x: interval


def _along(units: Units, flat: Hypothesis, guess: InitialGuess) -> Hypothesis:
    """The same where its size may differ along the way, with more and more control points."""
    finer = None
    for count in reversed(FINER):
        finer = _uneven(units, flat, guess, count, finer)
    return replace(flat, uneven=finer)


def _uneven(
    units: Units, flat: Hypothesis, guess: InitialGuess, count: int, finer: Hypothesis | None
) -> Hypothesis:
    """The same whose size is a curve of so many control points."""
    knots, padded = _knots(units, count)

    def curve(x: Array) -> Array:
        return padded(flat.magnitude(x) * np.exp(x[-count:]))

    def write(profile: Profile, x: Array) -> Profile:
        along = {"x": knots, "y": tuple(map(float, curve(x)))}
        return profile.with_effect(guess.effect(x.tolist()).model_copy(update=along))

    return replace(
        flat,
        unknowns=flat.unknowns.and_(_factors(count)),
        trials=np.zeros((0, len(guess.numbers) + count)),
        write=write,
        magnitude=lambda x: float(curve(x).max()),
        misfit_tolerance=max(flat.misfit_tolerance, SETTINGS.tolerances.free_curve),
        uneven=finer,
        factors=count,
    )


def _factors(count: int) -> Unknowns:
    """Logarithms of so many factors of a size along the way."""
    low, high, step = (np.full(count, value) for value in FACTOR)
    return Unknowns(low, high, step, np.zeros(count), np.full(count, UNEVEN))
