"""What a vision-language model replies: the schema it is held to, and the proposal in it.

The schema is the same in all rounds; `parse` refuses "complete" where a proposal is due.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from joda.errors import JodaError
from joda.profile import CHANNELS, Profile
from joda.proposal import Proposal
from joda.propose import Task, Turn
from joda.template import Template

UNSUPPORTED = {
    *("title", "description", "default", "minimum", "maximum", "exclusiveMinimum"),
    *("exclusiveMaximum", "multipleOf", "minLength", "maxLength", "pattern"),
    *("minItems", "maxItems"),
}
"""Keywords of JSON Schema that structured output does not know, or that `schema.md` says better."""


PLAINLY = (
    "Answer with one JSON object and nothing else: no words before or after it, no Markdown. It "
    "must obey this JSON Schema:\n"
)
"""For a model that cannot be held to a schema; the schema follows."""


def bare(text: str) -> str:
    """The JSON object in an answer, without thoughts, words and Markdown around it."""
    if not text.lstrip().startswith("{"):
        text = text.rpartition("</think>")[2]
    return text[text.find("{") : text.rfind("}") + 1] or text


def schema(templates: Mapping[str, Template]) -> dict[str, Any]:
    """The JSON Schema of an answer, within what structured output supports.

    Numbers' bounds cannot be said there; `parse` checks them.
    """
    proposal = _strict(Proposal.model_json_schema())
    parts = proposal.pop("$defs")
    parts["EffectProposal"]["properties"]["effect_name"]["enum"] = list(templates)
    envelope = closed_object(
        status={"type": "string", "enum": ["revised", "complete"]},
        proposal={"anyOf": [{"$ref": "#/$defs/Proposal"}, {"type": "null"}]},
    )
    return envelope | {"$defs": parts | {"Proposal": proposal}}


def parse(reply: str, task: Task, turns: Sequence[Turn]) -> Proposal | None:
    """The proposal in an answer; None where the last one is complete.

    Raises:
        JodaError: what is wrong with the answer, in words that can be sent back.
    """
    try:
        answer = json.loads(reply)
    except (ValueError, RecursionError) as error:  # RecursionError: brackets too deep
        raise JodaError(f"It is not JSON ({error}).") from None
    if not isinstance(answer, dict) or answer.get("status") not in ("revised", "complete"):
        raise JodaError('It must be an object whose status is "revised" or "complete".')
    if answer["status"] == "complete":
        if turns and not turns[-1].complaint:
            return None
        raise JodaError('A proposal is due here; status must be "revised".')
    try:
        proposal = Proposal.model_validate_json(json.dumps(answer.get("proposal")))
    except ValidationError as error:
        raise JodaError(_wrong(error, "proposal")) from None
    for number, effect in enumerate(proposal.effect_proposals):
        if effect.effect_name not in task.templates:
            raise JodaError(
                f"proposal.effect_proposals[{number}].effect_name: '{effect.effect_name}' is not "
                f"in the vocabulary; there are: {', '.join(task.templates)}."
            )
    joint = task.context.joint
    kind = {"hinge": "revolute", "slide": "prismatic"}[joint.type]
    if proposal.joint_summary.joint_type != kind:
        raise JodaError(f"proposal.joint_summary.joint_type: the joint is {kind}.")
    summary = proposal.joint_summary.model_copy(update={"joint_name": joint.name})
    return proposal.model_copy(update={"joint_summary": summary})


def parse_ablation(reply: str, task: Task) -> Profile:
    """The profile in an answer to `ablation`; raises JodaError as `parse` does."""
    try:
        answer = json.loads(reply)
        channels = {
            name: {
                "components": [
                    {
                        "label": "control points",
                        "interval": (0, 1),
                        "x": [point["s"] for point in answer[name]],
                        "y": [point["value"] for point in answer[name]],
                    }
                ]
            }
            for name in CHANNELS
        }
        return Profile.model_validate({"joint": task.context.joint, "channels": channels})
    except ValidationError as error:
        raise JodaError(_wrong(error)) from None
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise JodaError(f"It must be JSON with three lists of points ({error}).") from None


def closed_object(**properties: Any) -> dict[str, Any]:
    """The schema of an object with these keys, all of them and no others."""
    return {
        "type": "object",
        "properties": properties,
        "required": list(properties),
        "additionalProperties": False,
    }


def _strict(part: Any) -> Any:
    """A schema without what structured output does not support: all keys required, no others."""
    if isinstance(part, list):
        return [_strict(each) for each in part]
    if not isinstance(part, dict):
        return part
    if "properties" in part:
        kept = {name: _strict(each) for name, each in part["properties"].items()}
        parts = {name: _strict(each) for name, each in part.get("$defs", {}).items()}
        return closed_object(**kept) | ({"$defs": parts} if parts else {})
    return {key: _strict(each) for key, each in part.items() if key not in UNSUPPORTED}


def _wrong(error: ValidationError, root: str = "") -> str:
    """The first few things wrong with an answer: key and what."""
    found = []
    for each in error.errors(include_url=False)[:5]:
        keys = (f"[{key}]" if isinstance(key, int) else f".{key}" for key in each["loc"])
        found.append(f"{(root + ''.join(keys)).lstrip('.')}: {each['msg']}")
    return "; ".join(found) + "."
