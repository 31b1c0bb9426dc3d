"""The site is built without a warning, and what its tutorial and how-to pages show runs."""

import importlib
import json
import re
import shutil
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import mujoco
import numpy as np
import pytest
from chat_server import Chat, completion, words
from messages_server import serve
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore
from test_prompts import answers
from test_readme import COMMANDS, shell

from joda.diagnosis.settings import SETTINGS
from joda.measured.run_files import read_run
from joda.profile import ATTRIBUTES
from joda.propose.expected import Expectations

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
BLOCK = r"```(\w+)\n(.*?)^```$"
FLAGS = re.MULTILINE | re.DOTALL


def blocks(page: str, language: str) -> list[str]:
    """The page's blocks of that language, in their order."""
    found = re.findall(f"^{BLOCK}", (DOCS / page).read_text("utf-8"), FLAGS)
    return [text for of, text in found if of == language]


def write_files(page: str, folder: Path) -> None:
    """Writes the files that the page shows; the paragraph before ends with their names."""
    shown = re.findall(
        rf"^([^\n]+(?:\n[^\n]+)*)\n\n{BLOCK}", (DOCS / page).read_text("utf-8"), FLAGS
    )
    for before, language, text in shown:
        if language in ("xml", "json", "python"):
            path = folder / re.findall(r"`([\w/]+\.(?:xml|json|py))`", before)[-1]
            path.parent.mkdir(exist_ok=True)
            path.write_text(text, "utf-8")


def run(command: str, folder: Path) -> str:
    """What the command prints; it must succeed and have nothing to complain about."""
    result = shell(command, folder)
    assert (result.returncode, result.stderr) == (0, ""), result
    return result.stdout


def masked(text: str) -> set[str]:
    """The lines without their numbers: other machines round otherwise."""
    return {
        re.sub(r"-?\d[\d.]*(e-?\d+)?", "#", re.sub(" +", " ", line).rstrip())
        for line in text.splitlines()
    }


@pytest.fixture(scope="module")
def my_door(tmp_path_factory):
    """The tutorial's folder after all its commands, and what they printed."""
    folder = tmp_path_factory.mktemp("my_door")
    write_files("my_door.md", folder)
    commands = "".join(blocks("my_door.md", "sh")).splitlines()
    return folder, [run(command, folder) for command in commands]


@pytest.mark.long
@pytest.mark.long("my_door")
def test_the_tutorial_finds_the_closer_and_mends_the_model(my_door):
    _, told = my_door
    assert masked("".join(blocks("my_door.md", "text"))) <= masked("\n".join(told))
    found = re.search(r"direction_dependent_damping: .*? ([\d.]+) ± ", "\n".join(told))
    assert float(found[1]) == pytest.approx(3, rel=0.05)  # as the page's real.json has it
    assert "By direction" in told[-2]
    assert "The error of every segment of 0.4 s is less than 3 times the noise" in told[-1]


@pytest.mark.long
def test_the_other_tutorial_repairs_the_arm(tmp_path):
    write_files("my_robot.md", tmp_path)
    commands = "".join(blocks("my_robot.md", "sh")).splitlines()
    told = [run(command, tmp_path) for command in commands]
    assert masked("".join(blocks("my_robot.md", "text"))) <= masked("\n".join(told))
    (friction,) = re.findall(r"frictionloss is 0.1 N·m, the runs show ([\d.]+) ± ", told[3])
    (gain,) = re.findall(r"actuator is 60 N·m/rad, the runs show ([\d.]+) ± ", told[3])
    assert (float(friction), float(gain)) == pytest.approx((1.2, 25), rel=0.03)
    before, after = (re.findall(r"^\w+ +([\d.]+) rad", one, re.MULTILINE) for one in told[-2:])
    assert all(float(b) < 0.1 * float(a) for a, b in zip(before, after, strict=True))


