"""Every sentence that a mistake is answered with is tested somewhere; the small ones here."""

import ast
import math
import os
import re
from collections import Counter
from pathlib import Path

import mujoco
import pytest

import joda
from joda import JodaError
from joda.diagnosis.findings import read_diagnosis
from joda.files import check_target, make_folder, read_text, write_text
from joda.measured.run_files import read_run
from joda.propose.replies import parse
from joda.template import Template

ROOT = Path(__file__).parents[1]
MODELS = ROOT / "models"
PIECE = 12
"""So many letters in a row tell one sentence from another."""
ELSEWHERE = {
    "refine needs JAX (no module ",  # needs an environment without JAX
    "the batch came back without a result for this; ask again.",  # the service would be at fault
    "' cannot be collected (",
    " cannot be used: it was taken just now.",  # between the look and the use
    ": MuJoCo wrote ",  # it would be at fault
    " has no folder; run: pip install mujoco==",  # needs an environment without MuJoCo
}


def texts(tree: ast.AST) -> list[str]:
    """The constant strings, those in f-strings piece by piece."""
    nodes = ast.walk(tree)
    return [n.value for n in nodes if isinstance(n, ast.Constant) and isinstance(n.value, str)]


def sentences() -> dict[str, list[str]]:
    """Where a mistake is answered: FILE:LINE, and the constant pieces of the sentence."""
    found = {}
    for path in sorted((ROOT / "python").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) in ("JodaError", "ValueError"):
                found[f"{path.name}:{node.lineno}"] = texts(node)
    return found


def pieces(parts: list[str]) -> set[str]:
    """All runs of PIECE letters within the parts."""
    return {part[k : k + PIECE] for part in parts for k in range(len(part) - PIECE + 1)}


def test_every_sentence_is_in_a_test():
    tested = "\n".join(
        text.replace("\\", "")
        for path in (ROOT / "tests").rglob("*.py")
        for text in texts(ast.parse(path.read_text("utf-8")))
    )
    found = {place: pieces(parts) for place, parts in sentences().items()}
    count = Counter(piece for some in found.values() for piece in some)
    missing = []
    for place, some in found.items():
        own = {piece for piece in some if count[piece] == 1} or some
        if some and not any(piece in tested for piece in own):
            missing.append(place)
    assert len(found) > 100
    assert not missing


