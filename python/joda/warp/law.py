"""The plugin's law as one kernel: forces and rows of all joints in all worlds.

It runs where MuJoCo calls a plugin's compute: the step's constraint rows are made, the solver has
not run. Before it changes them it takes from the last step what a plugin's advance would: the
solver's forces are still there. Whether a step was taken, the world's time says; where time has
gone back, the world was reset and the joints forget.
"""

from typing import Any

import mujoco
import warp as wp

from joda.warp import laws, learned
from joda.warp.curves import Curves, descent, value
from joda.warp.numbers import Curve, Number, Place, Row, State

NO_SPRING = wp.constant(int(mujoco.mjtDisableBit.mjDSBL_SPRING))
NO_DAMPER = wp.constant(int(mujoco.mjtDisableBit.mjDSBL_DAMPER))
NO_FRICTION = wp.constant(int(mujoco.mjtDisableBit.mjDSBL_FRICTIONLOSS))
NO_GRAVITY = wp.constant(int(mujoco.mjtDisableBit.mjDSBL_GRAVITY))
EQUALITY = wp.constant(int(mujoco.mjtConstraint.mjCNSTR_EQUALITY))
FRICTION = wp.constant(int(mujoco.mjtConstraint.mjCNSTR_FRICTION_DOF))
LIMIT = wp.constant(int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT))


@wp.struct
class Profiles:
    """All joints in all worlds.

    Attributes:
        curves: of the variants; world w has variant w modulo their number.
        tables: of their learned forces.
        numbers: shape (numbers, worlds, joints), by `Number`.
        state: shape (states, worlds, joints), by `State`.
        rows: of the last step, -1: none; shape (rows, worlds, joints), by `Row`.
        places: shape (joints, places), by `Place`.
        inertia: as MuJoCo's dof_M0, kg·m² or kg, shape (joints,).
    """

    curves: Curves
    tables: learned.Tables
    numbers: wp.array3d[float]
    state: wp.array3d[float]
    rows: wp.array3d[int]
    places: wp.array2d[int]
    inertia: wp.array[float]


@wp.struct
class Joint:
    """A joint in a world, in the step being computed."""

    variant: int
    world: int
    index: int
    s: float
    damping: float
    friction: float
    load: float
    damps: int
    rubs: int


@wp.func
def find_row(
    kinds: wp.array[int],
    ids: wp.array[int],
    first: int,
    last: int,
    expected: int,
    kind: int,
    id: int,
) -> int:
    """The row of that kind and object among [first, last), -1: none. They come in any order."""
    end = wp.min(last, kinds.shape[0])
    if expected >= first and expected < end and kinds[expected] == kind and ids[expected] == id:
        return expected
    for row in range(first, end):
        if kinds[row] == kind and ids[row] == id:
            return row
    return -1


@wp.func
def along(profiles: Profiles, joint: Joint, up: int, number: int, v: float) -> float:
    """A curve of the direction of the motion, of two that follow each other; 0 at rest."""
    if wp.abs(v) < laws.STILL:
        return 0.0
    curve = wp.where(v < 0.0, up + 1, up)
    strength = profiles.numbers[number, joint.world, joint.index]
    return strength * value(profiles.curves, joint.variant, joint.index, curve, joint.s)


@wp.func
def resist(profiles: Profiles, joint: Joint, v: float) -> wp.vec3:
    """Damping, and friction in positive and in negative motion, of the joint that moves at v."""
    drag = joint.damping
    if joint.damps != 0:
        extra = along(
            profiles,
            joint,
            int(Curve.DAMPING_UP),
            int(Number.DIRECTION_DEPENDENT_DAMPING_STRENGTH),
            v,
        ) + wp.abs(v) * along(
            profiles, joint, int(Curve.QUADRATIC_UP), int(Number.QUADRATIC_DAMPING_STRENGTH), v
        )
        drag += wp.max(0.0, extra)
    if joint.rubs == 0:
        return wp.vec3(drag, joint.friction, joint.friction)
    w, j, k = joint.world, joint.index, joint.variant
    n = profiles.numbers
    excess = n[int(Number.STRIBECK_FRICTION_STRENGTH), w, j] * value(
        profiles.curves, k, j, int(Curve.STRIBECK), joint.s
    )
    both = (
        joint.friction
        + laws.stribeck(
            excess,
            n[int(Number.STRIBECK_FRICTION_VELOCITY), w, j],
            n[int(Number.STRIBECK_FRICTION_EXPONENT), w, j],
            v,
        )
        + n[int(Number.LOAD_DEPENDENT_FRICTION_COEFFICIENT), w, j] * wp.abs(joint.load)
    )
    strength = n[int(Number.ASYMMETRIC_FRICTION_STRENGTH), w, j]
    up = strength * value(profiles.curves, k, j, int(Curve.ASYMMETRY_UP), joint.s)
    down = strength * value(profiles.curves, k, j, int(Curve.ASYMMETRY_DOWN), joint.s)
    return wp.vec3(drag, wp.max(0.0, both + up), wp.max(0.0, both + down))


