"""Everything in the README runs, in the order in which it stands there."""

import os
import pydoc
import re
import subprocess
import sys
from pathlib import Path

import mujoco
import pytest

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text("utf-8")
COMMANDS = re.findall(r"^\| [^|]+ \| `((?:joda|python) .+?)` \|$", TEXT, re.MULTILINE)


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


def test_there_are_commands():
    named = {"demo", "generate", "revise", "attach", "plot", "bench", "schema"}
    assert named <= {line.split()[1] for line in COMMANDS}


@pytest.mark.parametrize("command", COMMANDS)
def test_command(command, folder):
    result = shell(command, folder)
    assert result.returncode == 0, result.stderr
    assert result.stderr == ""


def test_the_python_example(folder):
    code = re.search(r"```python\n(.*?)```", TEXT, re.DOTALL)[1]
    (folder / "example.py").write_text(code)
    result = shell("python example.py", folder)
    assert abs(float(result.stdout.strip("[]\n"))) < 0.002, result


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


@pytest.mark.parametrize("name", re.findall(r"`(joda\.[\w.]+)\(", TEXT))
def test_python_names_exist(name):
    owner, _, attribute = name.rpartition(".")
    assert hasattr(pydoc.locate(owner), attribute)


def test_ci_runs_the_two_setup_lines():
    block = re.search(r"```sh\n(.*?)```", TEXT, re.DOTALL)[1].splitlines()
    assert len(block) == 2
    assert block[0].endswith("joda demo")
    assert block[1].endswith("pytest")
    assert 'bash -euo pipefail -c "$(line 1)"' in (ROOT / ".ci" / "run").read_text()


@pytest.mark.parametrize("link", re.findall(r"\]\(((?!http)[^)]+)\)", TEXT))
def test_links_lead_somewhere(link):
    assert (ROOT / link).exists()
