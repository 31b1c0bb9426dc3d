"""Ends of the range that throw the joint back."""

from collections.abc import Iterator
from typing import Literal

from pydantic import Field

from joda.effects.base import Effect, parameter
from joda.effects.guesses import InitialGuess, Units

End = Literal["both", "low", "high"]
ENDS: dict[End, tuple[float, float]] = {"both": (0.0, 1.0), "low": (0.0, 0.02), "high": (0.98, 1.0)}
"""Where an end of the range acts, in normalised position."""


class EndStopRestitution(Effect):
    """How the ends of the range, or one of them, throw the joint back."""

    NAME = "ends of the range that throw the joint back"
    SHAPE_ERROR = 0.12  # an impact lies between two samples
    CONFUSED_WITH = ("backlash",)
    DESCRIPTION = "The ends of the range, or one of them, bounce more, or less, than the model's."
    LAW = "speed after / speed before = restitution; the limit's solver parameters are set so"
    SOURCE = "Newton's coefficient of restitution"
    SHOWS = "After an impact at an end the speed is another one than simulated."

    effect: Literal["end_stop_restitution"] = "end_stop_restitution"
    restitution: float = parameter(
        "speed after an impact per speed before", "1", "1", (0, 0.8), ge=0, lt=1
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
