"""Joints of every size on a bench: hands and ramps that brake before the ends, flicks.

Recording stops where the joint meets an end, which is rigid. Gaussian wells, inverse squares.
"""

from collections.abc import Sequence

import numpy as np

from joda.hidden.family import Family
from joda.hidden.joint import draw_truth
from joda.hidden.known import KNOWN
from joda.hidden.measuring import draw_encoder, move
from joda.hidden.truth import Truth
from joda.hidden.uncatalogued import UNCATALOGUED

HEAVY = ("actuation_delay",)
WEIGHTY = ("load_dependent_friction",)
RUBBING = ("presliding_friction", "stribeck_friction")
"""Effects that need a slow joint; gravity; dry friction of the base."""


def _truth(rng: np.random.Generator, names: Sequence[str], forced: bool) -> Truth:
    heavy, weighty, rubbing = (
        any(name in group for name in names) for group in (HEAVY, WEIGHTY, RUBBING)
    )
    return draw_truth(
        rng, heavy=heavy, gravity=weighty and not forced, friction=rubbing, damping=False
    )


LABORATORY = Family(
    "laboratory",
    "joint",
    KNOWN,
    UNCATALOGUED,
    ("backlash", "actuation_delay"),
    _truth,
    draw_encoder,
    move,
)
