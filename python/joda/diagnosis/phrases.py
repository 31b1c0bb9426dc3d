"""Effects in words: what is missing, where, how much, and what shows it."""

from joda.effects import CHANNEL_EFFECTS, EFFECTS
from joda.profile import Joint

NAMES = {
    "constant_friction_hinge": "dry friction",
    "constant_damping_hinge": "viscous damping",
    "constant_positive_conservative_hinge": "a constant force towards +q",
    "constant_negative_conservative_hinge": "a constant force towards \N{MINUS SIGN}q",
    "detent_internal": "a click-stop (detent)",
    "bistable_mechanism": "an over-centre mechanism with two stable sides",
    "bistable_mechanism_internal": "a snap between two stable places within the range",
    "magnetic_return_to_low_end": "a magnet at the low end",
    "magnetic_return_to_high_end": "a magnet at the high end",
    "spring_return_to_low_end": "a return spring towards the low end",
    "spring_return_to_high_end": "a return spring towards the high end",
    "spring_loaded_snap_detent_to_low_end": "a latch at the low end",
    "spring_loaded_snap_detent_to_high_end": "a latch at the high end",
    "position_dependent_friction": "dry friction that differs along the way",
    "position_dependent_damping": "damping that differs along the way",
    "asymmetric_friction": "more dry friction in one direction than in the other",
    "direction_dependent_damping": "more damping in one direction than in the other",
    "stribeck_friction": "more dry friction at rest than in motion (Stribeck)",
    "quadratic_damping": "drag that grows with the square of speed",
    "presliding_friction": "dry friction that gives way elastically before it slides",
    "load_dependent_friction": "dry friction that grows with the load",
    "added_inertia": "more inertia than the model has",
    "gravity_offset": "another pull of gravity (tilt, or another centre of mass)",
    "end_stop_restitution": "ends of the range that throw the joint back",
    "backlash": "play between what is pushed and what moves",
    "learned_force": "a law learned from the runs",
}
SHOWS = {
    "constant_friction_hinge": "the joint stops, or is held, where the model goes on",
    "constant_damping_hinge": "fast motion loses more than the model's, in proportion to speed",
    "constant_positive_conservative_hinge": "the force missing is the same in both directions",
    "constant_negative_conservative_hinge": "the force missing is the same in both directions",
    "detent_internal": "the joint is drawn to the middle of that place from either side",
    "bistable_mechanism": "the force missing changes its sign at a tipping point",
    "bistable_mechanism_internal": "the joint is drawn to two places there, with a barrier between",
    "magnetic_return_to_low_end": "a pull that grows steeply towards the end",
    "magnetic_return_to_high_end": "a pull that grows steeply towards the end",
    "spring_return_to_low_end": "a force missing that grows in proportion to position",
    "spring_return_to_high_end": "a force missing that grows in proportion to position",
    "spring_loaded_snap_detent_to_low_end": "a barrier before the end, and a hold behind it",
    "spring_loaded_snap_detent_to_high_end": "a barrier before the end, and a hold behind it",
    "position_dependent_friction": "a resistance missing that does not depend on speed, and "
    "differs with position",
    "position_dependent_damping": "a resistance missing that grows with speed, and differs with "
    "position",
}
SHAPE = "what is missing there has the shape of the template's curves"
"""What shows a template of one's own."""
WAYS = {"positive": "towards +q", "negative": "towards \N{MINUS SIGN}q"}

assert set(NAMES) >= {*EFFECTS, *CHANNEL_EFFECTS}

LEARN = (
    "What has no name can be learned from these runs: joda add ... --effect learned_force, which "
    "adds the law only if runs held out of the fit are clearly better with it."
)


SUREST = 0.99
"""Highest probability that is said."""


def named(effect: str) -> str:
    """The effect in a few words: a template of one's own by its file's name."""
    return NAMES.get(effect, effect.replace("_", " "))


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
    """
    value, doubt, unit = size
    way = f", {WAYS[direction]}" if direction in WAYS else ""
    of = "" if unit == "1" else f" {unit}"
    shows = SHOWS.get(effect) or (_lower(EFFECTS[effect].SHOWS) if effect in EFFECTS else SHAPE)
    before, after, noise = errors
    name = named(effect)
    return (
        f"{name[0].upper()}{name[1:]}{placed(interval, joint)}{way}, {value:.3g} "
        f"\N{PLUS-MINUS SIGN} {doubt:.2g}{of}: {shows}. {extrapolated(unvisited)}"
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
