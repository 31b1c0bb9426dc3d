"""Evaluation of a profile's channels; one numerical meaning, shared by every implementation.

`evaluate` is the definition, in NumPy; `merge` gives the C++ form, one piecewise cubic, which is
what runs inside MuJoCo. Golden vectors from SciPy test both.
"""

from typing import TYPE_CHECKING

from joda.field.reference import evaluate, pchip_slopes
from joda.profile import Channel

if TYPE_CHECKING:
    from joda import _core

__all__ = ["evaluate", "merge", "pchip_slopes"]


def merge(channel: Channel) -> "_core.Channel":
    """The channel merged into one piecewise cubic, in C++, for evaluation in bulk.

    Args:
        channel: its components and how they are combined.

    Returns:
        an object that gives (value, slope d/ds) for an array of normalised positions, as `evaluate`
        does, and has the breakpoints and coefficients.
    """
    import joda._core as core

    return core.Channel(channel.text(), channel.combine)