@pytest.mark.long
def test_what_has_no_name_is_learned(tmp_path):
    demo, add = blocks("unknown.md", "sh")[0].splitlines()
    assert demo in COMMANDS
    told = [run(demo, tmp_path), run(add, tmp_path)]
    assert masked(blocks("unknown.md", "text")[0]) <= masked(told[1])
    assert "3. Learn the law from the runs" in told[0]
    truth = json.loads((tmp_path / "alien" / "sealed.json").read_text())
    opened = told[0].partition("The seal is opened:")[2]
    assert truth["effect"].replace("_", " ") in opened.splitlines()[1]
    (left,) = re.findall(r"What was learned leaves ([\d.]+) % of the error", opened)
    assert float(left) < 10
    told_of = json.loads((tmp_path / "alien" / "diagnosis.json").read_text())
    assert told_of["verdict"] == "unexplained"
    (stiffness,) = re.findall(r"stiffness ([\d.]+) ± ", told[1])
    assert float(stiffness) == pytest.approx(13.9, rel=0.05)


@pytest.mark.long("my_door")
def test_a_log_of_mujoco_becomes_a_run(my_door):
    folder, _ = my_door
    write_files("howto/logs.md", folder)
    run("python log.py", folder)
    done = read_run(folder / "log.csv")
    assert np.gradient(done.position, done.time) == pytest.approx(done.velocity, abs=0.01)
    assert "the measurement's noise" in run("joda compare door.xml log.csv --joint hinge", folder)


def test_a_csv_with_other_units_becomes_a_run(tmp_path):
    write_files("howto/logs.md", tmp_path)
    run("python swing.py", tmp_path)
    told = [run(command, tmp_path) for command in blocks("howto/logs.md", "sh")[0].splitlines()]
    assert masked(blocks("howto/logs.md", "text")[0]) == masked(told[0])
    assert "the measurement's noise" in told[1]
    done = read_run(tmp_path / "runs" / "swing.csv")
    assert done.time == pytest.approx(np.arange(400) / 100)
    assert done.position[0] == pytest.approx(np.deg2rad(40))


