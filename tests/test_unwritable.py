"""Where nothing can be written: a command says so in a sentence, and leaves nothing of its own."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from forked import Ended, Forked
from workshop import COMMANDS, NO_FILE, check, contents, fill

HEED = () if os.geteuid() else ("setpriv", "--bounding-set=-dac_override", "--")
"""What begins a command that is to heed permissions, which root need not."""
WRITING = [
    *(line for line in COMMANDS if line.split()[0] not in ("bench", "render", "schema")),
    "attach microwave.xml composed.json -o scene.xml --force",
    "refine scene.xml curve.csv --joint door -o new.xml",
    "simulate scene.xml --joint door --release 0.1 --gif new.gif",
]
SLOW = ("diagnose", "improve", "refine scene.xml run")
"""They work long before a full disk shows, and write as others do."""
RENDER = "render microwave.xml --joint door -o new --count 2"
PATIENCE = 120.0
"""For a command, s."""
pytestmark = pytest.mark.skipif(
    subprocess.run([*HEED, "true"], capture_output=True).returncode != 0,
    reason="root's rights cannot be taken away here",
)


@pytest.fixture(scope="module")
def closed(tmp_path_factory):
    """A folder that may be read and not written."""
    folder = tmp_path_factory.mktemp("closed")
    fill(folder)
    inside = [folder, *(path for path in folder.rglob("*") if path.is_dir())]
    for path in inside:
        path.chmod(0o555)
    yield folder
    for path in inside:
        path.chmod(0o755)


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    """A folder on a disk without any room."""
    folder = tmp_path_factory.mktemp("full")
    mount = ["mount", "-t", "tmpfs", "-o", "size=4m", "joda", folder]
    if os.geteuid() or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("nothing can be mounted here")
    try:
        fill(folder)
        with (
            open(folder / "filler", "wb", buffering=0) as file,
            pytest.raises(OSError, match="No space left"),
        ):
            while True:
                file.write(bytes(4096))
        yield folder
    finally:
        subprocess.run(["umount", folder], check=True)


@pytest.fixture(scope="module")
def forked(tmp_path_factory):
    server = Forked(tmp_path_factory.mktemp("cache"), HEED)
    yield server
    server.close()


def alone(command: str, folder: Path) -> Ended:
    """How the command ends in a process of its own, which may render."""
    words = [*HEED, sys.executable, "-P", "-m", "joda", *command.split()]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    if "nothing can render here" in done.stderr:
        pytest.skip("nothing can render here")
    return Ended(done.returncode, done.stdout, done.stderr, interrupted=False)


def files(found: dict[str, str]) -> dict[str, str]:
    """Of what was found, what is no folder."""
    return {name: digest for name, digest in found.items() if digest != NO_FILE}


def check_refusal(ended: Ended, folder: Path, before: dict[str, str], reason: str) -> None:
    """One sentence that names what cannot be written, and no file is other than before."""
    check(ended, folder, before, several=True)
    told = rf" \S+: cannot be (written|made) \({reason}\)\.$"
    assert re.search(told, ended.stdout + ended.stderr, re.MULTILINE), ended
    after = contents(folder)
    shutil.rmtree(folder / "new", ignore_errors=True)  # a folder, still empty
    assert files(after) == files(before)


@pytest.mark.slow
@pytest.mark.parametrize("command", WRITING)
def test_a_folder_that_may_not_be_written(command, closed, forked):
    before = contents(closed)
    ended = forked.run(command.split(), closed, PATIENCE)
    check_refusal(ended, closed, before, "Permission denied")


@pytest.mark.slow
@pytest.mark.parametrize("command", [line for line in WRITING if not line.startswith(SLOW)])
def test_a_full_disk(command, full, forked):
    before = contents(full)
    ended = forked.run(command.split(), full, PATIENCE)
    check_refusal(ended, full, before, "No space left on device")


ALL_OR_NONE = [
    "add scene.xml run.csv run2.csv --joint door --diagnosis diagnosis.json -o new.xml",
    "compare scene.xml run.csv --joint door --json new.json --report new.html -o new.png",
    "refine scene.xml curve.csv --joint door -o new.xml",
    "simulate scene.xml --joint door --release 0.1 -o new.csv --duration 0.1",
]


@pytest.mark.sweep(2)
@pytest.mark.parametrize("command", ALL_OR_NONE)
def test_there_is_room_for_some_of_the_files_only(command, forked, tmp_path):
    fill(tmp_path)
    before = contents(tmp_path)
    ended = forked.run(command.split(), tmp_path, PATIENCE, largest=20_000)
    check_refusal(ended, tmp_path, before, "File too large")


@pytest.mark.slow
def test_pictures_have_no_room(closed, full):
    for folder, reason in ((closed, "Permission denied"), (full, "No space left on device")):
        before = contents(folder)
        check_refusal(alone(RENDER, folder), folder, before, reason)
