"""The table of joints: what each should do, written down before, beside what the rules make of it.

    python tests/benchmarks joint_table                  made objects of the seed that the rules
                                                         were written with, and other people's
    python tests/benchmarks joint_table --seed fresh     made objects that nobody has seen
    python tests/benchmarks joint_table --write FOLDER   the made objects as models with
                                                         expectations, for `joda evaluate proposer`

Each joint is given its behaviour by `joda generate`'s loop (rules, at most three rounds, no
pictures), once with its names and once with all names removed; `articulated.py` says what each
expectation means. Other people's files are used where they are to be had (`assets.py`).
"""

import argparse
import json
import secrets
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from articulated import objects

from joda import compile, context
from joda.interaction.behaviour import Behaviour, behaviour
from joda.propose import Task, Turn
from joda.propose.offline import Offline
from joda.propose.requirements import read_requirements, unmet
from joda.scenes.context import Context
from joda.template import read_templates

MODELS = Path(__file__).parents[2] / "models"
SEED, ROUNDS, PROPOSALS = 1, 2, 3
Expected = dict[str, Any]

DOOR = {"near": True, "shut": True, "half": "stays"}
DRAWER = {**DOOR, "force": (2, 30)}
KNOB = {"half": "stays", "force": (0.5, 35)}
SLIDING = {"half": "stays", "force": (1, 50)}
MICROWAVE = {"shut": True, "half": "stays", "force": (10, 60)}
BUTTON = {"half": "closes", "force": (1, 23)}
SWITCH = {"sides": True, "force": (1, 15)}
REAL: dict[str, dict[str, Expected]] = {
    "own:cabinet": {"door": {"opens": "+", "near": True, "shut": True, "half": "opens",
                             "force": (3, 40)}},
    "own:dishwasher": {"door": {"opens": "+", **DOOR, "force": (8, 60)}},
    "own:drawer": {"drawer": {"opens": "+", **DRAWER}},
    "own:knob": {"knob": {"clicks": True, "force": (0.5, 35)}},
    "own:laptop": {"lid": {"opens": "+", "half": "stays", "force": (1, 15)}},
    "own:lighter": {"button": {"opens": "+", **BUTTON}},
    "own:microwave": {"door": {"opens": "+", **MICROWAVE}},
    "own:oven": {"door": {"opens": "+", **DOOR, "force": (8, 60)}},
    "own:refrigerator": {"door": {"opens": "+", **DOOR, "force": (10, 67)}},
    "own:switch": {"rocker": SWITCH},
    "kitchen": {
        **{f"knob_Joint_{k}": KNOB for k in (1, 2, 3, 4)},
        "light_switch": SWITCH,
        "slide_cabinet": SLIDING,
        "left_hinge_cabinet": {"opens": "-", **DOOR, "force": (3, 30)},
        "right_hinge_cabinet": {"opens": "+", **DOOR, "force": (3, 30)},
        "microwave": {"opens": "-", **MICROWAVE},
    },
    "microwave": {"micro0joint": {"opens": "-", **MICROWAVE}},
    "cabinet": {f"{row}_level": {"opens": "-", **DRAWER} for row in ("top", "middle", "bottom")},
    "table": {
        "base__drawer": {"opens": "+", **DRAWER},
        "base__slide": SLIDING,
        "base__button": BUTTON,
        "base__switch": SWITCH,
    },
    "door": {
        "hinge": {"opens": "+", "half": "stays", "force": (0.5, 60)},
        "latch_joint": {"middle": True, "force": (2, 23)},
    },
    "drawer": {"goal_slidey": {"opens": "-", **DRAWER}},
    "drawer:doorlockB": {"doorjoint": {"opens": "-", "half": "stays", "force": (0.5, 60)}},
    "drawer:faucet": {"knob_Joint_1": {"half": "stays", "force": (1, 23)}},
    "drawer:laptop": {"#0": {"half": "stays", "force": (1, 15)}},
    "drawer:dial": {"knob_Joint_1": KNOB},
    "drawer:window": {"window_slide": {"half": "stays", "force": (2, 100)}},
    "drawer:window_horiz": {"window_slide": {"half": "stays", "force": (2, 100)}},
    "drawer:buttonbox": {"btnbox_joint": {"opens": "-", **BUTTON}},
    "drawer:coffeemachine": {"goal_slidey": {"opens": "+", **BUTTON}},
    "drawer:doorlockA": {"#0": KNOB},
    "drawer:handle_press": {"#0": {"opens": "-", "force": (1, 60)}},
    "drawer:lever": {"LeverAxis": {"half": "stays", "force": (1, 30)}},
    "drawer:hammerblock": {"NailSlideJoint": {"half": "stays"}},
}  # fmt: skip
"""Other people's joints: "asset", or "asset:another file beside it"."""


