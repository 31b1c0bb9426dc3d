"""The paper's ablations: without templates, without feedback rounds, the largest for the sum.

    python tests/benchmarks ablation           with the template library beside raw control points
    python tests/benchmarks ablation rounds    what feedback rounds and the sum of components bring

For the first, both were asked of the same Claude model in one round, twice each, with the same
pictures and context of the ten objects in models/; tests/recorded/README.md tells how. Every answer
is compiled, simulated, and held against what the object does, which neither was told. For the
second, the rules propose for each object with ten compile keys.
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from joda import compile, context
from joda.errors import JodaError
from joda.field import evaluate
from joda.interaction.behaviour import behaviour
from joda.propose import Task
from joda.propose.generation import run as propose
from joda.propose.offline import Offline
from joda.propose.recognise import gravity_role
from joda.propose.replies import parse, parse_ablation
from joda.propose.requirements import Requirement, unmet
from joda.propose.session import NONE, Session
from joda.template import read_templates

TESTS = Path(__file__).parents[1]
MODELS = TESTS.parent / "models"

OBJECTS: dict[str, tuple[str, tuple[Requirement, ...]]] = {
    name: (
        joint,
        tuple(
            Requirement(requirement, 3 if requirement == "clicks" else 0)
            for requirement in requirements.split()
        ),
    )
    for name, joint, requirements in (
        ("cabinet", "door", "held_shut opens_past"),
        ("dishwasher", "door", "closes_near held_shut stays_half stays_open"),
        ("drawer", "drawer", "closes_near held_shut stays_put"),
        ("knob", "knob", "clicks"),
        ("laptop", "lid", "stays_put"),
        ("lighter", "button", "closes_anywhere snaps"),
        ("microwave", "door", "latched stays_put"),
        ("oven", "door", "closes_near held_shut stays_half stays_open"),
        ("refrigerator", "door", "closes_near held_shut stays_put"),
        ("switch", "rocker", "two_sides"),
    )
}
"""What each object does; each can besides be opened and closed by hand."""

RUNS = (1, 2)
KEYS = tuple(map(str, range(10)))
MOST = 5
"""Rounds at most."""
WAYS = ("with feedback", "first proposal", "largest, not sum")
GRID = np.linspace(0, 1, 401)


def rows():
    """Per object and kind of answer: wishes met in each run, wishes in all, spread of the runs."""
    templates = read_templates()
    for name, (joint, wanted) in OBJECTS.items():
        found = context(MODELS / f"{name}.xml", joint)
        task = Task(found, templates)
        for kind in ("templates", "raw"):
            met, curves, lacking = [], [], []
            for run in RUNS:
                text = (TESTS / "recorded" / f"{kind}_{run}" / f"{name}.json").read_text("utf-8")
                try:
                    profile = (
                        compile(parse(text, task, ()), found)
                        if kind == "templates"
                        else parse_ablation(text, task)
                    )
                except JodaError as error:
                    met.append(0)
                    lacking.append({"answer": str(error)})
                    continue
                missed = unmet(wanted, behaviour(found, profile), found)
                met.append(len(wanted) + 1 - len(missed))
                lacking.append(missed)
                curves.append(evaluate(profile.channels.conservative, GRID)[0])
            yield name, kind, met, len(wanted) + 1, spread(curves), lacking


def spread(curves) -> float:
    """RMS difference of two runs' force curves, in units of the larger one's peak."""
    if len(curves) < 2:
        return float("nan")
    peak = max(np.abs(curve).max() for curve in curves)
    return float(np.sqrt(np.mean((curves[0] - curves[1]) ** 2)) / peak) if peak else 0.0


# --- without feedback rounds, without the sum
@dataclass(frozen=True)
class Loop:
    """What the rules came to for an object with one compile key.

    Attributes:
        gravity: whether gravity moves the joint.
        rounds: proposals until all that was proposed came true; infinite if it never did.
        met: of each of WAYS, how many of the object's behaviours came true.
        of: how many it has, being opened and closed by hand included.
    """

    gravity: bool
    rounds: float
    met: tuple[int, ...]
    of: int


def loop(name: str, key: str) -> Loop:
    """Proposes, simulates and revises, as `joda generate --proposer offline --key KEY` does."""
    joint, wanted = OBJECTS[name]
    with TemporaryDirectory() as folder:
        model = MODELS / f"{name}.xml"
        session = Session.start(Path(folder), model, joint, "", key=key, pictures=NONE)
        propose(session, Offline(key), MOST)
    found, turns = session.context, session.turns
    first, last = turns[0], turns[-1]
    largest = compile(last.proposal, found, key=key, combine="max")
    behaved = (last.behaviour, first.behaviour, behaviour(found, largest))
    of = len(wanted) + 1
    return Loop(
        gravity=gravity_role(found) != "level",
        rounds=next((k for k, turn in enumerate(turns, 1) if not turn.unmet), np.inf),
        met=tuple(of - len(unmet(wanted, one, found)) for one in behaved),
        of=of,
    )


def rounds() -> None:
    print(
        f"{'object':14}{'gravity':>8}{'rounds, mean':>14}{'most':>6}", *map("{:>18}".format, WAYS)
    )
    every = []
    for name in OBJECTS:
        mine = [loop(name, key) for key in KEYS]
        every += mine
        _tell(name, mine)
    heavy = [one for one in every if one.gravity]
    _tell("all", every)
    _tell("under gravity", heavy)
    for k, way in enumerate(WAYS):
        whole = (sum(one.met[k] == one.of for one in some) for some in (every, heavy))
        pairs = zip(("all", "under gravity"), whole, (every, heavy), strict=True)
        told = ", ".join(f"{what} {count} of {len(some)}" for what, count, some in pairs)
        print(f"{way}: all behaviours of the object come true: {told}")


def _tell(name: str, loops: list[Loop]) -> None:
    rounds = [one.rounds for one in loops]
    of = sum(one.of for one in loops)
    met = (f"{sum(one.met[k] for one in loops)} of {of}" for k in range(len(WAYS)))
    gravity = {True: "yes", False: ""}[all(one.gravity for one in loops)]
    numbers = f"{np.mean(rounds):14.2f}{max(rounds):6g}"
    print(f"{name:14}{gravity:>8}{numbers}", *map("{:>18}".format, met), flush=True)


def main() -> None:
    if sys.argv[1:] == ["rounds"]:
        return rounds()
    table = list(rows())
    print(f"{'object':14}{'templates':>12}{'raw':>8}{'spread: templates':>20}{'raw':>8}")
    for name in OBJECTS:
        ours, raw = (next(r for r in table if r[:2] == (name, k)) for k in ("templates", "raw"))
        print(
            f"{name:14}{sum(ours[2]):>6} of {2 * ours[3]:<2}{sum(raw[2]):>5} of {2 * raw[3]:<2}"
            f"{ours[4]:>14.2f}{raw[4]:>12.2f}"
        )
    for kind in ("templates", "raw"):
        mine = [row for row in table if row[1] == kind]
        met, of = sum(sum(row[2]) for row in mine), sum(2 * row[3] for row in mine)
        whole = sum(m == row[3] for row in mine for m in row[2])
        print(
            f"{kind}: {met} of {of} behaviours, all of an object's in {whole} of {2 * len(mine)} "
            f"answers; spread {np.nanmean([row[4] for row in mine]):.2f}"
        )
    print(json.dumps({f"{r[0]}/{r[1]}": [list(x.values()) for x in r[5]] for r in table}, indent=1))
