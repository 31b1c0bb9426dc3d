"""What real joints do, in numbers, and who says so: `forces.toml`, and what follows for one joint.

Forces are at the handle, speeds where the handle is, angles from the closed end.
"""

import tomllib
from collections.abc import Collection
from functools import cache
from importlib.resources import files
from typing import Literal, Self

import numpy as np
from pydantic import model_validator

from joda.component import Frozen
from joda.propose.requirements import Requirement
from joda.scenes.context import Context

Basis = Literal["standard", "measured", "estimate"]

CLOSING = {"closes_near", "closes_from", "closes_anywhere", "falls_shut"}
"""Requirements of a joint that closes by itself, from somewhere."""
STAYING = {"stays_put", "stays_half"}
"""Requirements of a joint that holds on its way."""


class Sourced(Frozen):
    """Something that is known of real joints.

    Attributes:
        basis: a standard's bound, a measurement, or the authors' estimate.
        source: where it is from; empty for an estimate.
    """

    basis: Basis
    source: str

    @model_validator(mode="after")
    def _check_source(self) -> Self:
        if (self.basis == "estimate") != (not self.source):
            raise ValueError("a source is needed, but for an estimate")
        return self


class Shuts(Sourced):
    """How fast a joint that closes by itself may arrive, at the handle, m/s."""

    most: float


class Holds(Sourced):
    """Between which angles from the closed end (degrees) a hinge stays where it is left."""

    between: tuple[float, float]


class Force(Sourced):
    """What opening real joints of a kind takes, and what they do when they are let go.

    Attributes:
        name: the kind.
        opening: within which the most lies that a slow hand needs, at the handle, N.
        shuts: None where such joints do not close by themselves.
        holds: None where they hold nowhere, or everywhere.
    """

    name: str
    opening: tuple[float, float]
    shuts: Shuts | None = None
    holds: Holds | None = None

    def wanted(self, names: Collection[str], context: Context) -> list[Requirement]:
        """What a joint of which such requirements are stated must keep besides.

        Args:
            names: of the requirements.
            context: the joint.
        """
        out = [Requirement("takes", *self.opening)]
        if self.shuts and CLOSING & set(names):
            out.append(Requirement("arrives", most=self.shuts.most))
        if self.holds and STAYING & set(names) and self.reached(context):
            out.append(Requirement("holds_between", *self.holds.between))
        return out

    def by(self, requirement: str) -> str:
        """Who says what such a requirement is about."""
        said = {"arrives": self.shuts, "holds_between": self.holds}.get(requirement) or self
        return said.source or "an estimate"

    def reached(self, context: Context) -> bool:
        """Whether the joint is a hinge that gets to where such joints hold."""
        span = float(np.degrees(np.ptp(context.joint.range)))
        return context.joint.type == "hinge" and bool(self.holds and self.holds.between[0] < span)


class _Forces(Frozen):
    joint: tuple[Force, ...]


@cache
def forces() -> dict[str, Force]:
    """The real joints of `forces.toml`, by name."""
    text = (files("joda.propose") / "forces.toml").read_text("utf-8")
    rows = _Forces.model_validate(tomllib.loads(text)).joint
    return {row.name: row for row in rows}
