"""diagnose, add, improve, and the demo with a hidden effect: what they write and say."""

import json
import re
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from hidden_cases import clear_case
from test_cli import fails

from joda import JodaError, add, compare, diagnose, hidden_effect, improve
from joda.commands.add import sentences as of_added
from joda.commands.diagnose import sentences
from joda.diagnosis import improvement
from joda.diagnosis.outcome import read_runs
from joda.diagnosis.phrases import effect_names, named
from joda.hidden import draw
from joda.measured.run_files import write_run

SEED = 9
"""Of the demo."""
KEYS = {
    "effect": str,
    "interval": list,
    "probability": float,
    "direction": str,
    "magnitude": float,
    "unit": str,
    "explanation": str,
    "held_out_error_before": float,
    "held_out_error_after": float,
    "indistinguishable_from": list,
}


def joda(*arguments, cwd):
    """Runs the command line in a process of its own that has no JAX."""
    code = "import sys; sys.modules['jax'] = None\nfrom joda.cli import main; main()"
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)], cwd=cwd, capture_output=True, text=True
    )


def thinned(run):
    """Every second sample of a run."""
    every = slice(None, None, 2)
    return replace(run, time=run.time[every], position=run.position[every], force=run.force[every])


def write(case, folder, count=4):
    """Model and runs of a case; names of the runs."""
    (folder / "model.xml").write_text(case.model)
    for run in (*case.train[:count], *case.held_out):
        write_run(folder / run.name, thinned(run))
    return [folder / run.name for run in case.train[:count]]


@pytest.fixture(scope="module")
def hidden(tmp_path_factory):
    """A clear case, diagnosed and mended on the command line."""
    rng = np.random.default_rng()
    effect = str(rng.choice(["quadratic_damping", "constant_friction_hinge"]))
    case = clear_case(effect)
    folder = tmp_path_factory.mktemp("hidden")
    runs = write(case, folder, count=5)
    names = [run.name for run in runs]
    told = joda(
        "diagnose", "model.xml", *names, "--joint", "joint", "--json", "d.json", "--report",
        "d.html", "-o", "d.png", cwd=folder,
    )  # fmt: skip
    added = joda(
        "add", "model.xml", *names, "--joint", "joint", "--diagnosis", "d.json", "-o", "new.xml",
        "--json", cwd=folder,
    )  # fmt: skip
    unseen = [folder / run.name for run in case.held_out]
    return SimpleNamespace(
        effect=case.seal["effect"],  # on a part of the range it has a name of its own
        seed=case.seed,
        folder=folder,
        runs=runs,
        told=told,
        added=added,
        unseen=unseen,
    )


def test_the_diagnosis_is_as_the_contract_says(hidden):
    assert (hidden.told.returncode, hidden.told.stderr) == (0, "")
    told = json.loads((hidden.folder / "d.json").read_text())
    assert set(told) >= {"verdict", "effects", "noise_floor", "next_experiment"}
    assert told["verdict"] == "missing_effect", hidden.seed
    assert isinstance(told["noise_floor"], float)
    assert told["next_experiment"] is None or isinstance(told["next_experiment"], str)
    for one in told["effects"]:
        assert {key: type(one[key]) for key in KEYS} == KEYS
        assert one["effect"] in effect_names()
        assert 0 <= one["interval"][0] < one["interval"][1] <= 1
        assert 0 <= one["probability"] <= 1
        assert one["direction"] in ("both", "positive", "negative")
        assert set(one["indistinguishable_from"]) <= set(effect_names())
        assert len(one["interval_error"]) == 2 and one["magnitude_error"] > 0
        assert one["probability"] >= 0.01
    assert all(0 <= a < b <= 1 for a, b in told["unvisited"])
    likely = [one["probability"] for one in told["effects"]]
    assert likely == sorted(likely, reverse=True)
    assert sum(likely) <= 1 + 1e-9


def test_the_hidden_effect_is_found(hidden):
    told = json.loads((hidden.folder / "d.json").read_text())
    first = told["effects"][0]
    assert hidden.effect in (first["effect"], *first["indistinguishable_from"]), hidden.seed
    # the one run of four that is held out may hardly show the effect
    least = max(first["held_out_error_before"], 2 * told["noise_floor"])
    assert first["held_out_error_after"] < least, hidden.seed


