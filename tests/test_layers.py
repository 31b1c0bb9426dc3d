"""The shape of the package: imports go downward, and importing it stays light."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "python" / "joda"

LAYERS = [
    {"errors", "_build", "_core"},
    {"files", "plugin"},
    {"runs", "least_squares", "limits", "smoothing", "stiffness"},
    {"hidden", "windows"},
    {"judge", "cutting"},
    {"component"},
    {"effects"},
    {"profile"},
    {"field", "model", "mjcf", "template", "proposal"},
    {"scene", "motion", "offscreen", "resistance", "_schema", "part", "laws"},
    {"studio", "_context"},
    {"_attach", "_compile", "draw", "suspicions"},  # stages, never each other
    # what combines them
    {"native", "page"},
    {"_plot", "_bench", "_render", "sheet", "rig", "changes", "mjx", "parameters"},
    {"behaviour", "_templates", "solo", "gauge", "places", "single", "hypotheses"},
    {"curves", "replay"},
    {"comparison"},
    {"maps", "static"},
    {"baseline"},
    {"guessing"},
    {"knocks"},
    {"ranking"},
    {"_compare"},
    {"experiments", "phrases", "mending", "weighing", "holdout"},
    {"findings"},
    {"diagnosis"},
    {"improving", "outcome"},
    {"_diagnose", "_improve"},
    {"_add"},
    {"stretches"},
    {"misfit"},
    {"fitting"},
    {"_refine"},
    {"wishes"},
    {"propose"},
    {"history"},
    {"session"},
    {"_generate"},  # the loop
    {"_generate_all", "_revise"},
    {"_demo"},
    {"_hidden_effect"},
    {"cli"},
]
LEVEL = {name: level for level, names in enumerate(LAYERS) for name in names}


def imports(path: Path) -> set[str]:
    """Modules of joda that the file imports at run time."""
    tree = ast.parse(path.read_text())
    checked = {
        id(node)
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for node in ast.walk(block)
    }
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and id(node) not in checked and node.module:
            if node.module == "joda":
                found |= {alias.name for alias in node.names}
            elif node.module.startswith("joda."):
                found.add(node.module.split(".")[1])
    return found & LEVEL.keys()


@pytest.mark.parametrize("path", sorted(PACKAGE.rglob("*.py")), ids=lambda path: path.stem)
def test_imports_go_downward(path):
    name = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if name == "__init__":
        return
    for other in imports(path) - {name}:
        assert LEVEL[other] < LEVEL[name], f"{name} imports {other}"


def test_every_module_has_its_layer():
    names = {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or path.is_dir()}
    assert names - {"__init__", "__pycache__"} <= LEVEL.keys()


@pytest.mark.parametrize("heavy", ["pydantic", "matplotlib", "typer", "scipy", "jax", "rich"])
def test_importing_joda_is_light(heavy):
    code = f"import joda, sys; sys.exit('{heavy}' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def test_help_needs_nothing_heavy():
    code = (
        "import sys; sys.argv = ['joda', '--help']\n"
        "from joda.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "sys.exit(any(name in sys.modules for name in ('matplotlib', 'scipy', 'pydantic', 'jax')))"
    )
    assert subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL).returncode == 0