def test_files(tmp_path):
    with pytest.raises(JodaError, match=r"^/dev/zero: cannot be read \(a device, no file\)\.$"):
        read_text(Path("/dev/zero"))
    with pytest.raises(JodaError, match=r"cannot be read \(Is a directory\)\.$"):
        read_text(tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(JodaError, match=r"cannot be made \(Not a directory\)\.$"):
        make_folder(tmp_path / "file" / "folder")
    with pytest.raises(JodaError, match=r"x: cannot be written \(No such file or directory\)\.$"):
        write_text(tmp_path / "no" / "x", "")
    with pytest.raises(JodaError, match=r"cannot be written \(Is a directory\)\.$"):
        write_text(tmp_path, "")
    for taken in (tmp_path, Path("/dev/null")):
        with pytest.raises(JodaError, match=r"cannot be written \(a folder or a device, no file\)"):
            check_target(taken, force=True)
    assert os.listdir(tmp_path) == ["file"]


def test_folders_that_are_not_empty(tmp_path):
    (tmp_path / "mine").write_text("")
    (tmp_path / "experiments.md").write_text("")
    told = re.escape("exists already; choose another folder with -o or add --force.")
    for command in (joda.demo, joda.hidden_effect):
        with pytest.raises(JodaError, match=told):
            command(tmp_path)
    told = "exists already; choose another folder with -o, add --force."
    with pytest.raises(JodaError, match=re.escape(told)):
        joda.generate(MODELS / "oven.xml", "door", tmp_path)
    with pytest.raises(JodaError, match="seeds is 0; give at least 1"):
        joda.experiments(["switch"], tmp_path / "new", seeds=0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" * 100_000, "not JSON that can be read (maximum recursion depth"),
        ("1" * 5000, "not JSON that can be read (Exceeds the limit"),
        ('{"effects": \n', ", line 2: not JSON (Expecting value)."),
    ],
)
def test_a_diagnosis_that_is_no_json(text, message, tmp_path):
    (tmp_path / "diagnosis.json").write_text(text)
    with pytest.raises(JodaError, match=re.escape(message)):
        read_diagnosis(tmp_path / "diagnosis.json")


def test_a_run_that_is_no_csv(tmp_path):
    (tmp_path / "run.csv").write_text("time,position\n0," + "1" * 200_000 + "\n")
    with pytest.raises(JodaError, match=r"line 2: not CSV \(field larger than field limit"):
        read_run(tmp_path / "run.csv")


def test_no_runs_and_no_profile(tmp_path):
    oven, new = MODELS / "oven.xml", tmp_path / "new.xml"
    told = "no runs; give at least one CSV file with time and position"
    for command in (joda.compare, joda.diagnose):
        with pytest.raises(JodaError, match=told):
            command(oven, "door", [])
    with pytest.raises(JodaError, match=told):
        joda.refine(oven, "door", [], new)
    run = tmp_path / "run.csv"
    run.write_text("time,position\n" + "".join(f"{k},{k / 10}\n" for k in range(9)))
    told = "joint 'door' carries no profile; make one with joda generate, or attach one"
    with pytest.raises(JodaError, match=told):
        joda.refine(oven, "door", [run], new)


def test_numbers_that_are_none():
    for name in ("push", "impulse"):
        with pytest.raises(JodaError, match=f"--{name} is inf; give a number."):
            joda.simulate(MODELS / "oven.xml", "door", **{name: math.inf})
    with pytest.raises(JodaError, match=r"--pause is -1; give 0 or more\."):
        joda.simulate(MODELS / "oven.xml", "door", hand=True, pause=-1)
    with pytest.raises(ValueError, match="give sin or cos for a hinge, force for a slide"):
        joda.effects.GravityOffset()


def test_an_effect_twice():
    given = {"effect": "backlash", "play": 0.01, "inertia": 0.002}
    joint = {"name": "j", "type": "hinge", "range": [0, 1], "unit": "rad"}
    content = {"joint": joint, "effects": [given] * 2}
    with pytest.raises(ValueError, match=r"effects\[1\]: the joint has backlash already"):
        joda.Profile.model_validate(content)


def test_a_robot_without_time(tmp_path):
    (tmp_path / "robot.csv").write_text("arm_pan\n0\n")
    told = "; of these it has arm_pan, 1 rows."
    with pytest.raises(JodaError, match=re.escape(told)):
        joda.simulate(MODELS / "microwave.xml", "door", robot=tmp_path / "robot.csv")


def test_a_template_with_negative_friction(tmp_path):
    template = next((ROOT / "templates").glob("constant_friction*.json")).read_text()
    broken = re.sub(r'("friction".*?"y": \[)', r"\1-", template, flags=re.DOTALL)
    assert broken != template
    (tmp_path / "t.json").write_text(broken)
    with pytest.raises(JodaError, match=r"friction\.y is negative; friction and damping must not"):
        Template.read(tmp_path / "t.json")


def test_an_answer_that_is_no_json():
    with pytest.raises(JodaError, match=r"^It is not JSON \(Expecting value"):
        parse("I would rather not.", None, ())


def test_an_integrator_that_mjx_does_not_have():
    from mujoco import mjx

    spec = mujoco.MjSpec.from_file(str(MODELS / "oven.xml"))
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    told = "joda.mjx steps with the integrators Euler and implicitfast, not "
    model = spec.compile()
    with pytest.raises(JodaError, match=told):
        joda.mjx.put_fields(model, {})
    with pytest.raises(JodaError, match=told):
        joda.mjx.step(mjx.put_model(model), None, None)
