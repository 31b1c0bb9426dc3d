"""Whether a hinge's range looks like degrees taken for radians, or radians taken for degrees."""

import numpy as np

from joda.profile import Joint

TURNS, SMALL = 2.0, 0.11
"""A range of more turns, or of less (rad: 2π taken for degrees), may be in the wrong unit."""


def implausible_range(joint: Joint) -> str:
    """A sentence where the unit of a hinge's range is in question; else nothing.

    MJCF has angles in degrees, or with <compiler angle="radian"/> in radians; URDF in radians.
    """
    if joint.type != "hinge":
        return ""
    lo, hi = joint.range
    told = f"joint '{joint.name}': its range of {lo:.4g} to {hi:.4g} rad"
    end = max(lo, hi, key=abs)
    if hi - lo > TURNS * 2 * np.pi and _near(lo, 1) and _near(hi, 1):
        return (
            f"{told} is {(hi - lo) / (2 * np.pi):.3g} turns; if degrees are meant, remove "
            'angle="radian" from <compiler>, or write the range in radians: '
            f"{np.deg2rad(lo):.4g} to {np.deg2rad(hi):.4g}."
        )
    degrees = float(np.rad2deg(end))
    odd = not _near(degrees, 0.5) and not _near(end, 1e-4)
    whole = _near(degrees, 0.01) or _near(float(np.rad2deg(degrees)), 5, 0.1)
    if hi - lo < SMALL and odd and whole:
        low, high = np.rad2deg((lo, hi))
        meant = f"{low:.4g} to {high:.4g}" if lo and hi else f"{degrees:.4g}"
        return (
            f"{told} is {low:.4g} to {high:.4g} degrees; if {meant} rad are meant, add "
            'angle="radian" to <compiler>, or write the range in degrees: '
            f"{np.rad2deg(low):.4g} to {np.rad2deg(high):.4g}."
        )
    return ""


def _near(value: float, step: float, within: float = 1e-6) -> bool:
    """Whether a number is a multiple of the step."""
    return bool(abs(value - step * round(value / step)) < within)
