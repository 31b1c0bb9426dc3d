"""A report as one HTML file that needs nothing else: text, tables and pictures inside."""

import base64
from collections.abc import Sequence
from html import escape

from joda.plain import plain

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 60rem; margin: 2rem auto;
       padding: 0 1rem; }
table { border-collapse: collapse; margin: 1rem 0; }
th, td { text-align: left; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid #ddd; }
img { max-width: 100%; }
"""


def _shown(text: str) -> str:
    """Plain text as HTML that shows it."""
    return escape(plain(text))


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return f"<p>{_shown(text)}</p>"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of plain texts."""
    cells = ["".join(f"<td>{_shown(cell)}</td>" for cell in row) for row in rows]
    first = "".join(f"<th>{_shown(cell)}</th>" for cell in head)
    return f"<table><tr>{first}</tr>{''.join(f'<tr>{row}</tr>' for row in cells)}</table>"


def picture(png: bytes, what: str) -> str:
    """A PNG, inside the file."""
    content = base64.b64encode(png).decode()
    return f'<img alt="{_shown(what)}" src="data:image/png;base64,{content}">'


def page(title: str, *parts: str) -> str:
    """The whole file."""
    return (
        f'<!doctype html>\n<html lang="en"><meta charset="utf-8"><title>{_shown(title)}</title>'
        f"<style>{STYLE}</style><h1>{_shown(title)}</h1>\n" + "\n".join(parts) + "</html>\n"
    )
