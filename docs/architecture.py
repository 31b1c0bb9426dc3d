"""The architecture as imports have it: packages in layers, and modules from runs to a verdict."""

import ast
from collections.abc import Mapping
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / "python" / "joda"
WAY = ("measured", "estimation", "diagnosis")
"""Packages that measured runs pass on their way to a verdict."""
LETTER, HEIGHT, GAP, ROW = 7.2, 24, 12, 58
"""Of the drawing, px: width of a letter, height of a box, between boxes, between layers."""
Graph = Mapping[str, frozenset[str]]


def page() -> str:
    """The page, as text."""
    packages = _graph({path: _package(path) for path in PACKAGE.rglob("*.py")})
    rooms = _rooms()
    way = longest("diagnosis.verdict", "measured.runs")
    return "\n\n".join(
        [
            "# Architecture",
            "Drawn from the imports at each build. Everything imports downward only "
            "(`tests/test_layers.py`); an arrow that others already imply is left out.",
            _drawing(packages),
            "## From runs to a verdict\n\nThe modules that `diagnosis.verdict` is made of; the "
            f"longest way down to what was measured has {len(way)}: "
            + " → ".join(f"`{name}`" for name in way)
            + ".",
            _drawing(_reached(rooms, "diagnosis.verdict")),
        ]
    )


def longest(top: str, down_to: str) -> tuple[str, ...]:
    """The longest way of imports from a room of `WAY` down to another, both included."""
    rooms = _rooms()
    above = {name for name in rooms if down_to in _reached(rooms, name)}
    return _longest({name: rooms[name] & above for name in above}, top)


@cache
def _rooms() -> Graph:
    """The modules of `WAY` by their package and name."""
    modules = {path: path.stem for name in WAY for path in (PACKAGE / name).rglob("*.py")}
    inside = {path: name for path, name in modules.items() if name != "__init__"}
    return _graph({path: f"{path.parent.name}.{name}" for path, name in inside.items()})


def _package(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def _graph(names: Mapping[Path, str]) -> Graph:
    """What each imports of the others."""
    known = set(names.values())
    out: dict[str, set[str]] = {
        name: set() for name in known if name not in ("__init__", "__main__")
    }
    for path, name in names.items():
        if name in out:
            wanted = {part for imported in imports(path) for part in _names(imported)}
            out[name] |= {one for one in wanted & out.keys() if one != name}
    return {name: frozenset(others) for name, others in out.items()}


def _names(imported: str) -> tuple[str, ...]:
    """What an imported module may be called: its outermost package, or with its own."""
    parts = imported.split(".")
    return parts[0], ".".join(parts[-2:])


def imports(path: Path) -> set[str]:
    """Modules of joda that a file imports at run time, without the package's own name."""
    tree = ast.parse(path.read_text("utf-8"))
    typing = {
        id(node)
        for block in ast.walk(tree)
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING"
        for node in ast.walk(block)
    }
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and id(node) not in typing:
            module = (node.module or "").removeprefix("joda").removeprefix(".")
            if (node.module or "").split(".")[0] == "joda":
                whole = {f"{module}.{alias.name}".strip(".") for alias in node.names}
                found |= whole | ({module} if module else set())
    return found


def _reached(graph: Graph, top: str) -> Graph:
    """What one is made of."""
    found, todo = set(), [top]
    while todo:
        if (name := todo.pop()) not in found:
            found.add(name)
            todo += graph[name]
    return {name: graph[name] & found for name in found}


def _longest(graph: Graph, top: str) -> tuple[str, ...]:
    """The longest way down."""

    @cache
    def way(name: str) -> tuple[str, ...]:
        return (name, *max(map(way, sorted(graph[name])), key=len, default=()))

    return way(top)


def _drawing(graph: Graph) -> str:
    """Boxes in layers, each above all that it imports."""
    layers: dict[int, list[str]] = {}
    for name in sorted(graph):
        layers.setdefault(len(_longest(graph, name)), []).append(name)
    wide = {name: LETTER * len(name) + 14 for name in graph}
    rows = [layers[level] for level in sorted(layers, reverse=True)]
    spans = [sum(wide[name] + GAP for name in row) for row in rows]
    width = max(spans) + GAP
    place: dict[str, tuple[float, float]] = {}
    boxes = []
    for number, (row, span) in enumerate(zip(rows, spans, strict=True)):
        x, y = (width - span + GAP) / 2, GAP + number * ROW
        for name in row:
            middle = x + wide[name] / 2
            place[name] = middle, y
            boxes.append(
                f'<rect x="{x:.0f}" y="{y}" width="{wide[name]:.0f}" height="{HEIGHT}" rx="4" '
                f'fill="#fff" stroke="#6b7280"/><text x="{middle:.0f}" y="{y + 16}" '
                f'text-anchor="middle">{name}</text>'
            )
            x += wide[name] + GAP
    lines = [
        f'<line x1="{place[a][0]:.0f}" y1="{place[a][1] + HEIGHT}" x2="{place[b][0]:.0f}" '
        f'y2="{place[b][1]}" stroke="#c3c8d0"/>'
        for a in sorted(graph)
        for b in sorted(_direct(graph, a))
    ]
    high = 2 * GAP + ROW * len(layers)
    return (
        f'<svg viewBox="0 0 {width:.0f} {high}" width="100%" style="max-width: {width:.0f}px" '
        f'font-family="monospace" font-size="12">{"".join([*lines, *boxes])}</svg>'
    )


def _direct(graph: Graph, name: str) -> set[str]:
    """What one imports that no other of its imports is made of."""
    below = {one: set(_reached(graph, one)) - {one} for one in graph[name]}
    return {one for one in graph[name] if not any(one in other for other in below.values())}
