"""What the page draws, as plain data: a channel's editor, and the charts of ECharts."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from joda.commands.studio.edits import positions
from joda.commands.studio.motions import Replayed
from joda.field import evaluate
from joda.pictures.draw import PREFIXES
from joda.pictures.style import COLOURS, GRAVITY
from joda.profile import Channel, Joint, Profile
from joda.scenes.motion import Motion

Array = NDArray[np.float64]

TITLES = {"conservative": "Conservative force", "friction": "Dry friction", "damping": "Damping"}
NOW, BEFORE, MEASURED = "#c8202f", "#b3b8bf", "#1f5fbf"
INK, FAINT = "#5b626b", "#e9ecef"
SAMPLES = 241
LINE = "path://M0,3 H30 V7 H0 Z"
"""The legend's sign for a line."""
SHOWN = 500
"""Most points of a line in a chart."""
IMPACT = 0.005
"""So near an end of the range, as a part of it, a force may leave the frame."""
ROOM = 0.05
"""Above and below what is shown, as a part of its height."""


def unit(joint: Joint, channel: str) -> str:
    """Of a channel's values."""
    hinge = joint.type == "hinge"
    if channel == "damping":
        return "N·m·s/rad" if hinge else "N·s/m"
    return "N·m" if hinge else "N"


def editor(
    profile: Profile,
    before: Profile,
    channel: str,
    selected: int,
    gravity: tuple[Array, Array] | None = None,
) -> dict[str, Any]:
    """What the editor of a channel shows.

    Args:
        profile: as it is.
        before: as it was opened, drawn in grey where it differs.
        channel: conservative, friction or damping.
        selected: number of the component whose control points are large.
        gravity: positions (rad or m) and the force that balances gravity there (N·m or N).

    Returns:
        `x` and `y`: ends of the axes; `factor`: what values were multiplied by for the prefix of
        their unit; `lines`, `handles`, labels and so on for curves.js.
    """
    own: Channel = getattr(profile.channels, channel)
    old: Channel = getattr(before.channels, channel)
    lo, hi = profile.joint.range
    lines = []
    if own != old:
        lines.append(_line(old, (0, 1), profile.joint, "ghost", BEFORE))
    if gravity is not None and np.any(gravity[1]):
        shown = {"kind": "gravity", "colour": GRAVITY}
        lines.append({"x": gravity[0].tolist(), "y": gravity[1].tolist(), **shown})
    if len(own.components) > 1:
        for number, component in enumerate(own.components):
            kind = "part chosen" if number == selected else "part"
            alone = Channel(components=(component,))
            lines.append(_line(alone, component.interval, profile.joint, kind))
    lines.append(_line(own, (0, 1), profile.joint, "sum"))
    handles = [
        {
            "component": number, "point": point, "x": lo + s * (hi - lo), "y": y,
            "label": component.label or f"component {number + 1}",
        }
        for number, component in enumerate(own.components)
        for point, (s, y) in enumerate(zip(positions(component), component.y, strict=True))
    ]  # fmt: skip
    handles.sort(key=lambda handle: handle["component"] == selected)  # drawn last: on top
    factor, prefix = _prefix(lines)
    for line in (*lines, *handles):
        line["y"] = (np.array(line["y"]) * factor).tolist()
    low, high = _limits([y for line in lines for y in line["y"]], channel != "conservative")
    return {
        "x": [lo, hi],
        "y": [low, high],
        "least": None if channel == "conservative" else 0.0,
        "factor": factor,
        "xlabel": f"joint position ({profile.joint.unit})",
        "ylabel": f"{prefix}{unit(profile.joint, channel)}",
        "colour": COLOURS[channel],
        "lines": lines,
        "handles": handles,
        "selected": selected,
        "empty": "" if own.components else "nothing here: double-click to begin a curve",
    }


def _line(
    channel: Channel, interval: tuple[float, float], joint: Joint, kind: str, colour: str = ""
) -> dict[str, Any]:
    a, b = interval
    edges = [e for part in channel.components for e in part.interval if a < e < b]
    beside = [np.nextafter(edges, 0), np.nextafter(edges, 1)] if edges else []
    points = [s for part in channel.components for s in positions(part) if a <= s <= b]
    s = np.unique(np.concatenate([np.linspace(a, b, SAMPLES), points, *beside]))
    s = s[~np.isin(s, edges)]
    lo, hi = joint.range
    y = evaluate(channel, s)[0]
    return {
        "x": np.round(lo + s * (hi - lo), 6).tolist(),
        "y": y.tolist(),
        "kind": kind,
        "colour": colour,
    }


def _prefix(lines: Sequence[dict[str, Any]]) -> tuple[float, str]:
    """What to multiply values by, and the prefix that their unit then has."""
    peak = max(float(np.abs(line["y"]).max()) for line in lines)
    if peak == 0 or 0.1 <= peak < 1e4:
        return 1.0, ""
    exponent = min(max(3 * math.floor(math.log10(peak) / 3), -12), 12)
    return 10.0**-exponent, PREFIXES[exponent]


def _limits(values: Sequence[float], from_zero: bool) -> tuple[float, float]:
    """Ends of an axis that has zero in view, and room to drag."""
    low, high = min(0.0, *values), max(0.0, *values)
    if high == low:
        return (0.0, 1.0) if from_zero else (-1.0, 1.0)
    room = 0.18 * (high - low)
    return (0.0 if from_zero else low - room), high + room


