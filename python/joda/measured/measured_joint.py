"""A joint of a model with what was measured of it."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from joda.joints.joint_model import JointModel, weighing
from joda.measured.quasi_static import QuasiStaticComparison
from joda.measured.replay import Replayer
from joda.measured.runs import Run
from joda.measured.sensing import Sensing
from joda.measured.trust import USUAL, Trust
from joda.profile import Profile
from joda.scenes.contacts import Contact
from joda.scenes.context import Context
from joda.scenes.limits import Stops
from joda.scenes.native import Row
from joda.template import Template, read_templates

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Measured:
    """A joint of a model with measured runs and quasi-static curves.

    Attributes:
        context: of the joint.
        profile: all that acts on it (`joda.scenes.native`).
        joint_model: all of the joint but its profile, as it is replayed.
        own_row: of friction that is MuJoCo's own in the scene, whichever is replayed; None if none
            is.
        timestep: of the model, s.
        replayer: of that profile.
        runs: measured.
        sigma: noise of each run's position, rad or m.
        curves: measured, each beside the model's.
        notes: what is suspicious about them.
        contacts: of the scene that resist the joint where it was measured.
        whole: whether all that acts on the joint there is replayed, and all of the runs.
        barred: the note on where the scene would not have let the joint; empty if there is none.
        trust: how far off its numbers, and those of the measurement, may be.
        templates: of effects that may be missing, by name.
        loose: numbers that have been set right, and the standard errors that are left of them.
        cut: the runs in segments, as they were cut so far (`joda.estimation.problem`).
    """

    context: Context
    profile: Profile
    joint_model: JointModel
    own_row: Row | None
    timestep: float
    replayer: Replayer
    runs: tuple[Run, ...]
    sigma: tuple[float, ...]
    curves: tuple[QuasiStaticComparison, ...]
    notes: tuple[str, ...]
    contacts: tuple[Contact, ...]
    whole: bool
    barred: str
    trust: Trust = USUAL
    templates: Mapping[str, Template] = field(default_factory=read_templates)
    loose: Mapping[str, float] = field(default_factory=dict)
    cut: dict[Hashable, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    def trusting(self, trust: Trust) -> "Measured":
        """The same joint and runs, whose numbers may be so far off."""
        return replace(self, trust=trust)

    def sensed(self, sensing: Sensing) -> "Measured":
        """The same joint with runs as they would be if what is wrong with them were right."""
        return replace(self, runs=tuple(map(sensing.of, self.runs)))

    def stopped(self, stops: Stops) -> "Measured":
        """The same joint with other ends of its range."""
        own = self.joint_model.stopped(stops)
        replayer = Replayer(self.context, self.profile, own, self.timestep)
        return replace(self, joint_model=own, replayer=replayer)

    def changed(
        self,
        profile: Profile | None = None,
        runs: Sequence[int] | None = None,
        joint_model: JointModel | None = None,
    ) -> "Measured":
        """The same joint with another profile, another body, or with some of its runs only."""
        numbers = range(len(self.runs)) if runs is None else runs
        new = self.profile if profile is None else profile
        own = joint_model or (self.joint_model if profile is None else self.joint_model.with_plugin)
        found = self.context if joint_model is None else weighing(self.context, joint_model)
        return replace(
            self,
            context=found,
            profile=new,
            joint_model=own,
            replayer=self.replayer
            if profile is None and joint_model is None
            else Replayer(found, new, own, self.timestep),
            runs=tuple(self.runs[k] for k in numbers),
            sigma=tuple(self.sigma[k] for k in numbers),
            curves=self.curves
            if profile is None
            else tuple(curve.against(new, found) for curve in self.curves),
        )

    @property
    def floor(self) -> float:
        """Noise of the runs' positions, rad or m; of the curves' forces where there are no runs."""
        noises = self.sigma or tuple(curve.sigma for curve in self.curves)
        return float(np.sqrt(np.mean(np.square(noises))))

    @property
    def pushed(self) -> bool:
        """Whether anything that is known pushed the joint, see `Run`; a gauge did for curves."""
        return not self.runs or any(run.pushed for run in self.runs)

    @property
    def unit(self) -> str:
        """Of what a model misses: position, or force where there are only curves."""
        joint = self.profile.joint
        return joint.unit if self.runs else joint.force_unit

    @property
    def unit_factor(self) -> float:
        """How many times the model's largest force that of a curve is, where that is so much or so
        little that its unit is in question; else 0, and where there are runs, beside which curves
        are not used."""
        factors = [] if self.runs else [curve.unusual_factor for curve in self.curves]
        return next(filter(None, factors), 0.0)

    def load(self, run: Run) -> Array:
        """What loads the joint at a run's samples, N·m or N, shape (n,): gravity and what is
        applied, and with an actuator how far its force is beyond these: what its gear transmits."""
        gravity = np.interp(run.position, self.context.positions, self.context.gravity_force)
        return self.exerted(run) - run.force - gravity if self._driven(run) else run.force + gravity

    def exerted(self, run: Run) -> Array:
        """By the actuators on the joint, N·m or N, shape (n,)."""
        servo = self.joint_model.servo
        if servo is None or run.command is None:
            return np.zeros(len(run.time))
        at = run.time - servo.delay
        command = run.command[np.maximum(np.searchsorted(run.time, at, side="right") - 1, 0)]
        velocity = np.gradient(run.position, run.time)
        return servo.force(command, run.position, velocity)

    def _driven(self, run: Run) -> bool:
        return self.joint_model.servo is not None and run.command is not None

    def paths(self) -> list[Array]:
        """Predicted positions of all runs, rad or m; NaN from where the force is not known."""
        replayer, pairs = self.replayer, zip(self.runs, self.sigma, strict=True)
        return [replayer.whole(run, replayer.start(run, sigma)) for run, sigma in pairs]

    def with_runs(self, parts: Sequence[Run], of: Sequence[int]) -> "Measured":
        """The same joint with parts of its runs, and of each the number of its run."""
        return replace(self, runs=tuple(parts), sigma=tuple(self.sigma[k] for k in of))

    def with_curves(self, curves: Sequence[QuasiStaticComparison]) -> "Measured":
        """The same joint with some of its curves, or with parts of them."""
        return replace(self, curves=tuple(curves))
