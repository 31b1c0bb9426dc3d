"""Contacts that resist a joint: found by moving it through its scene with collisions on.

All other joints stay at their reference positions, or at home. At each place the scene is solved
for a slow motion in either direction; what counts is the generalised force that a contact then
makes on the joint, not that two geoms touch: a door that rests in its frame touches it all along
and is free.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from joda.profile import Joint
from joda.scenes.engine import disable_bit, inertia_at
from joda.scenes.model import geom_name, moves_with
from joda.scenes.motion import at_home

Array = NDArray[np.float64]
Pair = tuple[str, str]

STEP = 0.01
"""How far apart, as a share of the range, the joint is put for a look."""
HALVINGS = 9
"""How often the step in which a contact begins or ends is halved."""
PACE = 0.1
"""Speed at which it moves meanwhile, ranges per second."""
FELT = 0.02
"""A contact resists if its force would move the joint by half this share of the range in 1 s."""
FIRM = 1e-6
"""Part of its force on the joint that a contact may exert on others without moving them."""
ALL_ELSE = ("gravity", "actuation", "spring", "damper", "frictionloss", "limit", "equality")
"""What acts on a joint besides contacts."""
END = 0.01
"""A contact no farther from an end of the range than this share of it is that end's stop."""


@dataclass(frozen=True)
class Contact:
    """A contact of what a joint moves with the rest of the scene, over a part of its path.

    Attributes:
        geom: of what the joint moves, by its name or its body's.
        other: of the rest.
        interval: where, in normalised position.
        path: the same, rad or m.
        force: the largest against the motion there, N·m or N.
        presses: whether it pushes somewhere, and does not only rub.
        along: whether it only rubs, and that wherever the joint was moved.
        stop: whether it lies at an end of the range, as a stop does.
        mounted: the bodies, where the other's is what the geom's is mounted on, fixed in the world:
            if that could move, MuJoCo would let them pass. Empty for any other.
    """

    geom: str
    other: str
    interval: tuple[float, float]
    path: tuple[float, float]
    force: float
    presses: bool
    along: bool
    stop: bool
    mounted: tuple[str, ...] = ()

    @property
    def hinders(self) -> bool:
        """Whether the joint moves otherwise than by itself there, and not everywhere alike."""
        return not (self.along or self.stop)


def contacts_along(
    model: mujoco.MjModel,
    joint: int,
    described: Joint,
    path: tuple[float, float],
    home: bool = False,
) -> tuple[Contact, ...]:
    """The contacts that resist a joint along its path.

    Args:
        model: the compiled scene.
        joint: its id.
        described: the joint, with its range.
        path: from where to where it is moved, rad or m.
        home: whether all else is at the keyframe `home`, if there is one, and not at its reference.

    Returns:
        by place, then by name; none where nothing resists, or contacts are disabled.
    """
    if not model.ngeom or model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_CONTACT:
        return ()
    sweep = _Sweep(model, joint, described, home)
    count = max(round((path[1] - path[0]) / (STEP * sweep.span)), 1) + 1
    positions = np.linspace(*path, count)
    looks = [sweep.look(float(position)) for position in positions]
    out = []
    for pair in sorted({pair for look in looks for pair in look}):
        resists = np.array([sweep.resists(look.get(pair)) for look in looks])
        pushes = np.array([sweep.presses(look.get(pair)) for look in looks])
        for first, last in _runs(resists):
            begin = sweep.edge(pair, positions, first, -1)
            end = sweep.edge(pair, positions, last, 1)
            a, b = (float(np.clip((x - sweep.lo) / sweep.span, 0, 1)) for x in (begin, end))
            force = max(look[pair].largest for look in looks[first : last + 1])
            out.append(
                Contact(
                    geom=pair[0],
                    other=pair[1],
                    interval=(a, b),
                    path=(begin, end),
                    force=force,
                    presses=bool(pushes[first : last + 1].any()),
                    along=bool(resists.all() and not pushes.any()),
                    stop=b <= END or a >= 1 - END,
                    mounted=sweep.mounted.get(pair, ()),
                )
            )
    return tuple(sorted(out, key=lambda one: (one.interval, one.geom, one.other)))


def pressing(
    model: mujoco.MjModel,
    joint: int,
    described: Joint,
    contacts: Iterable[Contact],
    positions: Array,
) -> Array:
    """The force with which contacts press on a joint, N·m or N, shape (n,); NaN where it is free.

    Those that push another joint as well, which may give way, count as if they only rubbed: 0.

    Args:
        model: the compiled scene.
        joint: its id.
        described: the joint, with its range.
        contacts: found along its path.
        positions: rad or m, shape (n,).
    """
    sweep = _Sweep(model, joint, described)
    pairs = {(one.geom, one.other) for one in contacts if one.presses}
    out = np.full(len(positions), np.nan)
    for k, position in enumerate(positions):
        looked = sweep.look(float(position))
        felt = [looked[pair] for pair in pairs & looked.keys() if sweep.resists(looked[pair])]
        if felt:
            firm = (one for one in felt if one.others < FIRM * one.largest and sweep.presses(one))
            out[k] = sum(one.mean for one in firm)
    return out


class Felt(NamedTuple):
    """A contact's generalised force, N·m or N.

    Attributes:
        up, down: on the joint while it moves towards +q, and towards -q.
        others: the largest on any other joint.
    """

    up: float
    down: float
    others: float

    @property
    def largest(self) -> float:
        """On the joint, in either direction."""
        return max(abs(self.up), abs(self.down))

    @property
    def mean(self) -> float:
        """On the joint at rest, without friction, which is the same in both directions."""
        return (self.up + self.down) / 2


