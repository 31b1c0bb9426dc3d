"""Cases of the bench: joints that hide an effect, drawn from a master seed."""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from zlib import crc32

import numpy as np

from joda.diagnosis.adding import AddedEffect, Error, add_effect, by_all, error, with_stop
from joda.diagnosis.split import parted
from joda.hidden import EFFECTS, FAMILIES, Case, draw, write
from joda.hidden.cases import FAMILY, PARTIAL, VISIBLE
from joda.measured.measured_joint import Measured
from joda.measured.reading import read_measured
from joda.profile import Profile

HARD = ("stribeck_friction", "presliding_friction", "backlash")
BROAD = tuple(n for n in EFFECTS if n.startswith(("constant_p", "constant_n", "spring_return")))
BOXES = ("detent_internal", "bistable_mechanism_internal")
ENDS = tuple(n for n in EFFECTS if n.startswith(("magnetic", "spring_loaded")))
RUBS = ("constant_friction_hinge", "position_dependent_friction", "load_dependent_friction")
DRAGS = ("constant_damping_hinge", "position_dependent_damping", "direction_dependent_damping")
LOCAL = (*BROAD, *BOXES, *ENDS, *RUBS[:2], *DRAGS[:2])
"""Effects that may act in a part of the range only."""
KINDS = (
    (*BROAD, "bistable_mechanism", "gravity_offset"),
    (*BOXES, *ENDS),
    (*RUBS, "asymmetric_friction", "stribeck_friction"),
    (*DRAGS, "quadratic_damping"),
    ("added_inertia", "backlash"),
)
"""Two effects of one case are of two kinds: within one, some make up for each other."""

CONTAINED = (
    *("constant_friction_hinge", "constant_damping_hinge"),  # in those that differ along the way
    *("constant_positive_conservative_hinge", "constant_negative_conservative_hinge"),
    *("gravity_offset", "asymmetric_friction"),  # in constant forces, and those in gravity
)
"""Effects that another entry, or the model's own with another, can be without any error."""

CLEAR = 15.0
"""How far an effect that shows for sure moves the joint, in standard deviations of the encoder."""
AGAIN = 5
"""How often a case in which the effect hardly shows is drawn again."""


@dataclass(frozen=True)
class Job:
    """A case to be drawn and examined; `wrong` is an effect to be added on purpose, `runs` are the
    only ones that there are, `adds` tells whether what is named first is added too."""

    master: int
    group: str
    number: int
    seed: int
    effect: str | None
    second: str | None = None
    forced: bool = True
    exclude: tuple[str, ...] = ()
    wrong: str | None = None
    family: str = FAMILY
    runs: tuple[int, ...] = ()
    adds: bool = True


def dice(master: int, *what) -> np.random.Generator:
    return np.random.default_rng([master, crc32(repr(what).encode())])


def unforced(family: str) -> tuple[str, ...]:
    """Effects that positions alone can show."""
    return tuple(name for name in EFFECTS if name not in FAMILIES[family].pushed)


def spread(family: str) -> list[tuple[str | None, bool]]:
    """What the cases of group `families` hide, in turn, and whether force is recorded."""
    named: list[tuple[str | None, bool]] = [(name, True) for name in EFFECTS]
    named += [(name, False) for name in unforced(family)]
    return [
        (None, True),
        (None, False),
        *named,
        *((one, True) for one in FAMILIES[family].uncatalogued),
    ]


