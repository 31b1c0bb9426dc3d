"""A family of cases: its joints, the laws they may hide, how they are moved and measured."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from joda.hidden.measuring import Encoder, Motions
from joda.hidden.sampler import Builder
from joda.hidden.truth import Joint, Truth


@dataclass(frozen=True)
class Family:
    """What cases are drawn from.

    Attributes:
        name: of the family.
        joint: what the base model calls its joint.
        known: effects that a diagnosis knows by name.
        uncatalogued: effects that no catalogue has.
        pushed: effects that do not show without a recorded force.
        draw_truth: a joint that hides nothing yet, for the effects' names and whether it is pushed.
        draw_encoder: how a joint is measured.
        move: moves a joint as suits the effects' names.
    """

    name: str
    joint: str
    known: Mapping[str, Builder]
    uncatalogued: Mapping[str, Builder]
    pushed: tuple[str, ...]
    draw_truth: Callable[[np.random.Generator, Sequence[str], bool], Truth]
    draw_encoder: Callable[[np.random.Generator, Joint], Encoder]
    move: Callable[[np.random.Generator, Truth, Sequence[str], bool], Motions]

    @property
    def builders(self) -> dict[str, Builder]:
        """All effects."""
        return {**self.known, **self.uncatalogued}
