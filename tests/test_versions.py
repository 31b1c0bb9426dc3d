"""Every MuJoCo that joda allows: the plugin's physics in each, and what stands beside joda.

Each version gets a virtual environment that sees this one's packages behind its own MuJoCo. There
joda has no library for that version, so it compiles one; what the tests need of newer versions
they skip with a reason.
"""

import json
import os
import re
import subprocess
import sys
from importlib import metadata, util
from pathlib import Path

import pytest

HERE = Path(__file__).parent
VERSIONS = ("3.3.0", "3.3.7", "3.11.0", "3.17.0")
"""metaworld's, the last of 3.3, mjlab's, and newton's; in 4.0.0 all other tests run."""
WARPS = ("3.11.0", "3.17.0")
"""Of MuJoCo Warp: mjlab's and newton's; 4.0 has its tests in every session."""
PHYSICS = ("physics", "plugin", "attach_physics", "engine", "effects_physics", "end_stops")
LONG = (
    "not ten_minutes and not knocking and not any_import_order and not any_timestep and "
    "not converges_to_scipys and not (terminal_speed and 0.0001)"
)
"""What takes half of the time, and has little to do with the version."""
BESIDE = ("mjlab", "newton[sim]", "playground", "robosuite", "metaworld", "dm_control")
UNREACHABLE = r"ConnectionError|NewConnection|Failed to fetch|No matching distribution|dns error"


def run(*command: str | Path, **environment: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        list(map(str, command)),
        capture_output=True,
        text=True,
        cwd=HERE.parent,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", **environment},
    )


def reached(result: subprocess.CompletedProcess) -> str:
    """What the command printed; the test is skipped where the registry was not reached."""
    if result.returncode and re.search(UNREACHABLE, result.stdout + result.stderr):
        pytest.skip(f"the package registry is not reached: {result.stderr.strip()[-200:]}")
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def python_with(folder: Path, *packages: str):
    """Calls a Python that has these packages before those of this one, and an empty cache."""
    venv = folder / "venv"
    assert run(sys.executable, "-m", "venv", "--without-pip", venv).returncode == 0
    site = next((venv / "lib").glob("python*/site-packages"))
    behind = [path for path in sys.path if path.endswith("site-packages")]
    (site / "others.pth").write_text("\n".join(behind))
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", site]
    reached(run(*pip, *packages))

    def call(*arguments: str | Path) -> subprocess.CompletedProcess:
        return run(venv / "bin" / "python", *arguments, XDG_CACHE_HOME=str(folder))

    return call


@pytest.fixture(scope="module", params=VERSIONS)
def python(request, tmp_path_factory):
    """A Python with that MuJoCo, and what it prints when it first loads joda."""
    call = python_with(tmp_path_factory.mktemp(request.param), f"mujoco=={request.param}")
    call.version = request.param
    return call


@pytest.mark.parametrize("version", WARPS)
def test_each_mujoco_warp(version, request, tmp_path):
    if not request.config.getoption("--whole"):
        pytest.skip("takes minutes: pytest tests/test_versions.py --whole")
    call = python_with(tmp_path, f"mujoco=={version}", f"mujoco-warp=={version}")
    options = ["-n", "0", "-q", "-p", "no:cacheprovider", "--tb=short", "-o", "addopts="]
    result = call("-m", "pytest", *options, HERE / "test_warp.py")
    assert result.returncode == 0, result.stdout[-4000:]
    assert int(re.search(r"(\d+) passed", result.stdout)[1]) > 12


@pytest.mark.sweep(2)
def test_the_plugins_physics(python):
    """The plugin is compiled once, and then all is as in the newest MuJoCo."""
    code = "import joda, mujoco; print(mujoco.__version__, joda.plugin_path().name)"
    first, second = python("-c", code), python("-W", "error", "-c", code)
    assert first.stdout == f"{python.version} libjoda_plugin-{python.version}.so\n", first.stderr
    assert first.stderr == f"joda: compiling its plugin for MuJoCo {python.version}, once\n"
    assert (second.stdout, second.stderr) == (first.stdout, "")
    tests = [HERE / f"test_{name}.py" for name in PHYSICS]
    options = [
        "-n",
        "0",
        "-q",
        "-p",
        "no:cacheprovider",
        "--tb=short",
        "-k",
        LONG,
        "-o",
        "addopts=",
    ]
    result = python("-m", "pytest", *options, *tests)
    assert result.returncode == 0, result.stdout[-4000:]
    passed = re.search(r"(\d+) passed", result.stdout)
    assert passed and int(passed[1]) > 250


