"""What a release is: the source archive, a wheel made from it, and what it leaves when it goes."""

import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

import joda

ROOT = Path(__file__).parents[1]
PACKAGES = Path(pytest.__file__).parents[1]
"""Where MuJoCo and the others are installed."""


def run(*command, cwd=None) -> str:
    """What the command prints; it must succeed."""
    command = [str(part) for part in command]
    result = subprocess.run(
        command, cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    assert result.returncode == 0, result.stdout
    return result.stdout


@pytest.fixture(scope="module")
def sdist(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sdist")
    code = f"from scikit_build_core.build import build_sdist; build_sdist({str(folder)!r})"
    run(sys.executable, "-c", code, cwd=ROOT)
    return next(folder.glob("joda-*.tar.gz"))


@pytest.fixture(scope="module")
def wheel(sdist):
    options = "--no-build-isolation", "--no-deps", "-q", "--config-settings=cmake.build-type=Debug"
    run(sys.executable, "-m", "pip", "wheel", *options, "-w", sdist.parent, sdist)
    return next(sdist.parent.glob("joda-*.whl"))


def files(*folders: str) -> set[str]:
    """Of these folders of the project, but for what Python leaves."""
    paths = (path for folder in folders for path in (ROOT / folder).rglob("*") if path.is_file())
    return {str(path.relative_to(ROOT)) for path in paths if "__pycache__" not in path.parts}


def test_the_source_archive_has_all_and_nothing_else(sdist):
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert files("python", "cpp", "templates", "prompts", "models", "tests") <= names
    assert {"README.md", "LICENSE", "CHANGELOG.md", "pyproject.toml", "CMakeLists.txt"} <= names
    assert not {name for name in names if name.endswith((".pyc", ".so", ".whl", ".gz"))}
    assert not {name.partition("/")[0] for name in names} & {".ci", ".git", ".venv", "build"}


def test_the_wheel_has_the_package_its_data_and_its_libraries(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}
    package = {name.removeprefix("python/") for name in files("python")}
    data = {f"joda/{name}" for name in files("templates", "prompts", "models")}
    sources = {name for name in names if name.startswith("joda/cpp/")}
    built = names - package - data - sources
    assert package | data <= names
    assert {name.partition(".")[0] for name in built} == {
        "joda/_core",
        "joda/plugins/libjoda_plugin-4",
    }
    assert {"joda/cpp/joint_dynamics.cc", "joda/cpp/engine.h"} < sources
    assert not sources - {f"joda/{name}" for name in files("cpp")}


def test_it_works_in_a_fresh_environment_and_leaves_nothing(wheel, tmp_path):
    run(sys.executable, "-m", "venv", "--without-pip", tmp_path / "venv")
    python = tmp_path / "venv" / "bin" / "python"
    site = next((tmp_path / "venv" / "lib").glob("python*/site-packages"))
    (site / "others.pth").write_text(str(PACKAGES))
    pip = sys.executable, "-m", "pip", "--python", python
    run(*pip, "install", "-q", "--no-deps", "--ignore-installed", wheel)
    code = "import mujoco, joda, sys; from joda.commands.doctor import _plugin; print(_plugin()[0])"
    told = run(python, "-P", "-c", code)
    assert f"{site / 'joda' / 'plugins' / 'libjoda_plugin'}" in told
    assert "gives the right force" in told
    assert run(tmp_path / "venv" / "bin" / "joda", "--version").startswith("joda ")
    run(*pip, "uninstall", "-q", "-y", "joda")
    assert [path.name for path in site.iterdir()] == ["others.pth"]
    assert not (tmp_path / "venv" / "bin" / "joda").exists()


@pytest.mark.skipif(not shutil.which("nm"), reason="there are no binutils")
def test_windows_import_library_has_all_that_the_plugin_calls():
    """On Linux the same sources leave these to libmujoco."""
    told = run("nm", "-D", "--undefined-only", joda.plugin_path())
    called = {word for word in told.split() if re.match("mj[a-z]?_", word)}
    _, exports = (ROOT / "cpp" / "mujoco.def").read_text().split("EXPORTS")
    assert set(exports.split()) == called
