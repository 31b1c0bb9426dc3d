"""Figures of the bench's rows of family `field`: numbers that are off, told apart from effects."""

from collections.abc import Callable

from hidden_figures import NEAR, fine, hides, near

KINDS = ("mass", "force_offset", "time_delay", "position_offset")
"""What may be off; a force's scale and a mass are one: only their ratio is known without friction
that is known."""
OTHERS = {"inertia", "gravity", "center_of_mass"}
"""Of the body too: told, they are told for nothing, as no case has them wrong."""
ROUGHLY = 0.02
"""Part by which a number is not worth being told."""


def by_numbers(rows: list[dict]) -> None:
    """Prints the figures as Markdown."""
    whole = [row for row in rows if "failed" not in row]
    pairs = [(row, kind) for row in whole for kind in KINDS if off(row, kind)]
    clean = [(row, kind) for row in whole for kind in KINDS if not off(row, kind)]
    print("| figure | of | |\n|---|---|---|")
    _line("first name right", [r for r in rows if hides(r) == "effect"], fine)
    _line("nothing missing: adequate", [r for r in rows if hides(r) == "nothing"], fine)
    calm = [(row, kind) for row, kind in pairs if hides(row) == "nothing"]
    _line("numbers named within 2 errors", pairs, within)
    _line("the same, where nothing is missing", calm, within)
    _line("false corrections, of each number", clean, lambda pair: told(*pair) is not None)
    _line("false corrections, of others", whole, lambda row: bool(OTHERS & set(numbers(row))))
    mended = [row for row in whole if "unseen" in row]
    _line(f"unseen whole runs within {NEAR} of the achievable", mended, near)
    print("\nWrong:")
    for row in rows:
        wrong = row.get("seal", {}).get("wrong", {})
        if not fine(row) or not all(within((row, kind)) for kind in KINDS if off(row, kind)):
            print(f"- {row['seed']} {row['effect']}: {wrong} -> {row.get('verdict')}, {_said(row)}")


def numbers(row: dict) -> dict[str, tuple[float, float]]:
    """Of each correction its factor or value, and its error."""
    return {
        one["parameter"]: (one["factor"] or one["value"], one["error"])
        for one in row.get("corrections", ())
    }


def told(row: dict, kind: str) -> tuple[float, float] | None:
    """A number and its error in units of the recorded force; None if it is not told."""
    found = numbers(row)
    scale, doubt = found.get("force_scale", (1.0, 0.0))
    if kind == "mass" and ("mass" in found or "force_scale" in found):
        mass, error = found.get("mass", (1.0, 0.0))
        return mass / scale, mass / scale * ((error / mass) ** 2 + (doubt / scale) ** 2) ** 0.5
    if kind not in found:
        return None
    value, error = found[kind]
    per = scale if kind == "force_offset" else 1.0
    return value / per, error / per


def right(row: dict, kind: str) -> float:
    """What it should be."""
    wrong = row["seal"].get("wrong", {})
    scale = wrong.get("force_scale", 1.0)
    if kind == "mass":
        return wrong.get("mass", 1.0) / scale
    return wrong.get(kind, 0.0) / (scale if kind == "force_offset" else 1.0)


def off(row: dict, kind: str) -> bool:
    """Whether it is."""
    return abs(right(row, kind) - (kind == "mass")) > (ROUGHLY if kind == "mass" else 0.0)


def within(pair: tuple[dict, str]) -> bool:
    """Whether it is told, within two of its errors."""
    found = told(*pair)
    return found is not None and abs(found[0] - right(*pair)) < 2 * found[1]


def _said(row: dict) -> str:
    parts = [f"{name} {value:.4g} ± {error:.2g}" for name, (value, error) in numbers(row).items()]
    named = [f"{one['effect']} {one['probability']:.2f}" for one in row.get("named", ())[:2]]
    return ", ".join([*named, *parts]) or "nothing"


def _line(what: str, every: list, test: Callable[..., bool]) -> None:
    if every:
        count = sum(map(test, every))
        print(f"| {what} | {count} of {len(every)} | {100 * count / len(every):.0f} % |")
