"""Generated misuse: wrong command lines, broken files, full disks, Ctrl-C at any moment.

Whatever happens, there is no traceback and no half-written file; a mistake is one sentence. Each
failure prints its seed. `JODA_MISUSE=500 pytest tests/test_misuse.py -n 0` tries 500.
"""

import contextlib
import hashlib
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
from xml.etree import ElementTree

import pytest
from forked import Ended, Forked
from PIL import Image

import joda
from joda.measured import runs

MODELS = Path(__file__).parents[1] / "models"
COUNT = int(os.environ.get("JODA_MISUSE", "40"))
SEED = int(os.environ.get("JODA_MISUSE_SEED", secrets.randbelow(10**6)))

COMMANDS = """
add scene.xml run.csv run2.csv --joint door --diagnosis diagnosis.json -o new.xml
attach microwave.xml composed.json -o new.xml
attach meshes.xml lid.json -o new.xml --native keep
bench scene.xml --json
compare scene.xml run.csv curve.csv --joint door --json new.json --report new.html -o new.png
compile proposal.json --model microwave.xml --joint door -o new.json --key other
context microwave.xml --joint door --json new.json
demo -o new
diagnose scene.xml run.csv run2.csv --joint door --json new.json --exclude backlash
experiments switch --seeds 1 -o new
generate microwave.xml --joint door -o new --rounds 1 --describe latches
generate gen -o new --rounds 1
generate microwave.xml --joint door -o gen --resume
improve scene.xml run.csv run2.csv --joint door -o new.xml --report new.html
plot composed.json -o new.png
plot scene.xml --joint door -o new.png
refine scene.xml run.csv --joint door -o new.xml --fit values --iterations 2
render microwave.xml --joint door -o new --count 2
revise gen --feedback weaker
schema proposal
simulate scene.xml --joint door --release 0.1 -o new.csv --duration 0.5
simulate scene.xml --joint door --hand 1,0 --pause 0.1 -o new.csv
simulate scene.xml --joint door --robot robot.csv -o new.csv
templates --templates more -o new.png
""".strip().splitlines()
SEVERAL = {"demo", "experiments", "generate", "render", "revise"}
"""Commands of several steps: what the first ones left, in whole files, stays when another fails.
So do whole files of all commands when they are interrupted or the disk is full."""
WORDS = [
    "", "-", "--", "-o", "--force", "--joint", "--hand", "--colour", "door", "dor", "#9",
    "body:x:1", "nan", "-1", "0", "1e999", "1,,2", "new.xml", "no/such/new.xml", ".", "..", "/",
    "/dev/null", "/dev/full", "/proc/new.xml", "/sys/new.xml", "composed.json", "microwave.xml",
    "run.csv", "gen", "é", "\udcff", "x" * 300, "a\nb", "*", "%s", "{}", "empty", "loop", "offline",
]  # fmt: skip
RUN = "time,position,force\n" + "".join(
    f"{k / 100},{0.5 + 0.3 * math.sin(k / 30):.5f},{math.cos(k / 30):.4f}\n" for k in range(120)
)
MESHES = """<mujoco><asset><mesh name="lid" file="lid.obj"/></asset><worldbody><body>
  <joint name="lid" range="0 90"/><geom type="mesh" mesh="lid"/></body></worldbody></mujoco>"""
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """A folder in which all of COMMANDS work."""
    folder = tmp_path_factory.mktemp("good")
    for name in ("microwave.xml", "oven.xml"):
        shutil.copy(MODELS / name, folder)
    shutil.copy(Path(__file__).parent / "microwave.latch.json", folder / "composed.json")
    joda.generate(folder / "microwave.xml", "door", folder / "gen", proposer="offline", rounds=1)
    shutil.copy(folder / "gen" / "proposal.json", folder)
    joda.attach(folder / "microwave.xml", [folder / "composed.json"], folder / "scene.xml")
    (folder / "run.csv").write_text(RUN)
    (folder / "run2.csv").write_text(RUN.replace("0.5", "0.51"))
    (folder / "curve.csv").write_text(re.sub("^[^,]*,", "", RUN, flags=re.MULTILINE))
    (folder / "robot.csv").write_text("time,arm_pan\n0,0\n1,0.5\n")
    effect = {
        "effect": "quadratic_damping", "interval": [0, 1], "probability": 0.9, "direction": "both",
        "magnitude": 0.2, "unit": "", "explanation": "", "held_out_error_before": 1,
        "held_out_error_after": 0.5, "indistinguishable_from": [],
    }  # fmt: skip
    diagnosis = {"verdict": "missing_effect", "effects": [effect], "noise_floor": 1e-3}
    (folder / "diagnosis.json").write_text(json.dumps({**diagnosis, "next_experiment": None}))
    (folder / "meshes.xml").write_text(MESHES)
    (folder / "lid.obj").write_text(TETRAHEDRON)
    lid = json.loads((folder / "composed.json").read_text())
    lid["joint"].update(name="lid", range=[0, math.pi / 2])
    (folder / "lid.json").write_text(json.dumps(lid))
    shutil.copytree(MODELS.parent / "templates", folder / "more")
    (folder / "empty").mkdir()
    (folder / "loop").symlink_to("loop")
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


def contents(folder: Path) -> dict[str, str]:
    """What lies in the folder: digests by name."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        if path.is_file()
        else "no file"
        for path in folder.rglob("*")
    }


def check_whole(path: Path) -> None:
    """The file was written to its end."""
    assert not path.name.startswith("."), f"{path} was left"
    if path.suffix in (".png", ".gif"):
        with Image.open(path) as picture:
            picture.load()
    elif path.suffix == ".json":
        json.loads(path.read_text())
    elif path.suffix == ".xml":
        ElementTree.parse(path)
    elif path.suffix == ".html":
        assert path.read_text().rstrip().endswith("</html>"), path
    elif path.suffix == ".csv":
        runs.read_measurement(path)


def check(ended, folder: Path, before: dict[str, str], several: bool) -> None:
    """No traceback, one sentence, no half-written file; `several` whole ones may be left."""
    told = f"{ended.status}, {ended.stderr[-3000:]}"
    assert "Traceback" not in ended.stderr, told
    assert "Error:" not in ended.stderr.replace("XML Error:", ""), told
    assert ended.status in ({0, 2, 130} if ended.interrupted else {0, 2}), told
    after = contents(folder)
    changed = [name for name in after if before.get(name) != after[name]]
    for name in changed:
        if (folder / name).is_file():
            check_whole(folder / name)
    if ended.status == 2:
        sentence = ended.stderr.splitlines()
        assert len(sentence) == 1, told
        assert sentence[0].startswith("joda: "), told
        assert len(sentence[0]) < 1500, told
        if not several:
            assert ended.stdout == "", told
    if ended.status == 130:
        assert ended.stderr.endswith("joda: interrupted.\n"), told
    if ended.status in (2, 130):
        assert before.keys() <= after.keys(), told
        if not several:
            assert not changed, (changed, told)


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
