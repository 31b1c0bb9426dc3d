"""What a case of the paper is: an object, what is done to its joint, and a number for it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np

from joda.commands.experiments.subject import Subject
from joda.interaction.traces import shown
from joda.scenes.motion import Motion


class Trial(Protocol):
    """What is done to a joint, and the number that says what came of it.

    Attributes:
        forced: whether something pushes the joint, so that its force is worth drawing.
        ends: normalised positions where its motions should end; empty where that says nothing.
    """

    forced: bool

    @property
    def ends(self) -> Sequence[float]:
        """See above."""
        ...

    def motions(self, subject: Subject) -> list[Motion]:
        """What the joint does."""
        ...

    def reference(self) -> Sequence[Motion]:
        """What it should do, where that is known; else nothing."""
        ...

    def number(self, subject: Subject, motions: Sequence[Motion]) -> float:
        """The number."""
        ...


@dataclass(frozen=True)
class Case:
    """A case.

    Attributes:
        name: of the case.
        model, joint: the bundled model and its joint.
        claim: what the object does and the baselines do not.
        meaning: what the number is.
        unit: of the number; "angle" is degrees of a hinge, mm or m of a slide.
        better: whether a smaller or a larger number is better.
        trial: what is done.
        fit: to what the baselines are fitted: the profile's forces or the trial's motions.
        show: arguments of `joda.simulate` for the picture; a robot's file is of the models.
        describe: given to the proposer.
        remark: what else is to be known.
    """

    name: str
    model: str
    joint: str
    claim: str
    meaning: str
    unit: str
    better: Literal["less", "more"]
    trial: Trial
    fit: Literal["forces", "motions"]
    show: Mapping[str, Any] = field(default_factory=dict)
    describe: str = ""
    remark: str = ""

    def separates(self, ours: Sequence[float], other: Sequence[float]) -> bool:
        """Whether all of our numbers are better than all of the others."""
        return max(ours) < min(other) if self.better == "less" else min(ours) > max(other)


def bundled(name: str) -> Path:
    """A file of the models that come with joda."""
    with as_file(files("joda") / "models") as folder:
        return Path(folder / name)


@dataclass(frozen=True)
class LetGo:
    """Let go at rest at several places: where does it end, and where does it belong?

    Attributes:
        belongs: normalised position where it is let go, to the one where it should come to rest.
        seconds: how long it is watched.
    """

    belongs: Mapping[float, float]
    seconds: float = 8.0
    forced = False

    @property
    def ends(self) -> Sequence[float]:
        """Where it belongs."""
        return list(self.belongs.values())

    def motions(self, subject: Subject) -> list[Motion]:
        """One for each place."""
        return [subject.let_go(s, self.seconds) for s in self.belongs]

    def reference(self) -> Sequence[Motion]:
        """Not known."""
        return ()

    def number(self, subject: Subject, motions: Sequence[Motion]) -> float:
        """The largest distance between an end and where it belongs, in degrees, mm or m."""
        ends = np.array([subject.share(motion)[-1] for motion in motions])
        return subject.shown(float(np.abs(ends - np.array(self.ends)).max()))


@dataclass(frozen=True)
class Press:
    """A virtual hand presses it from the low end to the high end and lets it come back.

    Attributes:
        seconds: in which the hand goes through the range.
    """

    seconds: float
    forced = True
    ends = ()

    def motions(self, subject: Subject) -> list[Motion]:
        """In and out."""
        return [subject.take(0.0, (1.0, 0.0), 0.3, self.seconds)]

    def reference(self) -> Sequence[Motion]:
        """Not known."""
        return ()

    def number(self, subject: Subject, motions: Sequence[Motion]) -> float:
        """Top speed on the way in or on the way out, the smaller one, in speeds of the hand."""
        (motion,) = motions
        s = subject.share(motion)
        velocity = np.where((s > 0.02) & (s < 0.98), motion.velocity, 0.0)  # not at the stops
        fastest = min(velocity.max(), -velocity.min())
        return float(fastest * self.seconds / subject.span)


@dataclass(frozen=True)
class Latch:
    """A robot pushes it shut, slightly and once more; a hand then pulls it open after either.

    Attributes:
        robot: files of targets, of a slight push, and of that and another one.
        start: where the joint begins, rad.
        pulled: how far the hand pulls, of the range.
    """

    robot: tuple[str, str]
    start: float
    pulled: float = 0.15
    forced = True
    ends = ()

    def motions(self, subject: Subject) -> list[Motion]:
        """Of either robot."""
        return [subject.send(str(bundled(name)), self.start) for name in self.robot]

    def reference(self) -> Sequence[Motion]:
        """Not known."""
        return ()

    def number(self, subject: Subject, motions: Sequence[Motion]) -> float:
        """How many times harder it is to pull open after both pushes than after the slight one."""
        slight, both = (self._pull(subject, float(subject.share(m)[-1])) for m in motions)
        return both / slight

    def _pull(self, subject: Subject, s: float) -> float:
        begin = float(np.clip(s, 0, 1))
        return float(subject.take(begin, (begin + self.pulled,)).force.max())


def unit_shown(case: Case, subject: Subject) -> str:
    """The unit of a case's number."""
    return shown(subject.context.joint)[1] if case.unit == "angle" else case.unit
