"""Whether a measured force has the sign of what was applied, from the balance of forces."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from joda.measured import smoothing
from joda.measured.runs import QuasiStatic, Run
from joda.scenes.context import Context

Array = NDArray[np.float64]

HATS = 24
"""Most functions of which a force that depends on position is made up."""


THROWN, SOON = 1e6, 0.01
"""Ranges that a joint at rest would fly between two samples under a force that can't be meant; the
time between samples where there is none, s."""


@dataclass(frozen=True)
class Balance:
    """Forces, or their impulses, as rows of a least-squares problem.

    Attributes:
        applied: measured, shape (n,).
        opposing: what an applied force does with positive coefficients (it accelerates against
            inertia and gravity, and overcomes friction and damping), shape (n, 3 or 1).
        free: what a force that depends on position can be, either sign; shape (n, m).
    """

    applied: Array
    opposing: Array
    free: Array


def balance_of_run(run: Run, position: Array, sigma: float, context: Context) -> Balance | None:
    """Impulses between times at which the velocity is estimated; None without a force, or where
    an actuator acts too."""
    time, known = run.time, ~np.isnan(run.force)
    alone = run.forced and run.command is None
    if not alone or not np.any(run.force[known]) or _one_way(position):
        return None
    spacing = max(0.05, 5 * np.median(np.diff(time)), (time[-1] - time[0]) / 200)
    edge = np.unique(np.searchsorted(time[:-1], np.arange(time[0], time[-1], spacing)))
    smooth = smoothing.smooth(time, position, time[edge], sigma)
    velocity = smooth.velocity
    slow = 3 * np.median(smooth.velocity_error) + 0.01 * np.abs(velocity).max()
    middle, steps = (position[1:] + position[:-1]) / 2, np.diff(time)

    def impulses(values: Array) -> Array:
        """Integrals between the edges; shape (edges - 1, ...)."""
        halves = (values[1:] + values[:-1]) / 2 if len(values) == len(time) else values
        total = np.cumsum((halves.T * steps).T, axis=0)
        return np.asarray(np.diff(np.insert(total, 0, 0, axis=0)[edge], axis=0))

    gravity = np.interp(position, context.positions, context.gravity_force)
    friction = np.tanh(np.interp(time, time[edge], velocity) / max(slow, 1e-12))
    momentum = context.equivalent_inertia * np.diff(velocity)
    opposing = [momentum - impulses(gravity), impulses(friction), np.diff(smooth.position)]
    use = impulses((~known).astype(float)) == 0
    return Balance(
        impulses(np.nan_to_num(run.force))[use],
        np.stack(opposing, axis=1)[use],
        np.stack([impulses(hat)[use] for hat in _hats(middle, len(edge) // 4)], axis=1),
    )


def _one_way(position: Array) -> bool:
    """Whether the joint hardly travelled back; any force may then depend on the position."""
    some = position[:: max(len(position) // 200, 1)]
    back = np.clip(np.diff(some), 0, None).sum(), np.clip(-np.diff(some), 0, None).sum()
    return bool(min(back) < 0.5 * np.ptp(position))


def too_large(run: Run | QuasiStatic, context: Context) -> str:
    """Speaks where the largest force can't be one: within a sample it throws the joint away."""
    largest = float(np.nanmax(np.abs(run.force), initial=0.0))
    lo, hi = context.joint.range
    interval = float(np.median(np.diff(run.time))) if isinstance(run, Run) else SOON
    if largest / context.equivalent_inertia * interval**2 < THROWN * (hi - lo):
        return ""
    unit = context.joint.force_unit
    return (
        f"the force is up to {largest:.3g} {unit}, which would throw a joint with an inertia of "
        f"{context.equivalent_inertia:.3g} {'kg·m²' if unit == 'N·m' else 'kg'} away at once; "
        f"correct it, in {unit}"
    )


def balance_of_curve(run: QuasiStatic, position: Array) -> Balance | None:
    """Friction opposes the direction of travel; all else depends on the position."""
    if _one_way(position):
        return None
    m = max(len(position) // 50, 1)
    k = np.arange(len(position))
    ahead, behind = np.minimum(k + m, k[-1]), np.maximum(k - m, 0)
    travel = np.sign(position[ahead] - position[behind])[:, None]
    return Balance(run.force, travel, np.stack([*_hats(position, len(position) // 4)], axis=1))


def _hats(position: Array, most: int) -> Iterator[Array]:
    """Piecewise linear functions that add up to one over what was visited; shape (n,) each."""
    count = max(min(HATS, most), 2)
    nodes, apart = np.linspace(position.min(), position.max(), count, retstep=True)
    for node in nodes:
        yield np.maximum(1 - np.abs(position - node) / apart, 0.0)


def wrong_sign(balance: Balance | None) -> str:
    """Speaks where the force explains the motion much better with its sign turned."""
    if balance is None or len(balance.applied) < balance.free.shape[1] + 15:
        return ""
    base, kept = np.linalg.qr(balance.free)
    base = base[:, np.abs(np.diag(kept)) > 1e-9 * np.abs(kept).max()]
    applied = balance.applied - base @ (base.T @ balance.applied)
    opposing = balance.opposing - base @ (base.T @ balance.opposing)
    right, wrong = _unexplained(applied, opposing), _unexplained(-applied, opposing)
    alone, spare = float(balance.applied @ balance.applied), len(applied) - balance.free.shape[1]
    if right <= 1e-4 * alone or right < max(1.5, 1 + 25 / spare) * wrong:
        return ""
    return (
        "the force looks like the reaction to what was applied to the joint: inertia, "
        f"friction and damping explain {100 * (1 - wrong / right):.0f} % of what position does not "
        "explain, but only if its sign is turned; turn it, or that of the position"
    )


def _unexplained(applied: Array, opposing: Array) -> float:
    """Least sum of squares that nonnegative coefficients leave: the best of all their subsets."""
    least = float(applied @ applied)
    for chosen in product((False, True), repeat=opposing.shape[1]):
        columns = opposing[:, np.array(chosen)]
        factors = np.linalg.lstsq(columns, applied, rcond=None)[0]
        if np.all(factors >= 0):
            least = min(least, float(((applied - columns @ factors) ** 2).sum()))
    return least
