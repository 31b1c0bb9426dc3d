"""What the numbers that decide a diagnosis should be, judged on families that they were not set on.

    python tests/benchmarks hidden families --family all --cases 2 --out rows.jsonl    (hours)
    python tests/benchmarks calibrate rows.jsonl                                     (seconds)

Of each family in turn: `joda.diagnosis.settings.SelectionSettings` are fitted to the cases of the
others (coordinate descent on the mean log loss of "nothing", "none of these" and every effect) and
judged on its own, beside those in use; then they are fitted to all of them. The rows hold the
evidence of each case, so nothing is simulated or fitted again.
"""

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from hidden_figures import SURE, hides

from joda.diagnosis.selection import (
    Evidence,
    Selection,
    closer_counts,
    decide,
    pooled,
    second_counts,
)
from joda.diagnosis.settings import SETTINGS, SelectionSettings

IN_USE = SETTINGS.selection
FACTORS = (0.4, 0.6, 0.8, 0.9, 1.1, 1.25, 1.6, 2.5)
"""By which a setting is tried to be changed."""
ROUNDS = 4
LEAST = 0.01
"""Least probability: a mistake that was thought impossible costs no more."""
AWAY = 0.005
"""Price of a setting changed by a factor of e: what the cases do not tell stays as it is."""


def looks(row: dict) -> list[Evidence]:
    """The evidence of a row's looks."""
    return [
        Evidence(**{**look, "effects": tuple(look["effects"]), "left": tuple(look["left"])})
        for look in row["looks"]
    ]


def decided(row: dict, settings: SelectionSettings) -> Selection:
    """What these settings say of a case, by the looks that were taken."""
    first, *more = looks(row)
    said = decide(first, settings=settings)
    if said.verdict != "missing_effect" and more:
        again = decide(more.pop(0), settings.second_look, wholly=True, settings=settings)
        said = again if second_counts(said, again) else said
    for closer in more:
        anew = decide(closer, settings=settings)
        if not closer_counts(said, anew):
            said = pooled(said, anew)
            break
        said = anew
    return said


def right(row: dict, said: Selection) -> bool:
    """Whether the verdict is right, or the first name."""
    if (what := hides(row)) != "effect":
        return said.verdict == {"nothing": "adequate", "outside": "unexplained"}[what]
    return said.verdict != "adequate" and said.effects[:1] in [(name,) for name in names(row)]


def names(row: dict) -> set[str]:
    """Those that are right."""
    return {row["effect"], *row["seal"].get("also_right", ())}


def loss(row: dict, settings: SelectionSettings) -> float:
    """Minus the logarithm of the probability of what is true."""
    said = decided(row, settings)
    adequate = said.verdict == "adequate"
    what = hides(row)
    if what == "nothing":
        likely = 1.0 if adequate else LEAST
    elif adequate:
        likely = LEAST
    elif what == "outside":
        likely = 1.0 - sum(said.probabilities)
    else:
        likely = sum(p for name, p in said.named if name in names(row))
    return -float(np.log(min(max(likely, LEAST), 1.0)))


def mean_loss(rows: Sequence[dict], settings: SelectionSettings) -> float:
    """Of all cases, each family counting alike."""
    families = sorted({row["family"] for row in rows})
    return float(
        np.mean([np.mean([loss(r, settings) for r in rows if r["family"] == f]) for f in families])
    )


def price(settings: SelectionSettings) -> float:
    """Of being other than in use."""
    pairs = zip(asdict(settings).values(), asdict(IN_USE).values(), strict=True)
    return AWAY * sum(abs(float(np.log(new / old))) for new, old in pairs)


def fitted(rows: Sequence[dict]) -> SelectionSettings:
    """Settings that suit these cases best."""
    best, least = IN_USE, mean_loss(rows, IN_USE)
    for _ in range(ROUNDS):
        before = least
        for name, old in asdict(best).items():
            for factor in FACTORS:
                tried = replace(best, **{name: old * factor})
                if (cost := mean_loss(rows, tried) + price(tried)) < least:
                    best, least = tried, cost
        if least == before:
            break
    return best


def reported(rows: Sequence[dict], settings: SelectionSettings) -> str:
    """Figures of cases, a row of the table."""
    cells = [f"{mean_loss(rows, settings):.3f}"]
    for what in ("effect", "nothing", "outside"):
        some = [row for row in rows if hides(row) == what]
        cells.append(f"{sum(right(row, decided(row, settings)) for row in some)}/{len(some)}")
    said = [(row, decided(row, settings)) for row in rows]
    sure = [(row, one) for row, one in said if one.probabilities and max(one.probabilities) >= SURE]
    good = [one.effects[0] in names(row) and hides(row) == "effect" for row, one in sure]
    return " | ".join([*cells, f"{sum(good)}/{len(good)}"])


def changed(settings: SelectionSettings) -> str:
    """The numbers that are not those in use."""
    pairs = zip(asdict(settings).items(), asdict(IN_USE).values(), strict=True)
    return ", ".join(f"{name} {old:g} → {new:.3g}" for (name, new), old in pairs if new != old)


def main() -> None:
    lines = [line for path in sys.argv[1:] for line in Path(path).read_text().splitlines()]
    rows = [row for row in map(json.loads, lines) if row.get("looks")]
    print("| judged on | set on | log loss | named | nothing | none of these | p ≥ 0.9 |")
    print("|---" * 7 + "|")
    for family in sorted({row["family"] for row in rows}):
        own = [row for row in rows if row["family"] == family]
        others = [row for row in rows if row["family"] != family]
        found = fitted(others)
        print(f"| {family} | in use | {reported(own, IN_USE)} |")
        print(f"| | the others | {reported(own, found)} |   {changed(found)}", flush=True)
    found = fitted(rows)
    print(f"| all | in use | {reported(rows, IN_USE)} |")
    print(f"| | all | {reported(rows, found)} |   {changed(found)}")
