"""The command line, run many times, each time in a fork of a process that has it loaded."""

import json
import os
import resource
import selectors
import signal
import subprocess
import sys
import time
import traceback
from dataclasses import dataclass

MERCY = 60.0
"""How long a command may take to end after Ctrl-C, s."""


@dataclass(frozen=True)
class Ended:
    """How a command ended; `interrupted`: it was told to by Ctrl-C."""

    status: int
    stdout: str
    stderr: str
    interrupted: bool


class Forked:
    """A process that runs commands on demand."""

    def __init__(self, cache, prefix=()):
        """Starts it; nothing can render.

        Args:
            cache: folder in which is kept what it compiles.
            prefix: command that it is started with, and its arguments.
        """
        environment = {
            "XDG_CACHE_HOME": str(cache),
            "MUJOCO_GL": "disabled",
            "OPENBLAS_NUM_THREADS": "1",
            "ANTHROPIC_API_KEY": "",
        }
        self._process = subprocess.Popen(
            [*prefix, sys.executable, "-P", __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **environment},
        )

    def run(self, arguments, folder, patience: float, largest: int | None = None) -> Ended:
        """Runs joda.

        Args:
            arguments: of the command line.
            folder: to run it in.
            patience: after so many s it gets Ctrl-C.
            largest: size of a file that the disk has room for, bytes.
        """
        request = [list(arguments), str(folder), patience, largest]
        print(json.dumps(request), file=self._process.stdin, flush=True)
        return Ended(*json.loads(self._process.stdout.readline()))

    def close(self):
        """Ends it."""
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()


def _child(arguments: list[str], folder: str, largest: int | None, ready: int) -> int:
    """What the child does, after it has written to `ready`; its exit status."""
    from joda.__main__ import main

    sys.stdout = os.fdopen(1, "w", encoding="utf-8")
    sys.stderr = os.fdopen(2, "w", encoding="utf-8", errors="backslashreplace", buffering=1)
    os.chdir(folder)
    if largest is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))
    sys.argv = ["joda", *arguments]
    os.write(ready, b".")
    try:
        main()
    except SystemExit as end:
        return end.code or 0
    except BaseException:
        traceback.print_exc()
    return 70


def _run(arguments, folder, patience, largest):
    """Forks, and waits for what the child prints."""
    pipes = os.pipe(), os.pipe()
    begun, ready = os.pipe()
    child = os.fork()
    if not child:
        os.setsid()
        for number, (_, end) in enumerate(pipes, 1):
            os.dup2(end, number)
        status = 71
        try:
            status = _child(arguments, folder, largest, ready)
            sys.stdout.flush()
        finally:
            os._exit(status)
    os.close(ready)
    os.read(begun, 1)
    os.close(begun)
    heard, interrupted, until = {}, False, time.monotonic() + patience
    with selectors.DefaultSelector() as selector:
        for end, other in pipes:
            os.close(other)
            selector.register(end, selectors.EVENT_READ)
            heard[end] = b""
        while selector.get_map():
            events = selector.select(max(until - time.monotonic(), 0))
            for key, _ in events:
                if some := os.read(key.fd, 1 << 16):
                    heard[key.fd] += some
                else:
                    selector.unregister(key.fd)
                    os.close(key.fd)
            if not events and time.monotonic() > until:
                os.killpg(child, signal.SIGKILL if interrupted else signal.SIGINT)
                interrupted, until = True, time.monotonic() + MERCY
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    texts = [text.decode(errors="backslashreplace") for text in heard.values()]
    return status, *texts, interrupted


def _serve():
    import joda

    for name in joda.COMMANDS:
        getattr(joda, name)
    joda.Profile  # noqa: B018 (loads it)
    for module in ("matplotlib.figure", "matplotlib.backends.backend_agg", "rich.table", "typer"):
        __import__(module)
    for line in sys.stdin:
        print(json.dumps(_run(*json.loads(line))), flush=True)


if __name__ == "__main__":
    _serve()
