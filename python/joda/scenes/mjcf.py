"""MJCF as text: find elements across includes, edit them, leave every other byte as it is.

MuJoCo's own writer (MjSpec.to_xml) expands includes, drops comments and rounds numbers, so a user's
file is edited in place of being written anew. An included file that has to change is written out
where it was included, which is what an include means; all others stay includes.
"""

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from joda.plain import UNSEEN

_TAG = re.compile(rb"""<(?:[^"'>]|"[^"]*"|'[^']*')*>""")
_ATTRIBUTE = re.compile(rb"""(?<!\s)\s+([\w:.\-]+)\s*=\s*("[^"]*"|'[^']*')""")


def quoted(value: str) -> str:
    """An attribute's value between quotation marks; what is not seen but acts as its number."""
    return UNSEEN.sub(lambda match: f"&#{ord(match[0])};", quoteattr(value))


class MjcfError(ValueError):
    """The text is not XML that can be edited in place."""


@dataclass(eq=False)
class Document:
    """One file: its bytes, its root element, and the edits still to be made."""

    path: Path
    content: bytes
    root: "Element" = field(init=False)
    edits: list[tuple[int, int, bytes]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Parses the content."""
        self.root = _parse(self)

    def edit(self, start: int, end: int, text: str) -> None:
        """Puts `text`, with the file's line ends, in the place of bytes `start` to `end`."""
        newline = "\r\n" if b"\r\n" in self.content else "\n"
        self.edits.append((start, end, text.replace("\n", newline).encode()))


@dataclass(eq=False)
class Element:
    """An element and where it stands in its document, in bytes."""

    document: Document
    tag: str
    attributes: dict[str, str]
    start: int
    inner: int  # end of the start tag
    close: int = -1  # start of the end tag; as `inner` for <tag/>
    end: int = -1
    own: "list[Element]" = field(default_factory=list)
    included: Document | None = None  # for an <include>

    @property
    def children(self) -> "Iterator[Element]":
        """Child elements, with includes replaced by what they include."""
        for child in self.own:
            if child.included:
                yield from child.included.root.children
            else:
                yield child

    def walk(self) -> "Iterator[Element]":
        """The element and all below it, in document order."""
        yield self
        for child in self.children:
            yield from child.walk()

    def set(self, **values: str) -> None:
        """Sets attributes, in place where they exist already."""
        tag = self.document.content[self.start : self.inner]
        for name, value in values.items():
            text = f"{name}={quoted(value)}".encode()
            for match in _ATTRIBUTE.finditer(tag):
                if match[1].decode() == name:
                    tag = tag[: match.start(1)] + text + tag[match.end() :]
                    break
            else:
                close = len(tag.removesuffix(b">").removesuffix(b"/").rstrip())
                tag = tag[:close] + b" " + text + tag[close:]
        self.document.edits.append((self.start, self.inner, tag))

    def replace(self, text: str) -> None:
        """Puts other lines in the place of the element, indented as it is."""
        self.document.edit(self.start, self.end, text.replace("\n", "\n" + self._indent()))

    def insert_after(self, text: str) -> None:
        """Inserts lines after the element, indented as it is."""
        self.document.edit(self.end, self.end, self._indented(text, 0))

    def insert_first(self, text: str) -> None:
        """Inserts lines before the element's first child; the element must have an end tag."""
        self.document.edit(self.inner, self.inner, self._indented(text, 1))

    def insert_last(self, text: str) -> None:
        """Inserts lines before the element's end tag; the element must have one."""
        at = len(self.document.content[: self.close].rstrip())
        self.document.edit(at, at, self._indented(text, 1))

    def _indent(self) -> str:
        line = self.document.content.rfind(b"\n", 0, self.start) + 1
        before = self.document.content[line : self.start]
        return before.decode() if not before.strip() else ""

    def _indented(self, text: str, levels: int) -> str:
        indent = "\n" + self._indent() + "  " * levels
        return indent + text.replace("\n", indent)


class Source:
    """A model's text with all that it includes."""

    def __init__(self, path: Path, content: bytes | None = None):
        """Reads the file, or takes `content` for what stands there; raises MjcfError, OSError."""
        self.folder = _join(Path.cwd(), path.parent)
        self.main = Document(path, path.read_bytes() if content is None else content)
        if self.main.root.tag != "mujoco":
            raise MjcfError(f"the root element is <{self.main.root.tag}>, not <mujoco>")
        self._include(self.main)

    @property
    def root(self) -> Element:
        """The <mujoco> element."""
        return self.main.root

    def joints(self) -> list[tuple[Element, Element]]:
        """(body, joint) elements in the order of the compiled model's joints."""
        out: list[tuple[Element, Element]] = []
        for section in self.root.children:
            if section.tag == "worldbody":
                _collect_joints(section, section, out)
        return out

    def relocate(self, folder: Path) -> None:
        """Rewrites what the text refers to for a main file that will lie in `folder`.

        To be called when all other edits are made.
        """
        there = _join(Path.cwd(), folder)
        if there != self.folder:
            self._relocate_assets(there)
        self._relocate_includes(self.main, there)

    def render(self) -> bytes:
        """The main file's bytes with all edits made."""
        return _apply(self.main)

    def _relocate_assets(self, there: Path) -> None:
        def moved(path: str) -> str:
            return path if os.path.isabs(path) else os.path.relpath(self.folder / path, there)

        kinds = ("assetdir", "meshdir", "texturedir")
        named = set()
        for element in self.root.walk():
            if element.tag == "compiler":
                found = {k: element.attributes[k] for k in kinds if k in element.attributes}
                named |= set(found)
                if found:
                    element.set(**{kind: moved(path) for kind, path in found.items()})
            elif element.tag == "model" and "file" in element.attributes:
                element.set(file=moved(element.attributes["file"]))
        missing = [] if "assetdir" in named else [kind for kind in kinds[1:] if kind not in named]
        if missing:
            paths = " ".join(f"{kind}={quoted(moved('.'))}" for kind in missing)
            self.root.insert_first(f"<compiler {paths}/>")

    def _relocate_includes(self, document: Document, there: Path) -> None:
        """Rewrites the includes that stay, as MuJoCo looks them up from the main file first."""
        for element in _raw(document.root):
            inner = element.included
            if not inner:
                continue
            moves = there != self.folder
            if _changed(inner) or (moves and any(e.included for e in _raw(inner.root))):
                self._relocate_includes(inner, there)
            elif moves or inner.path != _join(self.folder, element.attributes["file"]):
                element.set(file=os.path.relpath(inner.path, there))

    def _include(self, document: Document, above: tuple[Path, ...] = ()) -> None:
        for element in _raw(document.root):
            if element.tag != "include":
                continue
            name = element.attributes.get("file", "")
            tried = [_join(folder, name) for folder in (self.folder, document.path.parent)]
            path = next((path for path in tried if path.is_file()), None)
            if path is None:
                raise MjcfError(f"{document.path}: the included file {name} does not exist")
            if path in above:
                raise MjcfError(f"{path}: includes itself")
            element.included = Document(path, path.read_bytes())
            self._include(element.included, (*above, path))


def _join(folder: Path, path: str | Path) -> Path:
    """The path without "..", taken away as text, as MuJoCo does; links are not resolved."""
    return Path(os.path.normpath(folder / path))


def _parse(document: Document) -> Element:
    """The tree of a document's elements; raises MjcfError where it is not XML."""
    content = document.content
    try:  # MuJoCo reads bytes, whatever is declared; a comment may well be Latin-1
        content.decode()
        parser = expat.ParserCreate("UTF-8")
    except UnicodeDecodeError:
        parser = expat.ParserCreate("ISO-8859-1")
    stack: list[Element] = []
    roots: list[Element] = []

    def begin(tag: str, attributes: dict[str, str]) -> None:
        start = parser.CurrentByteIndex
        element = Element(document, tag, attributes, start, _tag_end(content, start))
        (stack[-1].own if stack else roots).append(element)
        stack.append(element)

    def finish(tag: str) -> None:
        element = stack.pop()
        if content[element.inner - 2 : element.inner] == b"/>":
            element.close = element.end = element.inner
        else:
            element.close = parser.CurrentByteIndex
            element.end = content.index(b">", parser.CurrentByteIndex) + 1

    def refuse(name: str, *declared: object) -> None:
        raise MjcfError(f"{document.path}: it declares an entity, which MuJoCo does not expand")

    parser.StartElementHandler, parser.EndElementHandler = begin, finish
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise MjcfError(f"{document.path}: {error}") from None
    return roots[0]


def _tag_end(content: bytes, start: int) -> int:
    """Index behind the '>' that closes the start tag at `start`."""
    match = _TAG.match(content, start)
    assert match  # as it is well-formed
    return match.end()


def _raw(element: Element) -> Iterator[Element]:
    for child in element.own:
        yield child
        yield from _raw(child)


def _collect_joints(node: Element, body: Element, out: list[tuple[Element, Element]]) -> None:
    """Joints of the body (in its frames too), then those of its child bodies."""

    def flat(element: Element) -> Iterator[Element]:
        for child in element.children:
            if child.tag == "frame":
                yield from flat(child)
            else:
                yield child

    children = list(flat(node))
    out += [(body, child) for child in children if child.tag in ("joint", "freejoint")]
    for child in children:
        if child.tag == "body":
            _collect_joints(child, child, out)


def _changed(document: Document) -> bool:
    below = (e.included for e in _raw(document.root) if e.included)
    return bool(document.edits) or any(map(_changed, below))


def _apply(document: Document, start: int = 0, end: int | None = None) -> bytes:
    """The document's bytes from `start` to `end` with the edits made."""
    edits = list(document.edits)
    for element in _raw(document.root):
        if element.included and _changed(element.included):
            root = element.included.root
            text = _apply(element.included, root.inner, root.close).strip()
            edits.append((element.start, element.end, text))
    out, at = [], start
    for first, last, text in sorted(edits, key=lambda edit: edit[:2]):
        out += [document.content[at:first], text]
        at = last
    return b"".join([*out, document.content[at:end]])
