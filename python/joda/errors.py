"""The one exception for a user's mistake."""

from joda.plain import one_line


class JodaError(ValueError):
    """A user's mistake, in one sentence that names the file, line or key and the remedy.

    The command line prints it and exits with status 2. Whatever it quotes, it is one line of
    bounded length that can be shown as it is (`joda.plain`).
    """

    def __init__(self, sentence: str) -> None:
        """Takes the sentence."""
        super().__init__(one_line(sentence))
