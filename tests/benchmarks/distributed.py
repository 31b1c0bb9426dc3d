"""What a task costs beside its work, and the bytes that it moves, on Ray's workers here.

    python tests/benchmarks distributed [JOINTS [EMPTY [ROUNDS]]]

JOINTS simulated doors are diagnosed by two workers; then EMPTY whose run says nothing, so that only
the way there and back takes time; then the joints of ROUNDS rounds of made objects (46 in each) are
given their behaviours. A count of 0 leaves one out.
"""

import sys
import tempfile
import time
from pathlib import Path
from typing import Literal

from distributed_cases import make
from joint_table import write

from joda import distribute

SEED = 1
"""Of the first round of made objects."""


def main() -> None:
    given = list(map(int, sys.argv[1:]))
    joints, empty, rounds = given + [1000, 1000, 22][len(given) :]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if joints:
            cases = make(folder / "doors", joints)
            measure("diagnose", cases, joints, _size(cases))
        if empty:
            cases = make(folder / "empty", empty)
            for path in cases.rglob("*.csv"):
                path.write_text("time,position\n0,0\n")
            measure("diagnose", cases, empty, _size(cases))
        if rounds:
            (cases := folder / "objects").mkdir()
            made = [write(cases / f"{k}", SEED + k, False, 1) for k in range(rounds)]
            # each joint's task takes along the round that it is of
            there = sum(_size(cases / f"{k}") * count for k, count in enumerate(made))
            measure("generate", cases, sum(made), there)


def measure(what: Literal["diagnose", "generate"], cases: Path, count: int, there: int) -> None:
    """Prints what so many tasks take, which take along so many bytes."""
    out = cases.with_name(f"{cases.name}.out")
    begin = time.perf_counter()
    done = distribute(what, cases, out, ray="local", workers=2)
    seconds = time.perf_counter() - begin
    print(
        f"{count} of {cases.name}: {seconds:.1f} s, {1e3 * seconds / count:.0f} ms each, "
        f"{sum(not one.failed for one in done)} done; "
        f"{there / count / 1e3:.1f} kB there, {_size(out) / count / 1e3:.1f} kB back each"
    )


def _size(folder: Path) -> int:
    """Bytes of all files."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
