"""A proposal that somebody has written already."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from joda.compiling import template_of
from joda.errors import JodaError
from joda.proposal import Proposal
from joda.propose import Answer, Task, Turn
from joda.template import Template


class FileProposer:
    """Proposes what a file says.

    Args:
        path: `proposal.json`.
    """

    def __init__(self, path: str | Path) -> None:
        """Takes the path; the file is read when asked."""
        self.path = Path(path)
        self.name = f"file:{path}"

    def check(self, library: Mapping[str, Template]) -> None:
        """Raises JodaError if the file cannot be read, or proposes what no template is."""
        for effect in Proposal.read(self.path).effect_proposals:
            try:
                template_of(library, effect)
            except JodaError as error:
                raise JodaError(f"{self.path}: {error}") from error

    def propose(self, task: Task, turns: Sequence[Turn]) -> Answer:
        """The file's proposal in round one, afterwards that it is complete.

        Raises:
            JodaError: the file cannot be read or is no proposal, or a change is asked for.
        """
        if not turns:
            return Answer(Proposal.read(self.path))
        if turns[-1].complaint:
            raise JodaError(f"{self.path}: a file cannot be revised in words; edit it instead.")
        return Answer(None)
