"""A measured joint as it is estimated: its runs in segments, and what simulates it."""

from dataclasses import replace
from functools import partial

import numpy as np

from joda.estimation.base_model import BaseModel, base_of
from joda.estimation.estimator import SegmentEstimator
from joda.estimation.quasi_static import QuasiStaticJoint, curve_segments
from joda.estimation.segmentation import OUTSIDE_NOISES, segments_of
from joda.estimation.segments import Segments
from joda.joints.divergence import linearized
from joda.joints.joint_model import JointModel
from joda.measured.measured_joint import Measured
from joda.scenes.limits import stiffness_of
from joda.scenes.native import Row

SOFT = (0.02, 1.0)
"""MuJoCo's own `solreflimit`: time constant (s) and damping ratio of the ends of a range."""
STRAYS = 3
"""At most so many samples are beyond the range by chance."""


def segments_for(
    measured: Measured,
    length: float | None = None,
    fine: bool = True,
    *,
    cut_at_ends: bool = True,
) -> Segments:
    """Runs in segments of some length (s), see `segments_of`; curves where there are no runs. They
    are cut once for each joint and its runs."""
    key = length, fine, cut_at_ends
    if key not in measured.cut:
        measured.cut[key] = _segments_for(measured, *key)
    found: Segments = measured.cut[key]
    return found


def _segments_for(
    measured: Measured, length: float | None, fine: bool, cut_at_ends: bool
) -> Segments:
    if not measured.runs:
        return curve_segments(measured.curves, measured.context, measured.timestep)
    lo, hi = measured.profile.joint.range
    fixed = lo, measured.joint_model.inertia, measured.timestep
    ends = float(np.sqrt(stiffness_of(measured.joint_model.solref, measured.timestep)))
    nearby = partial(linearized, measured.profile, measured.joint_model)
    runs = measured.runs, measured.sigma, hi - lo
    return segments_of(*runs, *fixed, length, fine, nearby, ends, cut_at_ends=cut_at_ends)


def posed(
    measured: Measured, segments: Segments, accurate: bool = True, row: Row | None = None
) -> tuple[SegmentEstimator, BaseModel]:
    """What estimates by segments of a measured joint, and the model as it is, whose strengths are
    the numbers.

    Args:
        measured: the joint.
        segments: of its runs, see `segments_for`.
        accurate: whether steps stand for none; else they are MuJoCo's.
        row: of friction that yields as MuJoCo's own does; None: it holds.
    """
    joint_model = replace(joint_model_for(measured, segments.h), friction_row=row)
    base = base_of(measured.profile, joint_model, segments.h, measured.trust, accurate)
    return SegmentEstimator(segments, segments.usable), base


def joint_model_for(measured: Measured, h: float) -> JointModel:
    """The joint, to be simulated in steps of h (s) where there are runs.

    MuJoCo's own ends of a range yield by more than an encoder's noise to what presses on them. They
    are hard here, unless somebody chose others or the measured ones yield too.
    """
    joint_model = as_it_is(measured)
    if joint_model.solref != SOFT or not measured.runs or _yields(measured):
        return joint_model
    return replace(joint_model, solref=(2 * h, 1.0))


def as_it_is(measured: Measured) -> JointModel:
    """The joint as its scene has it, with the plugin; where there are only curves it is not
    simulated."""
    joint_model = measured.joint_model.with_plugin
    return joint_model if measured.runs else QuasiStaticJoint(**vars(joint_model))


def _yields(measured: Measured) -> bool:
    """Whether the joint was beyond its range by more than noise."""
    beyond = (
        np.abs(run.position - np.clip(run.position, *measured.profile.joint.range)) / sigma
        for run, sigma in zip(measured.runs, measured.sigma, strict=True)
    )
    return sum(int(np.sum(noises > OUTSIDE_NOISES)) for noises in beyond) > STRAYS
