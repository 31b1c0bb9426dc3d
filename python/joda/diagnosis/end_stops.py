"""How stiff and how damped the ends of the range are, by the runs that come to them.

Segments in which a joint comes to an end, or rests there, tell nothing of its own laws, and of the
model's stop all that whole runs need to go on from there.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from joda.diagnosis.impacts import some_of
from joda.diagnosis.shape_refinement import bouncy, clearly
from joda.estimation.problem import as_it_is, segments_for
from joda.joints.joint_model import JointModel
from joda.measured.measured_joint import Measured

Array = NDArray[np.float64]
Solref = tuple[float, ...]

LONGER = 2.0
"""Length of segments, in units of the diagnosis' own: what comes back from an end tells of it."""
FIRST = (-2.8, -1.4, 0.0, 1.4, 2.8), (-0.7, 0.0, 0.7)
"""Logarithms of factors of the stiffness and of the damping ratio that are tried first, one at a
time."""
WIDE, TRIED, SETTLING = 0.4, 60, 4
"""How far a search begins to look, in those; models that it tries, and iterations that fit the
starts of one."""


def fitted_stop(train: Measured, held: Measured) -> Solref | None:
    """The parameter solref of the ends of the range that suits the runs there (Nelder and Mead
    1965), if it makes those that were held out clearly likelier; else None.

    Args:
        train: the joint with a profile, and runs to fit.
        held: the same with runs held out; where none comes to an end, part of the others judge.
    """
    if bouncy(train.profile):  # whose ends are its own
        return None
    fit, judge = _at_ends(train), _at_ends(held)
    if judge is None:  # then by every second segment of the others
        fit, judge = (_at_ends(train, slice(k, None, 2)) for k in (0, 1))
    if fit is None or judge is None:
        return None
    own = train.joint_model.solref

    def loss(z: Array) -> float:
        return fit(_changed(own, z))

    stiffnesses, ratios = FIRST
    first = [np.array((z, 0.0)) for z in stiffnesses] + [np.array((0.0, z)) for z in ratios]
    simplex = min(first, key=loss) + WIDE * np.array(((0, 0), (1, 0), (0, 1)))
    options = {"maxfev": TRIED, "initial_simplex": simplex}
    found = _changed(own, minimize(loss, simplex[0], method="Nelder-Mead", options=options).x)
    return found if clearly(judge(found), judge(own)) else None


def written(joint_model: JointModel, solref: Solref | None) -> tuple[dict[str, str], list[str]]:
    """Attributes of a joint's element in MJCF for a solref that was fitted beside its own solimp,
    and what is changed, for a person; nothing of either where none was fitted."""
    if solref is None:
        return {}, []
    pairs = ("solreflimit", solref), ("solimplimit", joint_model.solimp)
    own = {name: " ".join(f"{value:.6g}" for value in values) for name, values in pairs}
    was, now = (" ".join(f"{x:.4g}" for x in stop) for stop in (joint_model.solref, solref))
    return own, [
        f"ends of the range: solreflimit {was} → {now}, as the runs that come to them show"
    ]


def _at_ends(measured: Measured, which: slice = slice(None)) -> Callable[[Solref], float] | None:
    """Twice the negative log-likelihood of (some of the) segments at the ends, robustly, for a
    stop; None where there are none."""
    if not measured.runs:
        return None
    length = LONGER * segments_for(measured).length
    segments = segments_for(measured, length, fine=False)  # at the scene's own step
    numbers = np.flatnonzero(segments.long_enough & ~segments.usable)[which]
    if not len(numbers):
        return None
    estimator = some_of(segments, numbers)
    joint_model, profile = as_it_is(measured), measured.profile

    def loss(solref: Solref) -> float:
        own = joint_model.stopped(solref).simulator(profile, segments.h)
        return estimator.started(own, SETTLING).loss

    return loss


def _changed(solref: tuple[float, ...], z: Array) -> Solref:
    """With factors of the stiffness and of the damping ratio, by their logarithms (MuJoCo's
    documentation, Computation, Parameters: the stiffness is 1 / (time constant x damping ratio)²,
    or a number of its own)."""
    stiffness, ratio = map(float, np.exp(z))
    first, second = solref
    if first > 0:
        return first / (np.sqrt(stiffness) * ratio), second * ratio
    return first * stiffness, second * ratio * float(np.sqrt(stiffness))
