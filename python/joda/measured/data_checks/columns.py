"""What was made of a file's columns that a person may not expect."""

from joda.measured.runs import QuasiStatic, Run

FORCE = ("force", "torque", "effort", "moment", "kraft", "drehmoment", "couple", "fuerza")
TIME = ("time", "stamp", "zeit", "temps", "tiempo", "tempo", "sec")
"""Beginnings or parts of other names for a column; `t` alone is one too."""


def counted(run: Run) -> str:
    """Speaks where times were counted from another zero."""
    if not run.origin:
        return ""
    return f"time begins at {run.origin:.13g} s, and is counted from there"


def unread(run: Run | QuasiStatic) -> str:
    """Speaks where a column that was not read may be a missing one."""
    timed = isinstance(run, Run)
    if isinstance(run, Run) and run.pushed:
        return ""
    name, parts = ("force", FORCE) if timed else ("time", TIME)
    # columns of several joints (`force:JOINT`) are spoken of where they are read
    others = [name for name in run.unread if ":" not in name]
    alike = [other for other in others if _alike(other.lower(), parts)]
    if not alike:
        return ""
    taken = (
        "no force is known, as if none was applied"
        if timed
        else "without time this is a quasi-static curve"
    )
    return f"column '{alike[0]}' is not read, and {taken}; if it is the {name}, name it '{name}'"


def _alike(name: str, parts: tuple[str, ...]) -> bool:
    return name == parts[0][0] or any(part in name for part in parts)
