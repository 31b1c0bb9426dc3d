"""Play before the joint or behind it."""

from collections.abc import Iterator, Mapping
from itertools import product
from math import exp, log, nan
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from joda.effects.base import Effect, parameter
from joda.effects.guesses import InitialGuess, Trial, Units

KEPT = 3
"""Rough fits of a load behind a play that are fitted to the end: each impact may be or not."""
HEAVIEST = {"load": 0.45, "motor": 0.94}
"""Inertia of what is beyond the play, by the side on which the joint is, in units of the joint's: a
little less than what the plugin takes."""


class Backlash(Effect):
    """Play between two parts, of which the joint's own is the one that is measured."""

    NAME = "play between what is pushed and what moves"
    SHAPE_ERROR = 0.03  # a stiff contact yields a little before it carries
    CONFUSED_WITH = (
        "presliding_friction",
        "end_stop_restitution",
    )
    DESCRIPTION = (
        "What pushes the joint has play, or what the joint moves has: a loose handle, gears, a "
        "slack linkage."
    )
    LAW = (
        "side load: the applied force moves a handle of its own inertia, which takes the part "
        "along at the ends of the play; side motor: the part, on which the force acts, takes a "
        "load along; both without bounce"
    )
    SOURCE = "Nordin and Gutman, Automatica 38 (2002) 1633"
    SIDES: ClassVar[Mapping[str, str]] = {
        "load": "after each reversal of the force nothing happens for a moment, then an impact",
        "motor": "after each reversal the joint is light for a moment, then an impact slows it",
    }
    SHOWS = f"Side load: {SIDES['load']}. Side motor: {SIDES['motor']}."

    effect: Literal["backlash"] = "backlash"
    play: float = parameter("whole width of the play", "rad", "m", (0.001, 0.1), gt=0)
    inertia: float = parameter(
        "of the handle, besides the joint's; of the load, out of the joint's",
        *("kg·m²", "kg", (1e-4, 0.5)),
        gt=0,
    )
    side: Literal["load", "motor"] = Field(
        default="load",
        description="of the play on which the joint is: load: a handle is before it; motor: it is "
        "pushed and measured itself, and a load is behind it",
    )
    share: float = parameter(
        "of friction and damping, that acts on the load",
        *("1", "1", (0.3, 0.95)),
        default=0.0,
        ge=0,
        le=1,
    )

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """A play before the joint, where something pushes it through that, and behind it; how its
        contact yields in an impact is not known."""
        M, unit = joint.inertia, "rad" if joint.hinge else "m"

        def play(x: Trial) -> float:
            return joint.span * x[0]

        def before(x: Trial) -> Backlash:
            return cls(play=play(x), inertia=M * exp(x[1]))

        def behind(x: Trial) -> Backlash:
            return cls(play=play(x), inertia=M * exp(x[1]), side="motor", share=x[2])

        if joint.forced:
            yield InitialGuess(
                [(3e-3, 0.2, 0.002, nan, 0.5), (log(3e-3), log(HEAVIEST["load"]), 0.05)],
                list(product((0.01, 0.03), (log(0.03), log(0.15)))),
                before,
                play,
                unit,
                exact=False,
            )
        yield InitialGuess(
            [
                (3e-3, 0.2, 0.003, nan, 0.5),
                (log(0.01), log(HEAVIEST["motor"]), 0.1),
                (0.0, 0.98, 0.04),
            ],
            list(product((0.015, 0.05), (log(0.12), log(0.5)), (0.85,))),
            behind,
            play,
            unit,
            exact=False,
            kept=KEPT,
        )

    @property
    def shown(self) -> str:
        """How play on its side of the joint shows."""
        return f"Side {self.side}: {self.SIDES[self.side]}."

    @property
    def handle(self) -> float:
        """Inertia of a handle before the joint, kg·m² or kg; 0 for none."""
        return self.inertia if self.side == "load" else 0.0

    @property
    def load(self) -> float:
        """Inertia of a load behind the joint, kg·m² or kg; 0 for none."""
        return self.inertia if self.side == "motor" else 0.0

    @model_validator(mode="after")
    def _behind(self) -> Self:
        if self.share and self.side == "load":
            raise ValueError("share is of what lies behind the play; give side motor")
        return self
