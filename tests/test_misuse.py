"""Generated misuse: wrong command lines, broken files, full disks, Ctrl-C at any moment.

Whatever happens, there is no traceback and no half-written file; a mistake is one sentence. Each
failure prints its seed. `JODA_MISUSE=500 pytest tests/test_misuse.py -n 0` tries 500.
"""

import contextlib
import json
import math
import os
import random
import re
import secrets
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from forked import Ended, Forked
from workshop import COMMANDS, SEVERAL, check, contents, fill

COUNT = int(os.environ.get("JODA_MISUSE", "24"))
SEED = int(os.environ.get("JODA_MISUSE_SEED", secrets.randbelow(10**6)))

WORDS = [
    "", "-", "--", "-o", "--force", "--joint", "--hand", "--colour", "door", "dor", "#9",
    "body:x:1", "nan", "-1", "0", "1e999", "1,,2", "new.xml", "no/such/new.xml", ".", "..", "/",
    "/dev/null", "/dev/full", "/proc/new.xml", "/sys/new.xml", "composed.json", "microwave.xml",
    "run.csv", "gen", "é", "\udcff", "x" * 300, "a\nb", "*", "%s", "{}", "empty", "loop", "offline",
]  # fmt: skip


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A folder in which all of COMMANDS work."""
    folder = tmp_path_factory.mktemp("good")
    fill(folder)
    return folder


@pytest.fixture(scope="module")
def forked(tmp_path_factory):
    server = Forked(tmp_path_factory.mktemp("cache"))
    yield server
    server.close()


def damaged_json(text: str, dice: random.Random) -> str:
    """The same JSON with one value replaced or left out, at a random place."""
    content = json.loads(text)
    node, places = content, []

    def collect(node):
        items = node.items() if isinstance(node, dict) else enumerate(node)
        for key, value in list(items):
            places.append((node, key))
            if isinstance(value, dict | list):
                collect(value)

    collect(content)
    node, key = dice.choice(places)
    values = [
        None,
        "",
        "x",
        [],
        {},
        -1,
        0,
        1e308,
        10**400,
        math.nan,
        math.inf,
        True,
        [1, 0],
        "../x",
    ]
    if dice.random() < 0.3:
        del node[key]
    else:
        node[key] = dice.choice(values)
    return json.dumps(content)


def damaged_number(text: str, dice: random.Random) -> str:
    """The same text with one number replaced."""
    found = list(re.finditer(r"-?\d+(\.\d*)?", text))
    place = dice.choice(found)
    number = dice.choice(["nan", "inf", "-1", "0", "1e400", "1e30", "", "x", "--", "1 2 3", "1;2"])
    return text[: place.start()] + number + text[place.end() :]


def damage(path: Path, dice: random.Random) -> str:
    """Breaks the file somehow; says how."""
    raw = path.read_bytes()
    text = raw.decode()
    cut = dice.randrange(len(raw))
    lines = text.splitlines(keepends=True)
    line = dice.randrange(len(lines))
    ways = {
        "truncated": raw[:cut],
        "binary": dice.randbytes(300),
        "partly binary": raw[:cut] + dice.randbytes(20) + raw[cut:],
        "with zeros": raw[:cut] + b"\0" + raw[cut:],
        "empty": b"",
        "blank": b"\n \n",
        "UTF-16": text.encode("utf-16"),
        "of deep brackets": b"[" * 100_000,
        "with another number": damaged_number(text, dice).encode(),
        "without a line": "".join(lines[:line] + lines[line + 1 :]).encode(),
        "with a line twice": "".join([*lines[:line], lines[line], *lines[line:]]).encode(),
        "with Latin-1": raw[:cut] + "°é".encode("latin-1") + raw[cut:],
    }
    if path.suffix == ".json":
        for k in range(6):
            ways[f"with another value {k}"] = damaged_json(text, dice).encode()
    how = dice.choice([*ways, "missing", "a folder"])
    path.unlink()
    if how == "a folder":
        path.mkdir()
    elif how != "missing":
        path.write_bytes(ways[how])
    return f"{path.name} is {how}"


def garbled(arguments: list[str], dice: random.Random) -> list[str]:
    """The command line with one mistake."""
    place = dice.randrange(len(arguments))
    word = dice.choice(WORDS)
    changed = list(arguments)
    match dice.randrange(6):
        case 0:
            del changed[place]
        case 1:
            changed.insert(place, word)
        case 2 | 3:
            changed[place] = word
        case 4:
            other = dice.randrange(len(arguments))
            changed[place], changed[other] = changed[other], changed[place]
        case 5:
            changed[place] = changed[place][:-1] + dice.choice("xy-")
    return changed


@pytest.mark.slow
@pytest.mark.parametrize("number", range(COUNT))
def test_misuse(number, good, forked, tmp_path):
    seed = SEED + number
    dice = random.Random(seed)
    folder = tmp_path / "work"
    shutil.copytree(good, folder, symlinks=True)
    command = arguments = dice.choice(COMMANDS).split()
    largest, what = None, "nothing broken"
    kind = dice.random()
    if kind < 0.4:
        arguments = garbled(arguments, dice)
    elif kind < 0.85:
        names = [name for name in arguments if (folder / name).is_file()]
        if arguments[0] in ("revise", "generate"):
            names += [f"gen/{name}" for name in ("history.json", "proposal.json", "composed.json")]
        if "more" in arguments:
            names.append(f"more/{dice.choice(os.listdir(folder / 'more'))}")
        if names:
            what = damage(folder / dice.choice(names), dice)
    else:
        largest = int(10 ** dice.uniform(0, 4.5))
        what = f"the disk has room for {largest} bytes"
    before = contents(folder)
    patience = 10 ** dice.uniform(-1.5, 0.7)
    ended = forked.run(arguments, folder, patience, largest)
    print(f"JODA_MISUSE_SEED={seed}: {what}: joda {' '.join(arguments)!a}: {ended}")
    full = largest is not None or ended.interrupted
    check(ended, folder, before, several=full or command[0] in SEVERAL)


LONG = """
compare scene.xml run.csv curve.csv --joint door --json new.json --report new.html -o new.png
demo -o new
diagnose scene.xml run.csv run2.csv --joint door --json new.json
experiments switch --seeds 1 -o new
generate microwave.xml --joint door -o new
improve scene.xml run.csv run2.csv --joint door -o new.xml
refine scene.xml run.csv --joint door -o new.xml
render microwave.xml --joint door -o new
simulate scene.xml --joint door --hand 1,0 --gif new.gif
""".strip().splitlines()
GLFW = re.compile(r'Traceback.*\n  File "<string>", line \d+, in <module>\nKeyboardInterrupt\n')
"""What the process prints in which glfw, imported by MuJoCo, looks for its library's version."""
START = "from joda.__main__ import main; print(flush=True); main()"


@pytest.mark.slow
@pytest.mark.parametrize("number", range(max(COUNT // 8, 1)))
def test_ctrl_c_at_any_moment(number, good, tmp_path):
    """As in a terminal: the child processes that render are told too."""
    dice = random.Random(SEED + number)
    folder = tmp_path / "work"
    shutil.copytree(good, folder, symlinks=True)
    before = contents(folder)
    command = dice.choice(LONG).split()
    delay = dice.uniform(0, 4)
    print(f"JODA_MISUSE_SEED={SEED + number}: joda {' '.join(command)}, {delay:.3f} s")
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", START, *command],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    process.stdout.readline()
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(delay)
    interrupted = process.poll() is None
    if interrupted:
        os.killpg(process.pid, signal.SIGINT)
    stdout, stderr = process.communicate(timeout=60)
    if process.returncode == -signal.SIGINT and not stderr:
        return  # all was done, and Python about to end
    ended = Ended(process.returncode, stdout, GLFW.sub("", stderr), interrupted)
    check(ended, folder, before, several=True)
