"""The second demo: a joint hides an effect; it is found, added, and the seal is opened."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from joda.commands.add import add
from joda.commands.add import sentences as of_added
from joda.commands.compare import compare
from joda.commands.diagnose import diagnose
from joda.commands.diagnose import sentences as of_diagnosis
from joda.diagnosis.findings import Diagnosis, Finding
from joda.diagnosis.learning.law import LABEL
from joda.diagnosis.learning.report import sentences as law_sentences
from joda.diagnosis.overlap import overlap
from joda.diagnosis.phrases import named, percent
from joda.errors import JodaError
from joda.files import fresh, make_folder, occupied
from joda.hidden import EFFECTS, draw, write
from joda.hidden.cases import PUSHED, VISIBLE
from joda.measured.comparison import Comparison
from joda.measured.comparison import sentences as of_comparison

ALIENS = ("square_root_damping", "cogging", "maxwell_relaxation", "warming_up")
"""Laws of no catalogue that are drawn, each of another kind: over speed, position, and what was."""
HALF = 0.5
"""Part of the error on unseen windows that a learned law may leave."""
PLACED = 0.5
"""Least overlap (intersection over union) of the place said and the true one."""


@dataclass(frozen=True)
class HiddenEffect:
    """What the demo did.

    Attributes:
        folder: with the model, the measured runs, the seal, and what each step wrote.
        seed: draws the same again.
        truth: what was hidden: effect, interval, direction, magnitude, unit, ...
        diagnosis: what was said.
        before, after: the model on runs that no step has seen, as it was and with the effect; None
            where no effect was named.
        right: whether name, place, size and the error on unseen runs all agree.
        judgement: on what was said, a sentence.
    """

    folder: Path
    seed: int
    truth: dict[str, Any]
    diagnosis: Diagnosis
    before: Comparison
    after: Comparison | None
    right: bool
    judgement: str


def hidden_effect(
    output: str | Path | None = None,
    *,
    seed: int | None = None,
    position_only: bool = False,
    alien: bool = False,
    reveal: bool = False,
    force: bool = False,
    say: Callable[[str], None] = lambda sentence: None,
) -> HiddenEffect:
    """Draws a joint whose model lacks an effect, and finds it from measured runs.

    A simulator of its own (`joda.hidden`) makes the runs. Takes about a minute.

    Args:
        output: folder for everything that is made; created if missing. By default
            joda_hidden_effect, or the first of joda_hidden_effect_2, ... that does not exist.
        seed: of the joint, its effect and the runs; by default another one each time.
        position_only: the force is not recorded: the joint is let go or flicked.
        alien: the law is of no catalogue, and is learned from the runs.
        reveal: say at the beginning what is hidden.
        force: overwrite what an earlier demo left there.
        say: told what is done and what was found, sentence by sentence.

    Returns:
        the truth beside what was said.

    Raises:
        JodaError: the folder cannot be written, or holds files already.
    """
    if alien and position_only:
        raise JodaError("--alien needs the force; leave --position-only out.")
    folder = Path(output) if output is not None else fresh("joda_hidden_effect")
    if occupied(folder) and not force:
        raise JodaError(f"{folder}: exists already; choose another folder with -o or add --force.")
    make_folder(folder)
    if seed is None:
        seed = int(np.random.default_rng().integers(1_000_000))
    known = [name for name in EFFECTS if not (position_only and name in PUSHED)]
    names = ALIENS if alien else known
    effect = str(np.random.default_rng(seed).choice(names))
    say(f"Seed {seed}: simulating a joint that has one effect more than its model.")
    case = draw(seed, effect, forced=not position_only)
    write(case, folder)
    model, joint = folder / "model.xml", case.joint
    runs, unseen = ([folder / r.name for r in some] for some in (case.train, case.held_out))
    say(
        f"{model}: the model, a {case.truth.joint.kind}. {len(runs)} runs to learn from, "
        f"{len(unseen)} to judge by, {'positions only' if position_only else 'with the force'}."
    )
    truth = f"{_called(case.seal)}, {_where(case.seal)}, {_size(case.seal)}"
    say(f"Hidden is {truth}." if reveal else "What is hidden is sealed in sealed.json.")

    say("")
    say(f"1. Is the model good? (compare, {folder / 'compare.html'})")
    found = compare(model, joint, runs, report=folder / "compare.html", force=True)
    say(of_comparison(found)[0])
    say("")
    say(f"2. What does it lack? (diagnose, {folder / 'diagnosis.html'})")
    written = folder / "diagnosis.json"
    diagnosis = diagnose(
        model, joint, runs, json=written, report=folder / "diagnosis.html", force=True
    )
    for sentence in of_diagnosis(diagnosis):
        say(sentence)
    before, after = compare(model, joint, unseen), None
    if diagnosis.effects or alien:
        say("")
        what = "Learn the law from the runs" if alien else "Add it"
        say(f"3. {what}. (add, {folder / 'new.xml'}, {folder / 'new.png'})")
        chosen = LABEL if alien else None
        added = add(model, joint, written, runs, folder / "new.xml", effect=chosen, force=True)
        law = law_sentences(added.learned) if added.learned else []
        for sentence in (of_added(added)[0], *law, *added.departures):
            say(sentence)
        if added.scene:
            say("")
            say(f"4. Runs that no step has seen. (compare, {folder / 'unseen.html'})")
            page = folder / "unseen.html"
            after = compare(added.scene, joint, unseen, report=page, force=True)
            say(_unseen(before, after))
    say("")
    say("The seal is opened:")
    judge = _judged_law if alien else _judged
    judgement, right = judge(diagnosis, case.seal, before, after)
    say(f"  hidden: {truth}")
    for one in () if alien else diagnosis.effects[:1]:
        error = f" \u00b1 {one.magnitude_error:.2g}"
        say(f"  said:   {one.name}, {_where(vars(one))}, {_size(vars(one), error)}")
    say(judgement)
    if case.visible < VISIBLE:
        say(f"It moves the joint by only {case.visible:.1f} times the measurement's noise.")
    return HiddenEffect(
        folder=folder,
        seed=seed,
        truth=case.seal,
        diagnosis=diagnosis,
        before=before,
        after=after,
        right=right,
        judgement=judgement,
    )


def _called(seal: dict[str, Any]) -> str:
    """The effect in words, also one that no catalogue has."""
    name = seal["effect"]
    return named(name) if seal["in_catalogue"] else name.replace("_", " ")


def _where(told: dict[str, Any]) -> str:
    a, b = told["interval"]
    return f"s = {a:.2f} to {b:.2f}"


def _size(told: dict[str, Any], error: str = "") -> str:
    of = "" if told["unit"] == "1" else f" {told['unit']}"
    return f"{told['magnitude']:.3g}{error}{of}"


def _unseen(before: Comparison, after: Comparison) -> str:
    """The errors on runs that no step has seen."""
    unit = after.unit
    errors = [
        f"{what} {old:.3g} → {new:.3g} {unit}"
        for what, old, new in (
            ("free-run error", before.rmse, after.rmse),
            ("segment error (0.4 s)", before.rmse_window, after.rmse_window),
        )
        if old is not None and new is not None
    ]
    return f"On unseen runs: {', '.join(errors)}; the noise is {after.noise_floor:.2g} {unit}."


def _judged(
    diagnosis: Diagnosis, seal: dict[str, Any], before: Comparison, after: Comparison | None
) -> tuple[str, bool]:
    """What was said against what is true, a sentence; and whether all of it is right."""
    effect = seal["effect"]
    said = [one.effect for one in diagnosis.effects]
    if not said:
        return f"Missed: no effect was named (verdict: {diagnosis.verdict}).", False
    if said[0] == effect:
        wrong = _off(diagnosis.effects[0], seal, before, after)
        if not wrong:
            return "Right.", True
        return f"The name is right, but not all else: {'; '.join(wrong)}.", False
    if effect in diagnosis.effects[0].indistinguishable_from:
        return "Not the first one named, but one of those that these data cannot tell apart.", False
    if effect in said:
        one = diagnosis.effects[said.index(effect)]
        share = percent(one.probability)
        return f"Wrong: the hidden effect was named too, with {share}.", False
    return "Wrong: the hidden effect was not among those named.", False


def _judged_law(
    diagnosis: Diagnosis, seal: dict[str, Any], before: Comparison, after: Comparison | None
) -> tuple[str, bool]:
    """The same of a law that has no name: a sentence, and whether it was told to be unknown and
    unseen runs are missed by much less with what was learned."""
    known = diagnosis.verdict != "unexplained"
    said = ""
    if known and diagnosis.effects:
        said = f"It has no name, and was taken for {diagnosis.effects[0].name}. "
    if after is None or not before.rmse_window or not after.rmse_window:
        return f"{said}Missed: nothing was learned.", False
    part = after.rmse_window / before.rmse_window
    learned = part < HALF
    told = f"{said}What was learned leaves {100 * part:.2g} % of the error on unseen runs."
    return told, learned and not known


def _off(
    one: Finding, seal: dict[str, Any], before: Comparison, after: Comparison | None
) -> list[str]:
    """What is wrong of an effect with the right name, a clause each."""
    out = []
    if one.direction != seal["direction"]:
        out.append(f"the direction is {seal['direction']}, not {one.direction}")
    if (shared := overlap(one.interval, seal["interval"])) < PLACED:
        out.append(f"the intervals overlap by {100 * shared:.0f} % only")
    off = abs(one.magnitude - seal["magnitude"])
    if off > one.magnitude_error:
        out.append(
            f"the size is off by {off / one.magnitude_error:.1f} times its \N{PLUS-MINUS SIGN}"
        )
    if after is None:
        out.append("nothing was added")
    elif not (_less(after.rmse_window, before.rmse_window) and _less(after.rmse, before.rmse)):
        out.append("the error on unseen runs is not smaller with it")
    return out


def _less(after: float | None, before: float | None) -> bool:
    return after is not None and before is not None and after < before
