"""The main job: what it leaves, that it can be repeated and interrupted, how it fails."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import anthropic
import mujoco
import numpy as np
import pytest
from messages_server import error, message, serve
from test_prompts import answers, blank, images, texts

from joda import JodaError, generate
from joda.cli import main
from joda.pictures.offscreen import NoRenderer
from joda.profile import Profile
from joda.proposal import Proposal
from joda.propose import Answer, Usage
from joda.propose.anthropic import ProposalFailed
from joda.propose.history import History
from joda.propose.offline import Offline

MODELS = Path(__file__).parents[1] / "models"
OVEN = MODELS / "oven.xml"
FILES = {
    *("context.json", "pictures", "proposal.json", "composed.json", "profile.png", "scene.xml"),
    "history.json",
}
RESULTS = ("proposal.json", "composed.json", "scene.xml")
TEMPLATE = {
    "name": "squeak",
    "description": "A resistance that grows towards the high end.",
    "placement": "Anywhere.",
    "channels": {"friction": {"x": [0, 1], "y": [0.5, 1]}},
}


@pytest.fixture(autouse=True)
def without_a_key(monkeypatch):
    """No key and no model of the user's own."""
    for name in ("ANTHROPIC_API_KEY", "ANTHROPIC_BASE_URL", "JODA_VLM", "JODA_VLM_PRICE"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(name="quick")
def without_rendering(monkeypatch):
    """Pictures without rendering; returns the list of those asked for."""
    asked = []

    def render(model, joint, output, *, count, size, force):
        asked.append(joint)
        Path(output).mkdir(exist_ok=True)
        paths = [Path(output) / f"picture_{k}.png" for k in range(count)]
        for k, path in enumerate(paths):
            path.write_bytes(blank(64, 48, (40 * k, 0, 0)))
        return paths

    monkeypatch.setattr("joda.propose.session.render", render)
    return asked


@pytest.fixture(name="server")
def service(monkeypatch):
    """The Messages API on loopback, found through the environment."""
    monkeypatch.setattr(anthropic._base_client, "INITIAL_RETRY_DELAY", 0.001)
    with serve() as state:
        monkeypatch.setenv("ANTHROPIC_API_KEY", "sk-test")
        monkeypatch.setenv("ANTHROPIC_BASE_URL", state.url)
        monkeypatch.setenv("NO_PROXY", "127.0.0.1")
        monkeypatch.setenv("JODA_POLL_S", "0.001")
        monkeypatch.setenv("JODA_VLM", "claude-sonnet-5-5")
        yield state


@pytest.fixture(name="joda")
def command_line(monkeypatch, capsys):
    """The command line in this process: exit status, stdout, stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["joda", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        said = capsys.readouterr()
        assert "Traceback" not in said.err
        return end.value.code, said.out, said.err

    return run


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """An offline generation of the oven, from a copy of its own."""
    folder = tmp_path_factory.mktemp("made")
    shutil.copy(OVEN, folder / "oven.xml")
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("ANTHROPIC_API_KEY", raising=False)
        return generate(folder / "oven.xml", "door", folder / "out")


def reply(name="refrigerator", number=0, **usage):
    return message(json.dumps(answers(name)[number]), **usage)


def content(folder, names=RESULTS):
    return {name: (folder / name).read_bytes() for name in names}


def whole(folder):
    """The history, which is always whole."""
    return History.read(folder / "history.json")


@pytest.mark.slow
def test_it_leaves_exactly_its_files(made):
    assert {path.name for path in made.folder.iterdir()} == FILES
    pictures = sorted(path.name for path in (made.folder / "pictures").iterdir())
    assert pictures == [f"door_{s}.png" for s in ("0.00", "0.25", "0.50", "0.75", "1.00")]
    assert whole(made.folder) == made.history
    assert made.history.complete and 1 < len(made.history.rounds) <= 3
    last = made.history.rounds[-1]
    assert Proposal.read(made.folder / "proposal.json") == last.proposal and not last.unmet


def test_the_scene_behaves_as_composed_in_plain_mujoco(made):
    code = """
import mujoco, sys
model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
lo, hi = model.joint("door").range
for start in (0.03, 0.5):
    mujoco.mj_resetData(model, data)
    data.joint("door").qpos = lo + start * (hi - lo)
    while data.time < 8:
        mujoco.mj_step(model, data)
    print((data.joint("door").qpos[0] - lo) / (hi - lo))
"""
    scene = made.folder / "scene.xml"
    run = subprocess.run([sys.executable, "-c", code, scene], capture_output=True, text=True)
    closed, half = map(float, run.stdout.split())
    assert abs(closed) < 0.005, "let go nearly closed it closes"
    assert half == pytest.approx(0.5, abs=0.01), "half-way open it stays"
    plain = mujoco.MjModel.from_xml_path(str(OVEN))
    data = mujoco.MjData(plain)
    data.joint("door").qpos = 0.05
    mujoco.mj_step(plain, data, 4000)
    assert data.joint("door").qpos[0] > 1, "without a profile it falls open"


def test_compiling_what_it_left_gives_the_same_bytes(made, joda, tmp_path):
    target = tmp_path / "again.json"
    status, _, _ = joda(
        "compile", made.folder / "proposal.json", "--model", OVEN, "--joint", "door", "-o", target
    )
    assert status == 0
    assert target.read_bytes() == (made.folder / "composed.json").read_bytes()


def test_it_can_be_repeated_anywhere_under_any_name(made, quick, tmp_path, monkeypatch):
    place = tmp_path / "elsewhere"
    place.mkdir()
    shutil.copy(OVEN, place / "kitchen.xml")
    monkeypatch.chdir(place)
    again = generate("kitchen.xml", "door", "out")
    assert content(again.folder) == content(made.folder)
    assert whole(again.folder).rounds == made.history.rounds


def test_it_overwrites_only_when_told_to(made, joda, quick):
    model, folder = made.folder.parent / "oven.xml", made.folder.parent / "copy"
    shutil.copytree(made.folder, folder)
    before = content(folder, FILES - {"pictures"})
    status, out, err = joda("generate", model, "--joint", "door", "-o", folder)
    assert (status, out) == (2, "") and err.count("\n") == 1
    assert "exists already; choose another folder with -o, add --force or go on" in err
    assert content(folder, FILES - {"pictures"}) == before
    (folder / "composed.json").write_text("{}")
    assert joda("generate", model, "--joint", "door", "-o", folder, "--force")[0] == 0
    assert content(folder) == {name: before[name] for name in RESULTS}


def test_without_a_renderer_it_goes_by_the_text(made, tmp_path, monkeypatch):
    def nothing(*arguments, **options):
        raise NoRenderer

    monkeypatch.setattr("joda.propose.session.render", nothing)
    blind = generate(OVEN, "door", tmp_path / "out")
    assert {path.name for path in blind.folder.iterdir()} == FILES - {"pictures"}
    assert content(blind.folder, RESULTS[:2]) == content(made.folder, RESULTS[:2])
    assert any("No pictures" in note and "nothing can render" in note for note in blind.notes)


def test_a_joint_that_moves_nothing_visible_goes_by_the_text(joda, tmp_path):
    (tmp_path / "m.xml").write_text(
        """<mujoco><worldbody><geom size=".1"/><body>
        <joint name="door" range="0 90"/><inertial pos=".3 0 0" mass="1" diaginertia=".1 .1 .1"/>
        </body></worldbody></mujoco>"""
    )
    status, out, _ = joda("generate", tmp_path / "m.xml", "--joint", "door", "-o", tmp_path / "out")
    assert status == 0
    assert "No pictures, the proposer goes by the text" in out and "moves no geom" in out


def test_a_joint_that_moves_nothing_but_an_inertia_goes_by_the_text(tmp_path):
    (tmp_path / "m.xml").write_text(
        """<mujoco><worldbody><body><joint name="door" range="0 90"/>
        <inertial pos="0 0 0" mass="1" diaginertia=".1 .1 .1"/></body></worldbody></mujoco>"""
    )
    made = generate(tmp_path / "m.xml", "door", tmp_path / "out")
    assert not made.history.rounds[-1].unmet
    assert any(note.startswith("No pictures") for note in made.notes)


def test_rounds_limit_the_proposals(made, quick, tmp_path):
    first = generate(OVEN, "door", tmp_path / "out", rounds=1)
    assert first.history.rounds == made.history.rounds[:1] and not first.history.complete
    more = generate(OVEN, "door", tmp_path / "out", resume=True)
    assert more.history.rounds == made.history.rounds
    assert content(more.folder, RESULTS[:2]) == content(made.folder, RESULTS[:2])
    assert quick == ["door"], "pictured once"


def test_a_door_that_closes_from_an_angle_does_so_in_its_scene(quick, tmp_path):
    said = "It closes by itself from about 40 degrees on."
    out = generate(MODELS / "refrigerator.xml", "door", tmp_path / "out", describe=said)
    assert out.history.complete and not out.history.rounds[-1].unmet
    model = mujoco.MjModel.from_xml_path(str(out.folder / "scene.xml"))
    for degrees, shuts in ((30, True), (50, False)):
        data = mujoco.MjData(model)
        data.joint("door").qpos = np.radians(degrees)
        while data.time < 8:
            mujoco.mj_step(model, data)
        assert (abs(np.degrees(data.joint("door").qpos[0])) < 1) == shuts


def test_a_file_is_taken_as_it_is(made, quick, joda, tmp_path):
    given = made.folder / "proposal.json"
    status, out, _ = joda(
        "generate", OVEN, "--joint", "door", "-o", tmp_path / "out", "--proposer", given
    )
    assert status == 0 and f"file:{given}" in out
    assert content(tmp_path / "out", RESULTS[:2]) == content(made.folder, RESULTS[:2])
    assert whole(tmp_path / "out").complete
    by_path = generate(OVEN, "door", tmp_path / "path", proposer=given)
    assert len(by_path.history.rounds) == 1


def proposal_file(tmp_path, **changed):
    value = answers("oven")[0]["proposal"]
    value["effect_proposals"][0].update(changed)
    (tmp_path / "p.json").write_text(json.dumps(value))
    return tmp_path / "p.json"


@pytest.mark.parametrize(
    "joint,more,says",
    [
        ("dor", (), "joint 'dor' not found; hinges and slides of the model: 'door'."),
        (
            "door",
            ("--proposer", "gpt"),
            "gpt: no such proposer or file; give anthropic, openai, offline",
        ),
        ("door", ("--proposer", "anthropic"), "ANTHROPIC_API_KEY is not set"),
        ("door", ("--proposer", "BAD"), "effect_proposals[0].start_ratio: "),
        ("door", ("--templates", "no"), "no: no such folder of templates."),
        ("door", ("--rounds", "0"), "--rounds"),
    ],
)
def test_a_mistake_is_one_sentence_and_leaves_nothing(joda, tmp_path, joint, more, says):
    bad = str(proposal_file(tmp_path, start_ratio=-1))
    more = [bad if word == "BAD" else word for word in more]
    status, out, err = joda("generate", OVEN, "--joint", joint, "-o", tmp_path / "out", *more)
    assert (status, out) == (2, "") and says in err
    assert err.startswith("joda: ") and err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_an_unknown_effect_in_a_file_is_one_sentence_and_can_be_mended(joda, quick, tmp_path):
    bad = proposal_file(tmp_path, effect_name="flux_capacitor")
    command = ("generate", OVEN, "--joint", "door", "-o", tmp_path / "out", "--proposer", bad)
    status, _, err = joda(*command)
    assert status == 2 and "effect 'flux_capacitor' is not in the library; there are: b" in err
    assert err.startswith(f"joda: {bad}: ") and not (tmp_path / "out").exists()
    proposal_file(tmp_path)
    assert joda(*command)[0] == 0


def test_the_only_joint_needs_no_name(quick, tmp_path, joda):
    assert joda("generate", OVEN, "-o", tmp_path / "out", "--rounds", "1")[0] == 0
    assert whole(tmp_path / "out").joint == "door"
    (tmp_path / "two.xml").write_text(
        '<mujoco><worldbody><body><joint name="a" range="0 9"/><joint name="b" range="0 9" '
        'axis="1 0 0"/><geom size=".1"/></body></worldbody></mujoco>'
    )
    with pytest.raises(JodaError, match="choose a joint with --joint: 'a', 'b'"):
        generate(tmp_path / "two.xml", None, tmp_path / "two")


def interrupt(*arguments, **options):
    raise KeyboardInterrupt


class Scripted:
    """Offline, but for what the script says: an exception is raised, an answer given."""

    name = "scripted"

    def __init__(self, *script):
        self.script = list(script)

    def propose(self, task, turns):
        entry = self.script.pop(0) if self.script else None
        if isinstance(entry, BaseException):
            raise entry
        return entry or Offline().propose(task, turns)


def test_a_users_template_is_used_and_survives_a_resume(quick, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "squeak.json").write_text(json.dumps(TEMPLATE))
    weak = {"conservative": "none", "friction": "weak", "damping": "none"}
    path = proposal_file(tmp_path, effect_name="squeak", start_ratio=0.5, strength=weak)
    given = Proposal.read(path)
    given = given.model_copy(update={"effect_proposals": given.effect_proposals[:1]})
    proposer = Scripted(Answer(given), KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        generate(OVEN, "door", tmp_path / "out", proposer=proposer, templates=[tmp_path / "mine"])
    more = generate(OVEN, "door", tmp_path / "out", proposer=Scripted(Answer(None)), resume=True)
    assert more.history.complete and more.history.templates == ("../mine",)
    (part,) = Profile.read(tmp_path / "out" / "composed.json").channels.friction.components
    assert part.label == "squeak" and part.y[0] == pytest.approx(part.y[1] / 2, rel=1e-5)


def test_interrupted_and_resumed_it_gives_the_same_bytes(made, quick, tmp_path):
    first = Answer(made.history.rounds[0].proposal)
    with pytest.raises(KeyboardInterrupt):
        generate(OVEN, "door", tmp_path / "out", proposer=Scripted(first, KeyboardInterrupt()))
    assert len(whole(tmp_path / "out").rounds) == 1
    more = generate(OVEN, "door", tmp_path / "out", resume=True)
    assert content(more.folder, RESULTS[:2]) == content(made.folder, RESULTS[:2])
    assert [r.proposal for r in more.history.rounds] == [r.proposal for r in made.history.rounds]


@pytest.mark.slow
@pytest.mark.parametrize("step", ["behaviour", "draw", "attach", "write_bytes", "write_text"])
def test_interrupted_at_any_step_it_can_be_resumed(made, quick, tmp_path, monkeypatch, step):
    """In the second round, wherever the interruption falls; what it cost is kept."""
    import joda.propose.session as module

    real, spent = getattr(module, step), Usage(requests=1, input_tokens=7)
    rounds = [Answer(round.proposal, spent) for round in made.history.rounds]

    class Stopping(Scripted):
        def propose(self, task, turns):
            if turns:
                monkeypatch.setattr(module, step, interrupt)
            return super().propose(task, turns)

    with pytest.raises(KeyboardInterrupt):
        generate(OVEN, "door", tmp_path / "out", proposer=Stopping(*rounds))
    monkeypatch.setattr(module, step, real)
    kept = whole(tmp_path / "out")
    if step != "write_text":  # of the history itself
        assert kept.usage.requests == 2 and kept.usage.input_tokens == 14
    left = [Answer(None)] if len(kept.rounds) == 2 else [rounds[1], Answer(None)]
    more = generate(OVEN, "door", tmp_path / "out", proposer=Scripted(*left), resume=True)
    assert content(more.folder, RESULTS[:2]) == content(made.folder, RESULTS[:2])
    assert {path.name for path in more.folder.iterdir()} == FILES


def test_interrupted_while_picturing_it_can_be_begun_again(quick, tmp_path, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr("joda.propose.session.render", interrupt)
        with pytest.raises(KeyboardInterrupt):
            generate(OVEN, "door", tmp_path / "out")
    generate(OVEN, "door", tmp_path / "out", rounds=1)
    assert len(whole(tmp_path / "out").pictures) == 5


def test_what_an_earlier_generation_left_is_no_edit(quick, tmp_path, monkeypatch):
    generate(OVEN, "door", tmp_path / "out", rounds=1, key="old")
    old = (tmp_path / "out" / "composed.json").read_bytes()
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("joda.propose.session.attach", interrupt)
        generate(OVEN, "door", tmp_path / "out", rounds=1, force=True)
    generate(OVEN, "door", tmp_path / "out", rounds=1, resume=True)
    assert (tmp_path / "out" / "composed.json").read_bytes() != old


def test_a_model_that_was_moved_is_one_sentence(quick, tmp_path, joda):
    shutil.copy(OVEN, tmp_path)
    generate(tmp_path / "oven.xml", "door", tmp_path / "out", rounds=1)
    (tmp_path / "oven.xml").unlink()
    status, _, err = joda("revise", tmp_path / "out", "--feedback", "too weak")
    assert status == 2 and err.count("\n") == 1
    assert "history.json: model: there is no " in err and "put it back" in err


def test_what_a_failure_cost_is_kept_and_counted(quick, tmp_path):
    failed = ProposalFailed("no.", Usage(requests=2, input_tokens=500, dollars=0.01))
    with pytest.raises(ProposalFailed, match=r"^no\.$") as error:
        generate(OVEN, "door", tmp_path / "out", proposer=Scripted(failed))
    assert error.value.usage == failed.usage
    kept = whole(tmp_path / "out")
    assert [(f.reason, f.usage.requests) for f in kept.failures] == [("no.", 2)]
    assert kept.usage.input_tokens == 500 and kept.usage.dollars == 0.01
    with pytest.raises(JodaError, match="go on with --resume"):
        generate(OVEN, "door", tmp_path / "out")
    more = generate(OVEN, "door", tmp_path / "out", resume=True)
    assert more.history.usage.requests == 2 and more.history.rounds


def test_what_an_answer_cost_that_does_not_compile_is_kept(quick, tmp_path):
    bad = Proposal.read(proposal_file(tmp_path, effect_name="flux_capacitor"))
    answer = Answer(bad, Usage(requests=1, input_tokens=10))
    with pytest.raises(JodaError, match="flux_capacitor"):
        generate(OVEN, "door", tmp_path / "out", proposer=Scripted(answer))
    assert whole(tmp_path / "out").usage.input_tokens == 10


def test_a_proposer_with_nothing_to_say_at_first_is_one_sentence(quick, tmp_path):
    with pytest.raises(JodaError, match="scripted has nothing to propose"):
        generate(OVEN, "door", tmp_path / "out", proposer=Scripted(Answer(None)))


@pytest.mark.parametrize(
    "changed,says",
    [
        ({"joint": "rocker", "model": MODELS / "switch.xml"}, "holds joint 'door' of"),
        ({"describe": "it latches"}, "another --describe"),
        ({"key": "b"}, "another --key"),
        ({"templates": [MODELS]}, "another --templates"),
    ],
)
def test_a_resume_with_other_options_is_refused(quick, tmp_path, changed, says):
    call = {"model": OVEN, "joint": "door", "output": tmp_path / "out", "rounds": 1}
    generate(**call, key="a")
    with pytest.raises(JodaError, match=says):
        generate(**(call | changed), resume=True)
    assert generate(**(call | {"joint": "#0"}), resume=True).history.key == "a"


def test_a_resume_keeps_the_key(quick, tmp_path):
    whole_run = generate(OVEN, "door", tmp_path / "one", key="other")
    generate(OVEN, "door", tmp_path / "two", key="other", rounds=1)
    generate(OVEN, "door", tmp_path / "two", resume=True)
    assert content(tmp_path / "two", RESULTS[:2]) == content(whole_run.folder, RESULTS[:2])


def test_a_resume_does_not_lose_an_edit(made, quick, tmp_path):
    generate(OVEN, "door", tmp_path / "out", rounds=1)
    composed = tmp_path / "out" / "composed.json"
    edited = composed.read_text() + "\n"
    composed.write_text(edited)
    with pytest.raises(JodaError, match=r"composed.json: was edited .* add --force"):
        generate(OVEN, "door", tmp_path / "out", resume=True)
    assert composed.read_text() == edited
    generate(OVEN, "door", tmp_path / "out", resume=True, force=True)
    assert content(tmp_path / "out", RESULTS[:2]) == content(made.folder, RESULTS[:2])


FRIDGE = ("generate", MODELS / "refrigerator.xml", "--joint", "door")


def test_a_model_is_asked_in_rounds_through_the_command_line(joda, quick, server, tmp_path):
    slow_down = error(429, "rate_limit_error", "Slow down", retry_after_ms=1)
    server.script[:] = [slow_down, reply(), reply(number=1), reply(number=2)]
    status, out, err = joda(*FRIDGE, "-o", tmp_path / "out", "--describe", "its seal pulls it shut")
    assert (status, err) == (0, "")
    first, again, second, third = server.requests
    assert first == again and "its seal pulls it shut" in texts(first)
    assert len(images(first)) == 6 and len(images(second)) == 7  # the sheet and 5, the profile
    history = whole(tmp_path / "out")
    assert history.rounds[0].facts in texts(second) and history.rounds[1].facts in texts(third)
    assert history.complete and [r.usage.requests for r in history.rounds] == [2, 2]
    assert "Asked 4 times: 3000 tokens in (0 from the cache), 600 out, 0.012 dollars." in out
    composed = Profile.read(tmp_path / "out" / "composed.json")
    proposal = Proposal.model_validate(answers("refrigerator")[1]["proposal"])
    assert Proposal.read(tmp_path / "out" / "proposal.json") == proposal
    assert composed.joint.name == "door"


def test_json_is_the_history(joda, quick, server, tmp_path):
    server.script[:] = [reply()]
    status, out, _ = joda(*FRIDGE, "-o", tmp_path / "out", "--rounds", "1", "--json")
    assert status == 0
    assert json.loads(out)["rounds"][0]["usage"]["input_tokens"] == 1000


def test_after_a_refusal_it_can_be_resumed(joda, quick, server, tmp_path):
    server.script[:] = [reply(), message("", "refusal")]
    status, _, err = joda(*FRIDGE, "-o", tmp_path / "out")
    assert status == 2 and "declined to answer" in err and err.count("\n") == 1
    kept = whole(tmp_path / "out")
    assert len(kept.rounds) == len(kept.failures) == 1 and kept.usage.requests == 2
    server.script[:] = [reply(number=1), reply(number=2)]
    status, out, _ = joda(*FRIDGE, "-o", tmp_path / "out", "--resume")
    assert status == 0 and "Asked 4 times" in out
    assert server.requests[-2] == server.requests[1], "the same question as before"
    assert whole(tmp_path / "out").complete


@pytest.mark.slow
def test_ctrl_c_stops_at_once_and_it_can_be_resumed(joda, server, tmp_path):
    server.script[:] = [reply(), "hang"]
    command = [sys.executable, "-c", "from joda.cli import main; main()", *map(str, FRIDGE)]
    running = subprocess.Popen(
        [*command, "-o", str(tmp_path / "out")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "MUJOCO_GL": "disabled"},
        # a runner in the background may have told its children to ignore Ctrl-C
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    deadline = time.monotonic() + 60
    while len(server.requests) < 2 and running.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    out, err = running.communicate(timeout=30)
    assert (
        running.returncode == 130
        and re.fullmatch(r"Estimate, .*\nAsked \d times: .*\n", out)
        and err in ("", "joda: interrupted.\n")
    )
    kept = whole(tmp_path / "out")
    assert len(kept.rounds) == 1 and not kept.complete and kept.pictures == ()
    assert [(f.reason, f.usage.requests) for f in kept.failures] == [("interrupted", 1)]
    server.script[:] = [reply(number=1), reply(number=2)]
    assert joda(*FRIDGE, "-o", tmp_path / "out", "--resume")[0] == 0
    assert whole(tmp_path / "out").complete
    assert len(images(server.requests[-1])) == 2, "without pictures as it was begun"


def test_the_behaviour_in_the_history_is_that_of_the_scene(made):
    """What the history says of the last round, seen again by letting the scene's door go."""
    model = mujoco.MjModel.from_xml_path(str(made.folder / "scene.xml"))
    data = mujoco.MjData(model)
    lo, hi = model.joint("door").range
    for stretch in made.history.rounds[-1].behaviour.let_go:
        middle = float(np.mean(stretch.start))
        mujoco.mj_resetData(model, data)
        data.joint("door").qpos = lo + middle * (hi - lo)
        while data.time < 10:
            mujoco.mj_step(model, data)
        s = (data.joint("door").qpos[0] - lo) / (hi - lo)
        wanted = {"low_end": 0.0, "high_end": 1.0, "stays": middle}[stretch.goes]
        assert s == pytest.approx(wanted, abs=0.02)