def test_what_is_printed(hidden):
    lines = hidden.told.stdout.splitlines()
    told = json.loads((hidden.folder / "d.json").read_text())
    assert lines[0] == told["summary"]
    for one in told["effects"]:
        assert any(one["effect"] in line and one["explanation"] in line for line in lines)
    assert lines[-3:] == ["d.json", "d.html", "d.png"]


def test_the_page_needs_nothing_else(hidden):
    page = (hidden.folder / "d.html").read_text()
    told = json.loads((hidden.folder / "d.json").read_text())
    assert page.index(told["summary"]) < page.index("<img") < page.index("<table")
    assert "data:image/png;base64," in page
    assert "://" not in page
    assert (hidden.folder / "d.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


@pytest.mark.long
def test_adding_lowers_the_error_on_runs_that_nothing_has_seen(hidden):
    assert (hidden.added.returncode, hidden.added.stderr) == (0, "")
    added = json.loads(hidden.added.stdout)
    assert added["added"], hidden.seed
    assert added["after"]["window"] < added["before"]["window"], hidden.seed
    held = added["held_out"].split(", ")  # every fourth of those in which the joint moves
    assert 1 <= len(held) <= 2 and set(held) <= {run.name for run in hidden.runs}
    before, after = (
        compare(hidden.folder / name, "joint", hidden.unseen) for name in ("model.xml", "new.xml")
    )
    assert after.rmse_window < before.rmse_window, hidden.seed
    model = mujoco.MjModel.from_xml_path(str(hidden.folder / "new.xml"))
    mujoco.mj_step(model, mujoco.MjData(model), 10)
    for name in ("new.composed.json", "new.png"):
        assert (hidden.folder / name).exists()


@pytest.mark.long
def test_a_wrong_effect_never_raises_the_error(hidden):
    output = hidden.folder / "wrong.xml"
    added = add(
        hidden.folder / "model.xml",
        "joint",
        hidden.folder / "d.json",
        hidden.runs[:2],
        output,
        effect="magnetic_return_to_high_end",
    )
    assert added.after.window <= added.before.window, hidden.seed
    assert re.fullmatch(r"every fourth block of .* s in which the joint moves", added.held_out)
    said = of_added(added)[0]
    assert said.startswith("Added" if added.added else "Not added"), said
    assert output.exists() == added.added
    assert (added.reason is None) == added.added
    if added.added:
        found = compare(output, "joint", hidden.runs[:2])
        assert np.isfinite(found.rmse_window)


@pytest.mark.long
def test_the_stairs_never_rise(hidden, monkeypatch):
    one = replace(improvement.ADDING, max_effects=1)
    monkeypatch.setattr(improvement, "ADDING", one)
    page = hidden.folder / "story.html"
    output = hidden.folder / "improved.xml"
    result = improve(hidden.folder / "model.xml", "joint", hidden.runs, output, report=page)
    errors = [step.error.window for step in result.steps]
    assert errors == sorted(errors, reverse=True), hidden.seed
    assert len(errors) == 2, hidden.seed
    mujoco.MjModel.from_xml_path(str(output))
    assert output.with_suffix(".composed.json").exists()
    assert output.with_suffix(".png").exists()
    text = page.read_text()
    assert f"<td>+ {result.steps[1].effect}</td>" in text
    assert "://" not in text


@pytest.mark.long
def test_a_true_model_is_adequate_and_nothing_is_added(tmp_path):
    seed = int(np.random.default_rng().integers(2**31))
    print(seed)  # shown where the test fails
    names = [run.name for run in write(draw(seed, None), tmp_path)]
    line = ("model.xml", *names, "--joint", "joint")
    told = joda("diagnose", *line, "--json", "d.json", cwd=tmp_path)
    assert (told.returncode, told.stderr) == (0, ""), seed
    written = json.loads((tmp_path / "d.json").read_text())
    assert (written["verdict"], written["effects"]) == ("adequate", []), seed
    added = joda("add", *line, "--diagnosis", "d.json", "-o", "new.xml", cwd=tmp_path)
    assert added.returncode == 2
    assert "d.json: names no effect to add (verdict: adequate)" in added.stderr
    assert not (tmp_path / "new.xml").exists()


@pytest.mark.slow
def test_curves_alone_are_diagnosed_and_beside_runs_ignored(tmp_path):
    case = draw(1, None)
    runs = write(case, tmp_path, count=1)
    q = np.linspace(case.truth.joint.lo, case.truth.joint.hi, 30)
    rows = "\n".join(f"{x:.6g},{1 + 0.01 * k}" for k, x in enumerate(q))
    (tmp_path / "gauge.csv").write_text(f"position,force\n{rows}\n")
    found = diagnose(tmp_path / "model.xml", "joint", [tmp_path / "gauge.csv"],
                     picture=tmp_path / "d.png")  # fmt: skip
    assert sentences(found)[0] == found.summary
    assert (tmp_path / "d.png").exists()
    both = read_runs(tmp_path / "model.xml", "joint", [*runs, tmp_path / "gauge.csv"])
    assert any("gauge.csv: a quasi-static curve, not used" in note for note in both.notes)


@pytest.fixture
def mistaken(tmp_path):
    """A model, a run and a diagnosis that names an effect."""
    write(draw(1, None), tmp_path, count=1)
    content = {"joint": "joint", "verdict": "missing_effect", "effects": [{"effect": "backlash"}]}
    (tmp_path / "d.json").write_text(json.dumps(content))
    (tmp_path / "adequate.json").write_text('{"verdict": "adequate", "effects": []}')
    (tmp_path / "other.json").write_text(json.dumps(content | {"joint": "drawer"}))
    (tmp_path / "uncatalogued_forms.json").write_text('{"effects": [{"effect": "magic"}]}')
    (tmp_path / "text.json").write_text("{\nno")
    (tmp_path / "list.json").write_text("[]")
    (tmp_path / "degrees.csv").write_text(
        "time,position\n" + "\n".join(f"{0.01 * k},{90 * np.sin(0.05 * k)}" for k in range(200))
    )
    (tmp_path / "there.xml").write_text("")
    return tmp_path


ADD = "add model.xml run1.csv --joint joint -o new.xml --diagnosis"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("diagnose model.xml run1.csv --joint joint --exclude magic", "no effect 'magic'; there"),
        ("diagnose model.xml none.csv --joint joint", "none.csv: cannot be read"),
        ("diagnose model.xml run1.csv --joint door", "door"),
        ("diagnose model.xml degrees.csv --joint joint", "degrees.csv"),
        ("diagnose model.xml run1.csv --joint joint --json d.json", "d.json: exists already"),
        ("diagnose model.xml run1.csv --joint joint -o no/d.png", "the folder no does not exist"),
        (f"{ADD} none.json", "none.json: cannot be read"),
        (f"{ADD} text.json", "text.json, line 2: not JSON"),
        (f"{ADD} list.json", "list.json: key 'effects' is missing"),
        (f"{ADD} adequate.json", "adequate.json: names no effect to add (verdict: adequate)"),
        (f"{ADD} uncatalogued_forms.json", "no effect 'magic'; there are"),
        (f"{ADD} d.json --effect magic", "no effect 'magic'; there are"),
        (
            f"{ADD} other.json",
            "other.json: the diagnosis is for joint 'drawer', but --joint is 'joint'",
        ),
        (f"{ADD} d.json -o there.xml", "there.xml: exists already"),
        ("improve model.xml run1.csv --joint joint -o there.xml", "there.xml: exists already"),
        ("demo --seed 3", "go with joda demo hidden-effect"),
        ("demo hidden-effect --alien --position-only", "--alien needs the force"),
    ],
)
def test_a_mistake_is_one_sentence(mistaken, line, words):
    assert words in fails(*line.split(), cwd=mistaken)


@pytest.mark.long
def test_the_demo_opens_the_seal(tmp_path):
    said = []
    result = hidden_effect(tmp_path / "out", seed=SEED, position_only=True, say=said.append)
    seal = json.loads((tmp_path / "out" / "sealed.json").read_text())
    assert seal["effect"] == result.truth["effect"]
    assert result.right == (result.diagnosis.effects[0].effect == seal["effect"])
    opened = next(k for k, sentence in enumerate(said) if "seal is opened" in sentence)
    assert named(seal["effect"]) in said[opened + 1]
    assert result.judgement in said[opened + 2 :]
    assert not any("Hidden is" in sentence for sentence in said)
    assert result.after.rmse_window < result.before.rmse_window
    for name in ("model.xml", "diagnosis.html", "new.xml", "new.png", "unseen.html"):
        assert (tmp_path / "out" / name).exists()
    with pytest.raises(JodaError, match="exists already"):
        hidden_effect(tmp_path / "out", seed=SEED)


def test_nothing_imports_jax():
    commands = "joda.commands.improve, joda.commands.hidden_effect"
    code = f"import sys, {commands}; sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
