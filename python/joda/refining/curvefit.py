"""Fits the numbers of a joint's profile to quasi-static curves: the force that slowly moves it.

Nothing is simulated: Levenberg-Marquardt on the model's force, with the prior of
`joda.refining.fitting`.
"""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from joda.estimation.least_squares import Fit, levenberg_marquardt
from joda.estimation.profile_parameters import Parameters
from joda.measured.quasi_static import beside_model, static_force
from joda.measured.runs import QuasiStatic
from joda.profile import Profile
from joda.scenes.context import Context

Array = NDArray[np.float64]

NUDGE = 0.002
"""Step of a number for differences; ends of intervals move over several samples."""
LESS = 0.98
"""Part of the misfit that may be left for a fit to go on, believing less of it."""
BELIEVED = 0.3
"""Share of the misfit before it is fitted that may be the model's, and counts as noise."""


class CurveProblem:
    """A joint, its parameters and its measured curves.

    Every stretch of the way counts as much as any other, however long the joint was there.

    Attributes:
        parameters: what may change.
        sigma: noise of the measured force, N·m or N.
        runs: measured positions (rad or m) and forces (N·m or N), where the direction of travel is
            known.
        axes: what these are.
        notes: what the curves cannot tell, a sentence each.
    """

    def __init__(
        self,
        found: Context,
        whole: Callable[[Profile], Profile],
        parameters: Parameters,
        curves: Sequence[QuasiStatic],
    ) -> None:
        """Args: the joint; what makes all that acts on it of its profile; what may change; curves
        that were measured."""
        self._found, self._all_of = found, whole
        self.parameters = parameters
        joint = found.joint
        force = "force (N·m)" if joint.type == "hinge" else "force (N)"
        self.axes = f"position ({joint.unit})", force
        beside = [beside_model(curve, self._whole(parameters.start), found) for curve in curves]
        self.notes = tuple(note for _, notes in beside for note in notes)
        known = [(one, one.direction != 0) for one, _ in beside]
        self.sigma = float(np.sqrt(np.mean([one.sigma**2 for one, _ in known])))
        self.runs = [(one.curve.position[k], one.curve.force[k]) for one, k in known]
        self._directions = [one.direction[k] for one, k in known]
        self._weight = np.sqrt(np.concatenate([_share(one.curve.position)[k] for one, k in known]))
        self._weight /= np.sqrt(np.mean(self._weight**2))

    def _whole(self, theta: Array) -> Profile:
        return self._all_of(self.parameters.written(theta, exact=True))

    def paths(self, theta: Array) -> list[Array]:
        """The model's forces at the positions of `runs`, N·m or N."""
        whole = self._whole(theta)
        pairs = zip(self.runs, self._directions, strict=True)
        return [static_force(whole, self._found, at, way) for (at, _), way in pairs]

    def _misfit(self, theta: Array) -> Array:
        """Model minus measured, weighted by the way between samples; of mean square weight 1."""
        measured = np.concatenate([force for _, force in self.runs])
        return np.asarray((np.concatenate(self.paths(theta)) - measured) * self._weight)

    def rms(self, theta: Array) -> float:
        """RMS misfit over the way, N·m or N."""
        return float(np.sqrt(np.mean(self._misfit(theta) ** 2)))

    def fit(
        self,
        iterations: int,
        report: Callable[[str, int, float], None] = lambda stage, number, rms: None,
    ) -> Fit:
        """Fits all curves together.

        Args:
            iterations: at most so many.
            report: after each, "curves", its number and the RMS misfit.
        """
        best = self.parameters.start
        history: list[tuple[str, float]] = []
        interrupted = False

        def heard(_: int, theta: Array, __: float) -> None:
            nonlocal best
            best = theta
            history.append(("curves", self.rms(theta)))
            report("curves", len(history), history[-1][1])

        try:
            while len(history) < iterations:
                missed = self.rms(best)
                sigma = max(self.sigma, BELIEVED * missed)
                levenberg_marquardt(
                    partial(self._residuals, sigma=sigma),
                    partial(self._slopes, sigma=sigma),
                    best,
                    self.parameters.constraints,
                    iterations - len(history),
                    heard,
                )
                if self.rms(best) > LESS * missed:
                    break
        except KeyboardInterrupt:
            interrupted = True
        J = self._slopes(best, max(self.sigma, self.rms(best)))
        return Fit(best, np.asarray(np.linalg.inv(J.T @ J)), tuple(history), interrupted)

    def _residuals(self, theta: Array, sigma: float) -> Array:
        """Of samples and of the prior."""
        prior = (theta - self.parameters.start) / self.parameters.prior_std
        return np.concatenate([self._misfit(theta) / sigma, prior])

    def _slopes(self, theta: Array, sigma: float) -> Array:
        """Their derivatives, by central differences."""
        steps = NUDGE * np.eye(len(theta))
        pairs = ((self._misfit(theta + d), self._misfit(theta - d)) for d in steps)
        by_number = np.stack([(up - down) / (2 * NUDGE * sigma) for up, down in pairs], axis=1)
        return np.vstack([by_number, np.diag(1 / self.parameters.prior_std)])


def _share(position: Array) -> Array:
    """How much way each sample stands for: half the distance between its neighbours."""
    return np.asarray(np.gradient(np.concatenate([[0.0], np.abs(np.diff(position)).cumsum()])))
