"""A case tried with one compile seed: the profile that the rules propose, and both baselines."""

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from joda.commands.experiments.base import Case, bundled
from joda.commands.experiments.baselines import Baseline, fit_forces, fit_motions
from joda.commands.experiments.refinement_case import SCENE, Predicted, improved, measure
from joda.commands.experiments.subject import Subject
from joda.files import write_text
from joda.profile import Profile
from joda.propose.generation import ROUNDS, run
from joda.propose.offline import Offline
from joda.propose.session import NONE, Session
from joda.scenes.attaching import attach
from joda.scenes.context import Context
from joda.scenes.model import load_model
from joda.scenes.motion import Motion

WAYS = ("joda", "constant", "spring")


@dataclass(frozen=True)
class Tried:
    """What came of a case with one seed.

    Attributes:
        context: the joint.
        profile: that was proposed in the end.
        baselines: fitted to it, by name.
        subjects, motions, numbers: by name: "joda", "constant", "spring", and "usual", which is
            constant with MuJoCo's usual solver parameters for friction.
        first: the number of the first proposal.
        rounds: how many proposals there were.
        scene: name of the scene with the profile, in the folder.
    """

    context: Context
    profile: Profile
    baselines: Mapping[str, Baseline]
    subjects: Mapping[str, Subject]
    motions: Mapping[str, list[Motion]]
    numbers: Mapping[str, float]
    first: float
    rounds: int
    scene: str


def try_case(case: Case, key: str, folder: Path) -> Tried:
    """Proposes by rules, compiles with the key, fits the baselines, and measures all three.

    Args:
        case: the case.
        key: the compile seed.
        folder: gets what `joda generate` leaves, but for the joint's pictures.

    Raises:
        JodaError: the folder cannot be written.
    """
    model = bundled(case.model)
    session = Session.start(folder, model, case.joint, case.describe, key=key, pictures=NONE)
    run(session, Offline(key), ROUNDS)
    found, trial = session.context, case.trial
    proposed = [turn.profile for turn in session.turns]
    profile, scene, known = proposed[-1], "scene.xml", None
    if isinstance(trial, Predicted):
        known, runs = measure(trial, int(key), folder)
        profile, scene = improved(case, runs, folder), SCENE
        proposed.append(profile)
    subjects = {"joda": Subject(found, load_model(folder / scene))}
    motions = {"joda": trial.motions(subjects["joda"])}
    known = known or motions["joda"]
    baselines = {}
    for name, spring in (("constant", False), ("spring", True)):
        baselines[name] = (
            fit_forces(profile, found, spring)
            if case.fit == "forces"
            else fit_motions(profile, model, found, known, trial.ends, spring)
        )
        subjects[name] = baselines[name].subject(model, found)
        motions[name] = trial.motions(subjects[name])
    subjects["usual"] = baselines["constant"].subject(model, found, usual=True)
    motions["usual"] = trial.motions(subjects["usual"])
    numbers = {name: trial.number(subjects[name], motions[name]) for name in subjects}
    first = numbers["joda"]
    if len(proposed) > 1:
        first = _measured(case, model, found, proposed[0])
    return Tried(
        context=found,
        profile=profile,
        baselines=baselines,
        subjects=subjects,
        motions=motions,
        numbers=numbers,
        first=first,
        rounds=len(session.turns),
        scene=scene,
    )


def write_baselines(case: Case, tried: Tried, folder: Path) -> None:
    """The bare model with each baseline, as constant.xml and spring.xml; raises JodaError."""
    for name, baseline in tried.baselines.items():
        spec = baseline.written(bundled(case.model), case.joint)
        write_text(folder / f"{name}.xml", str(spec.to_xml()))


def _measured(case: Case, model: Path, found: Context, profile: Profile) -> float:
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder, "scene.xml")
        attach(model, profile, scene)
        subject = Subject(found, load_model(scene))
    return case.trial.number(subject, case.trial.motions(subject))
