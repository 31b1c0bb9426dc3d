"""Reading and writing whole files: atomic, never half, never over a user's file unasked."""

import os
import re
import tempfile
from collections.abc import Iterable, Mapping
from errno import EISDIR
from io import BytesIO, TextIOWrapper
from itertools import count
from pathlib import Path
from typing import TextIO

from joda.errors import JodaError

UTF16 = (b"\xff\xfe", b"\xfe\xff")
"""Byte order marks; UTF-32 begins so too."""
MAX_NAME = 50
"""Letters of a name that go into a file's name; a file system has room for 255 bytes of it."""
LARGEST = 20_000_000
"""Bytes of a JSON file that is read; what joda writes has a thousandth of it."""


def cache_folder() -> Path:
    """What joda keeps from call to call for this user; it is all that an uninstallation leaves."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "joda"


def read_text(path: Path) -> str:
    """Text of a UTF-8 file; raises JodaError if it is missing, unreadable or not text."""
    return _readable(path).decode("utf-8").removeprefix("\ufeff")


def text_lines(path: Path) -> TextIO:
    """The same line by line, whatever ends a line: for large tables."""
    return TextIOWrapper(BytesIO(_readable(path)), "utf-8-sig", newline=None)


def _readable(path: Path) -> bytes:
    """Content of a UTF-8 file; raises JodaError if it is missing, unreadable or not text."""
    if path.is_char_device():  # it may never end
        raise JodaError(f"{path}: cannot be read (a device, no file).")
    try:
        raw = path.read_bytes()
        raw.decode("utf-8")
    except UnicodeDecodeError as error:
        raise JodaError(f"{path}: {_no_text(raw, error.start)}.") from None
    except OSError as error:
        raise JodaError(f"{path}: cannot be read ({error.strerror}).") from None
    if (at := raw.find(b"\0")) >= 0:
        raise JodaError(f"{path}: {_no_text(raw, at)}.")
    return raw


def _no_text(raw: bytes, at: int) -> str:
    """What a file is that is not UTF-8 from some byte on, and what to do."""
    some = raw[:4096]
    if raw.startswith(UTF16) or max(some[::2].count(0), some[1::2].count(0)) > len(some) / 4:
        return "not a UTF-8 text file, it looks like UTF-16; save it as UTF-8"
    line = raw.count(b"\n", 0, at) + 1
    place = f"(byte {at}, line {line})"
    if b"\0" in raw:
        return f"not a text file, or damaged: there is a NUL byte {place}; write it anew"
    return (
        f"not a UTF-8 text file {place}; if it is text, in Latin-1 or Windows-1252 perhaps, save "
        "it as UTF-8"
    )


def read_json(path: Path) -> str:
    """Text of a JSON file, not yet parsed; raises JodaError as `read_text`, or if it is huge."""
    if path.is_file() and (size := path.stat().st_size) > LARGEST:
        raise JodaError(f"{path}: has {size / 1e6:.0f} MB; a file of this kind has at most 20 MB.")
    return read_text(path)


def check_target(path: Path, force: bool) -> None:
    """Raises JodaError if `path` exists and `force` is off, or no file can be made there.

    A full disk shows only when the file is written.
    """
    if path.exists() and not path.is_file():
        raise JodaError(f"{path}: cannot be written (a folder or a device, no file).")
    if path.exists() and not force:
        raise JodaError(f"{path}: exists already; choose another name or add --force.")
    if not path.parent.is_dir():
        raise JodaError(f"{path}: the folder {path.parent} does not exist; create it first.")
    try:
        tempfile.TemporaryFile(dir=path.parent).close()
    except OSError as error:
        raise _unwritable(path, error) from None


def named_like(path: Path, suffix: str) -> Path:
    """The file beside one, with its name and another suffix; raises JodaError for a folder."""
    if not path.name or path.is_dir():
        raise JodaError(f"{path}: cannot be written (a folder or a device, no file).")
    return path.with_suffix(suffix)


def check_targets(paths: Iterable[Path], force: bool, inputs: Iterable[str | Path] = ()) -> None:
    """Raises JodaError if one of several files cannot be made, two have one name, or one is read.

    Args:
        paths: to be written.
        force: whether what exists may be overwritten.
        inputs: files that are read meanwhile: these never are.
    """
    read = {Path(os.path.realpath(path)) for path in inputs}  # also of links that go in a circle
    seen: set[Path] = set()
    for path in paths:
        place = Path(os.path.realpath(path))
        if place in read:
            raise JodaError(f"{path}: is read here; choose another name for what is written.")
        if place in seen:
            raise JodaError(f"{path}: is the name of two files to write; give each its own.")
        seen.add(place)
        check_target(path, force)


def occupied(folder: Path) -> bool:
    """Whether something is there already: a file, or a folder that is not empty."""
    return folder.exists() and (not folder.is_dir() or any(folder.iterdir()))


def fresh(name: str) -> Path:
    """The first of NAME, NAME_2, NAME_3, ... that does not exist."""
    candidates = (Path(f"{name}_{k}" if k > 1 else name) for k in count(1))
    return next(path for path in candidates if not path.exists())


def file_name(name: str) -> str:
    """A part of a file's name that stands for `name`: no path, nothing special, not too long."""
    return re.sub(r"[^\w.-]+", "_", name)[:MAX_NAME].strip("._-") or "joint"


def make_folder(path: Path) -> None:
    """Makes the folder, and those above it, unless it exists; raises JodaError."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise JodaError(f"{path}: cannot be made ({error.strerror}).") from None


def write_together(contents: Mapping[Path, bytes | str]) -> None:
    """Writes these files, all of them whole, or none; raises JodaError if a folder forbids it.

    All is on the disk under other names before the first file gets its own.
    """
    written: dict[Path, Path] = {}
    path = Path()
    try:
        for path in contents:
            if path.is_dir():  # which would be found out in the midst
                raise IsADirectoryError(EISDIR, os.strerror(EISDIR))
        for path, content in contents.items():
            descriptor, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
            written[path] = Path(name)
            with os.fdopen(descriptor, "wb") as file:
                file.write(content.encode("utf-8") if isinstance(content, str) else content)
            umask = os.umask(0)
            os.umask(umask)
            os.chmod(name, 0o666 & ~umask)
        for path, temporary in written.items():
            temporary.replace(path)
    except OSError as error:
        raise _unwritable(path, error) from None
    finally:
        for temporary in written.values():
            temporary.unlink(missing_ok=True)


def write_bytes(path: Path, content: bytes) -> None:
    """Writes the whole file or nothing; raises JodaError if the folder does not allow it."""
    write_together({path: content})


def write_text(path: Path, text: str) -> None:
    """As write_bytes, for UTF-8 text."""
    write_together({path: text})


def _unwritable(path: Path, error: OSError) -> JodaError:
    return JodaError(f"{path}: cannot be written ({error.strerror}).")
