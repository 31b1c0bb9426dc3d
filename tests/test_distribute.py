"""Many joints at once: what is made is what the commands make one by one, wherever it is made."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest
from distributed_cases import make

import joda
import joda.commands.distribute as folder_module
from joda import distribute
from joda.commands.distribute.pool import _deferred, by_processes, by_ray
from joda.commands.distribute.task import Task


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def cases(tmp_path_factory) -> Path:
    """Two doors, one with two models, one whose run is no run."""
    folder = make(tmp_path_factory.mktemp("many") / "cases", 2)
    shutil.copytree(folder / "door_0000", folder / "deep" / "two")
    (folder / "deep" / "two" / "other.xml").write_text("<mujoco/>")
    shutil.copytree(folder / "door_0001", folder / "bad")
    (folder / "bad" / "run1.csv").write_text("time,position\n0,1\n")
    return folder


@pytest.fixture(scope="module")
def diagnosed(cases):
    seen = []
    done = distribute(
        "diagnose", cases, cases.parent / "out", workers=2, progress=lambda *what: seen.append(what)
    )
    return done, seen


def test_a_diagnosis_is_the_same_as_by_itself(cases, diagnosed, tmp_path, monkeypatch):
    done, seen = diagnosed
    assert [one.label for one in done] == ["bad", "deep/two", "door_0000", "door_0001"]
    assert [one.failed for one in done] == [True, True, False, False]
    assert "holds 2 models beside runs" in done[1].told
    assert "run1.csv" in done[0].told and not done[0].folder.exists()
    assert seen[-1][:2] == (4, 4)
    monkeypatch.chdir(cases.parent)
    for one in done[2:]:
        case = Path("cases") / one.label
        runs = sorted(case.glob("*.csv"))
        direct = joda.diagnose(case / "door.xml", "door", runs, json=tmp_path / f"{one.label}.json")
        assert direct.summary == one.told
        there = (one.folder / "diagnosis.json").read_bytes()
        assert there == (tmp_path / f"{one.label}.json").read_bytes()
        assert json.loads((one.folder / "result.json").read_text())["told"] == one.told


def test_ray_makes_the_same_bytes(cases, diagnosed):
    pytest.importorskip("ray")
    done, _ = diagnosed
    again = distribute("diagnose", cases, cases.parent / "by_ray", ray="local", workers=2)
    assert [(one.label, one.told) for one in again] == [(one.label, one.told) for one in done]
    assert contents(cases.parent / "by_ray") == contents(cases.parent / "out")


def test_resume_does_what_is_not_there_or_has_changed(cases, diagnosed, tmp_path):
    done, _ = diagnosed
    shutil.copytree(cases.parent / "out", tmp_path / "out")
    shutil.copytree(cases, tmp_path / "cases")
    shutil.rmtree(tmp_path / "cases" / "bad")
    shutil.rmtree(tmp_path / "cases" / "deep")
    (tmp_path / "out" / "door_0001" / "diagnosis.html").write_text("another")
    before = contents(tmp_path / "out")
    with pytest.raises(joda.JodaError, match="go on with --resume"):
        distribute("diagnose", tmp_path / "cases", tmp_path / "out")
    again = distribute("diagnose", tmp_path / "cases", tmp_path / "out", workers=1, resume=True)
    assert [one.kept for one in again] == [True, False]
    assert [one.told for one in again] == [one.told for one in done[2:]]
    assert contents(tmp_path / "out") == {
        **before,
        "door_0001/diagnosis.html": (done[3].folder / "diagnosis.html").read_bytes(),
    }
    run = tmp_path / "cases" / "door_0000" / "run0.csv"
    run.write_text("\n".join(run.read_text().splitlines()[:-5]) + "\n")
    again = distribute("diagnose", tmp_path / "cases", tmp_path / "out", workers=1, resume=True)
    assert [one.kept for one in again] == [False, True]


def test_improve_writes_the_scene_that_it_writes_by_itself(cases, tmp_path):
    shutil.copytree(cases / "door_0001", tmp_path / "cases" / "door")
    (one,) = distribute("improve", tmp_path / "cases", tmp_path / "out", workers=1)
    assert not one.failed and one.told.startswith("constant_damping_hinge added; ")
    case = tmp_path / "cases" / "door"
    direct = tmp_path / "direct" / "door"
    direct.mkdir(parents=True)
    joda.improve(case / "door.xml", "door", sorted(case.glob("*.csv")), direct / "new.xml")
    for name in ("new.xml", "new.composed.json", "new.png"):
        assert (one.folder / name).read_bytes() == (direct / name).read_bytes()


def test_generate_does_every_joint_as_by_itself(tmp_path):
    models = Path(__file__).parents[1] / "models"
    (tmp_path / "models").mkdir()
    shutil.copy(models / "knob.xml", tmp_path / "models")
    (one,) = distribute("generate", tmp_path / "models", tmp_path / "out", workers=1)
    assert one.label == "knob/knob" and not one.failed, one.told
    direct = tmp_path / "direct" / "knob" / "knob"
    joda.generate(tmp_path / "models" / "knob.xml", "knob", direct, proposer="offline")
    for name in ("composed.json", "proposal.json", "scene.xml", "profile.png"):
        assert (one.folder / name).read_bytes() == (direct / name).read_bytes()


class Deadly:
    """Ends the process that is handed it, as a fault in a library does."""

    def __reduce__(self):
        return os._exit, (1,)


def test_of_a_process_that_dies_only_its_own_task_is_lost(tmp_path):
    knob = (Path(__file__).parents[1] / "models" / "knob.xml").read_bytes()

    def task(name, content):
        return Task("generate", name, "knob.xml", "knob", (), "out", {"knob.xml": content}, {})

    tasks = [task("a", knob), task("b", Deadly()), task("c", knob), task("d", b"<mujoco")]
    done = {one.label: result for one, result in by_processes(tasks, 2)}
    assert sorted(done) == ["a", "b", "c", "d"]
    assert [done[name].failed for name in "abcd"] == [False, True, False, True]
    assert "process that did it died before it was done" in done["b"].told
    assert "knob.xml" in done["d"].told


def knob_in(folder: Path) -> Path:
    """A model of one joint, which `generate` is done with in seconds."""
    folder.mkdir(parents=True)
    return Path(shutil.copy(Path(__file__).parents[1] / "models" / "knob.xml", folder))


def test_what_is_reached_through_a_link_stays_there(tmp_path, monkeypatch):
    """Nothing is written but below the output, and the model is left alone."""
    knob = knob_in(tmp_path / "disk" / "deep" / "models" / "knob")
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "data").symlink_to(tmp_path / "disk" / "deep", target_is_directory=True)
    before, time = contents(tmp_path / "disk"), knob.stat().st_mtime_ns
    monkeypatch.chdir(tmp_path / "home")
    (done,) = distribute("generate", "data/models", tmp_path / "disk" / "many", workers=1)
    assert not done.failed
    made = {name for name in contents(tmp_path) if not name.startswith("disk/many/")}
    assert made == {f"disk/{name}" for name in before}  # a link's folder is not walked
    assert knob.stat().st_mtime_ns == time


def test_runs_are_known_by_any_spelling_of_their_ending(cases, tmp_path):
    shutil.copytree(cases / "door_0000", tmp_path / "up" / "door")
    for run in (tmp_path / "up" / "door").glob("*.csv"):
        run.rename(run.with_suffix(".CSV"))
    (done,) = distribute("diagnose", tmp_path / "up", tmp_path / "out", workers=1)
    assert not done.failed
    task = next(
        folder_module._cases("diagnose", tmp_path / "up", tmp_path / "out", None, False, "", [])
    )
    assert len(task.runs) == len(list((cases / "door_0000").glob("*.csv")))


def test_what_fails_anew_leaves_no_result_that_says_otherwise(cases, tmp_path):
    """Neither a run that is none, nor two models, nor a model that does not load."""
    failing = tmp_path / "cases"
    for name in ("bad", "deep"):
        shutil.copytree(cases / name, failing / name)
        (tmp_path / "out" / name / "two").mkdir(parents=True)
    old = [tmp_path / "out" / name / "result.json" for name in ("bad", "deep/two")]
    for path in old:
        path.write_text("{}")
    done = distribute("diagnose", failing, tmp_path / "out", workers=1, resume=True)
    assert [one.failed for one in done] == [True, True]
    assert not any(path.exists() for path in old)
    for name in ("a", "b"):
        knob_in(tmp_path / "models" / name)
    out = tmp_path / "made"
    first, second = distribute("generate", tmp_path / "models", out, workers=2)
    (tmp_path / "models" / "a" / "knob.xml").write_text("<mujoco")
    distribute("generate", tmp_path / "models", out, workers=1, resume=True)
    assert not (first.folder / "result.json").exists()
    assert (second.folder / "result.json").is_file()


def test_a_result_that_cannot_be_written_is_told_and_the_others_go_on(tmp_path):
    for name in ("a", "b"):
        knob_in(tmp_path / "models" / name)
    out = tmp_path / "out"
    done = distribute("generate", tmp_path / "models", out, workers=1)
    blocked = done[0].folder / "composed.json"
    before = contents(out)
    blocked.unlink()
    blocked.mkdir()
    again = distribute("generate", tmp_path / "models", out, workers=1, force=True)
    assert [one.failed for one in again] == [True, False]
    assert "composed.json: cannot be written" in again[0].told
    kept = {name: own for name, own in before.items() if "/composed.json" not in name}
    assert {name: contents(out).get(name) for name in kept} | {
        name: None for name in kept if name.endswith("result.json")
    } == kept | {name: None for name in kept if name.endswith("result.json")}


INTERRUPTED = """
import os, sys, time
from joda.commands.distribute import pool

