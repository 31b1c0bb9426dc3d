"""How good a proposer is: what is counted, what is kept, and what is refused."""

import json
import shutil
import sys
from pathlib import Path

import jsonschema
import openai
import pytest
from chat_server import Chat, completion, refusal, words
from messages_server import serve
from test_prompts import answers

from joda import JodaError, evaluate, schema
from joda.cli import main
from joda.commands.evaluate import Evaluation
from joda.proposal import Proposal
from joda.propose import Answer, Usage

MODELS = Path(__file__).parents[1] / "models"
SHUT, NEAR = "stays shut until it is pulled", "closes by itself when nearly closed"
CLICKS = "clicks into 5 positions"


class Recorded:
    """Answers with what was recorded, once; counts, and stops where it is told to."""

    name = "recorded"

    def __init__(self, stop=""):
        self.asked, self.stop = [], stop

    def propose(self, task, turns):
        kind = next(name for name in ("oven", "refrigerator") if name in task.context.around)
        self.asked.append(kind)
        if kind == self.stop:
            raise KeyboardInterrupt
        proposal = Proposal.model_validate(answers(kind)[0]["proposal"])
        usage = Usage(requests=1, input_tokens=100, output_tokens=10, dollars=0.01)
        return Answer(None if turns else proposal, usage)


