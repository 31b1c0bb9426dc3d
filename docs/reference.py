"""The reference, from the code: commands, Python, the plugin's attributes, effects, settings of the
diagnosis, schemas, the house."""

import inspect
import json
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, get_args

import architecture
import typer

import joda
from joda.cli import app
from joda.diagnosis import settings as decisions
from joda.effects import CHANNEL_EFFECTS, EFFECTS
from joda.profile import ATTRIBUTES, CHANNELS

EXAMPLE = {
    "joint": {"name": "door", "type": "hinge", "range": (0, 1.92), "unit": "rad"},
    "channels": {
        "conservative": {
            "components": [
                {"label": "latch", "interval": (0, 0.06), "x": (0, 0.5, 1), "y": (-2, -2.6, 0)}
            ]
        },
        "friction": {
            "combine": "max",
            "components": [{"label": "hinge", "interval": (0, 1), "x": (0, 1), "y": (0.1, 0.1)}],
        },
        "damping": {"components": []},
    },
    "effects": [{"effect": "backlash", "play": 0.01, "inertia": 0.002}],
}
"""A profile whose attributes show every form of text."""

MEANS = {
    "range": "Positions at s = 0 and s = 1, rad or m. Without it: the joint's own range.",
    "conservative": "Components of the force over position, N·m or N; positive pushes towards +q.",
    "friction": "Components of the greatest dry friction, N·m or N.",
    "damping": "Components of the damping, N·m·s/rad or N·s/m.",
    **{f"{name}_combine": "`sum` (the default) or `max` of the components." for name in CHANNELS},
    "effects": "Effects beyond the channels, see [effects](effects.md), separated by `;`.",
}
"""What each of the plugin's attributes holds."""


def write(folder: Path) -> None:
    """Writes the pages into the folder; those that would stay the same are not touched."""
    folder.mkdir(exist_ok=True)
    pages = {
        "commands": commands,
        "python": python,
        "attributes": attributes,
        "effects": effects,
        "settings": settings,
        "schemas": schemas,
        "architecture": architecture.page,
    }
    for name, page in pages.items():
        path, text = folder / f"{name}.md", page()
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")


def commands() -> str:
    """Every command: what it does, its usage, its arguments and options."""
    out = ["# Commands", "Every command prints this with `--help`."]
    for name in joda.COMMANDS:
        group: Any = typer.main.get_command(app(name))
        command = group.commands[name]
        context = typer.Context(command, info_name=f"joda {name}")
        usage = " ".join([context.info_name, *command.collect_usage_pieces(context)])
        records = (one.get_help_record(context) for one in command.get_params(context))
        rows = [(f"`{_cell(words)}`", _cell(text)) for words, text in filter(None, records)]
        text = inspect.cleandoc(command.help).replace("\b\n", "")
        out += [f"## joda {name}", f"```text\n{usage}\n```", text]
        out += [_table(("argument or option", "meaning"), rows)]
    return _page(out)


def python() -> str:
    """The functions of joda and what they return, then joda.effects, joda.mjx and joda.warp."""
    functions = [getattr(joda, name) for name in joda.__all__]
    returned = dict.fromkeys(one for f in functions for one in _returned(f))
    classes = [one for one in returned if one not in functions]
    out = ["# Python", *(_auto(getattr(joda, name), f"joda.{name}") for name in joda.__all__)]
    out += ["## What they return"]
    out += [_auto(one, f"{one.__module__}.{one.__name__}") for one in classes]
    for module in (joda.effects, joda.mjx, joda.warp):
        out += [f"## {module.__name__}", _directive("automodule", module.__name__, "no-members:")]
        own = {f"{module.__name__}.{name}": getattr(module, name) for name in module.__all__}
        out += [
            _auto(what, name)
            for name, what in own.items()
            if inspect.isclass(what) or inspect.isfunction(what)
        ]
    return _page(out)


