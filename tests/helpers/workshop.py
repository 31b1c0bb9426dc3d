"""A folder in which commands work, the commands, and what must be true however they end."""

import hashlib
import json
import math
import re
import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from PIL import Image

import joda
from joda.measured import run_files
from joda.measured.reading import read_measured

MODELS = Path(__file__).parents[2] / "models"

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
import run.csv --model scene.xml --joint door -o new --unit position=deg
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
NO_FILE = "no file"
RUN = "time,position,force\n" + "".join(
    f"{k / 100},{0.5 + 0.3 * math.sin(k / 30):.5f},{math.cos(k / 30):.4f}\n" for k in range(120)
)
MESHES = """<mujoco><asset><mesh name="lid" file="lid.obj"/></asset><worldbody><body>
  <joint name="lid" range="0 90"/><geom type="mesh" mesh="lid"/></body></worldbody></mujoco>"""
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def fill(folder: Path) -> None:
    """Puts into the folder what all of COMMANDS work on."""
    for name in ("microwave.xml", "oven.xml"):
        shutil.copy(MODELS / name, folder)
    shutil.copy(Path(__file__).parents[1] / "microwave.latch.json", folder / "composed.json")
    joda.generate(folder / "microwave.xml", "door", folder / "gen", proposer="offline", rounds=1)
    shutil.copy(folder / "gen" / "proposal.json", folder)
    joda.attach(folder / "microwave.xml", [folder / "composed.json"], folder / "scene.xml")
    (folder / "run.csv").write_text(RUN)
    (folder / "run2.csv").write_text(RUN.replace("0.5", "0.51"))
    (folder / "curve.csv").write_text(re.sub("^[^,]*,", "", RUN, flags=re.MULTILINE))
    (curve,) = read_measured(folder / "scene.xml", "door", [folder / "curve.csv"]).curves
    pairs = zip(curve.curve.position, 1.2 * np.nan_to_num(curve.force), strict=True)
    rows = "".join(f"{position:.5f},{force:.4f}\n" for position, force in pairs)
    (folder / "curve.csv").write_text("position,force\n" + rows)
    (folder / "robot.csv").write_text("time,arm_pan\n0,0\n1,0.5\n")
    effect = {
        "effect": "gravity_offset", "interval": [0, 1], "probability": 0.9,
        "direction": "both",
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


def contents(folder: Path) -> dict[str, str]:
    """What lies in the folder: digests by name."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        if path.is_file()
        else NO_FILE
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
        # as MuJoCo does, it is taken as bytes: a comment in Latin-1 is kept as it was
        ElementTree.fromstring(path.read_text(errors="replace"))
    elif path.suffix == ".html":
        assert path.read_text().rstrip().endswith("</html>"), path
    elif path.suffix == ".csv":
        run_files.read_measurement(path)


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
