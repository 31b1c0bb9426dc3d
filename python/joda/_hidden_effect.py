"""The second demo: a joint hides an effect; it is found, added, and the seal is opened."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from joda._add import add
from joda._add import sentences as of_added
from joda._compare import compare
from joda._diagnose import diagnose
from joda._diagnose import sentences as of_diagnosis
from joda.diagnosis.findings import Diagnosis
from joda.diagnosis.phrases import named
from joda.errors import JodaError
from joda.files import fresh, make_folder, occupied
from joda.hidden import EFFECTS, draw, write
from joda.hidden.cases import PUSHED, VISIBLE
from joda.measured.comparison import Comparison
from joda.measured.comparison import sentences as of_comparison


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
        right: whether the first effect named is the hidden one.
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
        reveal: say at the beginning what is hidden.
        force: overwrite what an earlier demo left there.
        say: told what is done and what was found, sentence by sentence.

    Returns:
        the truth beside what was said.

    Raises:
        JodaError: the folder cannot be written, or holds files already.
    """
    folder = Path(output) if output is not None else fresh("joda_hidden_effect")
    if occupied(folder) and not force:
        raise JodaError(f"{folder}: exists already; choose another folder with -o or add --force.")
    make_folder(folder)
    if seed is None:
        seed = int(np.random.default_rng().integers(1_000_000))
    names = [name for name in EFFECTS if not (position_only and name in PUSHED)]
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
    truth = f"{named(effect)}, {_where(case.seal)}, {_size(case.seal)}"
    say(f"Hidden is {truth}." if reveal else "What is hidden is sealed in sealed.json.")

    say(f"\n1. Is the model good? (compare, {folder / 'compare.html'})")
    found = compare(model, joint, runs, report=folder / "compare.html", force=True)
    say(of_comparison(found)[0])
    say(f"\n2. What does it lack? (diagnose, {folder / 'diagnosis.html'})")
    written = folder / "diagnosis.json"
    diagnosis = diagnose(
        model, joint, runs, json=written, report=folder / "diagnosis.html", force=True
    )
    for sentence in of_diagnosis(diagnosis):
        say(sentence)
    before, after = compare(model, joint, unseen), None
    if diagnosis.effects:
        say(f"\n3. Add it. (add, {folder / 'new.xml'}, {folder / 'new.png'})")
        added = add(model, joint, written, runs, folder / "new.xml", force=True)
        say(of_added(added)[0])
        say(f"\n4. Runs that no step has seen. (compare, {folder / 'unseen.html'})")
        page = folder / "unseen.html"
        after = compare(folder / "new.xml", joint, unseen, report=page, force=True)
        unit = after.unit
        say(
            f"Whole runs are missed by {before.rmse:.3g} → {after.rmse:.3g} {unit} RMS, windows of "
            f"0.4 s by {before.rmse_window:.3g} → {after.rmse_window:.3g} {unit}; the noise is "
            f"{after.noise_floor:.2g} {unit}."
        )
    say("\nThe seal is opened:")
    judgement = _judged(diagnosis, effect)
    say(f"  hidden: {truth}")
    for one in diagnosis.effects[:1]:
        doubt = f" \u00b1 {one.magnitude_error:.2g}"
        say(f"  said:   {named(one.effect)}, {_where(vars(one))}, {_size(vars(one), doubt)}")
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
        right=bool(diagnosis.effects) and diagnosis.effects[0].effect == effect,
        judgement=judgement,
    )


def _where(told: dict[str, Any]) -> str:
    a, b = told["interval"]
    return f"s = {a:.2f} to {b:.2f}"


def _size(told: dict[str, Any], doubt: str = "") -> str:
    of = "" if told["unit"] == "1" else f" {told['unit']}"
    return f"{told['magnitude']:.3g}{doubt}{of}"


def _judged(diagnosis: Diagnosis, effect: str) -> str:
    """What was said against what is true."""
    said = [one.effect for one in diagnosis.effects]
    if not said:
        return f"Missed: no effect was named (verdict: {diagnosis.verdict})."
    if said[0] == effect:
        return "Right."
    if effect in diagnosis.effects[0].indistinguishable_from:
        return "Not the first one named, but one of those that these data cannot tell apart."
    if effect in said:
        one = diagnosis.effects[said.index(effect)]
        return f"Wrong: the hidden effect was named too, with {100 * one.probability:.0f} %."
    return "Wrong: the hidden effect was not among those named."