@wp.func
def exerted(hinge: int, axis: wp.vec3, anchor: wp.vec3, force: wp.vec3, point: wp.vec3) -> float:
    """What of a force at a point acts along a joint, N·m or N."""
    if hinge != 0:
        return wp.dot(wp.cross(axis, point - anchor), force)
    return wp.dot(axis, force)


@wp.func
def implicit_stiffness(
    profiles: Profiles, joint: Joint, field: bool, h: float, v: float, force: float, inertia: float
) -> float:
    """The part of the springs that must act implicitly, N·m/rad: as in cpp/stiffness.h."""
    w, j = joint.world, joint.index
    n = profiles.numbers
    per_range = 1.0 / (n[int(Number.RANGE_HI), w, j] - n[int(Number.RANGE_LO), w, j])
    soft = laws.EXPLICIT_STIFFNESS * inertia / (h * h)
    sine, cosine = n[int(Number.GRAVITY_OFFSET_SIN), w, j], n[int(Number.GRAVITY_OFFSET_COS), w, j]
    gravity = wp.sqrt(sine * sine + cosine * cosine)
    landing = joint.s + h * (v + h / inertia * force) * per_range
    if (joint.s < 0.0 and landing < 0.0) or (joint.s > 1.0 and landing > 1.0):
        return wp.max(0.0, gravity - soft)
    strength = n[int(Number.CONSERVATIVE_STRENGTH), w, j] * per_range
    steepest = float(0.0)
    curve = int(Curve.CONSERVATIVE)
    if field:
        steepest = strength * profiles.curves.steepest[joint.variant, j, curve]
    stiffness = wp.abs(force) * per_range / laws.STRIDE
    if steepest + gravity > soft:
        reach = h * (wp.abs(v) + h / inertia * wp.abs(force)) * per_range
        near = strength * descent(
            profiles.curves, joint.variant, j, curve, joint.s - reach, joint.s + reach
        )
        stiffness = wp.max(stiffness, gravity + wp.min(near, steepest))
    return wp.max(0.0, stiffness - soft)


@wp.func
def force_of(profiles: Profiles, kind: int, w: int, j: int, forces: wp.array[float]) -> float:
    """The force of a joint's row in the last step, 0 where there was none."""
    row = profiles.rows[kind, w, j]
    return wp.where(row >= 0, forces[wp.max(row, 0)], 0.0)


@wp.func
def remember(
    profiles: Profiles,
    w: int,
    j: int,
    t: float,
    h: float,
    v: float,
    forces: wp.array[float],
    constraint: float,
    actuator: float,
):
    """Takes from the last step what the joint remembers, if one was taken; forgets if reset."""
    state = profiles.state
    seen = state[int(State.TIME), w, j]
    if seen < 0.0 or t < seen:
        state[int(State.FRICTION), w, j] = 0.0
        state[int(State.UNKNOWN_LOAD), w, j] = 0.0
        state[int(State.GAP), w, j] = 0.0
        state[int(State.SPEED), w, j] = 0.0
        state[int(State.REMEMBERED), w, j] = 0.0
    elif t > seen:
        psi = force_of(profiles, int(Row.FRICTION), w, j, forces)
        damping = force_of(profiles, int(Row.DAMPING), w, j, forces)
        limit = force_of(profiles, int(Row.LIMIT), w, j, forces)
        own = psi + damping + state[int(State.STOP_SIDE), w, j] * limit
        state[int(State.FRICTION), w, j] = psi + state[int(State.BESIDE_ROW), w, j]
        state[int(State.UNKNOWN_LOAD), w, j] = constraint - own - actuator
        gap = float(state[int(State.NEXT_GAP), w, j])
        speed = float(state[int(State.NEXT_SPEED), w, j])
        if profiles.numbers[int(Number.BACKLASH_LOAD), w, j] > 0.0:
            play = profiles.numbers[int(Number.BACKLASH_PLAY), w, j]
            after = laws.settle(play, h, state[int(State.NEXT_SIDE), w, j], gap, speed, v)
            gap = after[0]
            speed = after[1]
        state[int(State.GAP), w, j] = gap
        state[int(State.SPEED), w, j] = speed
        state[int(State.REMEMBERED), w, j] = learned.recalled(
            profiles.numbers[int(Number.LEARNED_FORCE_CHANGE), w, j],
            profiles.numbers[int(Number.LEARNED_FORCE_TIME), w, j],
            h,
            v,
            state[int(State.REMEMBERED), w, j],
        )
    state[int(State.TIME), w, j] = t


