"""Copies of plugins that MuJoCo cannot make, told before it reads the text.

An instance in a <replicate> corrupts its memory, whatever the plugin: it crashes now or later. A
plugin without an instance of its own in an attached model leaves a reference to nowhere.
"""

from collections.abc import Iterator
from pathlib import Path

from joda.errors import JodaError
from joda.plugin import PLUGIN
from joda.scenes.mjcf import Element, MjcfError, Source


def refuse_copied_plugins(path: Path) -> None:
    """Raises JodaError if the model has MuJoCo copy what it cannot."""
    try:
        _check(path, attached=False, above=())
    except (MjcfError, OSError, RecursionError):  # a file that includes itself
        return  # MuJoCo, or who edits the text, says what is wrong with it


def _check(path: Path, attached: bool, above: tuple[Path, ...]) -> None:
    if path in above:
        raise JodaError(f"{path}: attaches itself, by way of its <asset>; remove that <model>.")
    source = Source(path)
    models = {
        element.attributes.get("name", ""): source.folder / element.attributes.get("file", "")
        for element in source.root.walk()
        if element.tag == "model"
    }
    for element in source.root.walk():
        if element.tag == "replicate":
            for name in _instances(element, models):
                raise JodaError(
                    f'{path}: a <replicate> holds <plugin instance="{name}"/>, on which MuJoCo '
                    "crashes; take that line out and give each copy its profile with: joda attach."
                )
        alone = [e for e in element.children if e.attributes.get("plugin") == PLUGIN]
        if attached and element.tag == "body" and alone:
            raise JodaError(
                f'{path}: a body holds <plugin plugin="{PLUGIN}"> itself, which MuJoCo cannot '
                "attach to another model; put it into an <instance> of <extension> and <plugin "
                'instance="..."/> into the body.'
            )
    for file in models.values():
        _check(file, True, (*above, path))


def _instances(element: Element, models: dict[str, Path]) -> Iterator[str]:
    """Names of the plugin instances in the element and in the models that it attaches."""
    for inner in element.walk():
        if inner.tag == "plugin" and "instance" in inner.attributes:
            yield inner.attributes["instance"]
        elif inner.tag == "attach":
            name = inner.attributes.get("model", "")
            # a model without a name has that of its file's content
            for file in [models[name]] if name in models else models.values():
                yield from _instances(Source(file).root, {})