@pytest.fixture(autouse=True)
def environment(monkeypatch):
    for name in ("ANTHROPIC_API_KEY", "OPENAI_API_KEY", "OPENAI_BASE_URL", "JODA_VLM"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    monkeypatch.setattr("joda.propose.session.render", lambda *_, **__: [])


@pytest.fixture
def folder(tmp_path):
    """Two models, of which something is expected that is so and something that is not.

    The recorded refrigerator stays where it is let go at 2 to 3 % of its way.
    """
    models = tmp_path / "models"
    (models / "deep").mkdir(parents=True)
    for name, place, behaviours in (
        ("oven", "deep/oven", [CLICKS]),
        ("refrigerator", "refrigerator", [SHUT, NEAR]),
    ):
        shutil.copy(MODELS / f"{name}.xml", models / f"{place}.xml")
        expected = {"joints": {"door": {"opens": "+", "behaviours": behaviours}}}
        (models / f"{place}.expected.json").write_text(json.dumps(expected))
    return models


@pytest.fixture(name="joda")
def command_line(monkeypatch, capsys):
    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["joda", "evaluate", "proposer", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        said = capsys.readouterr()
        assert "Traceback" not in said.err
        return end.value.code, said.out, said.err

    return run


def test_what_comes_true_is_counted_with_its_cost(folder, tmp_path):
    seen = []
    result = evaluate(
        "proposer", folder, tmp_path / "o", proposer=Recorded(), rounds=2,
        progress=lambda *each: seen.append(each),
    )  # fmt: skip
    oven, fridge = result.joints
    assert (oven.label, fridge.label) == ("deep/oven/door", "refrigerator/door")
    assert list(fridge.behaviours) == ["opens towards +q", "can be opened and closed by hand",
                                       SHUT, NEAR]  # fmt: skip
    assert (fridge.met, len(fridge.behaviours)) == (3, 4)
    assert "let go at 2 to 3 % of the way it stays" in fridge.behaviours[NEAR]
    assert (oven.met, len(oven.behaviours)) == (2, 3)
    assert "not 5" in oven.behaviours[CLICKS]
    assert (result.met, result.of) == (5, 7)
    assert (oven.rounds, oven.usage.requests, oven.usage.input_tokens) == (1, 2, 200)
    assert result.usage.dollars == pytest.approx(0.04) and result.seconds > 0
    assert seen == [(0, 2, "deep/oven/door"), (1, 2, "refrigerator/door"), (2, 2, "done")]
    assert Evaluation.read(tmp_path / "o" / "evaluation.json") == result
    assert (tmp_path / "o" / "deep" / "oven" / "door" / "scene.xml").exists()


def test_it_is_not_told_what_is_expected(folder, tmp_path):
    (folder / "deep" / "oven.xml").unlink()
    (folder / "deep" / "oven.expected.json").unlink()
    with serve(Chat) as server:
        server.script[:] = [completion(json.dumps(answers("refrigerator")[0]))]
        evaluate(
            "proposer", folder, tmp_path / "o", proposer="openai", vlm="q", rounds=1,
            base_url=f"{server.url}/v1",
        )  # fmt: skip
    assert "# The user's wish\n\n(none)" in words(server.requests[0])


@pytest.mark.long
def test_interrupted_it_goes_on_and_pays_for_nothing_twice(folder, tmp_path):
    first = Recorded(stop="refrigerator")
    with pytest.raises(KeyboardInterrupt):
        evaluate("proposer", folder, tmp_path / "o", proposer=first, rounds=2)
    (kept,) = Evaluation.read(tmp_path / "o" / "evaluation.json").joints
    again = Recorded()
    result = evaluate("proposer", folder, tmp_path / "o", proposer=again, rounds=2, resume=True)
    assert set(again.asked) == {"refrigerator"} and result.joints[0] == kept
    assert len(result.joints) == 2
    # another expectation of what is done is judged anew, without asking
    changed = {"joints": {"door": {"opens": "-"}}}
    (folder / "deep" / "oven.expected.json").write_text(json.dumps(changed))
    silent = Recorded()
    result = evaluate("proposer", folder, tmp_path / "o", proposer=silent, rounds=2, resume=True)
    (oven,) = [one for one in result.joints if one.label == "deep/oven/door"]
    assert not silent.asked
    assert oven.behaviours["opens towards -q"] == "It opens towards -q: no, towards +q."


def test_the_command_prints_a_table_and_json(folder, tmp_path, joda):
    options = (folder, "--proposer", "offline", "--rounds", 1, "-o", tmp_path / "o")
    status, out, err = joda(*options)
    assert (status, err) == (0, "")
    assert "offline, 2 joints" in out and "deep/oven/door: It clicks into 5 positions: no," in out
    status, out, err = joda(*options, "--resume", "--json")
    told = json.loads(out)
    assert (status, err, told["proposer"], told["of"]) == (0, "", "offline", 7)
    assert told["met"] == sum(row["met"] for row in told["joints"])
    assert joda(*options)[2].endswith("add --force or go on with --resume.\n")
    status, _, err = joda(*options, "--rounds", 2, "--resume")
    assert status == 2 and "is of offline with --rounds 1 and no --effort; go on with" in err


@pytest.mark.long
def test_failures_are_rows_and_the_rest_is_not_asked_for_ever(folder, tmp_path, joda, monkeypatch):
    monkeypatch.setattr(openai._base_client, "INITIAL_RETRY_DELAY", 0.001)
    for name in ("b", "c"):
        for ending in (".xml", ".expected.json"):
            shutil.copy(folder / f"refrigerator{ending}", folder / f"{name}{ending}")
    with serve(Chat) as server:
        options = (folder, "--proposer", "openai", "--vlm", "q", "--base-url", f"{server.url}/v1",
                   "--rounds", 1, "-o", tmp_path / "o")  # fmt: skip
        server.script[:] = [refusal(403, "No.")]
        status, out, err = joda(*options)
        assert status == 2 and "3 joints in a row got no proposal, the rest is not asked" in err
        assert "Asked 3 times: " in out
        assert "(403: No)" in err and len(server.requests) == 3
        kept = Evaluation.read(tmp_path / "o" / "evaluation.json")
        assert [(one.met, one.rounds, one.usage.requests) for one in kept.joints] == [(0, 0, 1)] * 3
        assert all(one.failed for one in kept.joints)
        good = completion(json.dumps(answers("refrigerator")[0]))
        server.script[:] = [good, good, refusal(403, "No."), good]
        status, out, err = joda(*options, "--resume")
    assert status == 2 and "1 of 4 joints have no whole answer; see above." in err
    assert "openai:q, 4 joints" in out and "(403: No)" in out


@pytest.mark.parametrize(
    "text,says",
    [
        ("{", "not JSON"),
        ("{}", "joints"),
        ('{"joints": {}}', "at least 1"),
        ('{"joints": {"door": {"behaviours": ["sings"]}}}', "'sings' is not one behaviour; give"),
        ('{"joints": {"door": {"opens": "up"}}}', "opens"),
        ('{"joints": {"dor": {}}}', "joint 'dor' not found; hinges and slides of the model"),
        ('{"joints": {"door": {"wants": 1}}}', "wants"),
    ],
)
def test_wrong_expectations_are_said_before_anything_is_made(folder, tmp_path, joda, text, says):
    (folder / "refrigerator.expected.json").write_text(text)
    status, out, err = joda(folder, "--proposer", "offline", "-o", tmp_path / "o")
    assert (status, out) == (2, "") and says in err and "refrigerator.expected.json" in err
    assert not (tmp_path / "o").exists()


def test_mistakes_are_sentences(folder, tmp_path, joda):
    (folder / "refrigerator.xml").unlink()
    assert "no model of that name beside it" in joda(folder, "--proposer", "offline")[2]
    assert "holds no MODEL.expected.json" in joda(tmp_path / "models" / "deep" / "..", "-o",
                                                  folder, "--force")[2]  # fmt: skip
    assert "no such folder" in joda(tmp_path / "none", "--proposer", "offline")[2]
    assert "Give its folder with -o" in joda(folder, "--resume")[2]
    with pytest.raises(JodaError, match="'template' cannot be evaluated; proposer can"):
        evaluate("template", folder)


@pytest.mark.parametrize("path", sorted(MODELS.glob("*.expected.json")), ids=lambda p: p.stem)
def test_our_own_expectations_obey_the_schema(path):
    jsonschema.validate(json.loads(path.read_text()), schema("expected"))
