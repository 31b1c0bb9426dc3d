"""Effects in words: what is missing, where, how much, and what shows it."""

from functools import cache

from joda.effects import CHANNEL_EFFECTS, EFFECTS
from joda.profile import Joint
from joda.template import Template, read_templates

CURVES = {
    "position_dependent_friction": (
        "dry friction that differs along the way",
        "a resistance missing that does not depend on speed, and differs with position",
    ),
    "position_dependent_damping": (
        "damping that differs along the way",
        "a resistance missing that grows with speed, and differs with position",
    ),
}
"""Name and what shows it, of the free curves; other effects and templates have their own."""
WAYS = {"positive": "towards +q", "negative": "towards \N{MINUS SIGN}q"}

assert set(CURVES) == set(CHANNEL_EFFECTS)

LEARN = (
    "What has no name can be learned from these runs: joda add ... --effect learned_force, which "
    "adds the law only if runs held out of the fit are clearly better with it."
)


SUREST = 0.99
"""Highest probability that is said."""


@cache
def effect_names() -> tuple[str, ...]:
    """All that may be missing, but for templates of one's own."""
    return (*read_templates(), *CURVES, *EFFECTS)


def named(effect: str) -> str:
    """The effect in a few words: a template of one's own by its file's name."""
    return _words(effect)[0]


@cache
def _words(effect: str) -> tuple[str, str]:
    """An effect's name, and what shows it."""
    if effect in CURVES:
        return CURVES[effect]
    if effect in EFFECTS:
        return EFFECTS[effect].NAME, _lower(EFFECTS[effect].SHOWS)
    if own := read_templates().get(effect):
        return own.named, own.shows
    return effect.replace("_", " "), Template.model_fields["shows"].default


def percent(probability: float) -> str:
    """Of an effect, never said to be certain."""
    return f"{100 * min(probability, SUREST):.0f} %"


def placed(interval: tuple[float, float], joint: Joint) -> str:
    """Where it acts; nothing where it is all over the range."""
    a, b = interval
    if a <= 0.0 and b >= 1.0:
        return ""
    lo, hi = joint.range
    ends = " to ".join(f"{lo + s * (hi - lo):.3g}" for s in (a, b))
    return f" at q = {ends} {joint.unit} (s = {a:.2f} to {b:.2f})"


def explained(
    effect: str,
    direction: str,
    interval: tuple[float, float],
    unvisited: tuple[tuple[float, float], ...],
    size: tuple[float, float, str],
    errors: tuple[float, float, float],
    error_unit: str,
    joint: Joint,
    uneven: bool = False,
    shown: str | None = None,
) -> str:
    """An effect as a sentence for a person.

    Args:
        effect: its name.
        direction: both, positive or negative.
        interval: where it acts, in normalised position.
        unvisited: what of that no run has visited.
        size: magnitude, its standard deviation and unit.
        errors: of held-out segments before and after, and the noise.
        error_unit: of these.
        joint: of which it is.
        uneven: whether its size differs along the way.
        shown: how it shows with its other numbers, a sentence; None: as it does with any.
    """
    value, doubt, unit = size
    largest = " where it is largest" if uneven else ""
    way = f", {WAYS[direction]}" if direction in WAYS else ""
    of = "" if unit == "1" else f" {unit}"
    shows = _lower(shown) if shown else _words(effect)[1]
    before, after, noise = errors
    name = named(effect)
    return (
        f"{name[0].upper()}{name[1:]}{placed(interval, joint)}{way}, {value:.3g} "
        f"\N{PLUS-MINUS SIGN} {doubt:.2g}{of}{largest}: {shows}. {extrapolated(unvisited)}"
        f"With it, windows held out of the fit are missed by {after:.2g} "
        f"instead of {before:.2g} {error_unit} (noise {noise:.2g} {error_unit})."
    )


def extrapolated(unvisited: tuple[tuple[float, float], ...]) -> str:
    """That it is not known where no run has been, as a sentence; nothing if all was visited, but
    for what is too narrow to be told."""
    ends = [(f"{a:.2f}", f"{b:.2f}") for a, b in unvisited]
    where = " and ".join(f"s = {a} to {b}" for a, b in ends if a != b)
    return f"No run visited {where}: there it is extrapolated. " if where else ""


def _lower(sentence: str) -> str:
    """A sentence as a clause; only the first of several."""
    first = sentence.split(". ")[0].rstrip(".")
    return first[0].lower() + first[1:]
