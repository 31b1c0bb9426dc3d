"""Ctrl-C, also where the C code of some library swallows it or makes an error of its own of it."""

import _thread
import signal
import sys
import threading
from types import FrameType

STATUS = 130
"""Exit status after Ctrl-C: the shell's for SIGINT."""

_seen = threading.Event()


def watch() -> None:
    """From now on an interruption is remembered, and comes again where it was swallowed."""
    signal.signal(signal.SIGINT, _interrupt)
    sys.unraisablehook = _again


def seen() -> bool:
    """Whether there was one, whatever became of it."""
    return _seen.is_set()


def forget() -> None:
    """The interruption was the usual end of what ran."""
    _seen.clear()


def _interrupt(number: int, frame: FrameType | None) -> None:
    _seen.set()
    if _loading(frame):
        _later()
    else:
        raise KeyboardInterrupt


def _loading(frame: FrameType | None) -> bool:
    """Whether C code is being imported, which may crash if it is interrupted; JAX's does."""
    while frame and not frame.f_code.co_qualname.startswith("ExtensionFileLoader."):
        frame = frame.f_back
    return frame is not None


def _again(lost: "sys.UnraisableHookArgs") -> None:
    if isinstance(lost.exc_value, KeyboardInterrupt):
        _later()
    else:
        sys.__unraisablehook__(lost)


def _later() -> None:
    threading.Timer(0.01, _thread.interrupt_main).start()
