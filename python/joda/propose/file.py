"""A proposal that somebody has written already."""

from collections.abc import Sequence
from pathlib import Path

from joda.errors import JodaError
from joda.proposal import Proposal
from joda.propose import Answer, Task, Turn


class FileProposer:
    """Proposes what a file says.

    Args:
        path: `proposal.json`.
    """

    def __init__(self, path: str | Path) -> None:
        """Takes the path; the file is read when asked."""
        self.path = Path(path)
        self.name = f"file:{path}"

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
