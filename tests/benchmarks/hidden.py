"""How well hidden effects are found, placed and added: joda against joda.hidden, an independent
simulator.

python tests/benchmarks hidden                        every line, a table at the end; hours
python tests/benchmarks hidden forced --cases 50      one line
python tests/benchmarks hidden forced --seed 7 --out forced.jsonl    goes on where it was stopped
python tests/benchmarks hidden families --family all --cases 2       every effect of every family
python tests/benchmarks hidden families --family switches --free --no-add    named, not added
python tests/benchmarks hidden mixed --hides effect --free --cases 60       so many of all families
python tests/benchmarks hidden field --cases 30                      numbers that are off

Lines: none, forced, free, hard, outside, confident, place, add (and rose), time, two, cover, sure,
few, families, mixed, field, all. `few`: one to three of the runs only, and adding what is named
first. `cover`: whether the true size and place lie within what is said, where only the true effect
is asked for. `sure`: forced and free, the same and how sure the answers are. `families`: nothing,
every effect with force and by positions only, and laws of no catalogue, so many cases of each; a
table family by effect, and the error on unseen whole runs. `mixed`: some of these, of each family
in turn and of any effect. `field`: the family of that name, every third case hides nothing. Every
run draws a new master seed, from which all cases follow.
"""

import argparse
import json
import multiprocessing
import os
import secrets
import signal
import sys
import tempfile
import time
import traceback
from dataclasses import asdict, replace
from pathlib import Path

from hidden_cases import Job, case_of, job_of, mended, missed, mixed, read, spread
from hidden_families import by_effect
from hidden_field import by_numbers
from hidden_figures import fine, table, told
from hidden_floor import floor_of

from joda.diagnosis.adding import add_effect
from joda.diagnosis.improvement import improved
from joda.diagnosis.split import parted
from joda.diagnosis.verdict import diagnosed
from joda.hidden import FAMILIES, Case
from joda.hidden.cases import FAMILY
from joda.measured.measured_joint import Measured

CASES = {"none": 40, "forced": 75, "free": 48, "hard": 24, "outside": 48, "place": 36, "add": 25}
CASES |= {"field": 100, "two": 10, "cover": 96, "few": 50, "families": 1, "mixed": 60}
"""Groups of cases, and how many there are unless told; of `families`, of each effect."""
APART = ("place", "cover", "few", "families", "mixed", "field")
NEEDS = {"all": [group for group in CASES if group not in APART]}
NEEDS |= {"sure": ["forced", "free"]}
NEEDS |= {"confident": ["none", "forced", "free", "hard", "outside"]}
NEEDS |= {"rose": ["add"], "time": ["add"]} | {group: [group] for group in CASES}
"""Groups of each line."""


# --- what joda says and does
def examined(job: Job) -> dict:
    """One case: a row of the .jsonl."""
    row = {**vars(job), "exclude": list(job.exclude)}
    try:
        case = case_of(job)
        row |= {"seed": case.seed, "visible": min(case.visible, 1e6), "noise": case.noise}
        row |= {"seal": case.seal, "samples": sum(len(run.time) for run in case.train)}
        row["effect"] = case.seal["effect"]
        train, held_out = read(case)
        if job.second:
            row["second"] = case.seal["second"]["effect"]
            return row | both(case, train, held_out)
        if job.runs:
            return row | few(case, train.changed(runs=job.runs), held_out)
        row |= said(train, job.exclude)
        if job.group == "families" and job.adds:
            row |= unseen(row, case, train, held_out)
        if job.group == "field" and job.adds:
            row |= after_improve(case, train, held_out)
        if job.group == "none" and job.family == FAMILY:
            row["floor"] = floor_of(case, held_out)
        if job.wrong:
            row |= added(job, row, case, train, held_out)
        return row
    except Exception:
        return row | {"failed": traceback.format_exc()}


def said(train: Measured, exclude: tuple[str, ...] = ()) -> dict:
    """The diagnosis, in short."""
    begun = time.perf_counter()
    found = diagnosed(train, exclude)
    diagnosis = found.diagnosis
    keys = ("effect", "probability", "interval", "interval_error", "direction", "magnitude")
    keys += ("magnitude_error", "held_out_error_after", "indistinguishable_from")
    return {
        "seconds": time.perf_counter() - begun,
        "verdict": diagnosis.verdict,
        "looks": [asdict(look) for look in found.looks],
        "corrections": [asdict(one) for one in diagnosis.corrections],
        "named": [{key: getattr(one, key) for key in keys} for one in diagnosis.effects],
    }


def added(job: Job, row: dict, case: Case, train: Measured, held_out: Measured) -> dict:
    """Held-out errors after adding what was named first, and after adding a wrong effect."""
    kept, held = parted(train)
    before = missed(held_out).window
    out = {"before": before, "floor": floor_of(case, held_out)}
    tried = {"wrong": (job.wrong,)}
    if row["named"]:
        tried["after"] = tuple(row["named"][0][key] for key in ("effect", "direction", "interval"))
    for key, effect in tried.items():
        begun = time.perf_counter()
        added_effect = add_effect(kept, held, *effect)
        out[f"{key}_seconds"] = time.perf_counter() - begun
        new = missed(held_out, added_effect.profile).window if added_effect.effect else before
        out[f"{key}_error"] = new
    return out


def unseen(row: dict, case: Case, train: Measured, held_out: Measured) -> dict:
    """Errors on unseen whole runs, of what the true joint misses; after adding what was named, or
    after `improve` where only numbers are off."""
    if row["verdict"] != "missing_effect" and row["corrections"]:
        found = after_improve(case, train, held_out)
        return {key: found[key] for key in ("unseen_before", "unseen")}
    before = after = missed(held_out).whole
    if row["verdict"] == "missing_effect":
        first = row["named"][0]
        what = (first[key] for key in ("effect", "direction", "interval"))
        after = missed(mended(train, held_out, *what)[1]).whole
    least = case.achievable.together
    return {"unseen_before": before / least, "unseen": after / least}