def job_of(master: int, group: str, number: int, family: str = FAMILY) -> Job:
    """The number-th case of a group; effects come in turn, in a new order every round."""
    whose = () if family == FAMILY else (family,)
    rng = dice(master, *whose, group, number, "case")

    def turn(names: tuple[str, ...], at: int = number) -> str:
        order = dice(master, group, names, at // len(names)).permutation(len(names))
        return names[order[at % len(names)]]

    one = Job(master, group, number, int(rng.integers(2**31)), None, family=family)
    if group == "families":
        effect, forced = spread(family)[number % len(spread(family))]
        return replace(one, effect=effect, forced=forced)
    if group == "field":
        return one if number % 3 == 0 else replace(one, effect=turn(EFFECTS))
    if group == "none":
        return replace(one, forced=number % 2 == 0)
    if group == "free":
        return replace(one, effect=turn(unforced(family)), forced=False)
    if group == "outside" and number % 2 == 0:
        return replace(one, effect=turn(tuple(FAMILIES[family].uncatalogued), number // 2))
    if group == "outside":
        effect = turn(EFFECTS, number // 2)
        return replace(one, effect=effect, exclude=(effect,))
    if group == "cover":
        forced = number // len(EFFECTS) % 2 == 0
        effect = turn(EFFECTS)
        others = tuple(name for name in EFFECTS if name not in (effect, PARTIAL.get(effect)))
        forced |= effect in FAMILIES[family].pushed
        return replace(one, effect=effect, exclude=others, forced=forced)
    if group == "few":
        effect, count = turn(EFFECTS), 1 + number // 2 % 3
        runs = sorted(int(k) for k in rng.choice(8, count, replace=False))
        forced = number % 2 == 0 or effect in FAMILIES[family].pushed
        return replace(one, effect=effect, forced=forced, runs=tuple(runs))
    if group == "two":
        kinds = rng.choice(len(KINDS), 2, replace=False)
        effect, second = (str(rng.choice(KINDS[k])) for k in kinds)
        return replace(one, effect=effect, second=second)
    effect = turn({"hard": HARD, "place": LOCAL}.get(group, EFFECTS))
    if group == "add":
        others = [name for name in EFFECTS if name != effect]
        return replace(one, effect=effect, wrong=str(rng.choice(others)))
    return replace(one, effect=effect)


def mixed(master: int, hides: str, forced: bool, most: int) -> list[Job]:
    """Cases of group `families`, of each family in turn, in an order drawn by the master seed.

    Args:
        master: seed.
        hides: nothing, of which force is recorded of every other joint; effect; or outside.
        forced: whether of the others a force is recorded.
        most: how many there are at most.
    """
    each = []
    for family in sorted(set(FAMILIES) - {"field"}):
        every, beyond = spread(family), FAMILIES[family].uncatalogued
        kinds = ["outside" if e in beyond else "effect" if e else "nothing" for e, _ in every]
        places = [
            k
            for k, kind in enumerate(kinds)
            if kind == hides and (hides == "nothing" or every[k][1] == forced)
        ]
        rng = np.random.default_rng([master, len(family)])
        rounds = range(most if hides == "nothing" else 0)
        numbers = [r * len(every) + k for r in rounds for k in places] or rng.permutation(places)
        each.append([job_of(master, "families", int(number), family) for number in numbers])
    return [job for turn in zip(*each, strict=False) for job in turn][:most]


def case_of(job: Job) -> Case:
    """Draws again, with the next seed, where the effect hardly shows."""
    for seed in range(job.seed, job.seed + AGAIN):
        case = draw(seed, job.effect, job.forced, job.second, job.family)
        if case.visible >= VISIBLE:
            break
    return case


def clear_case(effect: str) -> Case:
    """Drawn anew each time, until the effect is clear."""
    rng = np.random.default_rng()
    while (case := draw(int(rng.integers(2**31)), effect)).visible < CLEAR:
        pass
    print(effect, case.seed)  # shown where a test fails
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


def missed(measured: Measured, profile: Profile | None = None) -> Error:
    """How far the model, or another profile, is off, also beyond the ends of the range."""
    return error(measured, profile, within=False)


def mended(
    train: Measured,
    held_out: Measured,
    effect: str,
    direction: str | None,
    interval: tuple[float, float] | None,
) -> tuple[AddedEffect, Measured]:
    """What `joda add` adds, and runs held out with the model that it writes."""
    parts = parted(train)
    added = add_effect(*parts, effect, direction, interval)
    if not added.effect:
        return added, held_out
    added = with_stop(added, *parts)
    right = held_out.changed(by_all(train, added.profile, added.effect, added.departs, interval))
    return added, right.stopped(added.stops) if added.stops else right
