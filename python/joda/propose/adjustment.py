"""Changes the strengths of a proposal as little as possible, until the forces fulfil its
requirements.

Wherever the joint should move by itself or stay, that is an inequality between its drive (the
conservative force and gravity) and its friction there, and both are linear in the effects'
strengths. So the least change is a linear program.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from joda.compiling import contributions, reference_scales
from joda.component import Component
from joda.field import evaluate
from joda.interaction.pulling import SLOW, grip
from joda.profile import Channel
from joda.proposal import EffectProposal, Proposal
from joda.propose.checks import ABOUT, FELT, share
from joda.propose.requirements import Requirement, read_requirements
from joda.scenes.context import Context
from joda.template import Template

Array = NDArray[np.float64]

SURE = 1.25
"""How many times the friction a drive should be to move the joint."""
HELD = 0.8
"""Up to which share of the friction a drive should be to be held by it."""
MIN_EXCESS = 0.02
"""Least excess of a drive, in units of the reference force."""
NEARLY = 0.8 * ABOUT
"""How far from an angle given by eye the joint may be undecided, as a share of it."""
WITHIN = 0.85
"""How near its bounds a force may come: the slow hand also accelerates, and brakes."""
EVEN = 0.9
"""Share of a pull that is left where another one takes over."""
FACTORS = (0.02, 50.0)
"""How far a strength may be changed in all."""
LACK = 1e3
"""What it costs to miss a demand by one reference force; doubling a strength costs 1."""


@dataclass(frozen=True)
class Demand:
    """Sum over terms of (drive's factor * drive + friction's factor * friction) >= least.

    Attributes:
        requirement: whose it is.
        terms: share of the way from the closed end, factor of the drive (positive opens) and of the
            friction there.
        least: in units of the reference force.
        damping: how many times the force that damping makes under a slow hand, at the first term's
            place, counts besides.
    """

    requirement: str
    terms: tuple[tuple[float, float, float], ...]
    least: float = 0.0
    damping: float = 0.0


def adjusted_strengths(
    proposal: Proposal,
    context: Context,
    templates: Mapping[str, Template],
    wanted: Sequence[Requirement],
    key: str = "",
) -> tuple[Proposal, set[str]]:
    """The proposal with refine factors changed so that the requirements come true.

    Args:
        proposal: what to mend.
        context: the joint.
        templates: by name.
        wanted: its requirements.
        key: as for `joda.compile`.

    Returns:
        the mended proposal, and the names of requirements that no strengths could fulfil.
    """
    from scipy.optimize import linprog

    parts = contributions(proposal, context, templates, key)
    places = [
        (number, channel)
        for number, part in enumerate(parts)
        for channel in ("conservative", "friction")
        if channel in part
    ]
    demands = [
        d
        for requirement in (Requirement("moves"), *wanted)
        for d in _demands(requirement, proposal, context)
    ]
    if not places or not demands:
        return proposal, set()
    reference = reference_scales(context)["conservative"]
    sign = -1.0 if context.closed_end == "high_end" else 1.0
    gravity = sign * np.array(context.gravity_force) / reference
    grid = np.linspace(0, 1, len(gravity))
    slow = float(np.ptp(context.joint.range)) / SLOW

    def side(way: float) -> float:
        return way if sign > 0 else 1 - way

    def moved(place: tuple[int, str], s: float, drive: float, friction: float) -> float:
        number, channel = place
        component = parts[number][channel]
        value = float(evaluate(Channel(components=(component,)), np.array([s]))[0][0])
        return value / reference * (sign * drive if channel == "conservative" else friction)

    rows = np.zeros((len(demands), len(places)))
    least = np.array([demand.least for demand in demands])
    for k, demand in enumerate(demands):
        for way, drive, friction in demand.terms:
            s = side(way)
            rows[k] += [moved(place, s, drive, friction) for place in places]
            least[k] -= drive * float(np.interp(s, grid, gravity))
        if demand.damping:
            s = side(demand.terms[0][0])
            least[k] -= demand.damping * _damped(parts, s) * slow / reference
    n, m = len(places), len(demands)
    # Unknowns: factors, how far each is from 1, what each demand lacks.
    cost = np.concatenate([np.zeros(n), np.ones(n), np.full(m, LACK)])
    identity = np.eye(n)
    above = np.concatenate(
        [
            np.hstack([-rows, np.zeros((m, n)), -np.eye(m)]),
            np.hstack([identity, -identity, np.zeros((n, m))]),
            np.hstack([-identity, -identity, np.zeros((n, m))]),
        ]
    )
    bounds = [FACTORS] * n + [(0, None)] * (n + m)
    limits = np.concatenate([-least, np.ones(n), -np.ones(n)])
    found = linprog(cost, above, limits, bounds=bounds, method="highs")
    lacks = {
        demand.requirement
        for demand, lack in zip(demands, found.x[2 * n :], strict=True)
        if lack > 1e-6
    }
    return _scaled(proposal, dict(zip(places, found.x[:n].tolist(), strict=True))), lacks


def _damped(parts: Sequence[Mapping[str, Component]], s: float) -> float:
    """All damping at a normalised position, N·m·s/rad or N·s/m."""
    components = tuple(part["damping"] for part in parts if "damping" in part)
    return float(evaluate(Channel(components=components), np.array([s]))[0][0])


def _scaled(proposal: Proposal, factors: Mapping[tuple[int, str], float]) -> Proposal:
    """The proposal with refine factors multiplied, by effect and channel."""
    effects = list(proposal.effect_proposals)
    for (number, channel), factor in factors.items():
        if abs(factor - 1) > 1e-4:
            effects[number] = rescale(effects[number], channel, factor)
    return proposal.model_copy(update={"effect_proposals": tuple(effects)})


def rescale(effect: EffectProposal, channel: str, factor: float) -> EffectProposal:
    """The effect with one refine factor multiplied, to three digits and at most 100."""
    old = effect.refineFactor
    new = float(f"{min(getattr(old, channel) * factor, 100.0):.3g}")
    return effect.model_copy(update={"refineFactor": old.model_copy(update={channel: new})})


def _demands(requirement: Requirement, proposal: Proposal, context: Context) -> list[Demand]:
    """What a requirement demands of drive and friction."""

    def shut(low: float, high: float) -> list[Demand]:
        return [_at(requirement, way, -1, -SURE, MIN_EXCESS) for way in _over(low, high)]

    def open_(low: float, high: float) -> list[Demand]:
        return [_at(requirement, way, 1, -SURE, MIN_EXCESS) for way in _over(low, high)]

    def stay(low: float, high: float) -> list[Demand]:
        ways = np.linspace(low, high, 15)
        return [_at(requirement, way, sign, HELD) for way in ways for sign in (1, -1)]

    held_shut = [_at(requirement, way, -1, HELD, 0.08) for way in (0.0, 0.005)]
    match requirement.name:
        case "moves":
            most = 0.6 * grip(context) / reference_scales(context)["conservative"]
            ways = np.linspace(0, 1, 33)
            return [_at(requirement, way, sign, -1, -most) for way in ways for sign in (1, -1)]
        case "takes":
            return _takes(requirement, proposal, context)
        case "falls_shut":
            return shut(0.08, 0.52)
        case "closes_near":
            return shut(0.01, 0.045)
        case "closes_from":
            way = share(context, requirement.number)
            beyond = np.linspace(min((1 + NEARLY) * way, 1.0), 1, 21) if way < 1 else ()
            held = [_at(requirement, far, 1, HELD) for far in beyond]
            return shut(0.01, (1 - NEARLY) * way) + held + _steady(requirement, proposal, context)
        case "closes_anywhere":
            return shut(0.02, 1)
        case "left_open":
            return [_at(requirement, way, 1, HELD) for way in np.linspace(0.012, 1, 41)]
        case "opens_past":
            return open_(0.48, 0.985)
        case "held_shut":
            return held_shut
        case "caught":
            return held_shut + _steady(requirement, proposal, context)
        case "free":
            ways = np.array([0.45, 0.5, 0.55])
            most = 0.5 * FELT * context.lever_arm / reference_scales(context)["conservative"]
            return [_at(requirement, way, sign, -1, -most) for way in ways for sign in (1, -1)]
        case "latched":
            return held_shut + _latch(requirement, proposal, context)
        case "stays_put":
            return stay(0.145, 0.955)
        case "holds_between" if context.joint.type == "hinge":
            low, high = (
                min(share(context, angle), 0.985)
                for angle in (requirement.number, requirement.most)
            )
            return stay(low - 0.005, high)
        case "stays_half":
            return stay(0.38, 0.62)
        case "stays_open":
            return [_at(requirement, way, 1, HELD, MIN_EXCESS) for way in (0.99, 1.0)]
        case "two_sides":
            return shut(0.06, 0.42) + open_(0.58, 0.94)
        case "returns_to_middle":
            return open_(0.08, 0.42) + shut(0.58, 0.92)
        case "clicks":
            return _clicks(requirement, proposal, context)
        case "snaps":
            return _snap(requirement, proposal, context)
    return []


def _takes(requirement: Requirement, proposal: Proposal, context: Context) -> list[Demand]:
    """Nowhere on the way open more than the most, and somewhere the least."""
    unit = context.lever_arm / reference_scales(context)["conservative"]
    most, least = WITHIN * requirement.most * unit, requirement.number / WITHIN * unit
    demands = [
        Demand(requirement.name, ((float(way), 1, -1),), -most, -1.0)
        for way in np.linspace(0, 1, 41)
    ]
    requirements = {other.name for other in read_requirements(proposal.whole_motion_descrptn)}
    if requirements & {"held_shut", "closes_near", "latched"}:
        where: tuple[float, ...] = (0.0, 0.004)
    elif requirements & {"clicks", "two_sides", "returns_to_middle"}:
        where = ()
    else:
        where = (0.98,) if "closes_anywhere" in requirements else (0.5,)
    return demands + [Demand(requirement.name, ((way, -1, 1),), least, 1.0) for way in where]


def _over(low: float, high: float) -> Array:
    """Places from low to high, no farther apart than a latch is wide."""
    return np.linspace(low, high, max(9, round(50 * (high - low)) + 1))


def _at(
    requirement: Requirement, way: float, drive: float, friction: float, least: float = 0.0
) -> Demand:
    return Demand(requirement.name, ((float(way), drive, friction),), least)


def _places(proposal: Proposal, context: Context, word: str) -> list[tuple[float, float]]:
    """Where effects with this word in their names are, from the closed end."""
    out = []
    for effect in proposal.effect_proposals:
        if word in effect.effect_name:
            a, b = effect.start_ratio, effect.end_ratio
            out.append((1 - b, 1 - a) if context.closed_end == "high_end" else (a, b))
    return out


def _latch(requirement: Requirement, proposal: Proposal, context: Context) -> list[Demand]:
    """A barrier before the latch, a hold within it, and no closing from before it."""
    out = [_at(requirement, 0.15, -1, 1)]
    for a, b in _places(proposal, context, "snap"):
        width = b - a
        out.append(_at(requirement, a + 0.8 * width, 1, 0, 0.1))
        out.append(_at(requirement, a + 0.15 * width, -1, -SURE, 0.3))
    return out


def _steady(requirement: Requirement, proposal: Proposal, context: Context) -> list[Demand]:
    """No jump where a pull that rises gives way to one that fades."""
    out = []
    for _, top in _places(proposal, context, "spring_return"):
        for begin, _ in _places(proposal, context, "magnetic_return"):
            if abs(top - begin) < 1e-3:
                ends = (top - 1e-3, begin + 1e-3)
                out += [
                    Demand(requirement.name, ((one, -1, 0), (other, EVEN, 0)))
                    for one, other in (ends, ends[::-1])
                ]
    return out


def _clicks(requirement: Requirement, proposal: Proposal, context: Context) -> list[Demand]:
    """Within each detent towards its middle, within each end's spring towards the end."""
    out = []
    for a, b in _places(proposal, context, "detent_internal"):
        for u in (0.12, 0.25, 0.35, 0.43):
            out.append(_at(requirement, a + u * (b - a), 1, -SURE, MIN_EXCESS))
            out.append(_at(requirement, b - u * (b - a), -1, -SURE, MIN_EXCESS))
    for a, b in _places(proposal, context, "spring_return"):
        inward = -1 if a < 1e-6 else 1
        ways = [a + u * (b - a) for u in (0.03, 0.2, 0.5, 0.9)]
        out += [_at(requirement, way, inward, -SURE, MIN_EXCESS) for way in ways]
    return out


def _snap(requirement: Requirement, proposal: Proposal, context: Context) -> list[Demand]:
    """The resistance against opening falls in the last quarter of a detent."""
    out = []
    for a, b in _places(proposal, context, "detent_internal"):
        peak, after = a + 0.75 * (b - a), b
        out.append(Demand(requirement.name, ((peak, -1, 0), (after, 1, 0)), 0.12))
    return out
