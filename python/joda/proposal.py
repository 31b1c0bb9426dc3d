"""A proposal, `proposal.json`: which effects a joint has, where, how strong in words.

The schema is that of the JODA paper (appendix "Output JSON Schema"), its spelling included.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from joda.component import Frozen
from joda.profile import File, JointLimitHint

Label = Literal["none", "weak", "medium", "strong", "dominant"]
Ratio = Annotated[float, Field(ge=0, le=1)]
Factor = Annotated[float, Field(ge=0, le=100)]


NARROWEST = 1e-3
"""Narrowest interval of an effect, in normalised position."""
MAX_EFFECTS = 100
"""A joint has three or four; more would only be slow."""


class JointSummary(Frozen):
    """The joint as the proposer understood it."""

    joint_name: str
    joint_type: Literal["revolute", "prismatic"]
    motion_description: str = ""
    overall_confidence: Ratio = 0.5


class Strength(Frozen):
    """How strong an effect is in each channel, in words."""

    conservative: Label = "none"
    friction: Label = "none"
    damping: Label = "none"


class RefineFactor(Frozen):
    """Multiplies what the strength labels give, channel by channel."""

    conservative: Factor = 1.0
    friction: Factor = 1.0
    damping: Factor = 1.0


class EffectProposal(Frozen):
    """One effect.

    Attributes:
        effect_name: a template's name.
        start_ratio, end_ratio: its interval in normalised joint position.
        strength, refineFactor: per channel.
        confidence: of the proposer, 0 to 1.
        reason: why it is there.
    """

    effect_name: str
    start_ratio: Ratio
    end_ratio: Ratio
    strength: Strength
    refineFactor: RefineFactor = RefineFactor()
    confidence: Ratio = 0.5
    reason: str = ""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.start_ratio < self.end_ratio:
            raise ValueError("start_ratio must be less than end_ratio")
        if self.end_ratio - self.start_ratio < NARROWEST:
            raise ValueError("end_ratio must be at least 0.001 greater than start_ratio")
        return self


class Proposal(File):
    """The content of `proposal.json`."""

    joint_summary: JointSummary
    whole_motion_descrptn: str = ""
    gravity_can_be_ignored: bool = False
    joint_limit_hint: JointLimitHint = JointLimitHint()
    effect_proposals: tuple[EffectProposal, ...]

    @model_validator(mode="after")
    def _check_count(self) -> Self:
        count = len(self.effect_proposals)
        if count > MAX_EFFECTS:
            raise ValueError(f"{count} effects are proposed; a joint has at most {MAX_EFFECTS}")
        return self