@pytest.mark.slow
def test_commands_run_in_each(python, tmp_path):
    model, profile, scene = (tmp_path / name for name in ("lid.xml", "lid.json", "scene.xml"))
    model.write_text(
        '<mujoco><worldbody><body><joint name="lid" range="0 90" damping="0.1"/>'
        '<geom size=".1" pos=".3 0 0" mass="1" contype="0"/></body></worldbody>'
        '<actuator><muscle joint="lid"/></actuator></mujoco>'
    )
    joint = {"name": "lid", "type": "hinge", "range": [0, 1.5708], "unit": "rad"}
    curve = {"interval": [0, 1], "x": [0, 0.5, 1], "y": [0.2, 0.5, 0.1]}
    channels = {"conservative": {"components": [curve]}, "friction": {"components": [curve]}}
    profile.write_text(json.dumps({"joint": joint, "channels": channels}))
    for command in (
        ["attach", model, profile, "-o", scene],
        ["simulate", scene, "--joint", "lid", "--release", "1.0", "-o", tmp_path / "run.csv"],
        ["compare", scene, tmp_path / "run.csv", "--joint", "lid"],
        ["export", scene, "--to", "native", "-o", tmp_path / "native.xml"],
        ["generate", model, "-o", tmp_path / "made", "--proposer", "offline"],
    ):
        result = python("-m", "joda", *command)
        assert result.returncode == 0, result.stderr
    assert "extension" not in (tmp_path / "native.xml").read_text()


@pytest.mark.slow
def test_what_a_version_lacks_is_refused_in_a_sentence(python, tmp_path):
    if python.version == "3.17.0":
        pytest.skip("it has all that joda needs")
    knob = '<body><joint name="knob"/><geom size=".1"/></body>'
    many = '<replicate count="2" offset="1 0 0"><geom size=".1"/></replicate>'
    discrete, behind = tmp_path / "discrete.xml", tmp_path / "behind.xml"
    discrete.write_text(
        f'<mujoco><option integrator="discrete"/><worldbody>{knob}</worldbody></mujoco>'
    )
    behind.write_text(f"<mujoco><worldbody>{many}{knob}</worldbody></mujoco>")
    profile = tmp_path / "composed.json"
    joint = {"name": "knob", "type": "hinge", "range": [0, 4.71], "unit": "rad"}
    rubbing = {"interval": [0, 1], "x": [0, 1], "y": [0.1, 0.1]}
    profile.write_text(
        json.dumps({"joint": joint, "channels": {"friction": {"components": [rubbing]}}})
    )
    for model, sentence in (
        (discrete, "MuJoCo cannot load it: invalid keyword: 'discrete'"),
        (behind, "forgets instances behind a <replicate>"),
    ):
        if python.version == "3.3.0" and model == behind:
            continue  # it does not forget them yet
        result = python("-m", "joda", "attach", model, profile, "-o", tmp_path / "new.xml")
        assert result.returncode == 2
        assert result.stderr.splitlines()[-1].count(sentence) == 1
        assert "Traceback" not in result.stderr


@pytest.mark.sweep(2)
@pytest.mark.skipif(not util.find_spec("uv"), reason="uv is not installed")
@pytest.mark.parametrize("package", BESIDE)
def test_a_package_that_uses_mujoco_resolves_beside_joda(package, tmp_path):
    """With the newest Python that all of them have."""
    needed = [line for line in metadata.requires("joda") if "extra ==" not in line]
    (tmp_path / "both.in").write_text("\n".join([*needed, package]))
    options = ["--no-header", "--no-annotate", "-q", "--python-version", "3.12"]
    told = reached(
        run(sys.executable, "-m", "uv", "pip", "compile", *options, tmp_path / "both.in")
    )
    chosen = dict(line.split("==") for line in told.splitlines() if "==" in line)
    assert re.sub(r"\[.*", "", package).replace("_", "-") in chosen
    assert (3, 3) <= tuple(map(int, chosen["mujoco"].split(".")[:2])) <= (4, 0)
