"""JSON Schemas of the files that joda reads and writes."""

from typing import Annotated, Any, Literal

import typer
from pydantic import BaseModel

from joda.measured.corrections_file import Corrections
from joda.profile import Profile
from joda.proposal import Proposal
from joda.propose.archetype import Archetypes
from joda.propose.expected import Expectations
from joda.template import Template
from joda.terminal.say import print_json


def schema(
    file: Literal[
        "composed", "proposal", "template", "archetype", "expected", "corrections"
    ] = "composed",
) -> dict[str, Any]:
    """The JSON Schema (draft 2020-12) of a file format.

    Args:
        file: "composed" for `composed.json`, "proposal" for `proposal.json`, "template" for the
            effect templates, "archetype" for the tables of kinds of joints (TOML), "expected" for
            what a model's joints should do (`MODEL.expected.json`), "corrections" for what a
            measurement has wrong (`MODEL.corrections.json`).

    Returns:
        the schema as a JSON object.
    """
    models: dict[str, type[BaseModel]] = {
        "composed": Profile,
        "proposal": Proposal,
        "template": Template,
        "archetype": Archetypes,
        "expected": Expectations,
        "corrections": Corrections,
    }
    return models[file].model_json_schema()


def command(
    file: Annotated[
        Literal["composed", "proposal", "template", "archetype", "expected", "corrections"],
        typer.Argument(help="Which file."),
    ] = "composed",
) -> None:
    """Print the JSON Schema of a file format.

    Example:

        joda schema composed
    """
    print_json(schema(file))
