"""From a proposal's words to physical curves: the paper's "Compilation to Dynamics".

Each channel of each effect is its template's prototype, stretched over the effect's interval and
scaled so that its peak is `reference * multiplier * refineFactor`. The multiplier is drawn from the
label's band by a hash of what the effect is, so the same proposal gives the same bytes anywhere,
and changing one label or interval changes nothing else.
"""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from joda.component import Component
from joda.errors import JodaError
from joda.field import evaluate
from joda.files import check_target, write_text
from joda.profile import CHANNELS, NOUNS, Channels, Profile, rounded
from joda.proposal import EffectProposal, Label, Proposal
from joda.scenes.context import Context, context
from joda.template import Template, read_templates

BANDS: dict[Label, tuple[float, float]] = {
    "none": (0.0, 0.0),
    "weak": (0.1, 0.2),
    "medium": (0.35, 0.55),
    "strong": (0.8, 1.2),
    "dominant": (1.6, 2.4),
}
"""Multipliers of the reference that a strength label stands for."""

GRID = 401
"""Positions at which peaks are looked for."""

TRAVEL_TIME = 1.0
"""Reference time (s) in which the inertial reference force moves a joint through its range."""

LARGEST = 30.0
"""Peak of a channel, in units of the reference, beyond which a proposal cannot be meant."""

HAND_FORCE = 10.0
"""What a hand calls strong (N), at the end of the lever arm. Small parts would go without it: by
gravity and inertia alone, the button of a lighter would need a hundredth of a newton."""

HAND_SPEED = 0.5
"""Reference speed (m/s) at the end of the lever arm."""


def compile(  # the command's name
    proposal: str | Path | Proposal,
    model: str | Path | Context,
    joint: str | None = None,
    output: str | Path | None = None,
    *,
    templates: Sequence[str | Path] = (),
    key: str = "",
    combine: Literal["sum", "max"] = "sum",
    force: bool = False,
) -> Profile:
    """Compiles a proposal to a profile.

    Args:
        proposal: the proposal, or its file.
        model: MJCF or URDF file that the joint is in, or the joint's context.
        joint: its name or address; by default the one that the proposal names.
        output: `composed.json` to write.
        templates: further folders of effect templates.
        key: another key draws other multipliers within the labels' bands.
        combine: how the components of a channel are combined.
        force: overwrite `output`.

    Returns:
        the profile.

    Raises:
        JodaError: a file cannot be read or written, the joint does not fit, an effect is unknown,
            or all together are absurdly strong.
    """
    if output is not None:
        check_target(Path(output), force)
    read, file = (
        (proposal, "")
        if isinstance(proposal, Proposal)
        else (Proposal.read(proposal), f"{proposal}: ")
    )
    summary = read.joint_summary
    found = model if isinstance(model, Context) else context(model, joint or summary.joint_name)
    kind = {"revolute": "hinge", "prismatic": "slide"}[summary.joint_type]
    if kind != found.joint.type:
        raise JodaError(
            f"{file}joint '{found.joint.name}' is a {found.joint.type} and the proposal is for a "
            f"{summary.joint_type} joint; set joint_summary.joint_type."
        )
    library = read_templates(templates)
    try:
        parts = contributions(read, found, library, key)
    except JodaError as error:
        raise JodaError(f"{file}{error}") from error
    channels = {
        name: {"combine": combine, "components": [part[name] for part in parts if name in part]}
        for name in CHANNELS
    }
    profile = Profile(
        joint=found.joint,
        channels=Channels.model_validate(channels),
        joint_limit_hint=read.joint_limit_hint,
    )
    if absurd := _absurd(profile, found, read.gravity_can_be_ignored):
        raise JodaError(f"{file}{absurd}")
    if output is not None:
        write_text(Path(output), profile.to_json())
    return profile


def _absurd(profile: Profile, found: Context, ignore_gravity: bool) -> str | None:
    """That a channel is far stronger than anything that moves the joint, a sentence."""
    s = np.linspace(0, 1, GRID)
    for name, reference in reference_scales(found, ignore_gravity).items():
        peak = float(np.abs(evaluate(getattr(profile.channels, name), s)[0]).max())
        if peak > LARGEST * reference:
            unit = found.joint.unit_of(name)
            return (
                f"{NOUNS[name]} would be up to {peak:.3g} {unit}, {peak / reference:.3g} times "
                f"what 'strong' stands for ({reference:.3g} {unit}); lower the strengths or the "
                "refineFactors, or propose fewer effects."
            )
    return None


def contributions(
    proposal: Proposal, found: Context, library: Mapping[str, Template], key: str = ""
) -> list[dict[str, Component]]:
    """What each effect of a proposal adds to the channels.

    Args:
        proposal: what to compile.
        found: the joint's context.
        library: templates by name.
        key: as for `compile`.

    Returns:
        one dict per effect, channel to component; channels that it leaves alone are missing.

    Raises:
        JodaError: an effect is not in the library.
    """
    references = reference_scales(found, proposal.gravity_can_be_ignored)
    seen: dict[str, int] = {}
    out = []
    for effect in proposal.effect_proposals:
        template = template_of(library, effect)
        number = seen[effect.effect_name] = seen.get(effect.effect_name, 0) + 1
        added = {}
        for name in CHANNELS:
            draw = f"{key}|{found.twin or found.joint.name}|{effect.effect_name}|{number}|{name}"
            component = _component(effect, template, name, references[name], draw)
            if component:
                added[name] = component
        out.append(added)
    return out


def reference_scales(found: Context, ignore_gravity: bool = False) -> dict[str, float]:
    """The size that a multiplier of 1 stands for, per channel: N·m or N, N·m·s/rad or N·s/m.

    Force: the largest of gravity's largest force on the joint, the inertial force, which moves it
    from rest to rest through its range in TRAVEL_TIME (accelerating for half of it, braking for the
    other: 4 I range / T^2), and a hand's force. Damping: what makes the reference force at a hand's
    speed.

    Args:
        found: the joint's context.
        ignore_gravity: leaves gravity out of the comparison.

    Returns:
        channel to reference.
    """
    lo, hi = found.joint.range
    arm = found.lever_arm
    inertial = 4 * found.equivalent_inertia * (hi - lo) / TRAVEL_TIME**2
    gravity = 0.0 if ignore_gravity else found.gravity_scale
    force = max(gravity, inertial, HAND_FORCE * arm)
    return {"conservative": force, "friction": force, "damping": force * arm / HAND_SPEED}


def template_of(library: Mapping[str, Template], effect: EffectProposal) -> Template:
    """What an effect is made from; raises JodaError if there is none of its name."""
    if effect.effect_name not in library:
        raise JodaError(
            f"effect '{effect.effect_name}' is not in the library; there are: {', '.join(library)}."
        )
    return library[effect.effect_name]


def _component(
    effect: EffectProposal, template: Template, channel: str, reference: float, draw: str
) -> Component | None:
    """The effect's part in a channel, None if it has none there."""
    curve = getattr(template.channels, channel)
    low, high = BANDS[getattr(effect.strength, channel)]
    multiplier = low + (high - low) * _uniform(draw)
    peak = reference * multiplier * getattr(effect.refineFactor, channel)
    if curve is None or peak == 0:
        return None
    return Component(
        label=effect.effect_name,
        interval=(effect.start_ratio, effect.end_ratio),
        x=curve.x,
        y=tuple(rounded(peak * y) for y in curve.y),
    )


def _uniform(draw: str) -> float:
    """A number in [0, 1) that depends on nothing but the text."""
    digest = hashlib.sha256(draw.encode()).digest()
    return int.from_bytes(digest[:6], "big") / 2**48
