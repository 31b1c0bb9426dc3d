"""The one exception for a user's mistake."""


class JodaError(ValueError):
    """A user's mistake, in one sentence that names the file, line or key and the remedy.

    The command line prints it and exits with status 2.
    """