class Row(NamedTuple):
    """A joint of the table: where it is from, what it is, its context and what is expected."""

    source: str
    part: str
    found: Context
    expected: Expected
    arm: float | None


@dataclass
class Result:
    """What came of a row: per expectation whether it is met; what it was taken for, how surely."""

    row: Row
    met: dict[str, bool]
    took: str
    sure: float
    force: float
    plausible: bool


def made(seed: int, named: bool, rounds: int = ROUNDS) -> Iterator[Row]:
    """The joints of made objects."""
    names = np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.urdf"
        for made_one in objects(seed, rounds):
            path.write_text(made_one.urdf(named, names))
            for joint in made_one.joints:
                found = context(path, joint.name)
                yield Row(made_one.category, joint.part, found, joint.expected, joint.arm)


def real(named: bool) -> Iterator[Row]:
    """Other people's joints and our own, those that are to be had."""
    from assets import asset

    for key, joints in REAL.items():
        name, _, file = key.partition(":")
        try:
            path = MODELS / f"{file}.xml" if name == "own" else asset(name)
        except BaseException as skipped:  # pytest's outcome, where one of them is missing
            if type(skipped).__name__ != "Skipped":
                raise
            continue
        if file and name != "own":
            path = path.with_name(f"{file}.xml")
        for joint, expected in joints.items():
            found = context(path, joint)
            if not named:
                found = found.model_copy(update={"names": (), "around": ()})
            yield Row(key, joint, found, expected, None)


def judge(row: Row) -> Result:
    """Runs the loop, and looks which expectations came true."""
    found, task = row.found, Task(row.found, read_templates())
    turns: list[Turn] = []
    proposer = Offline()
    while len(turns) < PROPOSALS:
        answer = proposer.propose(task, turns)
        if answer.proposal is None:
            break
        profile = compile(answer.proposal, found)
        behaved = behaviour(found, profile)
        lacking = unmet(read_requirements(answer.proposal.whole_motion_descrptn), behaved, found)
        turns.append(Turn(answer.proposal, profile, behaved, bytes, "", tuple(lacking.values())))
    behaved, summary = turns[-1].behaviour, turns[-1].proposal.joint_summary
    arm = found.lever_arm if row.arm is None else row.arm
    way = behaved.opening
    force = way.force / arm if way.arrived else float("inf")
    met = {key: holds(key, value, behaved, arm) for key, value in row.expected.items()}
    kind = summary.motion_description.split(" (")[0]
    return Result(row, met, kind, summary.overall_confidence, force, not turns[-1].unmet)


def holds(key: str, value: Any, behaved: Behaviour, arm: float) -> bool:
    """Whether the simulated joint does what is expected of it."""
    low = behaved.closed_end == "low_end"

    def rest(way: float) -> float:
        """Where it comes to rest, let go at this share of the way from its closed end."""
        s = way if low else 1 - way
        stretch = behaved.after(s)
        end = {"low_end": 0.0, "high_end": 1.0, "stays": s}.get(stretch.goes, stretch.end)
        return end if low else 1 - end

    if key == "opens":
        return (value == "+") == low
    if key == "half":
        end = rest(0.5)
        now = "closes" if end < 0.05 else "opens" if end > 0.95 else "stays"
        return now == value and (now != "stays" or abs(end - 0.5) <= 0.1)
    if key == "near":
        return rest(0.03) < 0.01
    if key == "shut":
        return rest(0.0) < 0.01 and behaved.opening.first / arm >= 0.5
    if key == "clicks":
        return bool(behaved.settles_at)
    if key == "sides":
        return rest(0.3) < 0.05 and rest(0.7) > 0.95
    if key == "middle":
        return all(abs(rest(way) - 0.5) < 0.1 for way in (0.1, 0.9))
    if key == "force":
        way = behaved.opening
        steady = way.force if way.steady is None else way.steady
        return bool(way.arrived and value[0] <= steady / arm <= value[1])
    raise KeyError(key)


