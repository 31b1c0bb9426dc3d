"""A folder of models: every joint has its profile or its reason, interrupted or not."""

import json
import shutil
from pathlib import Path

import mujoco
import pytest
from assets import SHARED
from messages_server import error, message
from test_generate import (  # noqa: F401
    MODELS,
    command_line,
    reply,
    service,
    whole,
    without_a_key,
    without_rendering,
)
from test_prompts import answers, texts

from joda import JodaError, generate, generate_all
from joda.proposal import Proposal
from joda.propose import session
from joda.propose.generation import Generated
from joda.propose.joints import PassedOver
from joda.propose.offline import Offline
from joda.terminal.rounds import saying_cost

pytestmark = pytest.mark.usefixtures("quick")

PART = '<mujoco><worldbody><geom class="theirs" size=".1"/></worldbody></mujoco>'  # not by itself
TWO = """<mujoco><default><default class="theirs"/></default>
  <include file="part.xml"/><worldbody>
  <body name="cup"><joint name="left/door" range="0 90"/><geom size=".1"/></body>
  <body name="jug"><joint name="left_door" range="0 90"/><geom size=".1"/></body>
  <body name="cap"><joint name=".." range="0 90"/><geom size=".1"/></body>
  <body name="free"><freejoint/><geom size=".1"/></body>
  <body name="wheel"><joint name="endless"/><geom size=".1"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def models(tmp_path):
    """Two hinges and a slide, one of them deeper in the folder."""
    folder = tmp_path / "models"
    (folder / "kitchen").mkdir(parents=True)
    shutil.copy(MODELS / "refrigerator.xml", folder)
    shutil.copy(MODELS / "drawer.xml", folder / "kitchen")
    shutil.copy(MODELS / "oven.xml", folder / "kitchen")
    return folder


NAMES = ["kitchen/drawer/drawer", "kitchen/oven/door", "refrigerator/door"]


def answered(entry, refused_from=3):
    """Of the joint that is asked for: a proposal in round one, complete in round two; of the drawer
    a refusal from some round on."""
    later = len(entry["params"]["messages"]) > 1
    if 1 + later >= refused_from and "drawer, a slide" in texts(entry["params"]):
        return {"type": "errored", "error": error(400, "invalid_request_error", "Bad.")["body"]}
    if later:
        return {"type": "succeeded", "message": reply("oven", 1)}
    name = "oven" if "oven" in texts(entry["params"]).split("# The joint")[1] else "refrigerator"
    answer = answers(name)[0]
    if "drawer, a slide" in texts(entry["params"]):
        answer["proposal"]["joint_summary"]["joint_type"] = "prismatic"
    return {"type": "succeeded", "message": message(json.dumps(answer))}


def test_every_joint_is_as_if_generated_alone(models, tmp_path):
    done = generate_all(models, tmp_path / "out")
    assert list(done) == NAMES
    by_itself = generate(models / "kitchen" / "oven.xml", "door", tmp_path / "single")
    made = done["kitchen/oven/door"]
    assert made.folder == tmp_path / "out" / "kitchen" / "oven" / "door"
    for name in ("proposal.json", "composed.json"):
        assert (made.folder / name).read_bytes() == (by_itself.folder / name).read_bytes()
    for each in done.values():
        mujoco.MjModel.from_xml_path(str(each.folder / "scene.xml"))


def test_the_command_tells_a_line_per_joint(joda, models, tmp_path):
    (models / "broken.xml").write_text("<mujoco><worldbody><body></worldbody></mujoco>")
    (models / "notes.xml").write_text("<notes>no model</notes>")
    status, out, err = joda("generate", models, "-o", tmp_path / "out", "--rounds", "1")
    assert status == 2 and err.count("\n") == 1
    assert err.startswith("joda: 1 of 4 have no profile")
    lines = out.splitlines()
    assert lines[-1] == f"Contact sheet: {tmp_path / 'out' / 'sheet.html'}"
    assert "behaviours come true" in lines[-2]
    assert len(lines) == 6 and all(any(line.startswith(n) for line in lines) for n in NAMES)
    assert next(line for line in lines if line.startswith("broken: ")).count("broken.xml") == 1


def test_a_joint_without_a_range_is_told_and_is_no_failure(joda, tmp_path):
    rotor = '<body name="rotor"><joint name="spin"/><geom size=".1"/></body>'
    (tmp_path / "fans").mkdir()
    (tmp_path / "fans" / "fan.xml").write_text(f"<mujoco><worldbody>{rotor}</worldbody></mujoco>")
    shutil.copy(MODELS / "drawer.xml", tmp_path / "fans")
    told = ("generate", tmp_path / "fans", "-o", tmp_path / "out", "--rounds", "1")
    status, out, err = joda(*told)
    assert (status, err) == (0, "")
    assert "fan/spin: passed over, as it has no range, over which a profile is: if it is" in out
    assert "\n1 joint has no range and no profile.\n" in out
    page = (tmp_path / "out" / "sheet.html").read_text()
    assert "fan/spin" in page and "1 without a profile" in page
    status, out, _ = joda(*told, "--resume", "--json")
    assert status == 0 and "passed over" in json.loads(out)["fan/spin"]["error"]
    (tmp_path / "fans" / "drawer.xml").unlink()
    status, out, err = joda("generate", tmp_path / "fans", "-o", tmp_path / "only")
    assert (status, err) == (0, "") and "1 joint has no range and no profile." in out
    assert "fan/spin" in (tmp_path / "only" / "sheet.html").read_text()
    (tmp_path / "fans" / "fan.xml").write_text("<mujoco/>")
    with pytest.raises(JodaError, match="holds no model with a hinge or slide that has a range"):
        generate_all(tmp_path / "fans", tmp_path / "none")


def test_a_joint_whose_later_round_came_to_nothing_keeps_its_profile(
    server, models, tmp_path, joda
):
    server.results = lambda entry: answered(entry, refused_from=2)
    status, out, err = joda("generate", models, "-o", tmp_path / "out")
    assert status == 2 and "1 of 3 stopped early and go on with --resume; see above." in err
    assert "Round 2 came to nothing: the service refuses the request (Bad)." in out
    assert "kitchen/drawer/drawer: " in out and "0 of 0 behaviours" not in out
    assert "Asked 6 times: " in out
    assert "came to nothing" in (tmp_path / "out" / "sheet.html").read_text()
    server.results = answered
    status, _, err = joda("generate", models, "-o", tmp_path / "out", "--resume")
    assert (status, err) == (0, "")


def test_what_was_asked_is_told_where_the_user_breaks_off(server, models, tmp_path, capsys):
    server.results = answered
    done = generate_all(models, tmp_path / "out")
    spent = sum(one.history.usage.requests for one in done.values())
    with pytest.raises(KeyboardInterrupt), saying_cost(tmp_path / "out", as_json=False):
        raise KeyboardInterrupt
    assert f"Asked {spent} times: " in capsys.readouterr().out


def test_a_complete_folder_that_is_resumed_has_the_same_sheet(tmp_path):
    robot = """<robot name="box"><link name="base"><collision><geometry><box size=".4 .4 .4"/>
      </geometry></collision></link><link name="lid"><inertial><mass value="1"/>
      <inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial><collision>
      <origin xyz=".2 0 .01"/><geometry><box size=".4 .4 .02"/></geometry></collision></link>
      <joint name="hinge" type="revolute"><origin xyz="-.2 0 .21"/><axis xyz="0 -1 0"/>
      <parent link="base"/><child link="lid"/><limit lower="0" upper="1.5" effort="1"
      velocity="1"/></joint></robot>"""
    (tmp_path / "boxes").mkdir()
    (tmp_path / "boxes" / "box.urdf").write_text(robot)
    made = generate_all(tmp_path / "boxes", tmp_path / "out")["box/hinge"]
    assert any("was written out by MuJoCo first" in note for note in made.notes)
    page = (tmp_path / "out" / "sheet.html").read_bytes()
    assert generate_all(tmp_path / "boxes", tmp_path / "out", resume=True)["box/hinge"] == made
    assert (tmp_path / "out" / "sheet.html").read_bytes() == page


def test_json_has_a_history_per_joint(joda, models, tmp_path):
    only = ("--joint", "drawer", "--rounds", "1", "--json")
    status, out, _ = joda("generate", models, "-o", tmp_path / "out", *only)
    assert status == 0
    assert list(json.loads(out)) == NAMES[:1]


def test_one_failing_joint_does_not_spoil_the_others(models, tmp_path):
    class Picky(Offline):
        def propose(self, task, turns):
            if task.context.joint.name == "drawer":
                raise JodaError("no drawers.")
            return super().propose(task, turns)

    done = generate_all(models, tmp_path / "out", proposer=Picky(), rounds=1)
    assert isinstance(done[NAMES[0]], JodaError) and str(done[NAMES[0]]) == "no drawers."
    assert all(isinstance(done[name], Generated) for name in NAMES[1:])
    again = generate_all(models, tmp_path / "out", rounds=1, resume=True)
    assert all(isinstance(each, Generated) for each in again.values())


def test_joints_get_folders_of_their_own_within_the_output(tmp_path):
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "two.xml").write_text(TWO)
    (tmp_path / "models" / "part.xml").write_text(PART)
    (tmp_path / "models" / "two.urdf").write_text(
        '<robot name="r"><link name="a"/><link name="b"><inertial><origin xyz="1 0 0"/>'
        '<mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        "</inertial></link>"
        '<joint name="j" type="revolute"><parent link="a"/><child link="b"/>'
        '<axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    target = tmp_path / "models" / "out"
    done = generate_all(tmp_path / "models", target, rounds=1)
    names = done.keys()
    assert isinstance(done["two_2/endless"], PassedOver)
    done = {label: each for label, each in done.items() if label != "two_2/endless"}
    assert all(isinstance(each, Generated) for each in done.values()), done
    folders = {label: each.folder.relative_to(target).as_posix() for label, each in done.items()}
    assert folders == {
        "two/j": "two/j",
        "two_2/left/door": "two_2/left_door",
        "two_2/left_door": "two_2/left_door_2",
        "two_2/..": "two_2/joint",
    }
    again = generate_all(tmp_path / "models", target, rounds=1, resume=True)
    assert again.keys() == names, "the scenes that were made are no models to do"


@pytest.mark.parametrize(
    "change,says",
    [
        ({"models": "none"}, "none: no such folder."),
        ({"models": "empty"}, "empty: holds no model with a hinge or slide that has a range"),
        ({"joint": "dor"}, "no model has a joint 'dor'; there are: 'door', 'drawer'."),
        ({"output": "file"}, "file: exists already"),
        ({"output": "models"}, "models: exists already"),
        ({"rounds": 0}, "rounds is 0"),
        ({"proposer": "gpt"}, "gpt: no such proposer or file"),
    ],
)
def test_mistakes_are_sentences(models, tmp_path, monkeypatch, change, says):
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    Path("file").write_text("mine")
    with pytest.raises(JodaError, match=says):
        generate_all(**({"models": "models", "output": "out"} | change))
    assert not Path("out").exists()


@pytest.mark.slow
def test_third_party_models_with_includes(tmp_path):
    folder = SHARED / "assets"
    if not folder.is_dir():
        pytest.skip("no assets beside the repository; JODA_SHARED says where they are")
    done = generate_all(folder, tmp_path / "out", rounds=1)
    assert not [f"{label}: {each}" for label, each in done.items() if isinstance(each, JodaError)]
    models = {label.split("/")[-2] for label in done}
    assert models == {"microwave", "wooden_cabinet", "calvin_table_D"}


@pytest.mark.slow
def test_rounds_of_all_joints_are_batches(server, models, tmp_path):
    server.results, server.looks = answered, 1
    told = []
    done = generate_all(models, tmp_path / "out", progress=lambda *each: told.append(each))
    assert [len(each) for each in server.batches] == [3, 3] and not server.requests
    for each in done.values():
        assert each.history.complete and len(each.history.rounds) == 1
        assert each.history.usage.requests == 2
    given = Proposal.model_validate(answers("oven")[0]["proposal"])
    assert Proposal.read(done["kitchen/oven/door"].folder / "proposal.json") == given
    assert not (tmp_path / "out" / "batch.json").exists()
    assert told[-1] == (3, 3, "done") and all(0 <= done <= total == 3 for done, total, _ in told)


@pytest.mark.slow
def test_interrupted_while_polling_it_goes_on_without_paying_twice(
    server,
    models,
    tmp_path,
    monkeypatch,
):
    server.results, server.looks = answered, 10**6

    def interrupt(done, total, what):
        if "0 of 3 answered" in what:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        generate_all(models, tmp_path / "out", progress=interrupt)
    assert len(server.batches) == 1 and (tmp_path / "out" / "batch.json").is_file()
    server.looks = 0
    done = generate_all(models, tmp_path / "out", resume=True)
    assert [len(each) for each in server.batches] == [3, 3]
    assert all(each.history.complete for each in done.values())


@pytest.mark.slow
@pytest.mark.parametrize("step", ["behaviour", "attach"])
def test_interrupted_while_answers_are_taken_it_goes_on_without_paying_twice(
    server, models, tmp_path, monkeypatch, step
):
    """At the second of three, before or after it is in the history."""
    server.results = answered
    real, calls = getattr(session, step), []

    def interrupt(*arguments, **options):
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return real(*arguments, **options)

    monkeypatch.setattr(session, step, interrupt)
    with pytest.raises(KeyboardInterrupt):
        generate_all(models, tmp_path / "out")
    histories = [whole(path.parent) for path in (tmp_path / "out").rglob("history.json")]
    assert sum(len(history.rounds) for history in histories) == {"behaviour": 1, "attach": 2}[step]
    done = generate_all(models, tmp_path / "out", resume=True)
    assert all(each.history.complete and len(each.history.rounds) == 1 for each in done.values())
    asked = [len(entry["params"]["messages"]) for batch in server.batches for entry in batch]
    assert asked.count(1) == 3, "the first round of each joint was asked for once"
    assert all(each.history.usage.requests == 2 for each in done.values())


@pytest.mark.slow
def test_a_service_that_stops_answering_is_a_sentence_and_it_goes_on(
    server,
    models,
    tmp_path,
    joda,
):
    server.results, server.deaf = answered, True
    status, out, err = joda("generate", models, "-o", tmp_path / "out")
    assert status == 2 and err.count("\n") == 1
    assert out.startswith("Estimate, joints: 3, with anthropic") and out.count("\n") == 1
    assert "batch.json: " in err and "cannot be reached, or breaks off; check the network" in err
    server.deaf = False
    done = generate_all(models, tmp_path / "out", resume=True)
    assert [len(each) for each in server.batches] == [3, 3]
    assert all(each.history.complete for each in done.values())


@pytest.mark.slow
def test_a_refusal_in_a_batch_is_that_joints(server, models, tmp_path, joda):
    server.results = lambda entry: answered(entry, refused_from=1)
    status, out, err = joda("generate", models, "-o", tmp_path / "out")
    assert status == 2 and "1 of 3 have no profile" in err
    assert "kitchen/drawer/drawer: the service refuses the request (Bad)." in out
    assert whole(tmp_path / "out" / "kitchen" / "drawer" / "drawer").usage.requests == 1
    spent = sum(whole(path.parent).usage.requests for path in tmp_path.rglob("history.json"))
    assert f"Asked {spent} times: " in out and spent == 5  # two joints twice, that one once
    assert whole(tmp_path / "out" / "refrigerator" / "door").complete
    server.results = answered
    status, _, err = joda("generate", models, "-o", tmp_path / "out", "--resume")
    assert (status, err) == (0, "")


def test_more_rounds_go_on_from_the_first(models, tmp_path):
    first = generate_all(models, tmp_path / "out", rounds=1)
    more = generate_all(models, tmp_path / "out", rounds=3, resume=True)
    for label in NAMES:
        assert more[label].history.rounds[0] == first[label].history.rounds[0]
    assert any(len(each.history.rounds) > 1 for each in more.values())
