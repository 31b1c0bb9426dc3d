"""Effects of what the joint is part of: masses, tilt, play, end stops."""

from collections.abc import Iterator, Mapping
from itertools import product
from math import exp, hypot, log, nan
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from joda.effects.base import Effect, parameter
from joda.effects.guesses import MOVED, TINY, TRIAL, InitialGuess, Trial, Units

HEAVY = 300.0
"""Added inertia, in units of the joint's, up to which is looked."""
PULL = (-300.0, 300.0, 0.005)
"""Bounds and step of a pull of gravity, in usual forces."""
KEPT = 3
"""Rough fits of a load behind a play that are fitted to the end: each impact may be or not."""


class AddedInertia(Effect):
    """More inertia than the bodies have."""

    NAME = "more inertia than the model has"
    DESCRIPTION = "The joint is harder to set in motion than its bodies' masses make it."
    LAW = "force -inertia dv/dt"
    SOURCE = "Newton's second law; `armature` of the joint in the scene"
    SHOWS = "All accelerations under a known force are too small by one factor."

    effect: Literal["added_inertia"] = "added_inertia"
    inertia: float = parameter("additional inertia", "kg·m²", "kg", (0.001, 5), gt=0)

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """From a tenth of the joint's own."""
        yield InitialGuess(
            [(1e-4, 5.0, 0.002, nan, HEAVY)],
            [[0.1]],
            lambda x: cls(inertia=joint.inertia * x[0]),
            lambda x: joint.inertia * x[0],
            "kg·m²" if joint.hinge else "kg",
            itself=lambda x: x[0] < MOVED * HEAVY,
        )


class GravityOffset(Effect):
    """Gravity acts otherwise than the bodies' masses say: tilt, or a wrong centre of mass."""

    NAME = "another pull of gravity (tilt, or another centre of mass)"
    KIND = "force"
    DESCRIPTION = "The axis is tilted, or the centre of mass is elsewhere than in the model."
    LAW = "force sin sin(q) + cos cos(q) on a hinge, force on a slide"
    SOURCE = "torque of a weight on an arm"
    SHOWS = (
        "A force, over a hinge's position like a sine and of a slide constant, the same in both "
        "directions and at rest; the joint drifts to another place than the model does."
    )

    effect: Literal["gravity_offset"] = "gravity_offset"
    sin: float = parameter("factor of sin q, of a hinge", "N·m", "-", (-5, 5), default=0.0)
    cos: float = parameter("factor of cos q, of a hinge", "N·m", "-", (-5, 5), default=0.0)
    force: float = parameter("constant, of a slide", "-", "N", (-20, 20), default=0.0)

    @model_validator(mode="after")
    def _something(self) -> Self:
        if not (self.sin or self.cos or self.force):
            raise ValueError("give sin or cos for a hinge, force for a slide")
        return self

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """A sine or a cosine of a hinge, a constant of a slide."""
        force, unit = joint.force, joint.of_force()
        if joint.hinge:
            yield InitialGuess(
                [PULL] * 2,
                [(TRIAL, 0.0), (0.0, TRIAL)],
                lambda x: cls(sin=force * x[0] or TINY, cos=force * x[1]),
                lambda x: force * hypot(*x),
                unit,
            )
        else:
            yield InitialGuess(
                [PULL],
                [[TRIAL]],
                lambda x: cls(force=force * x[0] or TINY),
                lambda x: force * abs(x[0]),
                unit,
            )

    def fits(self, kind: Literal["hinge", "slide"]) -> bool:
        """Whether only those numbers are set that such a joint has."""
        return not (self.force if kind == "hinge" else self.sin or self.cos)


HEAVIEST = {"load": 0.45, "motor": 0.94}
"""Inertia of what is beyond the play, by the side on which the joint is, in units of the joint's: a
little less than what the plugin takes."""


class Backlash(Effect):
    """Play between two parts, of which the joint's own is the one that is measured."""

    NAME = "play between what is pushed and what moves"
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
        "load": "after each reversal of the force nothing happens for a moment, then a knock",
        "motor": "after each reversal the joint is light for a moment, then a knock slows it",
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
        contact yields and knocks is not known."""
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


End = Literal["both", "low", "high"]
ENDS: dict[End, tuple[float, float]] = {"both": (0.0, 1.0), "low": (0.0, 0.02), "high": (0.98, 1.0)}
"""Where an end of the range acts, in normalised position."""


class EndStopRestitution(Effect):
    """How the ends of the range, or one of them, throw the joint back."""

    NAME = "ends of the range that throw the joint back"
    DESCRIPTION = "The ends of the range, or one of them, bounce more, or less, than the model's."
    LAW = "speed after / speed before = restitution; the limit's solver parameters are set so"
    SOURCE = "Newton's coefficient of restitution"
    SHOWS = "After a knock at an end the speed is another one than simulated."

    effect: Literal["end_stop_restitution"] = "end_stop_restitution"
    restitution: float = parameter(
        "speed after a knock per speed before", "1", "1", (0, 0.8), ge=0, lt=1
    )
    end: End = Field(
        default="both", description="of the range that does so; the other one stays the scene's"
    )

    @property
    def interval(self) -> tuple[float, float]:
        """Where it acts, in normalised position; all of the range stands for both ends."""
        return ENDS[self.end]

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """Of both ends, and of each."""
        return map(cls._of_end, ENDS)

    @classmethod
    def _of_end(cls, end: End) -> InitialGuess:
        return InitialGuess(
            [(0.05, 0.95, 0.02)],
            [[0.3], [0.6]],
            lambda x: cls(restitution=x[0], end=end),
            lambda x: x[0],
            "1",
            interval=ENDS[end],
        )
