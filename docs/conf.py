"""How Sphinx makes the site: `sphinx-build -W --keep-going docs site`."""

import os
import re
import sys
from functools import partial
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx

import joda

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

import reference  # noqa: E402

project = "JODA"
author = "the JODA developers"
release = version = joda.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
exclude_patterns = ["gallery/*/**"]
default_role = "code"
myst_heading_anchors = 3
napoleon_use_ivar = True
smartquotes = False
autodoc_preserve_defaults = True
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 80

html_theme = "furo"
html_title = "JODA"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_show_copyright = False
html_show_sourcelink = False

REPOSITORY = os.environ.get("JODA_REPOSITORY", "").rstrip("/")
"""Where the repository's files can be looked at, as `https://host/joda/blob/main`; may be empty."""


def _outward(page: str, link: re.Match[str]) -> str:
    """A link out of docs/ as one into the repository; as a mere path where that is unknown."""
    text, to = link.groups()
    target = Path(os.path.normpath((HERE / page).parent / to))
    if target.is_relative_to(HERE):
        return link[0]
    path = target.relative_to(HERE.parent).as_posix()
    if REPOSITORY:
        return f"[{text}]({REPOSITORY}/{path})"
    return f"`{path}`" if text in path else f"{text} (`{path}`)"


def _read(app: Sphinx, page: str, source: list[str]) -> None:
    source[0] = re.sub(r"\[([^\]]+)\]\((\.\./[^)]+)\)", partial(_outward, page), source[0])


def _sign(app: Sphinx, *said: Any) -> tuple[str | None, str | None]:
    """Signatures with the name of the union of all effects instead of its members."""
    *_, arguments, returned = said
    union = r"~?(?:typing\.)?Annotated\[.*?discriminator='effect'\)\]"
    return arguments and re.sub(union, "AnyEffect", arguments), returned


def setup(app: Sphinx) -> None:
    """The reference is written from the code before anything is read."""
    app.connect("builder-inited", lambda app: reference.write(HERE / "reference"))
    app.connect("source-read", _read)
    app.connect("autodoc-process-signature", _sign)
