"""What a column's name says: its role, of which joint, in which unit."""

import re

from joda.importing.log import Role

OWN = re.compile(r"(position|velocity|force|ctrl)\s*:\s*(\S.*)", re.IGNORECASE)
"""A column of a run as joda writes it."""
ROLES: dict[str, Role] = {
    **dict.fromkeys(("pos", "position", "qpos", "angle"), "position"),
    **dict.fromkeys(("vel", "velocity", "qvel", "speed"), "velocity"),
    **dict.fromkeys(("cmd", "command", "ctrl", "goal", "target", "action", "setpoint"), "ctrl"),
}
"""Roles by a name's last word."""
EFFORTS = {"effort", "torque", "eff", "tau", "current", "force"}
"""Last words of what an actuator gives, or draws."""
UNITS = {
    "rad": "rad", "radian": "rad", "radians": "rad", "rads": "rad",
    "deg": "deg", "degree": "deg", "degrees": "deg", "degs": "deg",
    "turn": "turn", "turns": "turn", "rev": "turn", "mm": "mm", "cm": "cm",
    "percent": "0..100", "pct": "0..100",
}  # fmt: skip
"""Units by a name's last word."""
WORDS = re.compile(r"[\s._/\-()\[\]]+")


def own(name: str) -> tuple[Role, str] | None:
    """Role and joint or actuator of a column of joda's own kind, such as "ctrl:elbow"."""
    match = OWN.fullmatch(name.strip())
    return (match[1].lower(), match[2]) if match else None  # type: ignore[return-value]


def read_name(name: str) -> tuple[Role, str, str]:
    """Role, joint and unit that a name says, each empty where it does not.

    "elbow.pos" is the position of elbow, "Elbow_vel_deg" its velocity in degrees; of
    "elbow_torque" only the joint is told, as it may be what an actuator gives or what acts from
    outside.
    """
    rest, unit, role = name.strip(), "", ""
    if (last := _last(rest)) and last[1] in UNITS:
        rest, unit = last[0], UNITS[last[1]]
    if (last := _last(rest)) and (last[1] in ROLES or last[1] in EFFORTS):
        rest, role = last[0], ROLES.get(last[1], "")
    return role, rest, unit  # type: ignore[return-value]


def normal(name: str) -> str:
    """A name without what spellings differ in: case and separators."""
    return re.sub(r"[^0-9a-z]+", "", name.lower()) or name


def _last(name: str) -> tuple[str, str] | None:
    """A name without its last word, and that in lower case; None where it is one word."""
    trimmed = name.rstrip(" ._/-()[]")
    parts = list(WORDS.finditer(trimmed))
    if not parts or not parts[-1].start():
        return None
    return trimmed[: parts[-1].start()], trimmed[parts[-1].end() :].lower()
