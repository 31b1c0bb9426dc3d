"""The proposer that needs no model, key or network: a table of archetypes, told by shape and names.

It recognises the kind of joint, proposes what such joints do and what force they take, and from the
second round on mends what the simulation did not show. How sure it is stands in each effect's
confidence, and what decided in the answer's `recognised`.
"""

import re
from collections.abc import Sequence
from collections.abc import Set as AbstractSet

import numpy as np

from joda.compiling import BANDS, reference_scales
from joda.errors import JodaError
from joda.interaction.pulling import SLOW
from joda.proposal import EffectProposal, JointSummary, Proposal, Strength
from joda.propose import Answer, Task, Turn
from joda.propose.added_effects import RISING, WISHED
from joda.propose.adjustment import adjusted_strengths, rescale
from joda.propose.archetype import Archetype
from joda.propose.archetype_effects import ArchetypeEffect
from joda.propose.checks import FELT, SOFT, share
from joda.propose.complaints import revise
from joda.propose.plausible import forces
from joda.propose.recognise import Recognition, recognise, scale_warning
from joda.propose.requirements import REQUIREMENTS, Requirement, read_requirements, state, unmet
from joda.scenes.context import Context

KNOB_ANGLE = 0.785
"""Angle (rad) between the positions of a knob, where nobody says how many it has."""

FORBIDS = re.compile(r"\b(?:should|must|may)(?: not|n't)\b|\bnever\b")

CLICKS = re.compile(r"detent_internal|spring_return")
"""Effects that make a joint click into positions."""

EXCLUSIVE = {
    "closes_from", "closes_anywhere", "stays_put", "stays_half", "opens_past", "two_sides",
    "returns_to_middle", "clicks", "holds_between",
}  # fmt: skip
"""Requirements about the middle of the way: the user's replace those of the kind."""

FORCEFUL = EXCLUSIVE | {"left_open", "takes", "free", "caught", "latched", "held_shut", "snaps"}
"""Requirements that say how strong something is; without them it takes what such joints take."""

CLOSES = {"closes_near", "closes_from", "closes_anywhere"}


class Offline:
    """Proposes by rules."""

    name = "offline"

    def __init__(self, key: str = "") -> None:
        """Args: key: with which proposals will be compiled."""
        self.key = key

    def propose(self, task: Task, turns: Sequence[Turn]) -> Answer:
        """See `joda.propose.Proposer`."""
        kind, found = recognise(task.context, task.description, task.archetypes)
        if not turns:
            warning = scale_warning(kind, task.context, task.description)
            first = self._first(task, kind, found)
            return Answer(first, notes=(warning,) if warning else (), recognised=found)
        last = turns[-1]
        if last.complaint:
            return Answer(self._revised(task, last), recognised=found)
        wanted = read_requirements(last.proposal.whole_motion_descrptn)
        lacking = unmet(wanted, last.behaviour, task.context)
        if not lacking:
            return Answer(None, recognised=found)
        adjusted = last.proposal
        if slow := [limit for name, limit in _slow(wanted) if name in lacking]:
            adjusted = _softer(adjusted, task.context, last, min(slow))
        if "free" in lacking:
            adjusted = _lighter(adjusted, task.context, last)
        if "takes" in lacking:
            adjusted = _less_damped(adjusted, task.context, wanted)
        if lacking.keys() - {"soft", "arrives"}:
            adjusted = self._adjusted(adjusted, task, wanted)
        return Answer(None if adjusted == last.proposal else adjusted, recognised=found)

    def _adjusted(self, proposal: Proposal, task: Task, wanted: Sequence[Requirement]) -> Proposal:
        """With strengths that fulfil the requirements, or further effects where none can."""
        arguments = task.context, task.templates, wanted, self.key
        adjusted, hopeless = adjusted_strengths(proposal, *arguments)
        added = [part for name in sorted(hopeless & WISHED.keys()) for part in WISHED[name]]
        if added:
            there = {_place(effect) for effect in proposal.effect_proposals}
            more = _effects(added, task.context, wanted, 0.3)
            more = tuple(effect for effect in more if _place(effect) not in there)
            adjusted, _ = adjusted_strengths(_with(proposal, more), *arguments)
        return adjusted

    def _revised(self, task: Task, last: Turn) -> Proposal:
        """What the user complains about is changed; else what the user wishes is added."""
        arguments = task.context, task.templates, last.complaint, self.key
        try:
            return revise(last.proposal, *arguments)
        except JodaError:
            said = last.complaint
            # "It does not stay open" asks for just that; "it should not" for the opposite.
            asked = read_requirements(said)
            if not FORBIDS.search(said.lower()):
                asked = [
                    requirement
                    for requirement in asked
                    if not REQUIREMENTS[requirement.name].denies
                ]
                asked += read_requirements(said, refused=True)
            if not asked:
                raise
        asked = _counted(asked, task.context)
        names = {requirement.name for requirement in asked}
        gone = names | _conflicting(names)
        old = read_requirements(last.proposal.whole_motion_descrptn)
        wanted = [requirement for requirement in old if requirement.name not in gone] + asked
        stated = last.proposal.model_copy(update={"whole_motion_descrptn": state(wanted)})
        if not unmet(asked, last.behaviour, task.context):
            raise JodaError(f"in simulation {state(asked).lower().rstrip('.')} already.")
        if "clicks" in names:  # as many as are asked for, not besides those that there are
            others = [e for e in stated.effect_proposals if not CLICKS.search(e.effect_name)]
            clicks = _effects(WISHED["clicks"], task.context, wanted, 0.3)
            stated = _with(stated.model_copy(update={"effect_proposals": tuple(others)}), clicks)
        return self._adjusted(stated, task, wanted)

    def _first(self, task: Task, kind: Archetype, found: Recognition) -> Proposal:
        context = task.context
        wanted, parts = _plan(kind, context, task.description)
        effects = _effects(parts, context, wanted, found.likely)
        summary = JointSummary(
            joint_name=context.joint.name,
            joint_type="revolute" if context.joint.type == "hinge" else "prismatic",
            motion_description=found.describe(),
            overall_confidence=found.likely,
        )
        proposal = Proposal(
            joint_summary=summary, whole_motion_descrptn=state(wanted), effect_proposals=effects
        )
        if any(
            requirement.name in RISING for requirement in wanted
        ):  # one pull in two parts, drawn apart
            proposal, _ = adjusted_strengths(proposal, context, task.templates, wanted, self.key)
        return proposal


