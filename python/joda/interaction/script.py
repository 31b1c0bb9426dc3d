"""What can be done to a joint: let it go, push it, take it by a virtual hand, send a robot."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.compiling import HAND_FORCE
from joda.errors import JodaError
from joda.interaction.hand import Grip, Hand, finest
from joda.interaction.pulling import FIRMNESS, SLOW, grip
from joda.interaction.robot import AFTER, read_targets
from joda.scenes.context import Context
from joda.scenes.motion import Act, Motion, at_home, idle, leaning, play

KINDS = ("release", "push", "impulse", "hand", "open", "robot")
OPTIONS = {
    "release": (),
    "push": ("start", "seconds"),
    "impulse": ("start",),
    "hand": ("start", "speed", "strength", "stiffness", "pause"),
    "open": ("speed", "strength", "stiffness"),
    "robot": ("start",),
}
"""Which options go with which interaction; `duration` goes with all."""
SPELLED = {"seconds": "for"}

ALONE = ("release", "push", "impulse", "hand")
"""True instead of a number stands for the usual one, see `_usual`."""

SECONDS = 3.0
"""How long a joint is watched after it was let go or pushed, s."""
SLOWLY = 10.0
"""How long (s) a hand takes to open a joint quasi-statically."""
IMPACT = 0.02
"""How long (s) an impulse lasts: half a sine, so that any timestep can resolve it."""


@dataclass(frozen=True)
class Interaction:
    """Something to do with a joint.

    Attributes:
        kind: its name.
        says: what is done.
        start: where the joint begins, rad or m.
        act: what acts on the scene.
        duration: s; None: until it is done.
        speed: of the hand, rad/s or m/s; None where there is none.
        note: what the user should be told; may be empty.
    """

    kind: str
    says: str
    start: float
    act: Act
    duration: float | None
    speed: float | None = None
    note: str = ""


def interaction(model: mujoco.MjModel, joint: int, found: Context, **asked: Any) -> Interaction:
    """The one that is asked for.

    Args:
        model: the compiled scene; a hand that is firm for the joint's inertia gets it a smaller
            timestep.
        joint: its id.
        found: its context.
        asked: see `joda.simulate`; None is not asked for.

    Raises:
        JodaError: not exactly one is asked for, or it is asked for what cannot be.
    """
    given = {name: value for name, value in asked.items() if value is not None}
    kind = _kind(given)
    if given[kind] is True and kind in ALONE:
        given[kind] = _usual(kind, found)
    _check_numbers(given)
    describe = Describe(found)
    if kind == "release":
        start = describe.within("release", given["release"])
        says = f"let go at {describe.at(start)}"
        return Interaction(kind, says, start, idle, given.get("duration", SECONDS))
    home = float(at_home(model).qpos[model.jnt_qposadr[joint]])
    start = describe.within("start", given.get("start", float(np.clip(home, *found.joint.range))))
    if kind in ("hand", "open"):
        return _by_hand(model, joint, describe, given, start)
    begins = f", from {describe.at(start)}"
    if kind == "robot":
        targets = read_targets(Path(given["robot"]), model)
        watched = given.get("duration", float(targets.time[-1]) + AFTER)
        says = f"a robot goes through {Path(given['robot']).name}"
        return Interaction(kind, says + begins, start, targets, watched)
    duration = given.get("duration", SECONDS)
    says, forces = _pushed(kind, given, duration, model.opt.timestep, describe)
    pushing = Forces(int(model.jnt_dofadr[joint]), forces)
    return Interaction(kind, says + begins, start, pushing, duration)


def perform(
    model: mujoco.MjModel,
    joint: int,
    done: Interaction,
    watch: Callable[[mujoco.MjData], None] = lambda data: None,
) -> Motion:
    """The interaction, simulated in the whole scene.

    Args:
        model, joint: as given to `interaction`.
        done: what it returned.
        watch: shown the scene before each step, and at the end.

    Raises:
        JodaError: the simulation is unstable.
    """
    begun = done.start if done.kind == "release" else leaning(model, joint, done.start)
    return play(model, joint, begun, done.act, done.duration, watch)


def _by_hand(
    model: mujoco.MjModel, joint: int, describe: "Describe", given: dict[str, Any], start: float
) -> Interaction:
    """A hand that goes somewhere, or opens slowly; lessens the timestep where it must."""
    found = describe.context
    lo, hi = found.joint.range
    to, pace, what = given.get("hand", ()), SLOW, "a hand takes it"
    for position in to:
        describe.within("hand", position)
    if "open" in given:
        start, end = (hi, lo) if found.closed_end == "high_end" else (lo, hi)
        to, pace, what = (end,), SLOWLY, "a hand opens it slowly"
    held = Grip(
        speed=given.get("speed", (hi - lo) / pace),
        strength=given.get("strength", grip(found)),
        stiffness=given.get("stiffness", FIRMNESS * found.lever_arm**2),
        pause=given.get("pause", 0.0),
    )
    way = ", then to ".join(describe.at(position) for position in to)
    says = f"{what} from {describe.at(start)} to {way}, at {held.speed:.3g} {describe.unit}/s"
    note = ""
    fine = finest(found.equivalent_inertia, held.stiffness)
    if fine < model.opt.timestep:
        model.opt.timestep = fine
        note = f"It is simulated in steps of {1000 * fine:.2g} ms, as so light a joint needs."
    kind, act = "open" if "open" in given else "hand", Hand(model, joint, to, held)
    return Interaction(kind, says, start, act, given.get("duration"), held.speed, note)


def _usual(kind: str, found: Context) -> float | tuple[float, float]:
    """Half-way; 10 N at the lever arm; what goes through the range in 1 s; opened and shut."""
    lo, hi = found.joint.range
    closed, opened = (hi, lo) if found.closed_end == "high_end" else (lo, hi)
    towards = float(np.sign(opened - closed))
    usual: dict[str, float | tuple[float, float]] = {
        "release": (lo + hi) / 2,
        "push": towards * HAND_FORCE * found.lever_arm,
        "impulse": towards * found.equivalent_inertia * (hi - lo),
        "hand": (opened, closed),
    }
    return usual[kind]


def _check_numbers(given: dict[str, Any]) -> None:
    """Raises JodaError for numbers that can be none."""
    for name in ("seconds", "speed", "strength", "stiffness", "duration"):
        if not 0 < given.get(name, 1.0) < np.inf:
            raise JodaError(f"--{SPELLED.get(name, name)} is {given[name]:g}; give more than 0.")
    if not 0 <= given.get("pause", 0.0) < np.inf:
        raise JodaError(f"--pause is {given['pause']:g}; give 0 or more.")
    for name in ("push", "impulse"):
        if not np.isfinite(given.get(name, 0.0)):
            raise JodaError(f"--{name} is {given[name]:g}; give a number.")


@dataclass(frozen=True)
class Forces:
    """Forces on a dof (N·m or N), one per timestep, then none; acts on a scene."""

    dof: int
    values: NDArray[np.float64]

    def __call__(self, data: mujoco.MjData) -> bool:
        """Sets the applied force."""
        step = round(data.time / data.model.opt.timestep)
        data.qfrc_applied[self.dof] = self.values[step] if step < len(self.values) else 0.0
        return True


@dataclass(frozen=True)
class Describe:
    """Positions and forces of a joint in words."""

    context: Context

    @property
    def unit(self) -> str:
        """Of position."""
        return self.context.joint.unit

    @property
    def force(self) -> str:
        """Unit of force."""
        return self.context.joint.force_unit

    def at(self, position: float) -> str:
        """The position, to 1e-4 of the range."""
        least = 1e-4 * float(np.ptp(self.context.joint.range))
        shown = 0.0 if abs(position) < least else position
        other = f" ({np.rad2deg(shown):.1f} degrees)" if self.unit == "rad" else ""
        return f"{shown:.4g} {self.unit}{other}".replace("(-0.0 ", "(0.0 ")

    def within(self, option: str, position: float) -> float:
        """The position; raises JodaError if it lies outside the joint's range."""
        lo, hi = self.context.joint.range
        room = 1e-6 * (hi - lo)
        if not lo - room <= position <= hi + room:
            raise JodaError(
                f"--{option} {position:g} is outside the range of joint "
                f"'{self.context.joint.name}', {lo:g} to {hi:g} {self.unit}; give {self.unit}."
            )
        return position


