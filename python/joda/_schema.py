"""JSON Schemas of the files that joda reads and writes."""

from typing import Any, Literal

from joda.profile import Profile
from joda.template import Template


def schema(file: Literal["composed", "template"] = "composed") -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a file format.

    Args:
        file: "composed" for `composed.json`, "template" for the effect templates.

    Returns:
        the schema as a JSON object.
    """
    models = {"composed": Profile.model_json_schema, "template": Template.model_json_schema}
    return models[file]()
