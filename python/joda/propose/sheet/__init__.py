"""The contact sheet of a folder of joints: one HTML file that needs nothing else.

Names come from other people's files: whatever is shown is escaped, and the page may load nothing.
"""

import shlex
from base64 import b64encode
from collections.abc import Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from urllib.parse import quote

from joda.plain import line
from joda.propose.sheet.entry import Entry

__all__ = ["Entry", "sheet"]

UNSURE = (0.5, 0.8, 0.95)
"""Confidences below which the page can be asked to show only."""


def sheet(entries: Sequence[Entry], folder: Path, title: str) -> str:
    """The page.

    Args:
        entries: the joints, in the order in which they are shown first.
        folder: where the page will be; files are linked from there.
        title: of the page.
    """
    made = [entry for entry in entries if not entry.failed]
    lacking = sum(bool(entry.unmet) for entry in made)
    unsure = sum(entry.likely < UNSURE[1] for entry in made)
    told = (
        f"{len(made)} joints, {lacking} of them with a behaviour that does not come true, {unsure} "
        f"less than {UNSURE[1]:.0%} sure; {len(entries) - len(made)} without a profile."
    )
    kinds = sorted({entry.kind for entry in made})
    options = "".join(f'<option value="{_text(kind)}">{_text(kind)}</option>' for kind in kinds)
    below = "".join(f'<option value="{s}">less than {s:.0%} sure</option>' for s in UNSURE)
    source = files("joda.propose.sheet")
    css, js = ((source / name).read_text("utf-8") for name in ("sheet.css", "sheet.js"))
    cards = "\n".join(_card(entry, folder) for entry in entries)
    policy = (
        "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
    )
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{_text(title)}</title>
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width">
<style>{css}</style></head><body>
<header><h1>{_text(title)}</h1><p>{_text(told)}</p>
<form id="filters"><input id="words" type="search" placeholder="name, kind, behaviour">
<select id="kind"><option value="">all kinds</option>{options}</select>
<select id="below"><option value="2">however sure</option>{below}</select>
<label><input id="lacking" type="checkbox"> only with something unmet</label>
<select id="order"><option value="number">by name</option><option value="likely">least sure first
</option><option value="force">hardest to open first</option></select>
<output id="shown"></output></form></header>
<main>
{cards}
</main><script>{js}</script></body></html>
"""


def _card(entry: Entry, folder: Path) -> str:
    """A joint."""
    name = f"<h2>{_text(entry.label)}</h2>"
    if entry.failed:
        return f'<article class="failed">{name}<p class="no">{_text(entry.failed)}</p></article>'
    picture = "<p>no picture</p>"
    if entry.picture:
        alt = _text(f"{entry.label}, closed and open")
        picture = f'<img loading="lazy" alt="{alt}" src="data:image/jpeg;base64,{entry.picture}">'
    where = quote(entry.folder.relative_to(folder).as_posix())
    links = " ".join(
        f'<a href="{where}/{file}">{text}</a>'
        for file, text in (("profile.png", "profile"), ("history.json", "history"))
    )
    scene = (entry.folder / "scene.xml").resolve()
    command = shlex.join(["joda", "studio", str(scene), "--joint", entry.joint])
    behaviours = "".join(
        f'<li class="{kind}">{_text(sentence)}</li>'
        for kind, sentences in (("yes", entry.met), ("no", entry.unmet), ("note", entry.notes))
        for sentence in sentences
    )
    hard = "Infinity" if entry.force is None else f"{entry.force:.6g}"
    remarks = "".join(f"<li>{_text(sentence)}</li>" for sentence in entry.remarks)
    if remarks:
        remarks = f"<details><summary>of the model</summary><ul>{remarks}</ul></details>"
    force = "a hand cannot open it" if entry.force is None else f"{entry.force:.3g} N at the handle"
    band = f" (such joints {entry.band[0]:g} to {entry.band[1]:g})" if entry.band else ""
    others = f"; else {', '.join(entry.others)}" if entry.others else ""
    return (
        f'<article data-kind="{_text(entry.kind)}" data-likely="{entry.likely}" '
        f'data-lacking="{len(entry.unmet)}" data-force="{hard}">{name}'
        f"{picture}{entry.sketch}"
        f'<p><b>{_text(entry.kind)}</b> <meter min="0" max="1" value="{entry.likely}"></meter> '
        f"{entry.likely:.0%}{_text(others)}</p>"
        f"<p>{_text(force + band)}</p><ul>{behaviours}</ul>{_rounds(entry)}{remarks}"
        f'<p class="more">{links} <button type="button">copy studio command</button></p>'
        f"<code>{_text(command)}</code></article>"
    )


def _rounds(entry: Entry) -> str:
    """What came true in each round, where there were several, as pictures.

    As images: what an SVG holds that somebody has changed is not obeyed there.
    """
    if len(entry.rounds) < 2:
        return ""
    out = []
    for round in entry.rounds:
        told = f"round {round.number}: {len(round.met)} of {len(round.met) + len(round.unmet)}"
        source = b64encode(round.picture.encode()).decode()
        shown = f'<img alt="{told}" src="data:image/svg+xml;base64,{source}">'
        out.append(f"<p>{told} came true</p>{shown if source else ''}")
    return f"<details><summary>{len(out)} rounds</summary>{''.join(out)}</details>"


def _text(text: str) -> str:
    """Text of unknown origin as HTML that shows it, also within an attribute."""
    return escape(line(text))