@wp.kernel(enable_backward=False)
def act(
    # of the model
    disabled: int,
    timestep: wp.array[float],
    gravity: wp.array[wp.vec3],
    body_subtreemass: wp.array2d[float],
    jnt_range: wp.array2d[wp.vec2],
    dof_frictionloss: wp.array2d[float],
    dof_invweight0: wp.array2d[float],
    jnt_actgravcomp: wp.array[int],
    # of the data
    time: wp.array[float],
    qpos: wp.array2d[float],
    qvel: wp.array2d[float],
    qacc_warmstart: wp.array2d[float],
    qfrc_applied: wp.array2d[float],
    xfrc_applied: wp.array2d[wp.spatial_vector],
    qfrc_gravcomp: wp.array2d[float],
    qfrc_actuator: wp.array2d[float],
    qfrc_constraint: wp.array2d[float],
    xipos: wp.array2d[wp.vec3],
    xanchor: wp.array2d[wp.vec3],
    xaxis: wp.array2d[wp.vec3],
    subtree_com: wp.array2d[wp.vec3],
    ne: wp.array[int],
    nf: wp.array[int],
    nl: wp.array[int],
    efc_type: wp.array2d[int],
    efc_id: wp.array2d[int],
    efc_pos: wp.array2d[float],
    efc_margin: wp.array2d[float],
    efc_force: wp.array2d[float],
    # ours, with its state
    profiles: Profiles,
    # changed
    efc_D: wp.array2d[float],
    efc_aref: wp.array2d[float],
    efc_frictionloss: wp.array2d[float],
    qfrc_passive: wp.array2d[float],
):
    """One joint in one world; dimensions (worlds, joints)."""
    w, j = wp.tid()
    n = profiles.numbers
    id, dof = profiles.places[j, int(Place.JOINT)], profiles.places[j, int(Place.DOF)]
    h = timestep[w % timestep.shape[0]]
    q, v = qpos[w, profiles.places[j, int(Place.QPOS)]], qvel[w, dof]
    inertia = 1.0 / dof_invweight0[w % dof_invweight0.shape[0], dof]
    constraint, actuator = qfrc_constraint[w, dof], qfrc_actuator[w, dof]
    remember(profiles, w, j, time[w], h, v, efc_force[w], constraint, actuator)
    held = profiles.state[int(State.FRICTION), w, j]
    gap, speed = profiles.state[int(State.GAP), w, j], profiles.state[int(State.SPEED), w, j]

    joint = Joint()
    joint.world = w
    joint.index = j
    joint.variant = w % profiles.curves.first.shape[0]
    lo, hi = n[int(Number.RANGE_LO), w, j], n[int(Number.RANGE_HI), w, j]
    joint.s = (q - lo) / (hi - lo)
    joint.damps = wp.where((disabled & NO_DAMPER) == 0, 1, 0)
    joint.rubs = wp.where((disabled & NO_FRICTION) == 0, 1, 0)

    kinds, ids = efc_type[w], efc_id[w]
    ends = ne[w] + nf[w]
    row = find_row(kinds, ids, ne[w], ends, profiles.rows[int(Row.FRICTION), w, j], FRICTION, dof)
    damping_row = int(-1)
    equality = profiles.places[j, int(Place.EQUALITY)]
    if equality >= 0:
        damping_row = find_row(kinds, ids, 0, ne[w], equality, EQUALITY, equality)
    coefficient = n[int(Number.LOAD_DEPENDENT_FRICTION_COEFFICIENT), w, j]
    low = n[int(Number.END_STOP_RESTITUTION_LOW), w, j]
    high = n[int(Number.END_STOP_RESTITUTION_HIGH), w, j]
    limits = jnt_range[w % jnt_range.shape[0], id]
    side = wp.where(q - limits[0] < limits[1] - q, 1.0, -1.0)
    stop = int(-1)
    if coefficient > 0.0 or low >= 0.0 or high >= 0.0:
        stop = find_row(kinds, ids, ends, ends + nl[w], -1, LIMIT, id)
    profiles.rows[int(Row.FRICTION), w, j] = row
    profiles.rows[int(Row.DAMPING), w, j] = damping_row
    profiles.rows[int(Row.LIMIT), w, j] = stop
    profiles.state[int(State.STOP_SIDE), w, j] = side

    sine, cosine = n[int(Number.GRAVITY_OFFSET_SIN), w, j], n[int(Number.GRAVITY_OFFSET_COS), w, j]
    spring = n[int(Number.GRAVITY_OFFSET_FORCE), w, j] + sine * wp.sin(q) + cosine * wp.cos(q)
    field = (disabled & NO_SPRING) == 0
    if field:
        spring += n[int(Number.CONSERVATIVE_STRENGTH), w, j] * value(
            profiles.curves, joint.variant, j, int(Curve.CONSERVATIVE), joint.s
        )
    yielding = h * implicit_stiffness(profiles, joint, field, h, v, spring, inertia)
    if joint.damps != 0:
        table = learned.resistance(profiles.tables, joint.variant, j, joint.s, v)
        pushed = learned.push(
            n[int(Number.LEARNED_FORCE_STRENGTH), w, j] * table,
            n[int(Number.LEARNED_FORCE_STIFFNESS), w, j],
            n[int(Number.LEARNED_FORCE_CHANGE), w, j],
            n[int(Number.LEARNED_FORCE_TIME), w, j],
            h,
            v,
            profiles.state[int(State.REMEMBERED), w, j],
        )
        spring += pushed[0]
        yielding += pushed[1]
        joint.damping = n[int(Number.DAMPING_STRENGTH), w, j] * value(
            profiles.curves, joint.variant, j, int(Curve.DAMPING), joint.s
        )
    if joint.rubs != 0:
        joint.friction = n[int(Number.FRICTION_STRENGTH), w, j] * value(
            profiles.curves, joint.variant, j, int(Curve.FRICTION), joint.s
        )
    if row >= 0:
        joint.friction += dof_frictionloss[w % dof_frictionloss.shape[0], dof]

    applied = qfrc_applied[w, dof]
    load = n[int(Number.BACKLASH_LOAD), w, j]
    external = float(applied)
    if coefficient > 0.0 or load > 0.0:
        body, hinge = profiles.places[j, int(Place.BODY)], profiles.places[j, int(Place.HINGE)]
        axis, anchor = xaxis[w, id], xanchor[w, id]
        if (disabled & NO_GRAVITY) == 0:
            weight = body_subtreemass[w % body_subtreemass.shape[0], body]
            pull = weight * gravity[w % gravity.shape[0]]
            external += exerted(hinge, axis, anchor, pull, subtree_com[w, body])
        if jnt_actgravcomp[id] == 0:  # else it is the actuator's
            external += qfrc_gravcomp[w, dof]
        for b in range(body, profiles.places[j, int(Place.LAST_BODY)] + 1):
            push = xfrc_applied[w, b]
            external += exerted(hinge, axis, anchor, wp.spatial_top(push), xipos[w, b])
            if hinge != 0:
                external += wp.dot(axis, wp.spatial_bottom(push))
        joint.load = external + profiles.state[int(State.UNKNOWN_LOAD), w, j]

    own = resist(profiles, joint, v)
    play = n[int(Number.BACKLASH_PLAY), w, j]
    passage = laws.alone()
    force = float(0.0)
    if load > 0.0:
        passage = laws.meet(
            play,
            load,
            n[int(Number.BACKLASH_SHARE), w, j],
            h,
            profiles.inertia[j],
            spring + external,
            v,
            own,
            yielding,
            resist(profiles, joint, v + speed),
            gap,
            speed,
        )
        force = passage.force + (passage.scale - 1.0) * external
        spring *= passage.scale
        yielding *= passage.scale
        profiles.state[int(State.NEXT_SIDE), w, j] = passage.side
        profiles.state[int(State.NEXT_GAP), w, j] = passage.gap
        profiles.state[int(State.NEXT_SPEED), w, j] = passage.speed
    against = passage.resistance * own
    drag = against[0] + yielding
    dry = wp.where(v < 0.0, against[2], against[1])

    beside = float(0.0)
    if row >= 0:
        bound = 0.5 * (against[1] + against[2])
        psi = wp.clamp(held, -bound, bound)
        D = laws.STIFF_ROW * inertia
        bristles = passage.resistance * n[int(Number.PRESLIDING_FRICTION_STIFFNESS), w, j]
        if bristles > 0.0:
            breakaway = n[int(Number.PRESLIDING_FRICTION_BREAKAWAY), w, j]
            left = laws.bristle_left(breakaway, psi, bound, v)
            D = laws.bristle_row(left, h, bristles, inertia)
            if joint.damps != 0:
                rate = n[int(Number.PRESLIDING_FRICTION_DAMPING), w, j]
                drag += passage.resistance * rate * left
            # near slip a soft row that holds so much would cost so much that float32 loses the
            # others: what it held acts beside it, and the row adds what the bristles still can
            ahead = v + h * qacc_warmstart[w, dof]
            if psi * ahead < 0.0 and bound * bound > D * laws.MOST_COST:
                beside = psi
                bound -= wp.abs(psi)
                psi = 0.0
        efc_D[w, row] = D
        efc_aref[w, row] = psi / D - v / h
        efc_frictionloss[w, row] = bound
        force += beside + 0.5 * (against[2] - against[1])  # as the row is symmetric
        dry = 0.0
    profiles.state[int(State.BESIDE_ROW), w, j] = beside
    if damping_row >= 0:
        efc_D[w, damping_row] = wp.max(h * drag, laws.IDLE_ROW * inertia)
        efc_aref[w, damping_row] = -v / h
        drag = 0.0
    else:
        spring /= 1.0 + h * yielding / inertia
    force += laws.resisting(dry, drag, v, h, inertia)

    inertia_before = n[int(Number.BACKLASH_HANDLE), w, j]
    if inertia_before > 0.0:
        moved = laws.handle(play, inertia_before, h, applied, v, gap, speed)
        force += moved[0] - applied
        profiles.state[int(State.NEXT_GAP), w, j] = moved[1]
        profiles.state[int(State.NEXT_SPEED), w, j] = moved[2]
    qfrc_passive[w, dof] += spring + force

    damping = wp.where(side > 0.0, low, high)
    if stop >= 0 and damping >= 0.0:
        depth = efc_pos[w, stop] - efc_margin[w, stop]
        efc_D[w, stop] = laws.STOP_IMPEDANCE / (1.0 - laws.STOP_IMPEDANCE) * inertia
        efc_aref[w, stop] = (
            -damping / (laws.STOP_IMPEDANCE * h) * side * v - laws.STOP_STIFFNESS / (h * h) * depth
        )


