"""What a vision-language model is told: a request of the Messages API from a task and its rounds.

What never changes comes first, so that prompt caching pays: the system prompt, the templates'
picture, then the joint, then the rounds. The answer's schema is the same in all rounds as well,
because another schema would be another cache (`joda.propose.replies`).
"""

import base64
import io
import json
import math
from collections.abc import Mapping, Sequence
from importlib.resources import files
from string import Template as Text
from typing import Any

from joda.compiling import BANDS, reference_scales
from joda.errors import JodaError
from joda.profile import CHANNELS
from joda.propose import Task, Turn
from joda.propose.replies import closed_object, schema
from joda.propose.requirements import REQUIREMENTS
from joda.scenes.context import Context
from joda.template import Template

MAX_TOKENS = 16_000
"""Room for an answer, reasoning included."""

# Pixels within which a picture's writing remains legible.
SHEET = (1000, 800)
PROFILE = (840, 700)
JOINT, JOINTS = (704, 528), 5  # more pictures than JOINTS share their area

Block = dict[str, Any]
CACHED: Block = {"cache_control": {"type": "ephemeral"}}
CACHED_LONG: Block = {"cache_control": {"type": "ephemeral", "ttl": "1h"}}
"""The longest that the service offers."""


def request(
    task: Task, turns: Sequence[Turn], sheet: bytes | None = None, *, lasting: bool = False
) -> dict[str, Any]:
    """A request for the next proposal, but for the model's name.

    Args:
        task: the joint.
        turns: the rounds so far, oldest first.
        sheet: PNG file of the templates' previews.
        lasting: it is for a batch, which may take hours: what all joints share is cached for
            longest; what only the next round of the same joint reads again is not, as that comes
            too late.

    Returns:
        keyword arguments of `client.messages.create`.

    Raises:
        JodaError: a picture cannot be read.
    """
    shared, own = (CACHED_LONG, {}) if lasting else (CACHED, CACHED)
    first: list[Block] = []
    if sheet is not None:
        first += [_text("The effect templates:"), _image(sheet, SHEET) | shared]
    first += _joint(task, own, references=True)
    messages: list[Block] = [{"role": "user", "content": first}]
    for number, turn in enumerate(turns, 1):
        envelope = {"status": "revised", "proposal": turn.proposal.model_dump(mode="json")}
        reply = json.dumps(envelope, ensure_ascii=False, separators=(",", ":"))
        messages.append({"role": "assistant", "content": [_text(reply)]})
        newest = number == len(turns)
        content = [_text(_round(number, turn)) | (own if newest else {})]
        if newest:  # the picture last: what precedes it is the next round's prefix
            content.append(_image(turn.picture(), PROFILE))
        messages.append({"role": "user", "content": content})
    return {
        "max_tokens": MAX_TOKENS,
        "system": [_text(system(task.templates)) | shared],
        "messages": messages,
        "output_config": {"format": {"type": "json_schema", "schema": schema(task.templates)}},
    }


def ablation(task: Task) -> dict[str, Any]:
    """A request for raw control points, without templates: the paper's ablation.

    Returns:
        as `request`; the answer is for `joda.propose.replies.parse_ablation`.
    """
    point = closed_object(s={"type": "number"}, value={"type": "number"})
    curves = closed_object(**{name: {"type": "array", "items": point} for name in CHANNELS})
    return {
        "max_tokens": MAX_TOKENS,
        "system": [_text(_read("ablation")) | CACHED],
        "messages": [{"role": "user", "content": _joint(task, CACHED, references=False)}],
        "output_config": {"format": {"type": "json_schema", "schema": curves}},
    }


def repair(asked: Mapping[str, Any], reply: str, wrong: str) -> dict[str, Any]:
    """The request again, with the reply and what is wrong with it."""
    content = f"This answer cannot be used: {wrong} Give the whole answer again, with that mended."
    messages = [
        *asked["messages"],
        {"role": "assistant", "content": [_text(reply.strip() or "(no text)")]},
        {"role": "user", "content": [_text(content)]},
    ]
    return {**asked, "messages": messages}


