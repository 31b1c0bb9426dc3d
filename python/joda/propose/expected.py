"""What joints of a model should do, written down before anybody proposes: `MODEL.expected.json`.

{"joints": {"door": {"opens": "+", "behaviours": ["stays shut until it is pulled"]}}}
"""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, field_validator

from joda.component import Frozen
from joda.interaction.behaviour import Behaviour
from joda.profile import File
from joda.propose.requirements import REQUIREMENTS, Requirement, read_requirements, unmet
from joda.scenes.context import Context

ENDING = ".expected.json"
MOVES, OPENS = REQUIREMENTS["moves"].says, "opens towards {}q"


class Expected(Frozen):
    """What a joint should do; the proposer is not told, but for the description.

    Attributes:
        behaviours: sentences as docs/generation.md lists them, one behaviour each.
        opens: the sign of q in which it opens; None: that is not judged.
        description: what the proposer is told of it, in words.
    """

    behaviours: tuple[str, ...] = ()
    opens: Literal["+", "-"] | None = None
    description: str = ""

    @field_validator("behaviours")
    @classmethod
    def _read(cls, sentences: tuple[str, ...]) -> tuple[str, ...]:
        for sentence in sentences:
            if len(read_requirements(sentence)) != 1:
                raise ValueError(
                    f"'{sentence}' is not one behaviour; give sentences as docs/generation.md "
                    "lists them, such as 'stays shut until it is pulled'"
                )
        return sentences

    @property
    def wanted(self) -> list[Requirement]:
        """The behaviours; one that is named twice counts once."""
        return list(
            dict.fromkeys(
                requirement for one in self.behaviours for requirement in read_requirements(one)
            )
        )

    @property
    def sentences(self) -> list[str]:
        """All that is judged: besides the behaviours, that a hand can open and close it."""
        way = [OPENS.format(self.opens)] if self.opens else []
        return [*way, MOVES, *(requirement.sentence for requirement in self.wanted)]

    def judge(self, behaved: Behaviour, context: Context) -> dict[str, str]:
        """Each of the sentences to what the joint does instead; empty where it is true."""
        lacking = unmet(self.wanted, behaved, context)
        instead = [lacking.get(name, "") for name in ("moves", *(one.name for one in self.wanted))]
        way = {"low_end": "+", "high_end": "-"}[behaved.closed_end]
        if self.opens:
            wrong = f"It {OPENS.format(self.opens)}: no, towards {way}q."
            instead.insert(0, "" if way == self.opens else wrong)
        return dict(zip(self.sentences, instead, strict=True))


class Expectations(File):
    """The content of a `MODEL.expected.json`, beside `MODEL.xml` or `MODEL.urdf`.

    Attributes:
        joints: by name or address.
    """

    schema_version: Literal[1] = 1
    joints: Annotated[dict[str, Expected], Field(min_length=1)]


def model_of(path: Path, endings: tuple[str, ...]) -> Path | None:
    """The model that a file of expectations is of; None: there is none beside it."""
    stem = path.name.removesuffix(ENDING)
    models = (path.with_name(stem + ending) for ending in endings)
    return next((model for model in models if model.is_file()), None)
