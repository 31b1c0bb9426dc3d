"""The shape of the package: imports go downward, and importing it stays light."""

import re
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "docs"))
from architecture import imports, longest

from joda import COMMANDS

PACKAGE = Path(__file__).parents[1] / "python" / "joda"

LAYERS = [
    {"plain", "threads"},
    {"errors", "_core", "component"},
    {"files", "effects"},
    {"making", "companions"},
    {"plugin"},
    {"profile"},
    {"field", "template", "proposal"},
    {"scenes"},
    {"exporting", "compiling", "joints"},
    {"mjx", "pictures", "warp"},
    {"measured"},
    {"estimation"},
    {"hidden", "importing", "interaction", "diagnosis"},
    {"refining", "propose"},
    {"terminal"},
    {"commands"},
    {"cli"},
    {"__main__"},
]
"""Modules and packages; each imports from those above it only."""
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}


def imported_rooms(path: Path) -> set[str]:
    """Modules and packages of joda that the file imports at run time."""
    return {name.partition(".")[0] for name in imports(path)} & LEVEL.keys()


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: path.stem)
def test_imports_go_downward(path):
    name = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if name == "__init__":
        return
    for other in imported_rooms(path) - {name}:
        assert LEVEL[other] < LEVEL[name], f"{name} imports {other}"


@pytest.mark.parametrize("package", sorted(p.parent for p in PACKAGE.rglob("*/__init__.py")))
def test_within_a_package_imports_go_downward_too(package):
    inside = "joda." + ".".join(package.relative_to(PACKAGE).parts) + "."
    graph = {}
    for path in package.glob("*.py"):
        text = path.read_text()
        graph[path.stem] = set(re.findall(rf"from {re.escape(inside)}(\w+)", text)) - {path.stem}
    list(TopologicalSorter(graph).static_order())  # raises CycleError


def test_the_way_from_what_was_measured_to_the_verdict_is_short():
    way = longest("diagnosis.verdict", "measured.runs")
    assert way[0] == "diagnosis.verdict" and way[-1] == "measured.runs"
    assert len(way) <= 9, way


def test_every_module_has_its_layer():
    names = {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or path.is_dir()}
    assert names - {"__init__", "__pycache__"} <= LEVEL.keys()


def imported(code: str) -> set[str]:
    """The modules that a Python has imported after it has run the code."""
    code = (
        f"import atexit, sys; atexit.register(lambda: print(*sys.modules, file=sys.stderr))\n{code}"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return set(result.stderr.split())


HEAVY = {"mujoco", "numpy", "scipy", "matplotlib", "jax", "rich"}


def test_importing_joda_is_light():
    assert not imported("import joda") & (HEAVY | {"typer", "pydantic"})


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["doctor", "--help"]])
def test_help_needs_nothing_heavy(arguments):
    """Typer itself imports pydantic for the help of a command."""
    code = f"sys.argv = {['joda', *arguments]}\nfrom joda.cli import main\nmain()"
    assert not imported(code) & HEAVY


SELDOM_NEEDED = {"matplotlib", "jax", "rich", "scipy.stats", "scipy.signal", "anthropic", "nicegui"}


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_is_loaded_without_what_few_of_its_runs_need(command):
    code = f"sys.argv = ['joda', '{command}', '--help']\nfrom joda.cli import main\nmain()"
    assert not imported(code) & SELDOM_NEEDED