def release(now: Motion | None, before: Motion | None, joint: Joint) -> dict[str, Any]:
    """The chart of a joint that is let go: position over time."""
    lines = [_series(m.time, m.position, *of) for m, of in _both(now, before)]
    return _chart("time (s)", f"position ({joint.unit})", lines)


def hand(now: Motion | None, before: Motion | None, joint: Joint) -> dict[str, Any]:
    """The chart of a hand that opens and shuts a joint: its force over position.

    An impact at an end of the range leaves the frame, else it would squeeze all the rest.
    """
    shown = _both(now, before)
    factor, prefix = _prefix([{"y": m.force} for m, _ in shown] or [{"y": [0.0]}])
    lines = [_series(m.position, factor * m.force, *of) for m, of in shown]
    axes = f"position ({joint.unit})", f"hand's force ({prefix}{unit(joint, 'friction')})"
    chart = _chart(*axes, lines, {"min": joint.range[0], "max": joint.range[1]})
    forces = [factor * m.force[_off_the_stops(m, joint)] for m, _ in shown]
    chart["yAxis"] |= _scale(np.concatenate(forces or [np.zeros(0)]))
    return chart


def _off_the_stops(motion: Motion, joint: Joint) -> NDArray[np.bool_]:
    """Where the joint is off the ends of its range by more than what a stop yields in an impact."""
    lo, hi = joint.range
    return np.abs(motion.position - (lo + hi) / 2) < (0.5 - IMPACT) * (hi - lo)


def _scale(values: Array) -> dict[str, float | None]:
    """An axis' ends and the interval of its marks, such that these values fill it."""
    span = float(np.ptp(values)) if len(values) else 0.0
    if span == 0:
        return {"min": None, "max": None, "interval": None}
    power = 10.0 ** math.floor(math.log10(span / 4))
    step = next(k * power for k in (1, 2, 5, 10) if k * power >= span / 4)
    low = math.floor((values.min() - ROOM * span) / step)
    high = math.ceil((values.max() + ROOM * span) / step)
    return {"min": round(low * step, 12), "max": round(high * step, 12), "interval": step}


def run(now: Replayed, before: Replayed | None, number: int) -> dict[str, Any]:
    """The chart of a measured run beside the model's replay."""
    measured = now.measured.runs[number]
    time = measured.time - measured.time[0]
    lines = []
    if before is not None and not np.array_equal(
        before.paths[number], now.paths[number], equal_nan=True
    ):
        lines.append(_series(time, before.paths[number], "as opened", BEFORE, "dashed"))
    lines.append(_series(time, now.paths[number], "model", NOW))
    dots = _series(time, measured.position, "measured", MEASURED)
    dots |= {"type": "scatter", "symbolSize": 4, "symbol": "circle"}
    return _chart("time (s)", f"position ({now.measured.profile.joint.unit})", [dots, *lines])


def _both(now: Motion | None, before: Motion | None) -> list[tuple[Motion, tuple[str, str, str]]]:
    """What is drawn: first how it was, where that differs, then how it is."""
    out: list[tuple[Motion, tuple[str, str, str]]] = []
    if before is not None and before is not now:
        out.append((before, ("as opened", BEFORE, "dashed")))
    if now is not None:
        out.append((now, ("now", NOW, "solid")))
    return out


def _series(x: Array, y: Array, name: str, colour: str, kind: str = "solid") -> dict[str, Any]:
    every = max(len(x) // SHOWN, 1)
    kept = np.append(np.arange(0, len(x) - 1, every), len(x) - 1)
    rows = [
        [float(f"{a:.5g}"), None if np.isnan(b) else float(f"{b:.5g}")]
        for a, b in zip(x[kept], y[kept], strict=True)
    ]
    return {
        "name": name,
        "type": "line",
        "data": rows,
        "showSymbol": False,
        "silent": True,
        "lineStyle": {"color": colour, "width": 2 if kind == "solid" else 1.5, "type": kind},
        "itemStyle": {"color": colour},
    }


def _chart(
    xlabel: str, ylabel: str, series: list[dict[str, Any]], across: dict[str, Any] | None = None
) -> dict[str, Any]:
    text = {"color": INK, "fontSize": 11}
    axis = {
        "type": "value",
        "nameLocation": "middle",
        "nameTextStyle": text,
        "axisLabel": text | {"hideOverlap": True},
        "axisLine": {"show": False},
        "axisTick": {"show": False},
        "splitLine": {"lineStyle": {"color": FAINT}},
        "scale": True,
    }
    return {
        "animation": False,
        "grid": {"left": 56, "right": 14, "top": 24, "bottom": 38},
        "legend": {
            "top": -2, "right": 4, "itemWidth": 16, "itemHeight": 8, "textStyle": text,
            "data": [
                {"name": one["name"], "icon": "circle" if one["type"] == "scatter" else LINE}
                for one in series
            ],
        },
        "tooltip": {"trigger": "axis", "confine": True, "textStyle": {"fontSize": 11}},
        "xAxis": axis | {"name": xlabel, "nameGap": 22} | (across or {}),
        "yAxis": axis | {"name": ylabel, "nameGap": 40, "splitNumber": 4},
        "series": series,
    }  # fmt: skip
