"""`python -m joda` and the command `joda`: loading it, too, can be interrupted in a sentence."""

import signal
import sys


def main() -> None:
    """Loads the command line and runs it."""
    try:
        from joda.cli import main as run

        run()
    except KeyboardInterrupt:
        print("joda: interrupted.", file=sys.stderr)
        sys.exit(130)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # from here on Ctrl-C just ends it


if __name__ == "__main__":
    main()
