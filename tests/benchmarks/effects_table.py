"""The catalogue of effects as docs/effects.md shows it: python tests/benchmarks effects_table"""

from joda.effects import CHANNEL_EFFECTS, EFFECTS


def catalogue() -> str:
    """Markdown, a section per effect."""
    out = []
    for name, cls in EFFECTS.items():
        curve = ["y"] if "y" in cls.model_fields else []
        out += [f"### {name}\n", f"{cls.DESCRIPTION}\n", f"    {cls.LAW}\n"]
        out += [f"- `{k}`: {cls.model_fields[k].description}" for k in (*cls.parameters(), *curve)]
        out += [f"- In measurements: {cls.SHOWS}"]
        if cls.CONFUSED_WITH:
            others = ", ".join(f"`{other}`" for other in cls.CONFUSED_WITH)
            out += [f"- Measurements may not tell it from {others}."]
        out += [f"- Source: {cls.SOURCE}\n"]
    for name, channel in CHANNEL_EFFECTS.items():
        out += [f"### {name}\n", f"A free curve in the {channel} channel: one more component.\n"]
    return "\n".join(out)


def main() -> None:
    print(catalogue())
