"""Figures of the bench's rows: how often right, how sure, how near."""

from collections.abc import Callable, Iterator
from itertools import pairwise

import numpy as np
from hidden_cases import CONTAINED, HARD
from hidden_coverage import coverage, reliability

from joda.diagnosis.overlap import overlap
from joda.hidden.cases import FAMILY
from joda.hidden.measuring import LATE

SURE = 0.9
BINS = (0.0, 0.5, 0.7, SURE, 1.0 + 1e-9)
PART = 0.02
"""Part by which a delay may be told wrong."""
NEAR = 1.5
"""Error on runs held out, in units of the true model's, that counts as mended."""


def first(row: dict) -> dict:
    """What is named first; nothing is as if of no probability."""
    none = {"effect": None, "probability": 0.0, "indistinguishable_from": []}
    return (row.get("named") or [none])[0]


def hides(row: dict) -> str:
    """What a diagnosis should say of it: nothing, an effect, or that it is outside."""
    if row["group"] == "outside" or not row.get("seal", {}).get("in_catalogue", True):
        return "outside"
    return "nothing" if row["effect"] is None else "effect"


def right(row: dict) -> bool:
    named = {row["effect"], *row.get("seal", {}).get("also_right", ())}
    return first(row)["effect"] in named


def second(row: dict) -> bool:
    return row["effect"] in [one["effect"] for one in row.get("named", [])[:2]]


def alike(row: dict) -> bool:
    return right(row) or row["effect"] in first(row)["indistinguishable_from"]


def unexplained(row: dict) -> bool:
    return row.get("verdict") == "unexplained"


def late(row: dict) -> bool:
    """Whether a law of no catalogue is a delay, and that is said of the measurement."""
    if row["effect"] != LATE:
        return False
    told = [one for one in row.get("corrections", ()) if one["parameter"] == "time_delay"]
    true = row["seal"]["magnitude"]
    return any(abs(one["value"] - true) < 2 * one["error"] + PART * true for one in told)


def silent(row: dict) -> bool:
    return row.get("verdict") in ("adequate", "insufficient_data")


def found(row: dict) -> bool:
    return {row["effect"], row["second"]} <= set(row.get("added", []))


def refused(row: dict) -> bool:
    """Whether a right answer was not added."""
    return right(row) and not row.get("added")


def rose(row: dict) -> bool:
    """Whether the error on runs that nothing has seen rose by more than 5 %."""
    return "failed" in row or row["after_error"] > 1.05 * row["before"]


def misled(row: dict) -> bool:
    """Whether what is named first is wrong."""
    if hides(row) != "effect":
        return row["verdict"] == "missing_effect"
    return not right(row)


def near(row: dict) -> bool:
    """Whether the error on runs held out counts as mended."""
    return row.get("unseen", float("inf")) <= NEAR


def fine(row: dict) -> bool:
    """Whether a case came out as it should."""
    if hides(row) == "nothing":
        return row.get("verdict") == "adequate"
    if hides(row) == "outside":
        return unexplained(row) or late(row)
    if row["group"] == "few":
        return not (refused(row) or rose(row))
    return found(row) if row["second"] else right(row)


def shared(row: dict) -> float:
    """Intersection over union of the true interval and the one said."""
    return overlap(row["seal"]["interval"], first(row)["interval"])


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
    yield from middle("place: intersection over union", "≥ 0.7", [shared(row) for row in placed])
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
    fews = of("few")
    yield from share("few: unseen error rose by more than 5 %", "0", fews, rose)
    for way, push in (("forced", True), ("free", False)):
        some = [row for row in fews if row["forced"] == push and row.get("named")]
        yield from share(f"few: right effect first, {way}", "", some, right)
        known = [row for row in some if right(row)]
        yield from share(f"few: right effect refused, {way}", "≤ 15 %", known, refused)
    told_of = [row for row in of("cover", "forced", "add", "free") if right(row)]
    yield from coverage(told_of)
    yield from reliability([row for row in of("forced", "add", "free") if row.get("named")])
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
    case = f"{row.get('family', FAMILY)}, {row['group']} {row['number']}"
    begin = f"{case}, seed {row['seed']}, {hidden}: "
    if "failed" in row:
        return begin + row["failed"].strip().splitlines()[-1]
    if row["group"] == "few":
        what = ", ".join(row["added"]) or row["reason"] or "nothing"
        ratio = row["after_error"] / row["before"]
        named = first(row)["effect"] or row["verdict"]
        return begin + f"{len(row['runs'])} runs, {named}; {what}; error × {ratio:.3g}"
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
