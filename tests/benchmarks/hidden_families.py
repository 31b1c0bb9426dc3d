"""Tables of the bench's rows: right first names, family by effect, and each family's figures."""

from collections.abc import Callable

from hidden_figures import NEAR, SURE, fine, first, hides, misled, near, told


def by_effect(rows: list[dict]) -> None:
    """Prints the tables as Markdown, and the cases that came out wrong."""
    families = list(dict.fromkeys(row["family"] for row in rows))
    print("Right / cases, with force and with positions only.\n")
    print("| hidden | " + " | ".join(families) + " |\n" + "|---" * (len(families) + 1) + "|")
    for name in dict.fromkeys(row["effect"] for row in rows):
        cells = [
            _cell([r for r in rows if (r["family"], r["effect"]) == (f, name)]) for f in families
        ]
        print(f"| {name or 'nothing'} | " + " | ".join(cells) + " |")
    print("\n| | " + " | ".join(families) + " |\n" + "|---" * (len(families) + 1) + "|")
    for line, which, test in FIGURES:
        cells = [_share([r for r in rows if r["family"] == f and which(r)], test) for f in families]
        print(f"| {line} | " + " | ".join(cells) + " |")
    if bad := [row for row in rows if not fine(row)]:
        print("\nWrong:")
        print("\n".join("- " + told(row) + _unseen(row) for row in bad))


def _cell(rows: list[dict]) -> str:
    return ", ".join(_share([r for r in rows if r["forced"] == way], fine) for way in (True, False))


def _share(rows: list[dict], test: Callable[[dict], bool]) -> str:
    return f"{sum(map(test, rows))}/{len(rows)}" if rows else "–"


def _unseen(row: dict) -> str:
    if "unseen" not in row:
        return ""
    return f"; unseen {row['unseen_before']:.2g} -> {row['unseen']:.2g} of the achievable"


def _added(row: dict) -> bool:
    """Whether there was an effect, and what was named was added."""
    return hides(row) == "effect" and row.get("adds", True)


def _sure(row: dict) -> bool:
    return first(row)["probability"] >= SURE


Figure = tuple[str, Callable[[dict], bool], Callable[[dict], bool]]
FIGURES: list[Figure] = [
    ("right name first, with force", lambda r: hides(r) == "effect" and r["forced"], fine),
    ("right name first, positions only", lambda r: hides(r) == "effect" and not r["forced"], fine),
    ("nothing: adequate", lambda r: hides(r) == "nothing", fine),
    ("no catalogue: unexplained", lambda r: hides(r) == "outside", fine),
    (f"unseen whole runs within {NEAR} of the achievable", _added, near),
    (f"right, of p ≥ {SURE}", _sure, lambda r: not misled(r)),
]
"""Name, the cases that it is of, and which of them count."""