FREE = '<mujoco><option><flag contact="disable"/></option></mujoco>'
"""Made objects overlap here and there, which is not what is to be judged."""
SENTENCES = {
    "near": "closes by itself when nearly closed",
    "shut": "stays shut until it is pulled",
    "clicks": "has clicks",
    "sides": "has two stable sides and flips over between them",
    "middle": "returns to the middle when let go",
}
HALF = {
    "stays": "holds half-way open",
    "closes": "falls shut from half-way open",
    "opens": "opens by itself from half-way on",
}


def written(found: Context, expected: Expected, arm: float) -> dict[str, Any]:
    """The same expectations as sentences; a force is one at the handle that the context sees."""
    out: dict[str, Any] = {"behaviours": []}
    for key, value in expected.items():
        if key == "opens":
            out["opens"] = value
        elif key == "half":
            out["behaviours"].append(HALF[value])
        elif key == "force":
            least, most = (round(force * arm / found.lever_arm, 3) for force in value)
            out["behaviours"].append(f"takes {least} to {most} newtons at the handle to open")
        else:
            out["behaviours"].append(SENTENCES[key])
    return out


def write(folder: Path, seed: int, named: bool, rounds: int) -> int:
    """Writes made objects and what is expected of them; how many joints there are."""
    folder.mkdir()
    names, count = np.random.default_rng(seed), 0
    for number, made_one in enumerate(objects(seed, rounds)):
        path = folder / f"object_{number}.urdf"
        head, tail = made_one.urdf(named, names).split(">", 1)
        path.write_text(f"{head}>{FREE}{tail}")
        joints = {
            joint.name: written(context(path, joint.name), joint.expected, joint.arm)
            for joint in made_one.joints
        }
        path.with_suffix(".expected.json").write_text(json.dumps({"joints": joints}, indent=2))
        count += len(joints)
    return count


def share(results: list[Result]) -> tuple[int, int]:
    """How many expectations are met, of how many."""
    met = [value for result in results for value in result.met.values()]
    return sum(met), len(met)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seed", default=str(SEED), help="a number, or fresh: drawn now")
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="objects of each kind")
    parser.add_argument("--only", choices=("named", "anonymous"))
    parser.add_argument("--made", action="store_true", help="made objects only")
    parser.add_argument("--write", type=Path, help="folder to make")
    arguments = parser.parse_args()
    fresh = arguments.seed == "fresh"
    seed = secrets.randbelow(2**31) if fresh else int(arguments.seed)
    print(f"seed {seed}")
    if arguments.write:
        named = arguments.only != "anonymous"
        print(write(arguments.write, seed, named, arguments.rounds), "joints")
        return
    for named in (True, False):
        if arguments.only == ("anonymous" if named else "named"):
            continue
        results = [judge(row) for row in made(seed, named, arguments.rounds)]
        others = [] if arguments.made or fresh else [judge(row) for row in real(named)]
        print("with names" if named else "names removed")
        for title, group in (("made", results), ("other people's and our own", others)):
            if not group:
                continue
            met, count = share(group)
            print(f"  {title}: {len(group)} joints, {met} of {count} ({met / count:.1%})")
            for result in group:
                lost = [key for key, good in result.met.items() if not good]
                if lost:
                    print(
                        f"    {result.row.source} {result.row.part}: {', '.join(lost)} "
                        f"[{result.took}, {result.sure:.2f}, {result.force:.3g} N]"
                    )