def system(templates: Mapping[str, Template]) -> str:
    """The system prompt: the same for all joints and rounds."""
    bands = "\n".join(
        f"- {label}: {'0' if high == 0 else f'{low:g} to {high:g}'}"
        for label, (low, high) in BANDS.items()
    )
    effects = "\n".join(_effect(template) for template in templates.values())
    checked = [requirement.says for name, requirement in REQUIREMENTS.items() if name != "moves"]
    behaviours = "\n".join(f"- it {says.format(number='N', most='M')}" for says in checked)
    return "\n".join(
        (
            _read("system", bands=bands, behaviours=behaviours),
            _read("vocabulary", effects=effects),
            _read("schema"),
            _read("feedback"),
        )
    )


def _joint(task: Task, cached: Block, references: bool) -> list[Block]:
    """The pictures of the joint, and last, `cached`, what is known and wished of it."""
    share = math.sqrt(JOINTS / max(JOINTS, len(task.pictures)))
    room = (int(JOINT[0] * share), int(JOINT[1] * share))
    pictures = [_image(picture, room) for picture in task.pictures]
    lines = ["# The joint", "", task.context.describe(), _gravity(task.context)]
    if references:
        lines.append(_references(task.context))
    lines += ["", "# The user's wish", "", task.description.strip() or "(none)"]
    head = [_text("The joint, from its low to its high end:")] if pictures else []
    return [*head, *pictures, _text("\n".join(lines)) | cached]


def _gravity(context: Context) -> str:
    """Gravity along the range, where it acts."""
    if context.gravity_scale == 0:
        return "gravity at s: none anywhere"
    last = len(context.positions) - 1
    picked = [round(k * last / 4) for k in range(5)]
    return "gravity at s: " + ", ".join(
        f"{k / last:.2g}: {context.gravity_force[k]:.3g}" for k in picked
    )


def _references(context: Context) -> str:
    force, damping = ("N·m", "N·m·s/rad") if context.joint.type == "hinge" else ("N", "N·s/m")
    scales = [reference_scales(context, ignored) for ignored in (False, True)]
    with_gravity, without = (
        f"{scale['conservative']:.3g} {force} and {scale['damping']:.3g} {damping}"
        for scale in scales
    )
    other = f", or {without} if gravity_can_be_ignored" if without != with_gravity else ""
    return f"reference:    {with_gravity}{other}"


def _round(number: int, turn: Turn) -> str:
    unmet = [f"- {requirement}" for requirement in turn.unmet] or ["(none)"]
    parts = [f"# Result of round {number}", "## Simulated", turn.facts.strip()]
    parts += ["## Requirements not met", "\n".join(unmet)]
    if turn.complaint:
        parts += ["## The user", _read("revision", complaint=turn.complaint.strip())]
    return "\n\n".join(parts)


def _effect(template: Template) -> str:
    channels = ", ".join(name for name in CHANNELS if getattr(template.channels, name))
    return f"- {template.name} [{channels}]: {template.description} {template.placement}"


def _read(name: str, **filled: str) -> str:
    text = (files("joda") / "prompts" / f"{name}.md").read_text(encoding="utf-8")
    return Text(text).substitute(filled) if filled else text


def _text(text: str) -> Block:
    return {"type": "text", "text": text}


def _image(png: bytes, room: tuple[int, int]) -> Block:
    """A picture, made to fit into so many pixels."""
    from PIL import Image

    try:
        with Image.open(io.BytesIO(png)) as opened:
            picture = opened.convert("RGB")
    except OSError:
        raise JodaError("a picture for the model is no image file; render it again.") from None
    picture.thumbnail(room, Image.Resampling.LANCZOS)
    out = io.BytesIO()
    picture.save(out, format="PNG")
    data = base64.standard_b64encode(out.getvalue()).decode()
    source = {"type": "base64", "media_type": "image/png", "data": data}
    return {"type": "image", "source": source}
