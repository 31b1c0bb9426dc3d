"""Evaluation of a profile's channels; one numerical meaning, shared by every implementation.

`reference` is the definition, in NumPy; the C++ core (`joda._core.Channel`) merges a channel into
one piecewise cubic at load and is what runs inside MuJoCo. Golden vectors from SciPy test both.
"""

from joda.field.reference import evaluate, pchip_slopes

__all__ = ["evaluate", "pchip_slopes"]