def after_improve(case: Case, train: Measured, held_out: Measured) -> dict:
    """Errors on unseen whole runs, of what the true joint misses; after `improve`."""
    steps, why = improved(train, parted(train))
    last, least = steps[-1], case.achievable.together
    right = last.right.of(held_out) if last.right else held_out
    right = right.stopped(last.stops) if last.stops else right
    return {
        "steps": [step.effect for step in steps[1:]],
        "why": why,
        "unseen_before": missed(held_out).whole / least,
        "unseen": missed(right, last.profile).whole / least,
    }


def few(case: Case, train: Measured, held_out: Measured) -> dict:
    """What is named of few runs, and the error on others before and after it is added."""
    row = said(train)
    before = missed(held_out).window
    out = row | {"before": before, "after_error": before, "added": [], "reason": None}
    if not row["named"]:
        return out
    first = tuple(row["named"][0][key] for key in ("effect", "direction", "interval"))
    added_effect = add_effect(*parted(train), *first)
    if not added_effect.effect:
        return out | {"reason": added_effect.reason}
    after = missed(held_out, added_effect.profile).window
    departs = list(added_effect.departs.sentences)
    return out | {"after_error": after, "added": [added_effect.effect], "departs": departs}


def both(case: Case, train: Measured, held_out: Measured) -> dict:
    """What improve adds to a joint that hides two effects."""
    begun = time.perf_counter()
    steps, why = improved(train, parted(train))
    return {
        "seconds": time.perf_counter() - begun,
        "added": [step.effect for step in steps[1:]],
        "why": why,
        "before": missed(held_out).window,
        "after_error": missed(held_out, steps[-1].profile).window,
        "floor": floor_of(case, held_out),
    }


# --- running
def begin(numbers) -> None:
    """A worker: on a core of its own, stopped by the bench; MuJoCo logs outside the repository."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.chdir(tempfile.gettempdir())
    if hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[(numbers.get() + os.getppid()) % len(cores)]})


def rows_of(path: Path, jobs: list[Job]) -> list[dict]:
    """What is there of some jobs already."""
    wanted = {(job.master, *place(vars(job))) for job in jobs}
    lines = path.read_text().splitlines() if path.exists() else []
    rows = [json.loads(line) for line in lines if line.endswith("}")]
    return [row for row in rows if (row["master"], *place(row)) in wanted]


def place(row: dict) -> tuple[str, str, int]:
    """Which of a master seed's cases it is."""
    return row.get("family", FAMILY), row["group"], row["number"]


def bench(jobs: list[Job], workers: int, path: Path) -> list[dict]:
    """Rows of all jobs; each is written as soon as it is there."""
    rows = rows_of(path, jobs)
    there = {place(row) for row in rows}
    left = [job for job in jobs if place(vars(job)) not in there]
    os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"
    context = multiprocessing.get_context("spawn")
    numbers = context.Queue()
    for k in range(workers):
        numbers.put(k)
    with path.open("a") as file, context.Pool(workers, begin, (numbers,)) as pool:
        try:
            for row in pool.imap_unordered(examined, left):
                file.write(json.dumps(row) + "\n")
                file.flush()
                rows.append(row)
                mark = "  " if fine(row) else "! "
                print(f"{len(rows):4} of {len(jobs)} {mark}{told(row)}", file=sys.stderr)
        except KeyboardInterrupt:
            print(f"stopped; go on with --seed {jobs[0].master} --out {path}", file=sys.stderr)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("line", nargs="?", default="all", choices=NEEDS)
    parser.add_argument("--family", default=FAMILY, choices=[*FAMILIES, "all"])
    parser.add_argument("--cases", type=int, help="of each group; of `families`, of each effect")
    parser.add_argument("--seed", type=int, default=secrets.randbits(32))
    parser.add_argument("--free", action="store_true", help="only cases with positions alone")
    parser.add_argument(
        "--no-add", action="store_true", help="of `families` and `field`: nothing is added"
    )
    parser.add_argument(
        "--hides", default="effect", choices=["nothing", "effect", "outside"], help="of `mixed`"
    )
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    if args.family != FAMILY and {"add", "two"} & set(NEEDS[args.line]):
        parser.error(f"{args.line} needs the true joint as a profile, which only {FAMILY} has")
    if args.line == "field":
        args.family = "field"
    path = args.out or Path(tempfile.gettempdir()) / f"hidden_bench_{args.seed}.jsonl"
    print(f"master seed {args.seed}, rows in {path}\n", flush=True)
    if args.line == "mixed":
        jobs = mixed(args.seed, args.hides, not args.free, args.cases or CASES["mixed"])
    else:
        jobs = [
            job_of(args.seed, group, number, family)
            for family in (FAMILIES if args.family == "all" else [args.family])
            for group in NEEDS[args.line]
            for number in range(count(group, family, args.cases))
        ]
    jobs = [replace(job, adds=not args.no_add) for job in jobs if not (args.free and job.forced)]
    rows = bench(jobs, args.workers, path.resolve())
    if args.line == "field":
        by_numbers(rows)
    elif args.line in ("families", "mixed"):
        by_effect(rows)
    else:
        table(rows)


def count(group: str, family: str, cases: int | None) -> int:
    """How many cases a group has."""
    return (cases or CASES[group]) * (len(spread(family)) if group == "families" else 1)
