"""Effects in words: what is missing, where, how much, and what shows it."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from joda.diagnosis.settings import SETTINGS
from joda.effects import CHANNEL_EFFECTS, EFFECTS
from joda.effects.base import Kind
from joda.errors import JodaError
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


def effect_names() -> tuple[str, ...]:
    """All that may be missing, but for templates of one's own."""
    return (*read_templates(), *CURVES, *EFFECTS)


@dataclass(frozen=True)
class Words:
    """An effect in words.

    Attributes:
        name: what a model without it lacks.
        shows: how it shows in measurements, a clause.
        kind: a force over position or a resistance, which are the same where the joint goes one way
            only; None of neither.
    """

    name: str
    shows: str
    kind: Kind | None


def words_of(effect: str, templates: Mapping[str, Template] | None = None) -> Words:
    """What a card or a template says of an effect.

    Args:
        effect: its name.
        templates: by name; None: the library's.
    """
    if effect in CURVES:
        return Words(*CURVES[effect], "resistance")
    if effect in EFFECTS:
        card = EFFECTS[effect]
        return Words(card.NAME, _lower(card.SHOWS), card.KIND)
    if template := (read_templates() if templates is None else templates).get(effect):
        forces = template.channels.conservative is not None
        return Words(template.named, template.shows, "force" if forces else "resistance")
    return Words(effect.replace("_", " "), Template.model_fields["shows"].default, None)


def named(effect: str, templates: Mapping[str, Template] | None = None) -> str:
    """The effect in a few words."""
    return words_of(effect, templates).name


def percent(probability: float) -> str:
    """Of an effect, never said to be certain."""
    return f"{100 * min(probability, SETTINGS.naming.surest):.0f} %"


def placed(interval: tuple[float, float], joint: Joint) -> str:
    """Where it acts; nothing where it is all over the range."""
    a, b = interval
    if a <= 0.0 and b >= 1.0:
        return ""
    lo, hi = joint.range
    ends = " to ".join(f"{lo + s * (hi - lo):.3g}" for s in (a, b))
    return f" at q = {ends} {joint.unit} (s = {a:.2f} to {b:.2f})"


def explained(
    words: Words,
    direction: str,
    interval: tuple[float, float],
    unvisited: tuple[tuple[float, float], ...],
    size: tuple[float, float, str],
    errors: tuple[float, float, float],
    error_unit: str,
    joint: Joint,
    uneven: bool = False,
    shown: str | None = None,
    alike: Sequence[str] = (),
) -> str:
    """An effect as a sentence for a person.

    Args:
        words: what it is called, and how it shows.
        direction: both, positive or negative.
        interval: where it acts, in normalised position.
        unvisited: what of that no run has visited.
        size: magnitude, its standard deviation and unit.
        errors: of held-out segments before and after, and the noise.
        error_unit: of these.
        joint: of which it is.
        uneven: whether its size differs along the way.
        shown: how it shows with its other numbers, a sentence; None: as it does with any.
        alike: in words, what these data cannot tell from it.
    """
    value, error, unit = size
    largest = " where it is largest" if uneven else ""
    way = f", {WAYS[direction]}" if direction in WAYS else ""
    of = "" if unit == "1" else f" {unit}"
    shows = _lower(shown) if shown else words.shows
    before, after, noise = errors
    name = words.name
    told = f" These data cannot tell it from {' or '.join(alike)}." if alike else ""
    return (
        f"{name[0].upper()}{name[1:]}{placed(interval, joint)}{way}, {value:.3g} "
        f"\N{PLUS-MINUS SIGN} {error:.2g}{of}{largest}: {shows}. {extrapolated(unvisited)}"
        f"With it, the held-out segment error is {after:.2g} "
        f"instead of {before:.2g} {error_unit} (noise {noise:.2g} {error_unit}).{told}"
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


def check_effect(name: str, templates: Collection[str] = ()) -> None:
    """Raises JodaError if there is no effect of that name, nor a template."""
    every = dict.fromkeys((*effect_names(), *templates))
    if name not in every:
        raise JodaError(f"no effect '{name}'; there are {', '.join(every)}.")
