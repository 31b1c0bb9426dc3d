"""Evaluation of a profile's channels; one numerical meaning, shared by every implementation.

This is the C++ form, one piecewise cubic, which is what runs inside MuJoCo; `jaxfield` has the same
in JAX. SciPy's PCHIP tests both.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from joda import _core as core
from joda.profile import Channel

__all__ = ["evaluate", "merge"]


def evaluate(channel: Channel, s: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Value and slope of a channel.

    Args:
        channel: its components and how they are combined.
        s: normalised joint positions, any shape; beyond [0, 1] the value at that end is held.

    Returns:
        value in the channel's unit and slope d/ds, arrays of the shape of s. Where two components
        of a maximum are equal, the slope is one of theirs.
    """
    return merge(channel)(s)


def merge(channel: Channel) -> core.PiecewiseCubic:
    """The channel merged into one piecewise cubic, in C++.

    Args:
        channel: its components and how they are combined.

    Returns:
        an object that gives (value, slope d/ds) for an array of normalised positions, as `evaluate`
        does, and has the breakpoints and cubics.
    """
    return core.PiecewiseCubic(channel.text(), channel.combine)
