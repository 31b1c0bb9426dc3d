"""What a task costs beside its work, and the bytes that it moves, on Ray's workers here.

    python tests/benchmarks distributed [JOINTS [EMPTY]]

JOINTS simulated doors are diagnosed by two workers; then EMPTY whose run says nothing, so that only
the way there and back takes time.
"""

import sys
import tempfile
import time
from pathlib import Path

from distributed_cases import make

from joda import distribute


def main() -> None:
    joints = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    empty = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for what, count in (("joints", joints), ("empty tasks", empty)):
            cases, out = make(folder / what / "cases", count), folder / what / "out"
            if what != "joints":
                for path in cases.rglob("*.csv"):
                    path.write_text("time,position\n0,0\n")
            there = sum(path.stat().st_size for path in cases.rglob("*") if path.is_file())
            begin = time.perf_counter()
            done = distribute("diagnose", cases, out, ray="local", workers=2)
            seconds = time.perf_counter() - begin
            back = sum(path.stat().st_size for path in out.rglob("*") if path.is_file())
            print(
                f"{count} {what}: {seconds:.1f} s, {1e3 * seconds / count:.0f} ms each, "
                f"{sum(not one.failed for one in done)} diagnosed; "
                f"{there / count / 1e3:.1f} kB there, {back / count / 1e3:.1f} kB back each"
            )