def _plan(
    kind: Archetype, context: Context, description: str
) -> tuple[list[Requirement], list[ArchetypeEffect]]:
    """Requirements and parts: the user's, and those of the kind that do not contradict them."""
    asked = {requirement.name: requirement for requirement in read_requirements(description)}
    denied = {requirement.name for requirement in read_requirements(description, refused=True)}
    dropped = denied | _conflicting(asked.keys())
    wanted = [Requirement(name) for name in kind.requirements if name not in dropped | asked.keys()]
    wanted += asked.values()
    names = {requirement.name for requirement in wanted}
    parts = [part for part in kind.effects if not part.serves or names & set(part.serves)]
    served = {name for part in parts for name in part.serves} | set(kind.requirements) - dropped
    added = [part for name in asked if name not in served for part in WISHED.get(name, ())]
    taken = {name for part in added for name in part.serves}
    parts = [part for part in parts if not part.serves or set(part.serves) - taken]
    if kind.force and not asked.keys() & FORCEFUL:
        usual = forces()[kind.force].wanted([requirement.name for requirement in wanted], context)
        wanted += [requirement for requirement in usual if requirement.name not in asked]
    return _counted(wanted, context), parts + added


def _counted(wanted: Sequence[Requirement], context: Context) -> list[Requirement]:
    """With a number of positions, where nobody says how many."""
    count = _positions(context)
    return [Requirement(w.name, w.number or count) if w.name == "clicks" else w for w in wanted]


def _conflicting(names: AbstractSet[str]) -> set[str]:
    """The requirements that these leave no room for."""
    out = EXCLUSIVE if names & EXCLUSIVE else set()
    if "closes_anywhere" in names:
        out = out | {"stays_open"}
    if names & {"closes_from", "closes_anywhere"}:
        out = out | {"latched"}
    if "left_open" in names:
        return out | CLOSES
    return out | ({"left_open"} if names & CLOSES else set())


def _positions(context: Context) -> int:
    """How many positions a knob has."""
    lo, hi = context.joint.range
    if context.joint.type != "hinge":
        return 3
    return min(max(round((hi - lo) / KNOB_ANGLE) + 1, 2), 12)


def _number(wanted: Sequence[Requirement], name: str) -> float:
    return next((requirement.number for requirement in wanted if requirement.name == name), 0)


