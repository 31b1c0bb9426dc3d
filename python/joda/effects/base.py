"""What every effect has: a name, a law, parameters with units, a text for the plugin."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from joda.component import Curve, Frozen, Points, numbers
from joda.effects.guesses import STRENGTH, TRIAL, AnyDirection, InitialGuess, Number, Trial, Units

Direction = Literal["positive", "negative"]
Kind = Literal["force", "resistance"]
DIRECTIONS: tuple[Direction, ...] = "positive", "negative"

PLACES = ("direction", "end")
"""Parameters that say where an effect acts."""
TABLE = ("interval", "positions", "velocities")
"""What a table's text begins with; its rows follow."""


def parameter(
    description: str, hinge: str, slide: str, typical: tuple[float, float], **bounds: Any
) -> Any:
    """A parameter of an effect.

    Args:
        description: what it is.
        hinge, slide: its unit for a hinge and for a slide.
        typical: smallest and largest value that is usual on doors, drawers, lids and knobs.
        bounds: default, gt, ge, lt, le of pydantic's Field.
    """
    unit = hinge if hinge == slide else f"{hinge} or {slide}"
    return Field(
        description=f"{description} ({unit}; typically {typical[0]:g} to {typical[1]:g})",
        json_schema_extra={"unit": [hinge, slide], "typical": list(typical)},
        **bounds,
    )


@dataclass(frozen=True)
class Motion:
    """How fast, how far and under what force a joint moves at most.

    Attributes:
        speed: rad/s or m/s.
        acceleration: rad/s² or m/s².
        force: N·m or N.
        travel: from one place to the farthest, rad or m.
    """

    speed: float
    acceleration: float
    force: float
    travel: float


class Effect(Frozen):
    """An effect beyond the three channels.

    Attributes:
        effect: its name.
        NAME: what a model without it lacks, in a few words.
        KIND: a force over position or a resistance, which runs in one direction do not tell apart;
            None of neither.
        ON_FRICTION: whether it acts through the solver's friction row.
        LIKE_A_NUMBER: whether a number of the model or of the measurement that is off may look the
            same in runs.
        WRITTEN_AS: the effect that a profile lists for it, as the plugin executes it; None: itself.
        SHAPE_ERROR: part of its size by which the real thing may differ from its law; None: as
            others of its kind (calibrated: `python tests/benchmarks hidden cover`).
        CONFUSED_WITH: effects and templates that measurements may not tell from it.
        DESCRIPTION: in plain words.
        LAW: the formula; v is the joint's velocity, s its normalised position.
        SOURCE: where the formula is from.
        SHOWS: how it shows in measurements.
    """

    NAME: ClassVar[str]
    KIND: ClassVar[Kind | None] = None
    ON_FRICTION: ClassVar[bool] = False
    LIKE_A_NUMBER: ClassVar[bool] = False
    WRITTEN_AS: ClassVar[str | None] = None
    SHAPE_ERROR: ClassVar[float | None] = None
    CONFUSED_WITH: ClassVar[tuple[str, ...]] = ()
    DESCRIPTION: ClassVar[str]
    LAW: ClassVar[str]
    SOURCE: ClassVar[str]
    SHOWS: ClassVar[str]

    effect: str

    @property
    def key(self) -> str:
        """What a joint may have only once: the name, with direction or end where there is one."""
        side = getattr(self, "direction", None) or getattr(self, "end", None)
        return f"{self.effect} {side}" if side else self.effect

    @property
    def shown(self) -> str:
        """How it shows in measurements, with its parameters; a sentence."""
        return self.SHOWS

    def largest_force(self, motion: Motion) -> float:
        """That it may exert in such a motion, N·m or N; 0 of what exerts none of its own."""
        return 0.0

    @classmethod
    def parameters(cls) -> tuple[str, ...]:
        """Names of its parameters but for the curve."""
        return tuple(k for k in cls.model_fields if k not in ("effect", *Curve.model_fields))

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """Where its fits begin, each way in which it may act in such a joint; none of an effect
        that has no numbers to be fitted, or cannot show there."""
        yield from ()

    def text(self) -> str:
        """The effect as in the plugin's attribute; defaults but for the place are left out."""
        words = [self.effect]
        for key in self.parameters():
            value = getattr(self, key)
            if key in PLACES or value != type(self).model_fields[key].default:
                words.append(f"{key}={value if isinstance(value, str) else numbers([value])}")
        return " ".join(words)

    def described(self) -> str:
        """Name and numbers for a person; what is zero or usual is left out."""
        values = ((key, getattr(self, key)) for key in self.parameters())
        words = [
            f"{key} {value if isinstance(value, str) else f'{value:.4g}'}"
            for key, value in values
            if value not in (0, "both", "load")
        ]
        return ", ".join([self.effect.replace("_", " "), *words])

    @classmethod
    def fields_of(cls, text: str) -> Mapping[str, Any]:
        """The inverse of `text`, as fields that are still to be checked."""
        head, _, curve = text.partition(":")
        name, *words = head.split()
        fields: dict[str, Any] = {"effect": name}
        fields |= dict(word.partition("=")[::2] for word in words)
        if curve.strip():
            parts = [part.split() for part in curve.split("|")]
            is_table = len(parts) > len(Curve.model_fields)
            fields |= dict(zip(TABLE if is_table else Curve.model_fields, parts, strict=False))
            if is_table:
                fields["y"] = parts[len(TABLE) :]
        return fields


class CurveEffect(Curve, Effect):
    """An effect whose size is a curve over the joint's position; by default all over the range.

    Attributes:
        POWER: of the speed by which its size is a force.
    """

    POWER: ClassVar[Literal[0, 1, 2]] = 0

    interval: tuple[float, float] = (0.0, 1.0)
    x: Points = (0.0, 1.0)

    @model_validator(mode="after")
    def _not_negative(self) -> Self:
        if min(self.y) < 0:
            raise ValueError("y must not be negative")
        return self

    def largest_force(self, motion: Motion) -> float:
        """Where its curve is largest, N·m or N."""
        return max(self.y) * motion.speed**self.POWER

    def text(self) -> str:
        """The effect as in the plugin's attribute."""
        return f"{super().text()}: {self.curve_text()}"

    def described(self) -> str:
        """Name and numbers for a person."""
        return f"{super().described()}, up to {max(self.y):.4g}"

    @classmethod
    def guess(
        cls,
        joint: Units,
        others: Sequence[tuple[Number, Trial]] = (),
        parameters: Callable[[Trial], Mapping[str, Any]] = lambda x: {},
        direction: AnyDirection = "both",
        exact: bool = True,
    ) -> InitialGuess:
        """Of the same size everywhere.

        Args:
            joint: its units.
            others: what is known of its numbers after the size, and values to begin with.
            parameters: what these numbers make of its parameters.
            direction, exact: see `InitialGuess`.
        """
        size = joint.force / joint.speed**cls.POWER
        one_way = {} if direction == "both" else {"direction": direction}
        return InitialGuess(
            [STRENGTH, *(number for number, _ in others)],
            list(product((TRIAL,), *(trials for _, trials in others))),
            lambda x: cls(y=(size * x[0],) * 2, **one_way, **parameters(x)),  # type: ignore[arg-type]
            lambda x: size * x[0],
            joint.of_force(cls.POWER),
            direction,
            exact,
        )
