"""Everything in the README runs, in the order in which it stands there, and so do the examples of
`--help`, most of which are the README's."""

import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from urllib.request import HTTPCookieProcessor, build_opener

import mujoco
import pytest
from typer.testing import CliRunner

import joda
from joda.cli import app

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text("utf-8")
README = re.findall(r"^\| [^|]+ \| `((?:joda|python) .+?)` \|$", TEXT, re.MULTILINE)
FIGURES = re.findall(r"^\| ([^|]+) \| ([^|`]+) \| (`[^|]+`) \|$", TEXT, re.MULTILINE)
HELP = {
    name: re.findall(
        r"^ {4,}(joda .+)$", CliRunner().invoke(app(name), [name, "-h"]).stdout, re.MULTILINE
    )
    for name in joda.COMMANDS
}
COMMANDS = list(dict.fromkeys([*README, *(line for lines in HELP.values() for line in lines)]))


def shell(command: str, cwd: Path) -> subprocess.CompletedProcess:
    """Runs the command with this Python's `joda` and `python` first on the path."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        command,
        shell=True,
        cwd=cwd,
        capture_output=True,
        text=True,
        env={**os.environ, "PATH": path},
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("readme")


def test_every_command_has_an_example():
    assert {line.split()[1] for line in README} >= set(joda.COMMANDS)
    for name, lines in HELP.items():
        assert lines
        assert all(line.startswith(f"joda {name}") for line in lines)


@pytest.mark.parametrize(
    "command",
    # that of docs/unknown.md takes long, and the test of that page runs it
    [line for line in COMMANDS if line.split()[1] != "studio" and "--alien" not in line],
)
def test_command(command, folder):
    result = shell(command, folder)
    assert result.returncode == 0, result.stderr
    assert result.stderr == ""


@pytest.mark.parametrize("command", [line for line in COMMANDS if line.split()[1] == "studio"])
def test_the_studio_answers_until_it_is_interrupted(command, folder):
    process = subprocess.Popen(
        [Path(sys.executable).parent / "joda", *shlex.split(command)[1:], "--no-browser"],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # NiceGUI serves pytest something else
        env={name: value for name, value in os.environ.items() if "PYTEST" not in name},
    )
    try:
        address = process.stdout.readline().split()[0]
        # the address has a token, for which the studio gives a cookie
        with build_opener(HTTPCookieProcessor()).open(address) as page:
            assert "joda studio" in page.read().decode()
        process.send_signal(signal.SIGINT)
        assert process.communicate(timeout=60)[1] == ""
        assert process.returncode == 0
    finally:
        process.kill()
        process.communicate()


def test_the_python_example(folder):
    code = re.search(r"```python\n(.*?)```", TEXT, re.DOTALL)[1]
    (folder / "example.py").write_text(code)
    result = shell("python example.py", folder)
    assert abs(float(result.stdout.strip("[]\n"))) < 0.002, result


def test_a_proposer_of_ones_own(folder):
    code = re.search(r"```python\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text(), re.DOTALL)[1]
    (folder / "mine.py").write_text(code)
    result = shell("python mine.py", folder)
    assert result.returncode == 0, result
    assert (folder / "mine" / "scene.xml").exists()


def test_the_rooms_of_contributing_are_there():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    rooms = re.findall(r"`(\w+)/`", text[text.index("| module") : text.index("## A template")])
    package = ROOT / "python" / "joda"
    own = {path.name for path in package.iterdir() if path.is_dir()} - {"__pycache__"}
    assert set(rooms) == own | {"cpp"}


def test_the_xml_example_is_a_profile():
    config = re.search(r"```xml\n<instance name=\"joda_door\">\n(.*?)</instance>", TEXT, re.DOTALL)[
        1
    ]
    model = mujoco.MjModel.from_xml_string(
        f"""<mujoco><extension><plugin plugin="joda.joint_dynamics"><instance name="p">{config}
        </instance></plugin></extension><worldbody><body><joint frictionloss="1e-12"/>
        <geom size=".1"/><plugin instance="p"/></body></worldbody></mujoco>"""
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.qfrc_passive[0] == pytest.approx(-2)


@pytest.mark.parametrize("row", FIGURES, ids=[row[0][:30] for row in FIGURES])
def test_the_figures_are_those_of_the_pages(row):
    what, figure, commands = row
    page = (ROOT / re.search(r"\((docs/\w+\.md)\)", what)[1]).read_text("utf-8")
    assert all(number in page for number in re.findall(r"\d[\d.]*", figure))
    for command in re.findall("`([^`]+)`", commands):
        program, name, *_ = command.split()
        assert name in joda.COMMANDS if program == "joda" else (ROOT / name).exists()


def test_python_names_exist(folder):
    names = sorted(set(re.findall(r"`(joda\.[\w.]+)\(", TEXT)))
    assert "joda.mjx.step" in names
    result = shell(f"python -c 'import joda; {'; '.join(names)}'", folder)
    assert (result.returncode, result.stderr) == (0, "")


def test_ci_runs_the_two_setup_lines():
    block = re.search(r"```sh\n(.*?)```", TEXT, re.DOTALL)[1].splitlines()
    assert len(block) == 2
    assert block[0].endswith("joda demo")
    assert block[1].endswith("pytest")
    assert 'bash -euo pipefail -c "$(line 1)"' in (ROOT / ".ci" / "run").read_text()


@pytest.mark.parametrize("link", re.findall(r"\]\(((?!http)[^)]+)\)", TEXT))
def test_links_lead_somewhere(link):
    assert (ROOT / link).exists()