def attributes() -> str:
    """The plugin's attributes, and an example of each form of text."""
    example = joda.Profile.model_validate(EXAMPLE).attributes()
    config = "\n".join(f'<config key="{key}" value="{text}"/>' for key, text in example.items())
    rows = [(f"`{key}`", MEANS[key]) for key in ATTRIBUTES]
    return _page(
        [
            "# The plugin's attributes",
            "An instance of the plugin `joda.joint_dynamics` serves the joints of the body that "
            "refers to it. In a body of several joints the joint's place stands in front, as in "
            "`0.friction`, `1.range`.",
            _table(("key", "holds"), rows),
            "Components are separated by `;`. Each is `label: a b | x… | y…`: its interval of the "
            "normalised position s, its control points within that interval (from 0 to 1), and "
            "their values. An example:",
            f"```xml\n{config}\n```",
        ]
    )


def effects() -> str:
    """The effects beyond the channels: law, numbers with units, source."""
    out = [
        "# Effects",
        "What they do in the step, and when to use which: [effects](../effects.md).",
    ]
    for name, cls in EFFECTS.items():
        curve = ["y"] * ("y" in cls.model_fields)
        fields = [(key, cls.model_fields[key]) for key in (*cls.parameters(), *curve)]
        rows = [(f"`{key}`", _cell(one.description), _default(one)) for key, one in fields]
        out += [f"## {name}", cls.DESCRIPTION, f"    {cls.LAW}"]
        out += [_table(("number", "meaning", "default"), rows)]
        out += [f"In measurements: {cls.SHOWS}"]
        if cls.CONFUSED_WITH:
            others = ", ".join(f"`{other}`" for other in cls.CONFUSED_WITH)
            out += [f"Measurements may not tell it from {others}."]
        out += [f"Source: {cls.SOURCE}."]
    out += ["## Free curves in a channel", "These effects are one more component of a channel:"]
    return _page([*out, _table(("effect", "channel"), CHANNEL_EFFECTS.items())])


def settings() -> str:
    """Every number that decides a diagnosis: value, unit, meaning."""
    out = ["# Settings of the diagnosis", inspect.cleandoc(decisions.__doc__ or "")]
    for name, group in vars(decisions.SETTINGS).items():
        first, _, listed = inspect.cleandoc(type(group).__doc__ or "").partition("Attributes:")
        told = dict(re.findall(r"^    (\w+): (.*(?:\n     .*)*)", listed, re.MULTILINE))
        rows = [(f"`{key}`", f"{value:g}", _cell(told[key])) for key, value in vars(group).items()]
        out += [f"## {name}", first.strip(), _table(("setting", "value", "what it decides"), rows)]
    return _page(out)


def schemas() -> str:
    """The JSON Schemas of the files."""
    out = ["# JSON schemas", "`joda schema NAME` prints these (draft 2020-12)."]
    for kind in get_args(inspect.signature(joda.schema).parameters["file"].annotation):
        text = json.dumps(joda.schema(kind), indent=2, ensure_ascii=False)
        out += [f"## {kind}", f"```json\n{text}\n```"]
    return _page(out)


def _returned(function: Any) -> list[type]:
    """Classes of joda that a function returns, by itself or within a list or dict."""
    if inspect.isclass(function):
        return []
    told = inspect.signature(function).return_annotation
    classes = [one for one in (told, *get_args(told)) if inspect.isclass(one)]
    return [one for one in classes if one.__module__.startswith("joda.")]


def _auto(what: Any, name: str) -> str:
    """A directive for autodoc."""
    if not inspect.isclass(what):
        return _directive("autofunction", name)
    options = ("members:", "exclude-members: model_config") if what is joda.Profile else ()
    return _directive("autoclass", name, *options)


def _directive(kind: str, name: str, *options: str) -> str:
    lines = [f".. {kind}:: {name}", *(f"   :{option}" for option in options)]
    return "\n".join(["```{eval-rst}", *lines, "```"])


def _table(head: Sequence[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown; nothing where there are no rows."""
    lines = ["| " + " | ".join(row) + " |" for row in (head, *rows)]
    return "\n".join([lines[0], "|---" * len(head) + "|", *lines[1:]]) if lines[1:] else ""


def _cell(text: str | None) -> str:
    return " ".join((text or "").split()).replace("|", r"\|")


def _default(field: Any) -> str:
    return "" if field.is_required() else f"{field.default}"


def _page(parts: Iterable[str]) -> str:
    return "\n\n".join(part for part in parts if part) + "\n"
