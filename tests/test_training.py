"""What docs/howto/training.md shows runs beside each tool, in a virtual environment of its own.

The tools come from the package registry as they are today; joda is the one that is installed here.
Only Gymnasium's is small: the others need some GB, so they run with --whole.
"""

import os
import re
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
from test_docs import write_files

import joda

UNREACHABLE = r"ConnectionError|NewConnection|No matching distribution"
OUT_OF_ONESELF = {
    "mjlab_cabinet.py": """
with torch.no_grad():
    strength = [wp.to_torch(env.fields.numbers[name])[:, 0] for name in RANDOM]
    strong = 3 * strength[0] + 0.3 * strength[1] > 5.9
    assert strong[held].all(), "a latch of less than 6 N·m held"
    assert len(set(strength[0].tolist())) == WORLDS
""",
    "playground_cabinet.py": """
door = state.info["fields"]["door"]
strength = 3 * door.conservative.strength + 0.3 * door.friction.strength
assert ((strength > 6) == (state.info["steps"] == STEPS))[abs(strength - 6) > 0.2].all()
assert len(set(strength.tolist())) == WORLDS
""",
}
"""What is asked at the end of a script, of what only it knows."""


@pytest.fixture
def beside(tmp_path, request):
    """Installs packages beside joda, and runs in their environment the page's scripts."""

    def install(*packages: str):
        venv = tmp_path / "venv"
        subprocess.run([sys.executable, "-m", "venv", venv], check=True)
        needed = [line for line in metadata.requires("joda") if "extra ==" not in line]
        pip = [venv / "bin" / "pip", "install", "-q", "--disable-pip-version-check"]
        told = subprocess.run([*pip, *needed, *packages], capture_output=True, text=True)
        if told.returncode and re.search(UNREACHABLE, told.stderr):
            pytest.skip(f"the package registry is not reached: {told.stderr.strip()[-200:]}")
        assert told.returncode == 0, told.stderr
        site = next((venv / "lib").glob("python*/site-packages"))
        shutil.copytree(Path(joda.__file__).parent, site / "joda")
        distribution = metadata.distribution("joda")
        folder = next(file.parent for file in distribution.files if file.name == "METADATA")
        shutil.copytree(distribution.locate_file(folder), site / folder.name)
        write_files("howto/training.md", tmp_path)
        run("-m", "joda", "attach", "cabinet.xml", "latch.json", "-o", "scene.xml")
        return run

    def run(*arguments: str) -> str:
        environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "MUJOCO_GL": "disable"}
        told = subprocess.run(
            [tmp_path / "venv" / "bin" / "python", *arguments],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
        )
        assert told.returncode == 0, told.stdout[-2000:] + told.stderr[-4000:]
        return told.stdout

    def script(name: str) -> str:
        with (tmp_path / name).open("a", encoding="utf-8") as file:
            file.write(OUT_OF_ONESELF.get(name, ""))
        return run(name)

    install.script = script
    return install


@pytest.fixture
def whole(request):
    if not request.config.getoption("--whole"):
        pytest.skip("takes some GB: pytest tests/test_training.py --whole")


@pytest.mark.long
def test_gymnasium(beside):
    """The latch and the friction, 3.3 N·m, hold against 3 and not against 6."""
    beside("gymnasium[mujoco]")
    assert beside.script("gym_cabinet.py").splitlines() == [
        "pulled with 3 N·m: shut",
        "pulled with 6 N·m: open",
    ]


def test_robosuite(whole, beside):
    """A latch of 8 N·m on robosuite's own door, whose range ends at 0.4 rad."""
    beside("robosuite", "mujoco<3.9")
    told = re.findall(r"pulled with (\d+) N·m: (\S+) rad", beside.script("robosuite_door.py"))
    (weak, shut), (strong, opened) = ((float(a), float(b)) for a, b in told)
    assert (weak, strong) == (5, 12)
    assert shut == pytest.approx(0, abs=1e-3) and opened == pytest.approx(0.4, abs=5e-3)


@pytest.mark.parametrize(
    ("packages", "name"),
    [
        (("mjlab",), "mjlab_cabinet.py"),
        (("playground", "optax>=0.2.3"), "playground_cabinet.py"),
    ],
    ids=("mjlab", "playground"),
)
def test_latches_of_many_worlds(packages, name, whole, beside):
    """Each world has its own: those above 6 N·m hold, the others are opened and begin anew."""
    beside(*packages)
    told = beside.script(name).splitlines()[-1]
    opened, held = map(int, re.fullmatch(r"(\d+) doors were opened, (\d+) of 64.*", told).groups())
    assert opened > 64 and 1 <= held < 32