def slow(task):
    try:
        open(os.path.join(task, f"begun {os.getpid()} {time.time()}"), "w").close()
        time.sleep(60)
    finally:
        open(os.path.join(task, f"left {os.getpid()}"), "w").close()

pool.run = slow
if __name__ == "__main__":
    list(pool.by_processes([sys.argv[1]] * 6, 2))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_begins_nothing_more_and_no_worker_outlives_its_pool(tmp_path, how):
    """Tasks that are begun leave properly, the others are not begun, nothing is printed by them."""
    (tmp_path / "many.py").write_text(INTERRUPTED)
    folder = tmp_path / "told"
    folder.mkdir()
    run = subprocess.Popen(
        [sys.executable, tmp_path / "many.py", folder], stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    waited_for(lambda: len(list(folder.glob("begun *"))) == 2)
    if how == signal.SIGINT:
        os.killpg(run.pid, how)  # as a terminal does
    else:
        run.send_signal(how)
    _, errors = run.communicate(timeout=30)
    waited_for(lambda: len(list(folder.glob("left *"))) == 2)
    assert len(list(folder.glob("begun *"))) == 2
    workers = [int(path.name.split()[1]) for path in folder.glob("begun *")]
    waited_for(lambda: not any(Path(f"/proc/{worker}").exists() for worker in workers))
    if how == signal.SIGINT:
        assert errors.count("Traceback") <= 3 and errors.rstrip().endswith("KeyboardInterrupt")


def test_ctrl_c_waits_until_it_may_act():
    """Else it would leave a lock of the pool locked, and the pool would never end."""
    before, reached = signal.getsignal(signal.SIGINT), []
    with pytest.raises(KeyboardInterrupt), _deferred() as act:
        signal.raise_signal(signal.SIGINT)
        reached.append("it went on")
        act()
        reached.append("and on")
    with pytest.raises(KeyboardInterrupt), _deferred():
        signal.raise_signal(signal.SIGINT)
        reached.append("up to the end")
    assert reached == ["it went on", "up to the end"]
    assert signal.getsignal(signal.SIGINT) is before


def waited_for(condition, seconds=30.0):
    """Fails if the condition does not come true."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_mistakes_are_one_sentence(cases, tmp_path):
    for arguments, said in (
        (("diagnose", tmp_path / "none"), "no such folder"),
        (("diagnose", tmp_path), "holds no folder with a model"),
        (("generate", tmp_path), "holds no model"),
    ):
        with pytest.raises(joda.JodaError, match=said):
            distribute(*arguments, tmp_path / "out")
    with pytest.raises(joda.JodaError, match="--describe is of generate"):
        distribute("diagnose", cases, tmp_path / "out", describe="it stays")
    with pytest.raises(joda.JodaError, match="--passive is of diagnose and improve"):
        distribute("generate", cases, tmp_path / "out", passive=True)
    code = (
        "import sys; sys.modules['ray'] = None\nimport joda\n"
        f"try: joda.distribute('diagnose', {str(cases)!r}, {str(tmp_path / 'o')!r}, ray='local')\n"
        "except joda.JodaError as error: print(error)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert '--ray needs Ray; run: pip install ".[ray]"' in run.stdout


def test_a_cluster_that_does_not_answer_is_one_sentence(cases, tmp_path):
    pytest.importorskip("ray")
    with pytest.raises(joda.JodaError, match=r"no Ray cluster answers at 127\.0\.0\.1:1;"):
        distribute("diagnose", cases, tmp_path / "out", ray="127.0.0.1:1")


@pytest.mark.parametrize("error", [ConnectionError, RuntimeError, ValueError, KeyError])
def test_what_answers_and_is_no_cluster_that_can_be_used_is_one_sentence(error, monkeypatch):
    def init(address, **_):
        raise error("no token")

    ray = SimpleNamespace(init=init, exceptions=SimpleNamespace(RayError=KeyError))
    monkeypatch.setitem(sys.modules, "ray", ray)
    monkeypatch.setenv("RAY_NUM_REDIS_GET_RETRIES", "1")
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        told = rf"no Ray cluster can be used at {address} \('?no token'?\); does `ray start"
        with pytest.raises(joda.JodaError, match=told):
            next(by_ray([], address, None))


def test_a_joint_must_be_named_where_there_are_several(cases, tmp_path):
    case = tmp_path / "cases" / "door"
    shutil.copytree(cases / "door_0000", case)
    two = (
        (case / "door.xml")
        .read_text()
        .replace(
            "</worldbody>", '<body><joint name="b" range="0 1"/><geom size="1"/></body></worldbody>'
        )
    )
    (case / "door.xml").write_text(two)
    (one,) = distribute("diagnose", tmp_path / "cases", tmp_path / "out", workers=1)
    assert one.failed and "2 hinges and slides with a range ('door', 'b'); name one" in one.told
    command = ["distribute", "diagnose", tmp_path / "cases", "-o", tmp_path / "again"]
    run = subprocess.run([sys.executable, "-m", "joda", *command], capture_output=True, text=True)
    assert run.returncode == 2 and "name one with --joint" in run.stdout
    assert "1 of 1 joints have no result; see above." in run.stderr