@wp.kernel(enable_backward=False)
def forget(mask: wp.array[bool], profiles: Profiles):
    """Makes the joints of the masked worlds begin anew; dimensions (worlds, joints)."""
    w, j = wp.tid()
    if mask[w]:
        profiles.state[int(State.TIME), w, j] = -1.0


def launch(m: Any, d: Any, profiles: Profiles) -> None:
    """The law for a step of mujoco_warp whose rows and passive forces are made."""
    efc = d.efc
    wp.launch(
        act,
        dim=profiles.rows.shape[1:],
        inputs=[
            *(m.opt.disableflags, m.opt.timestep, m.opt.gravity, m.body_subtreemass),
            *(m.jnt_range, m.dof_frictionloss, m.dof_invweight0, m.jnt_actgravcomp),
            *(
                d.time,
                d.qpos,
                d.qvel,
                d.qacc_warmstart,
                d.qfrc_applied,
                d.xfrc_applied,
                d.qfrc_gravcomp,
                d.qfrc_actuator,
                d.qfrc_constraint,
                d.xipos,
                d.xanchor,
                d.xaxis,
                d.subtree_com,
            ),
            *(d.ne, d.nf, d.nl, efc.type, efc.id, efc.pos, efc.margin, efc.force),
            profiles,
        ],
        outputs=[efc.D, efc.aref, efc.frictionloss, d.qfrc_passive],
        device=d.qpos.device,
    )
