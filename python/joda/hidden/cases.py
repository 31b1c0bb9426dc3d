"""Cases: a joint, its base model, measured runs, and sealed what is hidden."""

import json
import zlib
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from joda.errors import JodaError
from joda.files import make_folder, write_text
from joda.hidden.achievable import Achievable, achievable
from joda.hidden.families import FAMILIES
from joda.hidden.family import Family
from joda.hidden.joint import base_model
from joda.hidden.laws import Array, Law, Tilt
from joda.hidden.measuring import Encoder, measure, shows
from joda.hidden.sampler import Hidden, Sampler
from joda.hidden.truth import Joint, Truth
from joda.measured.run_files import write_run
from joda.measured.runs import Run

FAMILY = "laboratory"
EFFECTS = tuple(FAMILIES[FAMILY].known)
"""Effects that a diagnosis knows by name; every family has all of them."""
UNCATALOGUED = tuple(FAMILIES[FAMILY].uncatalogued)
"""Effects that it does not know, of the first family."""
PUSHED = FAMILIES[FAMILY].pushed
"""Effects of the first family that need a recorded force."""

TRIES = 6
VISIBLE = 5.0
"""How far an effect must move the joint in the upper quartile of windows, in standard deviations
of the encoder."""
SOFT = 0.08
"""How far a run may go beyond the range, of the range."""
WHOLE = 0.8
"""Part of the range from which on a resistance is called constant and not position-dependent."""
PARTIAL = {
    "constant_friction_hinge": "position_dependent_friction",
    "constant_damping_hinge": "position_dependent_damping",
}
"""What it is called below."""
CONSTANT = ("constant_negative_conservative_hinge", "constant_positive_conservative_hinge")
"""Forces towards the low and the high end."""
LOADED = ("constant_friction_hinge", "load_dependent_friction")
"""Frictions that are the same under a constant load."""


@dataclass(frozen=True)
class Case:
    """A diagnosis to be made.

    Attributes:
        seed: of its draw.
        model: MJCF of the base model.
        joint: name of its joint.
        truth: everything about the joint.
        train, held_out: measured runs, of the same kinds.
        held_out_clean: those held out, without noise.
        seal: what is hidden: effect (None for nothing), interval, direction, magnitude, unit,
            visible, in_catalogue, also_right (names of laws that are the same here), and under
            `second` the same of a second effect; `wrong`, where numbers are: these by the names of
            a diagnosis' corrections, true over the model's, of a measurement in its units.
        noise: standard deviation of the encoder, rad or m.
        quantised: whether its error is that of steps, sqrt(12) times as large, and not Gaussian.
        visible: how far the effect moves the joint, in standard deviations of the encoder.
        family: that it is of.
        encoder: how it is measured.
        step: of the simulation, s.
        clock: time at which each held-out run begins, s.
    """

    seed: int
    model: str
    joint: str
    truth: Truth
    train: list[Run]
    held_out: list[Run]
    held_out_clean: list[Run]
    seal: dict[str, Any]
    noise: float
    quantised: bool
    visible: float
    family: str
    encoder: Encoder
    step: float
    clock: Array

    @property
    def within(self) -> bool:
        """Whether no run goes far beyond the range, as no sensible measurement would."""
        joint, room = self.truth.joint, SOFT * self.truth.joint.span
        runs = (*self.train, *self.held_out)
        return all(
            run.position.min() > joint.lo - room and run.position.max() < joint.hi + room
            for run in runs
        )

    @cached_property
    def achievable(self) -> Achievable:
        """What the true joint misses of the held-out runs, replayed whole from a noisy start."""
        return achievable(self.truth, self.held_out_clean, self.encoder, self.step, self.clock)


def draw(
    seed: int,
    effect: str | None,
    forced: bool = True,
    second: str | None = None,
    family: str = FAMILY,
) -> Case:
    """Draws a case; the same arguments give the same case.

    Args:
        seed: of all draws.
        effect: one of EFFECTS, or beyond them one of the family; None hides nothing.
        forced: something moves the joint, and the force is recorded; else it is let go or flicked.
        second: another effect.
        family: one of FAMILIES.

    Raises:
        JodaError: for a family or an effect that there is not, or that needs a recorded force.
    """
    if family not in FAMILIES:
        raise JodaError(f"no family '{family}'; there are {', '.join(FAMILIES)}.")
    names = [name for name in (effect, second) if name is not None]
    of = FAMILIES[family]
    _check(of, names, forced)
    best: Case | None = None
    what = (names, forced) if family == FAMILY else (family, names, forced)
    for attempt in range(TRIES):
        key = zlib.crc32(repr(what).encode())
        rng = np.random.default_rng([seed, key, attempt])
        case = _attempt(rng, of, seed, names, forced, attempt)
        if best is None or (case.within, case.visible) > (best.within, best.visible):
            best = case
        if best.within and best.visible >= VISIBLE:
            break
    assert best is not None
    return best


