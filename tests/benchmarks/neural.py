"""Laws of no catalogue, learned as joda does and by a plain neural network from the same windows:
how far both miss runs that nothing has seen, and runs faster than any they were learned from.

python tests/benchmarks neural [--cases 6] [--skip 0] [--seed fresh] -o neural.jsonl

The network's weight decay, and when its fit stops, are chosen by the loss of the runs held out, and
it is taken only if it passes what a learned law must.
"""

import argparse
import json
import time
from dataclasses import replace
from itertools import product
from pathlib import Path

import jax
import numpy as np
from hidden_cases import read
from neural_network import Moved, Network, Replays

from joda.diagnosis.adding import clearly, error, fallen, replayed
from joda.diagnosis.learning.term_selection import learn
from joda.diagnosis.paired_test import worse
from joda.diagnosis.shape_refinement import Likelihood
from joda.diagnosis.split import parted
from joda.estimation.problem import segments_for
from joda.hidden import FAMILIES, draw

DECAYS = (1e-3, 0.3)
"""Weight decays that are tried."""
FASTER = 1.2
"""How much faster a run is that leaves what was visited, in the highest speed that was."""
KINDS = ("law", "network")
OF = ("whole runs: learned, network", "windows: learned, network")


def network_of(train, held) -> tuple[Moved | None, Moved]:
    """A network that is taken as a learned law is, None if it is not; and the model as it is."""
    network, likelihood = Network(train), Likelihood(held)
    begun = network.begun(jax.random.key(0))
    found = [network.fitted(begun, decay, likelihood) for decay in DECAYS]
    loss, numbers = min(found, key=lambda one: one[0])
    moved, none = Moved(network, numbers), Moved(network, begun)
    (before, replays), (after, later) = replayed(held), replayed(with_network(held, moved))
    taken = clearly(loss, likelihood.loss(held.profile)) and fallen(before, after)
    if taken and replays and later and worse(replays, later):
        taken = False
    return (moved if taken else None), none


def with_network(measured, moved: Moved):
    """The joint with a network's force."""
    return replace(measured, replayer=Replays(measured, moved))


def compared(known, unseen) -> dict:
    """Errors on unseen runs: of the model, the same in JAX, with a learned law and a network."""
    begun = time.process_time()
    added_effect, law = learn(*parted(known))
    halfway = time.process_time()
    moved, none = network_of(*parted(known))
    took = time.process_time()
    before = error(unseen)
    network = error(with_network(unseen, moved)) if moved else before
    return {
        "model": vars(before),
        "model in JAX": vars(error(with_network(unseen, none))),
        "law": vars(error(unseen, added_effect.profile)),
        "network": vars(network),
        "taken": {"law": law is not None, "network": moved is not None},
        "seconds": {"law": halfway - begun, "network": took - halfway},
    }


def fastest(measured) -> np.ndarray:
    """Of each run."""
    segments = segments_for(measured)
    speeds = np.abs(segments.start[:, 1])
    return np.array([speeds[segments.run == k].max(initial=0) for k in range(len(measured.runs))])


def examined(seed: int, effect: str) -> dict:
    """One case: errors where all runs are learned from, and of runs faster than those."""
    case = draw(seed, effect)
    known, unseen = read(case)
    row = {"seed": seed, "effect": effect, "noise": case.noise}
    row |= {"truth": case.achievable.together, "all": compared(known, unseen)}
    slow = known.changed(runs=np.argsort(fastest(known))[: len(known.runs) // 2].tolist())
    far = np.flatnonzero(fastest(unseen) > FASTER * fastest(slow).max())
    if len(far):
        row["faster"] = compared(slow, unseen.changed(runs=far.tolist()))
        row["times"] = float(fastest(unseen)[far].max() / fastest(slow).max())
        truth = [case.achievable.runs[k] for k in far]
        row["truth faster"] = float(np.sqrt(np.mean(np.square(truth))))
    return row


def told(rows: list[dict]) -> list[str]:
    """A table of what is left of the model's errors, and what holds for all."""
    heads = ("law", "truth", *OF, "times as fast", "truth", *OF)
    out = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for row in rows:
        cells = [row["effect"], share(row["all"], row["truth"]), *parts(row["all"])]
        if "faster" in row:
            cells += [f"{row['times']:.1f}", share(row["faster"], row["truth faster"])]
            cells += parts(row["faster"])
        out.append(f"| {' | '.join(cells)} |")
    for which, of in product(("all", "faster"), ("whole", "window")):
        pairs = np.array(
            [[left(row[which], kind, of) for kind in KINDS] for row in rows if which in row]
        )
        law, network = np.exp(np.log(pairs).mean(axis=0))
        wins = [int(np.sum(np.sign(pairs[:, 1] - pairs[:, 0]) == sign)) for sign in (1, -1)]
        out.append(
            f"{which}, {of}: geometric means {law:.2g} with the law, {network:.2g} with the "
            f"network; the law is better in {wins[0]}, the network in {wins[1]} of {len(pairs)}"
        )
    return out


def left(found: dict, kind: str, of: str) -> float:
    """Part of the model's error that is left: all where nothing was taken."""
    return found[kind][of] / found["model"][of] if found["taken"][kind] else 1.0


def share(found: dict, error: float) -> str:
    """An error of whole runs in the model's."""
    return f"{error / found['model']['whole']:.2g}"


def parts(found: dict) -> list[str]:
    """What is left, of whole runs and of windows, by the law and by the network."""
    return [
        ", ".join(
            f"{left(found, kind, of):.2g}" if found["taken"][kind] else "none" for kind in KINDS
        )
        for of in ("whole", "window")
    ]


def main() -> None:
    """Draws cases law by law, and writes a line for each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=6)
    parser.add_argument("--skip", type=int, default=0, help="so many of them were counted before")
    parser.add_argument("--seed", default="fresh")
    parser.add_argument("-o", "--output", type=Path, default=Path("neural.jsonl"))
    given = parser.parse_args()
    seed = None if given.seed == "fresh" else int(given.seed)
    entropy = np.random.SeedSequence(seed).entropy % 2**32 if seed is None else seed
    print(f"seed {entropy}")
    rng, laws = np.random.default_rng(entropy), tuple(FAMILIES["laboratory"].uncatalogued)
    for number in range(given.cases):
        effect, seed = laws[number % len(laws)], int(rng.integers(2**31))
        if number < given.skip:
            continue
        row = examined(seed, effect)
        with given.output.open("a") as file:
            file.write(json.dumps(row) + "\n")
        print(json.dumps(row), flush=True)
    print("\n".join(told([json.loads(line) for line in given.output.open()])))
