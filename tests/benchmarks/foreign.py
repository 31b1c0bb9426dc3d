"""How right the diagnosis is on joints that another generator made (shared/data/foreign_cases).

python tests/benchmarks foreign                  every case; a table at the end
python tests/benchmarks foreign 3 7 --no-add     some of them, the diagnosis alone

Per case: the verdict and the first name beside the answer, and the error of whole runs that nothing
has seen, after `joda add`, in units of what the true joint misses from a start that is as noisy.
"""

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
import time
import traceback
from pathlib import Path

from assets import SHARED
from hidden_cases import mended, missed

FOLDER = SHARED / "data" / "foreign_cases"


def examined(job: tuple[Path, bool]) -> dict:
    """One case: what was said, and the errors."""
    folder, adds = job
    os.chdir(tempfile.gettempdir())
    try:
        return {"case": folder.name} | _examined(folder, adds)
    except Exception:
        return {"case": folder.name, "failed": traceback.format_exc()}


def _examined(folder: Path, adds: bool) -> dict:
    from joda.diagnosis.outcome import read_runs
    from joda.diagnosis.verdict import diagnosed
    from joda.measured.reading import read_measured

    answer = json.loads((folder / "answer.json").read_text())
    runs, unseen = (sorted((folder / part).glob("*.csv")) for part in ("runs", "heldout"))
    model = folder / "model.xml"
    begun = time.perf_counter()
    measured = read_runs(model, answer["joint"], runs)
    said = diagnosed(measured).diagnosis
    row = {
        "seconds": time.perf_counter() - begun,
        "answer": answer["effect"] or answer["not_in_any_catalogue"] or "nothing",
        "right": right(answer, said),
        "verdict": said.verdict,
        "named": [(one.effect, round(one.probability, 3)) for one in said.effects],
        "noise": answer["position_noise"],
        "floor": measured.floor,
    }
    held_out = read_measured(model, answer["joint"], unseen)
    before = after = missed(held_out)
    if adds and said.verdict == "missing_effect":
        first = said.effects[0]
        what = first.effect, first.direction, first.interval
        added_effect, better = mended(measured, held_out, *what)
        row["added"] = added_effect.effect or added_effect.reason
        after = missed(better)
    achievable = answer["achievable_held_out_rmse"]
    row |= {"before": before.whole / achievable, "after": after.whole / achievable}
    return row


def right(answer: dict, said) -> bool:
    """Whether the first thing said is what the answer says."""
    names = {answer["effect"], *answer["also_right"]}
    first = said.effects[0].effect if said.effects else None
    if answer["verdict"] == "missing_effect":
        return said.verdict == "missing_effect" and first in names
    return said.verdict == answer["verdict"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", type=int)
    parser.add_argument("--no-add", action="store_true")
    parser.add_argument("--folder", type=Path, default=FOLDER)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    wanted = {f"case{number:02d}" for number in args.cases}
    folders = [one for one in sorted(args.folder.glob("case*")) if one.name in wanted or not wanted]
    os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"
    rows = []
    with multiprocessing.get_context("spawn").Pool(args.workers) as pool:
        jobs = [(folder.resolve(), not args.no_add) for folder in folders]
        for row in pool.imap_unordered(examined, jobs):
            rows.append(row)
            print(told(row), file=sys.stderr, flush=True)
            if args.out:
                with args.out.open("a") as file:
                    file.write(json.dumps(row) + "\n")
    fine = [row for row in rows if "failed" not in row]
    near = [row for row in fine if row["after"] <= 1.5]
    print(f"right {sum(row['right'] for row in fine)} of {len(rows)}")
    print(f"unseen error within 1.5 of the achievable one: {len(near)} of {len(rows)}")


def told(row: dict) -> str:
    """A row in a line."""
    if "failed" in row:
        return f"{row['case']}  failed\n{row['failed']}"
    named = ", ".join(f"{name} {100 * share:.0f} %" for name, share in row["named"][:3])
    added = row.get("added")
    refused = f"; {added}" if added and added != row["named"][0][0] else ""
    return (
        f"{row['case']} {'  ' if row['right'] else '! '}{row['answer']:32} {row['verdict']:16} "
        f"{named or '-'}; unseen {row['before']:.1f} -> {row['after']:.2f}; "
        f"{row['seconds']:.0f} s{refused}"
    )