def _effects(
    parts: Sequence[ArchetypeEffect],
    context: Context,
    wanted: Sequence[Requirement],
    confidence: float,
) -> tuple[EffectProposal, ...]:
    """Parts placed on the joint's own range, as many and as far as the requirements say."""
    mirrored = context.closed_end == "high_end"
    words = {
        "closed": "high_end" if mirrored else "low_end",
        "open": "low_end" if mirrored else "high_end",
        "opening": "negative" if mirrored else "positive",
        "closing": "positive" if mirrored else "negative",
    }
    out = []
    for part in parts:
        reach = share(context, _number(wanted, part.reach)) if part.reach else 1.0
        for name, (a, b) in _spread(part, int(_number(wanted, "clicks"))):
            a, b = (min(reach * end, 1.0) for end in (a, b))
            start, end = (1 - b, 1 - a) if mirrored else (a, b)
            out.append(
                EffectProposal(
                    effect_name=name.format(**words),
                    start_ratio=round(start, 4),
                    end_ratio=round(end, 4),
                    strength=Strength(
                        conservative=part.conservative,
                        friction=part.friction,
                        damping=part.damping,
                    ),
                    confidence=confidence,
                    reason=part.reason,
                )
            )
    return tuple(out)


def _spread(part: ArchetypeEffect, positions: int) -> list[tuple[str, tuple[float, float]]]:
    """A part's effects: `detents` are one at each position, springs at the ends of the way."""
    if part.effect != "detents":
        return [(part.effect, part.place)]
    step = 1 / max(positions - 1, 1)
    inner = [((k - 0.5) * step, (k + 0.5) * step) for k in range(1, positions - 1)]
    return [
        ("spring_return_to_{closed}", (0.0, step / 2)),
        *[("detent_internal", place) for place in inner],
        ("spring_return_to_{open}", (1 - step / 2, 1.0)),
    ]


def _place(effect: EffectProposal) -> tuple[str, float, float]:
    """What an effect is and where; a second one of these could only make it stronger."""
    return effect.effect_name, effect.start_ratio, effect.end_ratio


def _with(proposal: Proposal, effects: Sequence[EffectProposal]) -> Proposal:
    return proposal.model_copy(update={"effect_proposals": (*proposal.effect_proposals, *effects)})


def _slow(wanted: Sequence[Requirement]) -> list[tuple[str, float]]:
    """The requirements that it shuts slowly, and at how many m/s at most."""
    return [
        ("soft", SOFT),
        *(
            (requirement.name, requirement.most)
            for requirement in wanted
            if requirement.name == "arrives"
        ),
    ]


def _softer(proposal: Proposal, context: Context, last: Turn, limit: float) -> Proposal:
    """More damping where it closes, so that it arrives with `limit` (m/s at the lever arm) at
    most; a damper there, if there is none."""
    fastest = last.behaviour.fastest
    if fastest is None:
        return proposal
    factor = min(1.5 * fastest.speed * context.lever_arm / limit, 10.0)
    closed = 1.0 if context.closed_end == "high_end" else 0.0
    effects = [
        rescale(effect, "damping", factor)
        if effect.strength.damping != "none" and effect.start_ratio <= closed <= effect.end_ratio
        else effect
        for effect in proposal.effect_proposals
    ]
    if tuple(effects) == proposal.effect_proposals:
        return _with(proposal, _effects(WISHED["soft"], context, (), 0.3))
    return proposal.model_copy(update={"effect_proposals": tuple(effects)})


def _lighter(proposal: Proposal, context: Context, last: Turn) -> Proposal:
    """Less damping half-way, so that a slow hand hardly feels it."""
    ways = last.behaviour.opening, last.behaviour.closing
    factor = 0.5 * FELT * context.lever_arm / max(abs(way.middle) for way in ways)
    effects = [
        rescale(effect, "damping", min(factor, 1.0))
        if effect.strength.damping != "none" and effect.start_ratio < 0.7 and effect.end_ratio > 0.3
        else effect
        for effect in proposal.effect_proposals
    ]
    return proposal.model_copy(update={"effect_proposals": tuple(effects)})


def _less_damped(proposal: Proposal, context: Context, wanted: Sequence[Requirement]) -> Proposal:
    """Damping that leaves a slow hand at least half of the most that opening may take."""
    most = (
        next(requirement.most for requirement in wanted if requirement.name == "takes")
        * context.lever_arm
    )
    span = float(np.ptp(context.joint.range))
    allowed = 0.3 * most * SLOW / span
    reference = reference_scales(context)["damping"]

    def factor(effect: EffectProposal) -> float:
        strength = BANDS[effect.strength.damping][1] * effect.refineFactor.damping * reference
        return min(allowed / strength, 1.0) if strength else 1.0

    effects = [
        rescale(effect, "damping", factor(effect)) if factor(effect) < 1 else effect
        for effect in proposal.effect_proposals
    ]
    return proposal.model_copy(update={"effect_proposals": tuple(effects)})