def test_a_ros_bag_becomes_a_run(tmp_path):
    """As the page says, with the effort as the force."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    names = "sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time"
    state, header, time = (store.types[name] for name in names)
    at = np.arange(0, 3, 0.01)
    with Writer(tmp_path / "recording", version=9) as bag:
        topic = bag.add_connection("/joint_states", names[0], typestore=store)
        for t in at:
            numbers = [np.array([0, value]) for value in (np.sin(t), np.cos(t), 0.1 * t)]
            stamp = time(sec=7 + int(t), nanosec=round(1e9 * (t % 1)))
            message = state(header(stamp, ""), ["lamp", "hinge"], *numbers)
            bag.write(topic, round(1e9 * (t + 9)), store.serialize_cdr(message, names[0]))
    write_files("howto/logs.md", tmp_path)
    (command,) = re.findall(r"`(joda import recording .+?)`", (DOCS / "howto/logs.md").read_text())
    (column,) = re.findall(r"`(--column force:hinge=.+?)`", (DOCS / "howto/logs.md").read_text())
    run(f"{command.replace('arm.xml', 'lamp.xml')} --joint hinge {column}", tmp_path)
    done = read_run(tmp_path / "runs" / "recording.csv")
    assert done.time == pytest.approx(at, abs=1e-6)
    assert done.position == pytest.approx(np.sin(at))
    assert done.velocity == pytest.approx(np.cos(at))
    assert done.force == pytest.approx(0.1 * at, abs=1e-9)


@pytest.mark.long("my_door")
def test_templates_effects_and_proposers_of_ones_own(my_door):
    folder, _ = my_door
    for page in ("templates", "effect", "proposer"):
        write_files(f"howto/{page}.md", folder)
    told = [run(command, folder) for command in blocks("howto/templates.md", "sh")[0].splitlines()]
    assert "soft_stop" in told[0]
    (folder / "real.json").rename(folder / "composed.json")
    run("python stribeck.py", folder)
    assert "stribeck_friction velocity=0.05" in (folder / "stribeck.xml").read_text()
    run("joda generate door.xml --joint hinge --proposer offline --rounds 1 -o offline", folder)
    (folder / "offline" / "proposal.json").rename(folder / "proposal.json")
    run("python mine.py", folder)
    assert (folder / "generated" / "scene.xml").exists()


def test_a_server_of_ones_own(tmp_path, monkeypatch):
    """The pages' commands, with a server at another address."""
    for name in ("OPENAI_API_KEY", "ANTHROPIC_API_KEY", "JODA_VLM", "JODA_VLM_PRICE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    write_files("my_door.md", tmp_path)
    for name in ("oven.xml", "switch.xml", "switch.expected.json"):
        folder = tmp_path / "models" if name.startswith("switch") else tmp_path
        folder.mkdir(exist_ok=True)
        shutil.copy(ROOT / "models" / name, folder)
    asked, estimating = blocks("howto/proposer.md", "sh")[0], blocks("generation.md", "sh")[0]
    with serve(Chat) as server:
        reply, done = answers("refrigerator")[0], {"status": "complete", "proposal": None}
        server.script[:] = [completion(json.dumps(each)) for each in (reply, done, reply)]
        commands = [
            line.replace("http://127.0.0.1:8000", server.url)
            for line in [*asked.splitlines(), *estimating.splitlines()]
        ]
        told = [run(command, tmp_path) for command in commands]
    assert [sent["model"] for sent in server.requests] == ["qwen3-vl"] * 3
    assert "it closes too hard" in words(server.requests[-1]) and "Estimate" in told[-1]
    page = (DOCS / "generation.md").read_text("utf-8")
    (command,) = re.findall(r"`(joda evaluate proposer models .+?)`", page)
    assert "offline, 1 joints" in run(command, tmp_path)
    Expectations.model_validate_json(blocks("generation.md", "json")[0])


def test_steps_in_mjx(tmp_path):
    """What the page shows, for fewer steps, ends where MuJoCo does: past the latch."""
    write_files("howto/training.md", tmp_path)
    text = (tmp_path / "steps.py").read_text()
    assert "STEPS = 1000" in text
    (tmp_path / "steps.py").write_text(text.replace("STEPS = 1000", "STEPS = 40"))
    run("".join(blocks("howto/training.md", "sh")), tmp_path)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    data = mujoco.MjData(model)
    data.ctrl[:] = 1
    mujoco.mj_step(model, data, 40)
    assert data.qpos[0] > 0.1
    told = run("python steps.py", tmp_path).splitlines()[-1]  # MJX says what it lacks before
    assert float(told.strip("[]")) == pytest.approx(data.qpos[0], 1e-3)


@pytest.mark.long("my_door")
def test_a_host_in_cpp(my_door):
    folder, _ = my_door
    (folder / "cpp").symlink_to(ROOT / "cpp")
    (folder / "better.xml").rename(folder / "scene.xml")
    assert re.match(
        r"time 5\.\d+\nhinge -?0\.\d+\n", run(blocks("howto/cpp_host.md", "sh")[0], folder)
    )


def test_the_plugin_has_the_attributes_of_the_reference():
    """In the same order, in which the compiled model has them."""
    code = (ROOT / "cpp" / "profile.h").read_text()
    texts = re.search(r"kTextNames[^{]*\{(.*?)\}", code, re.DOTALL)[1]
    assert ("range", *re.findall(r'"(\w+)"', texts)) == ATTRIBUTES


def test_the_table_of_what_decides_has_the_settings_of_the_formulas():
    text = (DOCS / "diagnose.md").read_text()
    table = text.partition("| setting | value |")[2].partition("\n\n")[0]
    rows = [row.split("|")[1:3] for row in table.splitlines() if row.startswith("| `")]
    told = {name.strip(" `"): float(value) for name, value in rows}
    assert told == asdict(SETTINGS.selection)


def test_every_other_setting_is_told_with_its_value():
    sys.path.insert(0, str(DOCS))
    page = importlib.import_module("reference").settings()
    for name, group in asdict(SETTINGS).items():
        table = page.partition(f"## {name}\n")[2].partition("\n## ")[0]
        rows = dict(re.findall(r"^\| `(\w+)` \| (\S+) \| .{15,} \|$", table, re.MULTILINE))
        assert set(rows) == set(group), name
        for key, value in group.items():
            assert float(rows[key]) == pytest.approx(value, rel=1e-5)


def test_the_tests_that_pages_name_are_there():
    pages = [*ROOT.glob("*.md"), *DOCS.rglob("*.md")]
    named = {
        name for page in pages for name in re.findall(r"tests/\w+\.py", page.read_text("utf-8"))
    }
    assert len(named) > 20
    assert [name for name in sorted(named) if not (ROOT / name).exists()] == []


def test_the_site_is_built_without_a_warning(tmp_path):
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "docs", tmp_path]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "joda simulate" in (tmp_path / "reference" / "commands.html").read_text("utf-8")
