"""Laws of no catalogue, learned: how far runs that nothing has seen are missed before, after,
and by the true joint itself.

python tests/benchmarks unknown [--cases 10] [--seed fresh] [--family laboratory] -o unknown.jsonl
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
from hidden_cases import read

from joda.diagnosis.adding import error
from joda.diagnosis.learning.term_selection import learn
from joda.diagnosis.split import parted
from joda.hidden import FAMILIES, draw

NEAR = 2.0
"""Error of whole unseen runs, in the true joint's own, that counts as near."""


def examined(seed: int, effect: str, family: str) -> dict:
    """One case: what it hides, and its errors in windows and on whole runs."""
    case = draw(seed, effect, family=family)
    known, unseen = read(case)
    begun = time.process_time()
    added_effect, found = learn(*parted(known))
    took = time.process_time() - begun
    errors = {
        when: vars(error(unseen, profile))
        for when, profile in (("before", known.profile), ("after", added_effect.profile))
    }
    return {
        **{"seed": seed, "effect": effect, "family": family, "noise": case.noise},
        **{"terms": found and vars(found.law.terms), "reason": added_effect.reason},
        **{"unseen": errors, "achievable": case.achievable.together, "seconds": took},
    }


def told(rows: list[dict]) -> list[str]:
    """A table of the laws, and what holds for all."""
    out = ["| law | cases | learned | whole runs, after / before | windows, after / before |"]
    out.append("|---|---|---|---|---|")
    for effect in sorted({row["effect"] for row in rows}):
        own = [row for row in rows if row["effect"] == effect]
        learned = sum(row["terms"] is not None for row in own)
        parts = " | ".join(f"{np.median([part(row, of) for row in own]):.2g}" for of in OF)
        out.append(f"| {effect} | {len(own)} | {learned} | {parts} |")
    near = [ratio(row) <= NEAR for row in rows]
    worse = [part(row, "window") > 1 for row in rows]
    seconds = [row["seconds"] for row in rows]
    out.append(
        f"whole unseen runs within {NEAR:g} times what the truth misses: {sum(near)} of "
        f"{len(rows)}; windows missed by more than before: {sum(worse)}; "
        f"{np.median(seconds):.0f} s of a core in the median, {max(seconds):.0f} s at most"
    )
    return out


OF = ("whole", "window")


def part(row: dict, of: str) -> float:
    """The error that is left, in that before."""
    return row["unseen"]["after"][of] / row["unseen"]["before"][of]


def ratio(row: dict) -> float:
    """Error of whole unseen runs in the true joint's own, of which noise is the least."""
    return row["unseen"]["after"]["whole"] / max(row["achievable"], row["noise"])


def main() -> None:
    """Draws cases law by law, and writes a line for each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=10)
    parser.add_argument("--seed", default="fresh")
    parser.add_argument("--family", default="laboratory", choices=sorted(FAMILIES))
    parser.add_argument("-o", "--output", type=Path, default=Path("unknown.jsonl"))
    given = parser.parse_args()
    seed = None if given.seed == "fresh" else int(given.seed)
    entropy = np.random.SeedSequence(seed).entropy % 2**32 if seed is None else seed
    print(f"seed {entropy}")
    rng, laws, rows = np.random.default_rng(entropy), tuple(FAMILIES[given.family].uncatalogued), []
    for number in range(given.cases):
        effect = laws[number % len(laws)]
        row = examined(int(rng.integers(2**31)), effect, given.family)
        rows.append(row)
        with given.output.open("a") as file:
            file.write(json.dumps(row) + "\n")
        print(f"{number + 1}: {effect}: {part(row, 'whole'):.3g}, {ratio(row):.3g}", flush=True)
    print("\n".join(told(rows)))
