"""The plugin compiled where joda has none for the MuJoCo that is installed."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import mujoco
import pytest

import joda
from joda import making

SOURCES = Path(joda.__file__).parent / "cpp"
VERSION = mujoco.__version__


@pytest.fixture
def cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.delenv("CXX", raising=False)
    return tmp_path


def made(cache: Path) -> list[Path]:
    return [path for path in cache.rglob("*") if path.is_file()]


def refused() -> str:
    with pytest.raises(joda.JodaError) as caught:
        making.make(SOURCES, VERSION)
    assert str(caught.value).startswith(f"joda has no plugin for MuJoCo {VERSION} and cannot ")
    return str(caught.value)


def test_a_package_without_the_library_makes_it_once(cache, capfd):
    """And what is made gives the right force, in another process; nothing else is left."""
    package = cache / "site" / "joda"
    shutil.copytree(Path(joda.__file__).parent, package)
    shutil.rmtree(package / "plugins")
    code = "from joda.commands.doctor import _plugin; import joda; "
    code += "print(joda.plugin_path(), _plugin()[0])"
    environment = os.environ | {"PYTHONPATH": str(package.parent)}
    told = []
    for _ in range(2):
        command = [sys.executable, "-c", code]
        told.append(subprocess.run(command, capture_output=True, text=True, env=environment))
    assert told[0].stderr == f"joda: compiling its plugin for MuJoCo {VERSION}, once\n"
    assert told[1].stderr == ""
    assert told[0].stdout == told[1].stdout
    assert "gives the right force" in told[0].stdout
    (library,) = made(cache / "joda")
    assert told[0].stdout.startswith(str(library))


def test_no_compiler(cache, monkeypatch):
    monkeypatch.setenv("PATH", str(cache))
    assert "there is no C++ compiler (on Debian or Ubuntu: apt-get install g++)" in refused()
    assert not made(cache)


def test_a_compiler_that_is_not_there(cache, monkeypatch):
    monkeypatch.setenv("CXX", "no-such-compiler -O2")
    assert "no-such-compiler does not start (No such file or directory)" in refused()
    assert not made(cache)


def test_a_compiler_that_fails(cache, monkeypatch):
    monkeypatch.setattr(making, "FLAGS", ["-DMJAPI=error_here_("])
    assert " failed (" in refused()
    assert not made(cache)


def test_a_cache_that_cannot_be_written(cache, monkeypatch):
    (cache / "joda").write_text("a file where a folder must be")
    assert "cannot be written (" in refused()
    assert refused().endswith("name another folder with XDG_CACHE_HOME.")


def test_no_sources(cache, tmp_path):
    with pytest.raises(joda.JodaError, match="install a wheel of joda"):
        making.make(tmp_path / "nothing", VERSION)
