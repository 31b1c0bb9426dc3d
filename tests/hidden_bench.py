"""How well hidden effects are found, placed and added: joda against joda.hidden, an independent
simulator.

python tests/hidden_bench.py                        every line, a table at the end; hours
python tests/hidden_bench.py forced --cases 50      one line
python tests/hidden_bench.py forced --seed 7 --out forced.jsonl    goes on where it was stopped

Lines: none, forced, free, hard, outside, confident, place, add (and rose), time, two, all. Every
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
from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from unittest import mock
from zlib import crc32

import numpy as np
from hidden_model import true_profile
from scipy.interpolate import CubicSpline

from joda.diagnosis.improving import improved
from joda.diagnosis.mending import error, mend, parted
from joda.diagnosis.verdict import diagnosed
from joda.hidden import EFFECTS, OUTSIDE, Case, draw, simulator, write
from joda.hidden.cases import PUSHED, VISIBLE
from joda.hidden.laws import State
from joda.hidden.truth import Play, Truth
from joda.measured import smoothing
from joda.measured.reading import Measured, read_measured
from joda.measured.replay import START, TRIES, WINDOW

FREE = tuple(name for name in EFFECTS if name not in PUSHED)
HARD = ("stribeck_friction", "presliding_friction", "backlash")
BROAD = tuple(n for n in EFFECTS if n.startswith(("constant_p", "constant_n", "spring_return")))
BOXES = ("detent_internal", "bistable_mechanism_internal")
ENDS = tuple(n for n in EFFECTS if n.startswith(("magnetic", "spring_loaded")))
RUBS = ("constant_friction_hinge", "position_dependent_friction", "load_dependent_friction")
DRAGS = ("constant_damping_hinge", "position_dependent_damping", "direction_dependent_damping")
LOCAL = (*BROAD, *BOXES, *ENDS, *RUBS[:2], *DRAGS[:2])
"""Effects that may act in a part of the range only."""
FAMILIES = (
    (*BROAD, "bistable_mechanism", "gravity_offset"),
    (*BOXES, *ENDS),
    (*RUBS, "asymmetric_friction", "stribeck_friction"),
    (*DRAGS, "quadratic_damping"),
    ("added_inertia", "backlash"),
)
"""Two effects of one case are of two families: within one, some make up for each other."""

CONTAINED = (
    *("constant_friction_hinge", "constant_damping_hinge"),  # in those that differ along the way
    *("constant_positive_conservative_hinge", "constant_negative_conservative_hinge"),
    *("gravity_offset", "asymmetric_friction"),  # in constant forces, and those in gravity
)
"""Effects that another entry, or the model's own with another, can be without any error."""

CASES = {"none": 40, "forced": 75, "free": 48, "hard": 24, "outside": 48, "place": 36, "add": 25}
CASES |= {"two": 10}
"""Groups of cases, and how many there are unless told."""
NEEDS = {"all": [group for group in CASES if group != "place"]}
NEEDS |= {"confident": ["none", "forced", "free", "hard", "outside"]}
NEEDS |= {"rose": ["add"], "time": ["add"]} | {group: [group] for group in CASES}
"""Groups of each line."""
AGAIN = 5
"""How often a case in which the effect hardly shows is drawn again."""
SURE = 0.9
BINS = (0.0, 0.5, 0.7, SURE, 1.0 + 1e-9)
NEAR = 1.5
"""Error on runs held out, in units of the true model's, that counts as mended."""
H = 2e-4
"""Step of the true model's replay, s."""


# --- cases
@dataclass(frozen=True)
class Job:
    """A case to be drawn and examined; `wrong` is an effect to be added on purpose."""

    master: int
    group: str
    number: int
    seed: int
    effect: str | None
    second: str | None = None
    forced: bool = True
    exclude: tuple[str, ...] = ()
    wrong: str | None = None


def dice(master: int, *what) -> np.random.Generator:
    return np.random.default_rng([master, crc32(repr(what).encode())])