class _Sweep:
    """A scene in which a joint is put here and there."""

    def __init__(
        self, model: mujoco.MjModel, joint: int, described: Joint, home: bool = False
    ) -> None:
        self.model = model
        self.data = at_home(self.model) if home else mujoco.MjData(self.model)
        self._others = self.data.qpos.copy()
        self.lo, hi = described.range
        self.span = hi - self.lo
        self.qpos, self.dof = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        self.moved = moves_with(model, int(model.jnt_bodyid[joint]))[model.geom_bodyid]
        self.felt = FELT * self.span * self._inertia()
        self._looks: dict[float, dict[Pair, Felt]] = {}
        self.mounted: dict[Pair, tuple[str, ...]] = {}

    def _inertia(self) -> float:
        mujoco.mj_fwdPosition(self.model, self.data)
        return inertia_at(self.model, self.data, self.dof)

    def look(self, position: float) -> dict[Pair, Felt]:
        """The forces of all contacts of what moves with what does not, at a position."""
        if position not in self._looks:
            self._looks[position] = self._look(position)
        return self._looks[position]

    @contextmanager
    def _nothing_else(self) -> Iterator[None]:
        """Only contacts act: pulled away from one by anything else, the joint shows no force."""
        before = self.model.opt.disableflags
        for kind in ALL_ELSE:
            self.model.opt.disableflags |= disable_bit(kind)
        try:
            yield
        finally:
            self.model.opt.disableflags = before

    def _look(self, position: float) -> dict[Pair, Felt]:
        with self._nothing_else():
            return self._looked(position)

    def _looked(self, position: float) -> dict[Pair, Felt]:
        model, data = self.model, self.data
        mujoco.mj_resetData(model, data)
        data.qpos[:] = self._others
        data.qpos[self.qpos] = position
        mujoco.mj_fwdPosition(model, data)
        rows = self._rows()
        if not rows:
            return {}
        forces = []
        for sign in (1.0, -1.0):
            data.qvel[self.dof] = sign * PACE * self.span
            mujoco.mj_forwardSkip(model, data, int(mujoco.mjtStage.mjSTAGE_POS), 1)
            forces.append({pair: self._force(own) for pair, own in rows.items()})
        return {pair: self._felt(forces[0][pair], forces[1][pair]) for pair in rows}

    def _felt(self, up: Array, down: Array) -> Felt:
        both = np.maximum(np.abs(up), np.abs(down))
        others = np.delete(both, self.dof).max(initial=0.0)
        return Felt(float(up[self.dof]), float(down[self.dof]), float(others))

    def _rows(self) -> dict[Pair, list[int]]:
        """Solver rows of those contacts."""
        contact = self.data.contact
        geoms = np.asarray(contact.geom).reshape(-1, 2)
        own = self.moved[geoms] & (geoms >= 0)
        out: dict[Pair, list[int]] = {}
        for k in np.flatnonzero(own[:, 0] != own[:, 1]):
            first, dim = int(contact.efc_address[k]), int(contact.dim[k])
            if first < 0:
                continue
            pyramidal = self.model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
            count = 2 * (dim - 1) if pyramidal and dim > 1 else dim
            mine, others = geoms[k] if own[k, 0] else geoms[k][::-1]
            pair = self._name(int(mine)), self._name(int(others))
            out.setdefault(pair, []).extend(range(first, first + count))
            if bodies := _mounted(self.model, int(mine), int(others)):
                self.mounted[pair] = bodies
        return out

    def _name(self, geom: int) -> str:
        if geom < 0:
            return "a flexible body"
        return geom_name(self.model, geom)

    def _force(self, rows: Sequence[int]) -> Array:
        """The generalised force of solver rows, N·m or N, shape (nv,)."""
        only = np.zeros(self.data.nefc)
        only[list(rows)] = self.data.efc_force[list(rows)]
        out = np.empty(self.model.nv)
        mujoco.mj_mulJacTVec(self.model, self.data, out, only)
        return out

    def resists(self, felt: Felt | None) -> bool:
        """Whether a joint in motion feels it."""
        return felt is not None and felt.largest > self.felt

    def presses(self, felt: Felt | None) -> bool:
        """Whether the force is more than friction."""
        return felt is not None and abs(felt.mean) > max(self.felt, abs(felt.up - felt.down) / 4)

    def edge(self, pair: Pair, positions: Array, sample: int, way: int) -> float:
        """Where a contact begins (way -1) or ends (1) beside a place at which it resists."""
        inside, beyond = float(positions[sample]), sample + way
        if not 0 <= beyond < len(positions):
            return inside
        outside = float(positions[beyond])
        for _ in range(HALVINGS):
            middle = (inside + outside) / 2
            if self.resists(self.look(middle).get(pair)):
                inside = middle
            else:
                outside = middle
        return inside


def _mounted(model: mujoco.MjModel, mine: int, other: int) -> tuple[str, ...]:
    """The bodies of two geoms, the other's first, where that is fixed and carries the first's.

    MuJoCo leaves out contacts of a body with the one that carries it, but not with the world's.
    """
    if mine < 0 or other < 0:
        return ()
    body, base = (int(model.geom_bodyid[geom]) for geom in (mine, other))
    carrier = model.body_parentid[model.body_weldid[body]]
    fixed = model.body_weldid[carrier] == 0 and model.body_weldid[base] == 0
    return (model.body(base).name, model.body(body).name) if fixed else ()


def _runs(true: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last of each stretch of neighbours that are true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], true, [False]]).astype(int)))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]
