"""Cases: a joint, its base model, measured runs, and sealed what is hidden."""

import json
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from joda.errors import JodaError
from joda.files import make_folder, write_text
from joda.hidden.die import Die, Hidden
from joda.hidden.joint import base_model, draw_truth
from joda.hidden.known import KNOWN
from joda.hidden.laws import Law
from joda.hidden.measuring import draw_encoder, measure, move, shows
from joda.hidden.outside import BEYOND
from joda.hidden.truth import Truth
from joda.measured.runs import Run, write_run

EFFECTS = tuple(KNOWN)
"""Effects that a diagnosis knows by name."""
OUTSIDE = tuple(BEYOND)
"""Effects that it does not know."""
BUILDERS = KNOWN | BEYOND

HEAVY = ("actuation_delay",)
WEIGHTY = ("load_dependent_friction",)
RUBBING = ("presliding_friction", "stribeck_friction")
PUSHED = ("backlash", "actuation_delay")
"""Effects that need a slow joint; gravity; dry friction of the base; a recorded force."""

TRIES = 6
VISIBLE = 5.0
"""How far an effect must move the joint in the upper quartile of windows, in standard deviations
of the encoder."""
JOINT = "joint"


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
            visible, and under `second` the same of a second effect.
        noise: standard deviation of the encoder, rad or m.
        quantised: whether its error is that of steps, sqrt(12) times as large, and not Gaussian.
        visible: how far the effect moves the joint, in standard deviations of the encoder.
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


def draw(seed: int, effect: str | None, forced: bool = True, second: str | None = None) -> Case:
    """Draws a case; the same arguments give the same case.

    Args:
        seed: of all draws.
        effect: one of EFFECTS or OUTSIDE; None hides nothing.
        forced: hands move the joint, and the force is recorded; else it is let go or flicked.
        second: another effect.

    Raises:
        JodaError: for an effect that there is not, or that needs a recorded force.
    """
    names = [name for name in (effect, second) if name is not None]
    _check(names, forced)
    best: Case | None = None
    for attempt in range(TRIES):
        key = zlib.crc32(repr((names, forced)).encode())
        case = _attempt(np.random.default_rng([seed, key, attempt]), seed, names, forced, attempt)
        if best is None or case.visible > best.visible:
            best = case
        if best.visible >= VISIBLE:
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


def _check(names: list[str], forced: bool) -> None:
    for name in names:
        if name not in BUILDERS:
            raise JodaError(f"no hidden effect '{name}'; there are {', '.join(BUILDERS)}.")
        if name in PUSHED and not forced:
            raise JodaError(f"{name} does not show without a recorded force; draw it forced.")


def _attempt(
    rng: np.random.Generator, seed: int, names: list[str], forced: bool, attempt: int
) -> Case:
    wants = [any(name in group for name in names) for group in (HEAVY, WEIGHTY, RUBBING)]
    bare = draw_truth(
        rng, heavy=wants[0], gravity=wants[1] and not forced, friction=wants[2], damping=False
    )
    die = Die(rng, bare, attempt / (TRIES - 1))
    hidden = [BUILDERS[name](die) for name in names]
    truth = replace(bare, hidden=_laws(hidden))
    encoder = draw_encoder(rng, bare.joint)
    motions = move(rng, truth, names, forced)
    others = [replace(bare, hidden=_laws(hidden[:i] + hidden[i + 1 :])) for i in range(len(names))]
    visible = [shows(other, motions) / encoder.sigma for other in others]
    train, held_out, clean = measure(rng, motions, encoder)
    return Case(
        seed,
        base_model(bare, JOINT),
        JOINT,
        truth,
        train,
        held_out,
        clean,
        _seal(names, hidden, visible),
        encoder.sigma,
        encoder.quantised,
        min(visible, default=np.inf),
    )


def _laws(hidden: list[Hidden]) -> tuple[Law, ...]:
    return tuple(law for one in hidden for law in one.laws)


def _seal(names: list[str], hidden: list[Hidden], visible: list[float]) -> dict[str, Any]:
    seals: list[dict[str, Any]] = [
        {
            "effect": name,
            "interval": [float(x) for x in one.interval],
            "direction": one.direction,
            "magnitude": float(one.magnitude),
            "unit": one.unit,
            "visible": round(float(seen), 2),
        }
        for name, one, seen in zip(names, hidden, visible, strict=True)
    ]
    if not seals:
        return {"effect": None}
    return seals[0] | ({"second": seals[1]} if len(seals) > 1 else {})


def overlap(one: Sequence[float], other: Sequence[float]) -> float:
    """Intersection over union of two intervals, 0 to 1."""
    (a, b), (c, d) = one, other
    return float(max(min(b, d) - max(a, c), 0.0) / (max(b, d) - min(a, c)))