def job_of(master: int, group: str, number: int) -> Job:
    """The number-th case of a group; effects come in turn, in a new order every round."""
    rng = dice(master, group, number, "case")

    def turn(names: tuple[str, ...], at: int = number) -> str:
        order = dice(master, group, names, at // len(names)).permutation(len(names))
        return names[order[at % len(names)]]

    one = Job(master, group, number, int(rng.integers(2**31)), None)
    if group == "none":
        return replace(one, forced=number % 2 == 0)
    if group == "free":
        return replace(one, effect=turn(FREE), forced=False)
    if group == "outside" and number % 2 == 0:
        return replace(one, effect=turn(OUTSIDE, number // 2))
    if group == "outside":
        effect = turn(EFFECTS, number // 2)
        return replace(one, effect=effect, exclude=(effect,))
    if group == "two":
        families = rng.choice(len(FAMILIES), 2, replace=False)
        effect, second = (str(rng.choice(FAMILIES[k])) for k in families)
        return replace(one, effect=effect, second=second)
    effect = turn({"hard": HARD, "place": LOCAL}.get(group, EFFECTS))
    if group == "add":
        others = [name for name in EFFECTS if name != effect]
        return replace(one, effect=effect, wrong=str(rng.choice(others)))
    return replace(one, effect=effect)


def case_of(job: Job) -> Case:
    """Draws again, with the next seed, where the effect hardly shows."""
    for seed in range(job.seed, job.seed + AGAIN):
        case = draw(seed, job.effect, job.forced, job.second)
        if case.visible >= VISIBLE:
            break
    return case


def read(case: Case) -> tuple[Measured, Measured]:
    """The base model with the runs to learn from, and with those held out."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write(case, folder)
        train, held_out = (
            read_measured(folder / "model.xml", case.joint, [folder / run.name for run in runs])
            for runs in (case.train, case.held_out)
        )
    return train, held_out


# --- what the true joint reaches
def true_error(case: Case) -> float:
    """RMS error (rad or m) of the true joint on the held-out runs in windows of 0.4 s.

    As `Replayer.windows` does it, and as easily misled by a knock: from starts that are fitted
    within their measurement's error, under the measured force, linear between samples. What has a
    memory starts each window as along the clean run. For a case that hides nothing, or EFFECTS: a
    delay's memory and a disturbance's clock are left out.
    """
    pieces = [piece for k, run in enumerate(case.held_out) for piece in _pieces(k, run)]
    starts, doubts = (np.array([getattr(p, key) for p in pieces]) for key in ("start", "doubt"))
    forces = np.repeat(np.array([p.force for p in pieces]).T, 3, axis=1)
    memory = {}
    if any(isinstance(law, State | Play) for law in case.truth.hidden):
        at = np.repeat([round(p.begin / H) for p in pieces], 3)
        memory = {name: x[at, np.repeat([p.run for p in pieces], 3)] for name, x in _kept(case)}
    off = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
    best, move = np.zeros_like(starts), np.zeros_like(starts)
    least, misfits = np.full(len(pieces), np.inf), [np.zeros(0)] * len(pieces)
    for _ in range(TRIES):
        moved = np.clip(best + move, -START, START)
        q, v = np.reshape((starts + doubts * moved)[:, None] + doubts[:, None] * off, (-1, 2)).T
        path = _replayed(case.truth, forces, q, v, memory).reshape(len(forces), -1, 3)
        for k, p in enumerate(pieces):
            near = np.stack([np.interp(p.time, H * np.arange(len(path)), x) for x in path[:, k].T])
            misfit = near[0] - p.position
            wanted = np.concatenate([misfit / p.sigma, moved[k]])
            if (square := float(wanted @ wanted)) < least[k]:
                rows = np.vstack([(near[1:] - near[0]).T / p.sigma, np.eye(2)])
                least[k], best[k], misfits[k] = square, moved[k], misfit
                move[k] = -np.linalg.lstsq(rows, wanted, rcond=None)[0]
            else:
                move[k] /= 4
    return float(np.sqrt(np.mean(np.concatenate(misfits) ** 2)))


@dataclass(frozen=True)
class Piece:
    """A window of a run: its samples, their times from its begin, measured start, force."""

    run: int
    begin: float
    time: np.ndarray
    position: np.ndarray
    start: tuple[float, float]
    doubt: tuple[float, float]
    force: np.ndarray
    sigma: float


def _pieces(number: int, run) -> Iterator[Piece]:
    sigma = smoothing.noise(run.time, run.position)
    count = max(int((run.time[-1] - run.time[0]) / WINDOW + 1e-9), 1)
    for begin in run.time[0] + WINDOW * np.arange(count):
        inside = (run.time >= begin - 1e-9) & (run.time <= begin + WINDOW + 1e-9)
        if np.count_nonzero(inside) < smoothing.LEAST:
            continue
        x = smoothing.smooth(run.time, run.position, np.array([begin]), sigma)
        yield Piece(
            number,
            begin,
            run.time[inside] - begin,
            run.position[inside],
            (x.position[0], x.velocity[0]),
            (x.position_error[0], x.velocity_error[0]),
            np.interp(begin + H * np.arange(round(WINDOW / H) + 1), run.time, run.force),
            sigma,
        )


def _kept(case: Case) -> Iterator[tuple[str | int, np.ndarray]]:
    """What the joint remembers along the clean runs: states of laws (by number), handle (by name).

    Arrays have shape (steps, runs).
    """
    runs, truth = case.held_out_clean, case.truth
    t = H * np.arange(round(max(run.time[-1] for run in runs) / H) + 1)
    paths = [CubicSpline(run.time, run.position) for run in runs]
    known = [np.clip(t, run.time[0], run.time[-1]) for run in runs]
    q = np.array([path(x) for path, x in zip(paths, known, strict=True)]).T
    v = np.array([path(x, 1) for path, x in zip(paths, known, strict=True)]).T
    pushes = [np.interp(x, run.time, run.force) for run, x in zip(runs, known, strict=True)]
    push, s = np.array(pushes).T, (q - truth.joint.lo) / truth.joint.span
    for number, law in enumerate(truth.hidden):
        if isinstance(law, State):
            z = [law.start(s[0])]
            for k in range(len(t) - 1):
                z.append(law.advance(z[-1], s[k], v[k], H))
            yield number, np.array(z)
    handle = simulator._Handle(truth, q[0], v[0], H)
    if handle.loose:
        out = []
        for k in range(len(t)):
            out.append((handle.offset, handle.velocity, handle.side))
            if k + 1 < len(t):
                handle.step((q[k], v[k]), (q[k + 1], v[k + 1]), push[k])
        yield from zip(("offset", "velocity", "side"), np.moveaxis(out, 1, 0), strict=True)


def _replayed(truth: Truth, forces, q, v, memory) -> np.ndarray:
    """Positions under forces (steps + 1, lanes) from starts (lanes,) with a memory."""

    def started(law, z):
        law = copy(law)
        object.__setattr__(law, "start", lambda s: z)
        return law

    def handle(*args):
        one = HANDLE(*args)
        if "side" in memory:
            one.offset, one.side = memory["offset"], memory["side"]
            one.velocity = np.where(one.side != 0, v, memory["velocity"])
        return one

    laws = [started(law, memory[k]) if k in memory else law for k, law in enumerate(truth.hidden)]
    own = replace(truth, hidden=tuple(laws))
    with mock.patch.object(simulator, "_Handle", handle):
        steps = len(forces) - 1
        return simulator.simulate(own, simulator.Tape(forces), q, v, steps, H).position


HANDLE = simulator._Handle


def floor_of(case: Case, held_out: Measured) -> float:
    """The true model's error (rad or m): by itself, or in MuJoCo where that is more, as MuJoCo's
    steps and soft ends of the range are in every model's."""
    own = error(held_out, true_profile(case, held_out.profile)).window
    return max(true_error(case), own)


# --- what joda says and does
def examined(job: Job) -> dict:
    """One case: a row of the .jsonl."""
    row = {**vars(job), "exclude": list(job.exclude)}
    try:
        case = case_of(job)
        row |= {"seed": case.seed, "visible": min(case.visible, 1e6), "noise": case.noise}
        row |= {"seal": case.seal, "samples": sum(len(run.time) for run in case.train)}
        train, held_out = read(case)
        if job.second:
            return row | both(case, train, held_out)
        row |= said(train, job.exclude)
        if job.group == "none":
            row["floor"] = floor_of(case, held_out)
        if job.wrong:
            row |= added(job, row, case, train, held_out)
        return row
    except Exception:
        return row | {"failed": traceback.format_exc()}


def said(train: Measured, exclude: tuple[str, ...] = ()) -> dict:
    """The diagnosis, in short."""
    begun = time.perf_counter()
    diagnosis = diagnosed(train, exclude).diagnosis
    keys = ("effect", "probability", "interval", "direction", "indistinguishable_from")
    return {
        "seconds": time.perf_counter() - begun,
        "verdict": diagnosis.verdict,
        "named": [{key: getattr(one, key) for key in keys} for one in diagnosis.effects],
    }


def added(job: Job, row: dict, case: Case, train: Measured, held_out: Measured) -> dict:
    """Held-out errors after adding what was named first, and after adding a wrong effect."""
    kept, held = parted(train)
    before = error(held_out).window
    out = {"before": before, "floor": floor_of(case, held_out)}
    tried = {"wrong": (job.wrong, None)}
    if row["named"]:
        tried["after"] = row["named"][0]["effect"], row["named"][0]["direction"]
    for key, (effect, direction) in tried.items():
        begun = time.perf_counter()
        mended = mend(kept, held, effect, direction)
        out[f"{key}_seconds"] = time.perf_counter() - begun
        new = error(held_out, mended.profile).window if mended.effect else before
        out[f"{key}_error"] = new
    return out


def both(case: Case, train: Measured, held_out: Measured) -> dict:
    """What improve adds to a joint that hides two effects."""
    begun = time.perf_counter()
    steps, why = improved(train)
    return {
        "seconds": time.perf_counter() - begun,
        "added": [step.effect for step in steps[1:]],
        "why": why,
        "before": error(held_out).window,
        "after_error": error(held_out, steps[-1].profile).window,
        "floor": floor_of(case, held_out),
    }


# --- figures
def first(row: dict) -> dict:
    """What is named first; nothing is as if of no probability."""
    none = {"effect": None, "probability": 0.0, "indistinguishable_from": []}
    return (row.get("named") or [none])[0]


def right(row: dict) -> bool:
    return first(row)["effect"] == row["effect"]


def second(row: dict) -> bool:
    return row["effect"] in [one["effect"] for one in row.get("named", [])[:2]]


def alike(row: dict) -> bool:
    return right(row) or row["effect"] in first(row)["indistinguishable_from"]


def unexplained(row: dict) -> bool:
    return row.get("verdict") == "unexplained"


def silent(row: dict) -> bool:
    return row.get("verdict") in ("adequate", "insufficient_data")


def found(row: dict) -> bool:
    return {row["effect"], row["second"]} <= set(row.get("added", []))


def misled(row: dict) -> bool:
    """Whether what is named first is wrong."""
    if row["group"] in ("none", "outside"):
        return row["verdict"] == "missing_effect"
    return not right(row)


def fine(row: dict) -> bool:
    """Whether a case came out as it should."""
    if row["group"] == "none":
        return row.get("verdict") == "adequate"
    if row["group"] == "outside":
        return unexplained(row)
    return found(row) if row["second"] else right(row)


def overlap(row: dict) -> float:
    """Intersection over union of the intervals."""
    (a, b), (c, d) = row["seal"]["interval"], first(row)["interval"]
    return max(min(b, d) - max(a, c), 0.0) / (max(b, d) - min(a, c))


def local(row: dict) -> bool:
    a, b = row["seal"]["interval"]
    return b - a < 0.999


Figure = tuple[str, str, str, int]


def share(line: str, bar: str, rows: list[dict], test: Callable[[dict], bool]) -> Iterator[Figure]:
    if rows:
        yield line, bar, f"{100 * np.mean([test(row) for row in rows]):.1f} %", len(rows)


def middle(line: str, bar: str, values: list[float], unit: str = "") -> Iterator[Figure]:
    if values:
        text = f"median {np.median(values):.3g}{unit}, {min(values):.3g} to {max(values):.3g}"
        yield line, bar, text, len(values)


def figures(rows: list[dict]) -> Iterator[Figure]:
    """Every figure that the rows tell; what failed counts as wrong."""

    def of(*groups: str) -> list[dict]:
        return [row for row in rows if row["group"] in groups]

    forced, well = of("forced", "add"), [row for row in rows if "failed" not in row]
    yield from share("none: adequate", "≥ 95 %", of("none"), fine)
    for way, push in (("forced", True), ("free", False)):
        yield from share(
            f"none: adequate, {way}", "", [r for r in of("none") if r["forced"] == push], fine
        )
    yield from share("none: adequate, or too few data", "", of("none"), silent)
    yield from share("forced: right effect first", "≥ 90 %", forced, right)
    yield from share("forced: among the first two", "≥ 97 %", forced, second)
    yield from share("forced: first, or named with the first", "", forced, alike)
    yield from share("free: right effect first", "≥ 75 %", of("free"), right)
    yield from share("free: first, or named with the first", "", of("free"), alike)
    for name in HARD:
        hard = [row for row in of("hard") if row["effect"] == name]
        yield from share(f"hard: {name} first", "≥ 75 %", hard, right)
    outside = of("outside")
    beyond, removed = ([r for r in outside if bool(r["exclude"]) == out] for out in (False, True))
    yield from share("outside: unexplained", "≥ 80 %", outside, unexplained)
    yield from share("outside: beyond the catalogue", "", beyond, unexplained)
    yield from share("outside: own entry removed", "", removed, unexplained)
    alone = [row for row in removed if row["effect"] not in CONTAINED]
    yield from share("outside: removed, and in no other entry", "", alone, unexplained)
    answers = [row for row in well if row.get("named")]
    sure = [row for row in answers if first(row)["probability"] >= SURE]
    yield from share(f"confident: wrong of those with p ≥ {SURE}", "≤ 3 %", sure, misled)
    yield from share(
        f"confident: p ≥ {SURE} and wrong, of all",
        "",
        [row for row in well if not row["second"]],
        lambda row: first(row)["probability"] >= SURE and misled(row),
    )
    claims = [row for row in answers if row["verdict"] == "missing_effect"]
    for a, b in pairwise(BINS):
        some = [row for row in claims if a <= first(row)["probability"] < b]
        yield from share(
            f"calibration: right at p {a:g} to {b:.3g}", "", some, lambda row: not misled(row)
        )
    placed = [row for row in of("forced", "add", "place") if right(row) and local(row)]
    yield from middle("place: intersection over union", "≥ 0.7", [overlap(row) for row in placed])
    adds = [row for row in of("add") if "floor" in row]
    ratios = [row["after_error"] / row["floor"] for row in adds if right(row)]
    near = [row for row in adds if right(row)]
    yield from share(
        f"add: within {NEAR} of the true model's error",
        "≥ 80 %",
        near,
        lambda row: row["after_error"] <= NEAR * row["floor"],
    )
    yield from middle("add: error, of the true model's", "", ratios)
    for key, what in (
        ("after", "rose: by what was named first"),
        ("wrong", "rose: by a wrong one"),
    ):
        changes = [r[f"{key}_error"] / r["before"] for r in adds if f"{key}_error" in r]
        if changes:
            count = sum(x > 1 for x in changes)
            yield what, "0", f"{count}; at most {max(changes):.3g} times", len(changes)
    yield from share("two: both found", "≥ 60 %", of("two"), found)
    floors = [row["floor"] / row["noise"] for row in of("none", "add", "two") if "floor" in row]
    yield from middle("floor: the true model's error, of the noise", "", floors)
    yield from middle("time: diagnose", "", [r["seconds"] for r in well if not r["second"]], " s")
    seconds = [row["after_seconds"] for row in adds if "after_seconds" in row]
    yield from middle("time: add", "", seconds, " s")
    yield from middle("time: improve", "", [r["seconds"] for r in well if r["second"]], " s")


def told(row: dict) -> str:
    """One case as a line."""
    hidden = " + ".join(filter(None, (row["effect"], row["second"]))) or "nothing"
    hidden += " (its entry removed)" * bool(row["exclude"]) + ", free" * (not row["forced"])
    begin = f"{row['group']} {row['number']}, seed {row['seed']}, {hidden}: "
    if "failed" in row:
        return begin + row["failed"].strip().splitlines()[-1]
    if row["second"]:
        return begin + (", ".join(row["added"]) or "nothing") + f" added; {row['why']}"
    names = ", ".join(f"{one['effect']} {one['probability']:.2f}" for one in row["named"][:3])
    return begin + row["verdict"] + (f": {names}" if names else "")


def table(rows: list[dict]) -> None:
    """The figures as Markdown, and the cases that came out wrong."""
    print("| line | bar | measured | cases |\n|---|---|---|---|")
    for line in figures(rows):
        print("| " + " | ".join(map(str, line)) + " |")
    if bad := [row for row in rows if not fine(row)]:
        print("\nWrong:")
        print("\n".join("- " + told(row) for row in bad))


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
    wanted = {(job.master, job.group, job.number) for job in jobs}
    lines = path.read_text().splitlines() if path.exists() else []
    rows = [json.loads(line) for line in lines if line.endswith("}")]
    return [row for row in rows if (row["master"], row["group"], row["number"]) in wanted]


def bench(jobs: list[Job], workers: int, path: Path) -> list[dict]:
    """Rows of all jobs; each is written as soon as it is there."""
    rows = rows_of(path, jobs)
    there = {(row["group"], row["number"]) for row in rows}
    left = [job for job in jobs if (job.group, job.number) not in there]
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
    parser.add_argument("--cases", type=int, help="of each group")
    parser.add_argument("--seed", type=int, default=secrets.randbits(32))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    path = args.out or Path(tempfile.gettempdir()) / f"hidden_bench_{args.seed}.jsonl"
    print(f"master seed {args.seed}, rows in {path}\n", flush=True)
    groups = NEEDS[args.line]
    jobs = [job_of(args.seed, g, k) for g in groups for k in range(args.cases or CASES[g])]
    table(bench(jobs, args.workers, path.resolve()))


if __name__ == "__main__":
    main()