def _kind(given: dict[str, Any]) -> str:
    """The one interaction that is given; raises JodaError."""
    kinds = [kind for kind in KINDS if kind in given]
    if len(kinds) != 1:
        listed = ", ".join(f"--{kind}" for kind in KINDS)
        which = " and ".join(f"--{kind}" for kind in kinds) or "none"
        raise JodaError(f"one interaction at a time: give exactly one of {listed}, not {which}.")
    for option in given.keys() - {"duration", kinds[0]} - set(OPTIONS[kinds[0]]):
        with_it = " or ".join(f"--{kind}" for kind in KINDS if option in OPTIONS[kind])
        raise JodaError(f"--{SPELLED.get(option, option)} goes with {with_it}, not --{kinds[0]}.")
    return kinds[0]


def _pushed(
    kind: str, given: dict[str, Any], duration: float, step: float, describe: Describe
) -> tuple[str, NDArray[np.float64]]:
    """What is done, and the force in each step, N·m or N."""
    if kind == "impulse":
        phase = (np.arange(max(round(IMPACT / step), 1)) + 0.5) * step / IMPACT
        shape = np.sin(np.pi * np.minimum(phase, 1.0)) if len(phase) > 1 else np.ones(1)
        impulse = given["impulse"]
        return f"an impulse of {impulse:.3g} {describe.force}·s", impulse * shape / (
            shape.sum() * step
        )
    seconds = given.get("seconds", duration)
    says = f"pushed with {given['push']:.3g} {describe.force} for {seconds:g} s"
    return says, np.full(max(round(seconds / step), 1), float(given["push"]))