def write(case: Case, folder: Path) -> None:
    """Writes model.xml, run1.csv, ..., held_out1.csv, ..., and sealed.json, into a folder."""
    make_folder(folder)
    write_text(folder / "model.xml", case.model)
    for run in (*case.train, *case.held_out):
        write_run(folder / run.name, run)
    seal = {"seed": case.seed, "joint": case.joint, "noise": case.noise, **case.seal}
    write_text(folder / "sealed.json", json.dumps(seal, indent=1, ensure_ascii=False) + "\n")


def _check(of: Family, names: list[str], forced: bool) -> None:
    for name in names:
        if name not in of.builders:
            raise JodaError(f"no hidden effect '{name}'; there are {', '.join(of.builders)}.")
        if name in of.pushed and not forced:
            raise JodaError(f"{name} does not show without a recorded force; draw it forced.")


def _attempt(
    rng: np.random.Generator, of: Family, seed: int, names: list[str], forced: bool, attempt: int
) -> Case:
    bare = of.draw_truth(rng, names, forced)
    sampler = Sampler(rng, bare, attempt / (TRIES - 1))
    hidden = [of.builders[name](sampler) for name in names]
    truth = replace(bare, hidden=_laws(hidden))
    encoder = of.draw_encoder(rng, bare.joint)
    motions = of.move(rng, truth, names, forced)
    others = [replace(bare, hidden=_laws(hidden[:i] + hidden[i + 1 :])) for i in range(len(names))]
    visible = [shows(other, motions) / encoder.sigma for other in others]
    train, held_out, clean = measure(rng, motions, encoder)
    return Case(
        seed,
        base_model(bare, of.joint),
        of.joint,
        truth,
        train,
        held_out,
        clean,
        _seal(of, bare.joint, names, hidden, visible, forced) | _wrong(truth, encoder),
        encoder.sigma,
        encoder.quantised,
        min(visible, default=np.inf),
        of.name,
        encoder,
        motions.h,
        motions.clock[motions.train :],
    )


def _laws(hidden: list[Hidden]) -> tuple[Law, ...]:
    return tuple(law for one in hidden for law in one.laws)


def _seal(
    of: Family,
    joint: Joint,
    names: list[str],
    hidden: list[Hidden],
    visible: list[float],
    forced: bool,
) -> dict[str, Any]:
    seals: list[dict[str, Any]] = [
        {
            "effect": _called(name, one),
            "interval": [float(x) for x in one.interval],
            "direction": one.direction,
            "magnitude": float(one.magnitude),
            "unit": one.unit,
            "visible": round(float(seen), 2),
            "in_catalogue": name in of.known,
            "also_right": _alike(joint, name, one, forced),
        }
        for name, one, seen in zip(names, hidden, visible, strict=True)
    ]
    if not seals:
        return {"effect": None}
    return seals[0] | ({"second": seals[1]} if len(seals) > 1 else {})


def _wrong(truth: Truth, encoder: Encoder) -> dict[str, Any]:
    """Numbers that the base model or the measurement has wrong."""
    wrong = encoder.instrument.wrong
    if truth.believed:
        wrong["mass"] = truth.joint.inertia / truth.believed.inertia
    return {"wrong": wrong} if wrong else {}


def _called(name: str, hidden: Hidden) -> str:
    """The effect's name, which for a resistance depends on how far it reaches."""
    a, b = hidden.interval
    return PARTIAL.get(name, name) if b - a < WHOLE else name


def _alike(joint: Joint, name: str, hidden: Hidden, forced: bool) -> list[str]:
    """Names of the same law on a slide: a weight more is a constant force in all of the range;
    where only the weight loads it, its friction is constant."""
    if joint.kind == "hinge" or hidden.interval != (0.0, 1.0):
        return []
    if name == "gravity_offset":
        return [CONSTANT[law.constant > 0] for law in hidden.laws if isinstance(law, Tilt)]
    if name in LOADED and not forced:
        return [other for other in LOADED if other != name]
    return ["gravity_offset"] if name in CONSTANT else []
