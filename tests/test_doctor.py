"""`joda doctor` says what works; here things are broken for it, in processes of their own."""

import json
import os
import re
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import mujoco
import pytest

import joda
from joda import companions, plugin
from joda.commands import doctor


def python(code, *arguments, **environment):
    """Runs the code; environment variables that are "" are not set."""
    environment = {**os.environ, "ANTHROPIC_API_KEY": "", **environment}
    return subprocess.run(
        [sys.executable, "-P", "-c", code, *arguments],
        capture_output=True,
        text=True,
        env={name: value for name, value in environment.items() if value},
    )


def checks(*parts, **environment):
    """What these parts of it find, by name."""
    calls = ", ".join(f"*doctor._{part}" for part in parts)
    code = f"""
import json, sys
from joda.commands import doctor
json.dump([{{**vars(check), "fatal": check.fatal}} for check in [{calls}]], sys.stdout)"""
    result = python(code, **environment)
    assert (result.returncode, result.stderr) == (0, "")
    return {check["what"]: check for check in json.loads(result.stdout)}


@pytest.fixture
def package(tmp_path):
    """A copy of the package that Python finds before the installed one."""
    source = Path(joda.__file__).parent
    shutil.copytree(source, tmp_path / "joda", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "joda"


def test_all_that_is_needed_works_here():
    command = "from joda.cli import main; main()"
    result = python(command, "doctor", ANTHROPIC_API_KEY="sk-not-to-be-seen")
    assert (result.returncode, result.stderr) == (0, "")
    lines = [line.rstrip() for line in result.stdout.splitlines()]
    assert any("gives the right force" in line for line in lines if line.startswith("ok"))
    assert any(line.startswith("ok") and "extra: mjx" in line for line in lines)
    assert "ANTHROPIC_API_KEY is set" in result.stdout
    assert "not-to-be-seen" not in result.stdout
    assert lines[-1] == "All that joda needs works."


def test_no_library_of_the_plugin_and_nothing_to_make_it_of(package):
    """With the whole command: it works although joda itself does not."""
    shutil.rmtree(package / "plugins")
    shutil.rmtree(package / "cpp")
    command = "from joda.cli import main; main()"
    result = python(command, "doctor", "--json", PYTHONPATH=str(package.parent))
    assert (result.returncode, result.stderr) == (1, "")
    told = json.loads(result.stdout)
    assert not told["ok"]
    found = {check["what"]: check for check in told["checks"]}
    assert (found["MuJoCo"]["state"], found["plugin"]["state"]) == ("ok", "missing")
    assert f"joda has no plugin for MuJoCo {mujoco.__version__}" in found["plugin"]["found"]
    assert found["plugin"]["remedy"].endswith("pip install --force-reinstall --no-deps .")


def test_a_plugin_that_is_no_library(package):
    (package / "plugins" / joda.plugin_path().name).write_text("not a library")
    plugin = checks("plugin()", PYTHONPATH=str(package.parent))["plugin"]
    assert (plugin["state"], plugin["fatal"]) == ("broken", True)
    assert "does not load" in plugin["found"]


def test_a_plugin_that_was_compiled_here_and_is_damaged(tmp_path, monkeypatch):
    """Reinstalling would not help: the cache stays."""
    damaged = tmp_path / "joda" / "plugins" / "libjoda_plugin.so"
    damaged.parent.mkdir(parents=True)
    damaged.write_text("not a library")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for module in (plugin, doctor):
        monkeypatch.setattr(module, "plugin_path", lambda: damaged)
    told = r"\.so: cannot be loaded \(.*\); delete it, so that it is compiled anew\.$"
    with pytest.raises(joda.JodaError, match=told):
        plugin._library.__wrapped__(mujoco.__version__)
    monkeypatch.setattr(doctor, "_child", lambda code: (False, "file too short"))
    [check] = doctor._plugin()
    assert (check.state, check.remedy) == ("broken", f"run: rm {damaged}")


def test_no_compiler(monkeypatch):
    def none():
        raise joda.JodaError("joda has no plugin and cannot compile it.")

    monkeypatch.setattr(doctor, "plugin_path", none)
    monkeypatch.setattr(doctor, "compiler", list)
    [check] = doctor._plugin()
    assert check.remedy.endswith("apt-get install g++, or install a wheel of joda")


def test_a_compiler_that_fails(monkeypatch):
    """Reinstalling would call it again."""

    def fails():
        raise joda.JodaError("joda has no plugin and cannot compile it: g++ failed.")

    monkeypatch.setattr(doctor, "plugin_path", fails)
    monkeypatch.setattr(doctor, "compiler", lambda: ["g++"])
    [check] = doctor._plugin()
    assert check.remedy.startswith("name a C++17 compiler that works with CXX")


@pytest.mark.parametrize(
    ("extra", "installed", "said"),
    [
        ("mjx", "3.11.2", "'mujoco-mjx==3.11.*' mujoco==3.11.2"),
        ("mjx", "4.0.0", "'mujoco-mjx==3.17.*' mujoco==4.0.0"),
        ("mjx", "3.3.7", "in another environment: it goes with MuJoCo 3.11 and newer, and here is"),
        ("warp", "3.17.0", "'mujoco-warp==3.17.*' mujoco==3.17.0"),
        ("warp", "3.13.0", "it goes with MuJoCo 3.11, 3.17 and 4.0, and here is 3.13.0"),
    ],
)
def test_no_remedy_lifts_mujoco(monkeypatch, extra, installed, said):
    monkeypatch.setattr(companions, "version", lambda name: installed)
    assert said in doctor._extra_remedy(extra)


def test_a_plugin_with_a_wrong_answer(monkeypatch):
    monkeypatch.setattr(doctor, "FORCE", 1.4)
    [plugin] = doctor._plugin()
    assert plugin.state == "broken"
    assert "gives a force of 1.3 N·m where 1.4 is right" in plugin.found


def test_modules_that_are_missing_and_broken(tmp_path):
    missing = "raise ModuleNotFoundError(\"No module named 'anthropic'\")"
    (tmp_path / "anthropic.py").write_text(missing)
    for name in ("jax", "scipy"):
        (tmp_path / f"{name}.py").write_text(f"raise ImportError('{name} is torn')")
    found = checks("libraries()", "extras()", "key()", PYTHONPATH=str(tmp_path))
    vlm, mjx, libraries = found["extra: vlm"], found["extra: mjx"], found["libraries"]
    assert (vlm["state"], mjx["state"], libraries["state"]) == ("missing", "broken", "broken")
    assert (vlm["fatal"], mjx["fatal"], libraries["fatal"]) == (False, False, True)
    assert "only if you want it, run: " in vlm["remedy"]
    assert "pip install 'anthropic>=" in vlm["remedy"]
    assert "jax is torn" in mjx["found"]
    assert "'scipy>=" in libraries["remedy"]
    assert found["key: Claude"]["state"] == "missing"


def test_every_library_that_joda_requires_is_tried():
    """Diagnosis may need one that other commands do without."""
    required = {re.match("[a-z-]+", one).group() for one in doctor._required()} - {"mujoco"}
    assert required == {{"PIL": "pillow"}.get(name, name) for name in doctor.LIBRARIES}


def test_it_says_which_joda_this_is():
    found = {check.what: check.found for check in doctor._here(doctor._mujoco())}
    assert found["joda"] == f"{joda.__version__}, {Path(joda.__file__).resolve().parent}"


def test_every_extra_that_has_packages_is_looked_at():
    extras = set(metadata.metadata("joda").get_all("Provides-Extra"))
    assert set(doctor.EXTRAS) == extras - {"all", "docs", "test"}


def test_what_is_left_in_the_cache(tmp_path):
    asked = {"XDG_CACHE_HOME": str(tmp_path / "my cache")}
    assert checks("cache()", **asked)["cache"]["found"].startswith("empty, ")
    folder = tmp_path / "my cache" / "joda"
    (folder / "jax").mkdir(parents=True)
    (folder / "jax" / "compiled").write_bytes(bytes(1_500_000))
    found = checks("cache()", **asked)["cache"]
    assert found["found"] == f"1.5 MB in {folder}, which an uninstallation leaves"
    assert found["remedy"] == f"to empty it, run: rm -r '{folder}'"
    assert not found["fatal"]


def test_a_hidden_renderer():
    found = checks("renderers()", __EGL_VENDOR_LIBRARY_FILENAMES="/dev/null", DISPLAY="")
    egl, osmesa = found["pictures: EGL"], found["pictures: OSMesa"]
    assert egl["state"] == "broken"
    assert egl["fatal"] == (osmesa["state"] != "ok")
    assert ("apt-get install libegl1" in egl["remedy"]) == egl["fatal"]
    assert found["window: GLX"]["found"] == "no display (DISPLAY is not set)"


def test_renderers_that_are_asked_for_and_do_not_work():
    pictures = checks("renderers()", MUJOCO_GL="disabled")["pictures: MUJOCO_GL=disabled"]
    assert (pictures["state"], pictures["fatal"]) == ("broken", True)
    assert "unset MUJOCO_GL" in pictures["remedy"]


def test_without_a_mujoco_that_works_nothing_else_is_blamed():
    result = python("from joda.cli import main; main()", "doctor", "--json", MUJOCO_GL="nonsense")
    assert (result.returncode, result.stderr) == (1, "")
    found = {check["what"]: check for check in json.loads(result.stdout)["checks"]}
    assert found["MuJoCo"]["state"] == "broken"
    assert found["MuJoCo"]["remedy"] == "unset MUJOCO_GL, which is 'nonsense'"
    broken = [what for what, check in found.items() if check["needed"] and check["state"] != "ok"]
    assert broken == ["MuJoCo"]
    assert "extra: mjx" not in found and "extra: studio" in found
