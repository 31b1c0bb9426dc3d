"""Effects that the measurements cannot tell apart."""

from joda.diagnosis.search import Ranking
from joda.diagnosis.selection import LEFT, LITTLE, Selection

RIVAL = 0.35
"""Part of the excess that an effect may leave that counts as an alternative."""
RESISTING = (
    *("position_dependent_friction", "position_dependent_damping", "constant_friction_hinge"),
    *("constant_damping_hinge", "asymmetric_friction", "direction_dependent_damping"),
)
DRIVING = (
    *("constant_positive_conservative_hinge", "constant_negative_conservative_hinge"),
    *("spring_return_to_low_end", "spring_return_to_high_end", "bistable_mechanism"),
    *("magnetic_return_to_low_end", "magnetic_return_to_high_end", "gravity_offset"),
    *("spring_loaded_snap_detent_to_low_end", "spring_loaded_snap_detent_to_high_end"),
    *("detent_internal", "bistable_mechanism_internal"),
)
"""What resists motion, and what is a force over position: the same where it goes one way only."""
ALIKE = 0.1
"""By how much of the misfit two effects may differ that the data cannot tell apart."""


def indistinguishable(
    ranking: Ranking, selection: Selection, number: int, one_way: bool
) -> tuple[str, ...]:
    """Effects that the data cannot tell from a candidate."""
    own, left = selection.excess
    names = [candidate.hypothesis.effect for candidate in ranking.candidates]
    alike = {
        name
        for k, name in enumerate(names)
        if abs(left[k] - left[number]) < ALIKE * (left[number] + LITTLE)
        and left[k] < max(RIVAL * own, LEFT)
    }
    if one_way:
        for mine, other in ((RESISTING, DRIVING), (DRIVING, RESISTING)):
            if names[number] in mine:
                alike |= set([name for name in names if name in other][:1])
    return tuple(name for name in names if name in alike and name != names[number])
