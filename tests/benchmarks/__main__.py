"""Runs what measures, apart from what asserts.

python tests/benchmarks                     what there is
python tests/benchmarks NAME [ARGUMENTS]    one of them
"""

import ast
import sys
from importlib import import_module
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "helpers")]


def main() -> None:
    there = {path.stem: path for path in sorted(HERE.glob("*.py")) if runs(path)}
    name, *rest = sys.argv[1:] or [""]
    if name in there:
        sys.argv = [name, *rest]
        import_module(name).main()
        return
    width = max(map(len, there))
    for stem, path in there.items():
        about = (ast.get_docstring(ast.parse(path.read_text("utf-8"))) or "").partition("\n\n")[0]
        print(f"{stem:{width}}  {' '.join(about.split())}")
    if name:
        sys.exit(f"\n{name!r} is none of these.")


def runs(path: Path) -> bool:
    """Whether it is a benchmark and no part of one."""
    return path != Path(__file__) and "\ndef main() -> None:" in path.read_text("utf-8")


if __name__ == "__main__":
    main()
