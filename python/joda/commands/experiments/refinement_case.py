"""The paper's refinement case: a profile is mended by measured releases of the real object.

There is no real object here: a planted profile, which the fits do not know, stands for it, measured
with an encoder's noise. How well each predicts releases from other places is the number.
"""

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from joda.commands.experiments.base import Case, bundled
from joda.commands.experiments.subject import Subject
from joda.commands.improve import improve
from joda.component import Component
from joda.errors import JodaError
from joda.measured.run_files import write_run
from joda.measured.runs import Run
from joda.profile import Channel, Channels, Profile, Resistance
from joda.scenes.attaching import attach
from joda.scenes.context import Context, context
from joda.scenes.model import load_model
from joda.scenes.motion import Motion

NOISE = 5e-4
"""Of a measured position, as a share of the range."""
RATE = 0.004
"""Time between measured samples, s."""
SCENE = "improved.xml"


def gravity_cabinet(found: Context) -> Profile:
    """A flap with a catch, a damper, and hinges that carry part of its weight when it is open."""
    catch = Component(
        label="catch",
        interval=(0, 0.12),
        x=(0, 0.08, 0.2, 0.4, 0.7, 1),
        y=(-3.0, -2.16, -1.14, -0.42, -0.12, 0.0),
    )
    support = Component(label="support", interval=(0.6, 1), x=(0, 0.3, 1), y=(0.0, -2.5, -2.5))
    friction, damping = (
        Component(label=label, interval=(0, 1), x=(0, 1), y=(value, value))
        for label, value in (("friction", 0.4), ("damping", 1.2))
    )
    return Profile(
        joint=found.joint,
        channels=Channels(
            conservative=Channel(components=(catch, support)),
            friction=Resistance(components=(friction,)),
            damping=Resistance(components=(damping,)),
        ),
    )


@dataclass(frozen=True)
class Predicted:
    """Let go where it was not measured: how far is it from what the object does?

    Attributes:
        model, joint: the bundled model and its joint.
        truth: the object's own profile.
        measured: normalised positions of the releases that are fitted.
        places: of those that are predicted.
        by_hand: normalised positions: a hand takes it from one to the others, its force measured.
        watched: how long each of the first is recorded, s; the object is in motion for so long.
        seconds: how long each of the others is compared, s.
    """

    model: str
    joint: str
    truth: Callable[[Context], Profile]
    measured: tuple[float, ...]
    places: tuple[float, ...]
    by_hand: tuple[float, tuple[float, ...]] = (0.15, (0.95, 0.15))
    watched: float = 0.6
    seconds: float = 2.0
    forced = False
    ends = ()

    def motions(self, subject: Subject) -> list[Motion]:
        """One for each place."""
        return [subject.let_go(s, self.seconds) for s in self.places]

    def number(self, subject: Subject, motions: Sequence[Motion]) -> float:
        """Root mean square of the difference in position, in degrees, mm or m."""
        pairs = zip(motions, self.reference(), strict=True)
        apart = np.concatenate([subject.share(one) - subject.share(other) for one, other in pairs])
        return subject.shown(float(np.sqrt(np.mean(apart**2))))

    def reference(self) -> list[Motion]:
        """What the object does from the same places."""
        return self.motions(_object(self))


def measure(trial: Predicted, seed: int, folder: Path) -> tuple[list[Motion], list[Path]]:
    """Releases of the object as an encoder records them, and the files of these and of a hand.

    Args:
        trial: says where it is let go.
        seed: of the noise.
        folder: for the files.
    """
    subject, random = _object(trial), np.random.default_rng(seed)
    motions, paths = [], []
    for s in trial.measured:
        motion = subject.let_go(s, trial.watched, RATE)
        noise = random.normal(0, NOISE * subject.span, len(motion.time))
        path = folder / f"release_{s:g}.csv"
        position = motion.position + noise
        write_run(path, Run(path.name, motion.time, position, None, motion.force, forced=False))
        motions.append(Motion(motion.time, position, motion.velocity, motion.force))
        paths.append(path)
    hand = subject.take(*trial.by_hand)
    every = slice(None, None, max(round(RATE / subject.model.opt.timestep), 1))
    time, force = hand.time[every], hand.force[every]
    position = hand.position[every] + random.normal(0, NOISE * subject.span, len(time))
    paths.append(folder / "by_hand.csv")
    write_run(paths[-1], Run(paths[-1].name, time, position, None, force, forced=True))
    return motions, paths


def improved(case: Case, runs: Sequence[Path], folder: Path) -> Profile:
    """The profile of scene.xml improved by runs; leaves improved.xml. Raises JodaError."""
    made = improve(folder / "scene.xml", case.joint, runs, folder / SCENE, force=True)
    if made.composed is None:
        raise JodaError(f"{folder / 'scene.xml'}: {made.why}")
    return Profile.read(made.composed)


@cache
def _object(trial: Predicted) -> Subject:
    """The planted object."""
    path = bundled(trial.model)
    found = context(path, trial.joint)
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder, "scene.xml")
        attach(path, trial.truth(found), scene)
        return Subject(found, load_model(scene))
