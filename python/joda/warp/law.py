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
from joda.warp.curves import Curves, Values, max_stiffness, values
from joda.warp.numbers import Curve, Number, Place, Row, State

wp.set_module_options({"max_unroll": max(len(Number), len(State))})
Numbers = wp.types.vector(length=len(Number), dtype=float)
"""All numbers of a joint in a world, by `Number`."""
Memory = wp.types.vector(length=len(State), dtype=float)
"""What a joint in a world remembers, by `State`."""

BLOCK = 64
"""Threads of a block: the kernel keeps so much in registers that larger ones leave
multiprocessors without work."""
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
        rebounds: restitution of an end stop by its damping, see `laws.stop_damping`.
    """

    curves: Curves
    tables: learned.Tables
    numbers: wp.array3d[float]
    state: wp.array3d[float]
    rows: wp.array3d[int]
    places: wp.array2d[int]
    inertia: wp.array[float]
    rebounds: wp.array[float]


@wp.struct
class Resisting:
    """Of a joint in a step: what resists it, at any speed.

    Attributes:
        damping, friction: at any speed.
        load: that friction depends on.
        damps, rubs: 0 where the model switches damping or friction off.
    """

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
    if expected >= first and expected < end:
        expected_kind, expected_id = kinds[expected], ids[expected]
        if expected_kind == kind and expected_id == id:
            return expected
    for row in range(first, end):
        if ids[row] == id and kinds[row] == kind:
            return row
    return -1


@wp.func
def along(curves: Values, up: int, v: float) -> float:
    """A curve of the direction of the motion, of two that follow each other; 0 at rest."""
    if wp.abs(v) < laws.STILL:
        return 0.0
    return wp.where(v < 0.0, curves[up + 1], curves[up])


@wp.func
def resist(n: Numbers, curves: Values, joint: Resisting, v: float) -> wp.vec3:
    """Damping, and friction in positive and in negative motion, of the joint that moves at v."""
    drag = joint.damping
    if joint.damps != 0:
        directed = n[int(Number.DIRECTION_DEPENDENT_DAMPING_STRENGTH)]
        quadratic = n[int(Number.QUADRATIC_DAMPING_STRENGTH)]
        extra = directed * along(curves, int(Curve.DAMPING_UP), v) + wp.abs(v) * (
            quadratic * along(curves, int(Curve.QUADRATIC_UP), v)
        )
        drag += wp.max(0.0, extra)
    if joint.rubs == 0:
        return wp.vec3(drag, joint.friction, joint.friction)
    both = (
        joint.friction
        + laws.stribeck_friction(
            n[int(Number.STRIBECK_FRICTION_STRENGTH)] * curves[int(Curve.STRIBECK)],
            n[int(Number.STRIBECK_FRICTION_VELOCITY)],
            n[int(Number.STRIBECK_FRICTION_EXPONENT)],
            v,
        )
        + n[int(Number.LOAD_DEPENDENT_FRICTION_COEFFICIENT)] * wp.abs(joint.load)
    )
    strength = n[int(Number.ASYMMETRIC_FRICTION_STRENGTH)]
    up = strength * curves[int(Curve.ASYMMETRY_UP)]
    down = strength * curves[int(Curve.ASYMMETRY_DOWN)]
    return wp.vec3(drag, wp.max(0.0, both + up), wp.max(0.0, both + down))


@wp.func
def exerted(hinge: int, axis: wp.vec3, anchor: wp.vec3, force: wp.vec3, point: wp.vec3) -> float:
    """What of a force at a point acts along a joint, N·m or N."""
    if hinge != 0:
        return wp.dot(wp.cross(axis, point - anchor), force)
    return wp.dot(axis, force)


@wp.func
def implicit_stiffness(
    curves: Curves,
    variant: int,
    joint: int,
    n: Numbers,
    s: float,
    field: bool,
    h: float,
    v: float,
    force: float,
    inertia: float,
) -> float:
    """The part of the springs that must act implicitly, N·m/rad: as in cpp/stiffness.h."""
    per_range = 1.0 / (n[int(Number.RANGE_HI)] - n[int(Number.RANGE_LO)])
    soft = laws.EXPLICIT_STIFFNESS * inertia / (h * h)
    sine, cosine = n[int(Number.GRAVITY_OFFSET_SIN)], n[int(Number.GRAVITY_OFFSET_COS)]
    gravity = wp.sqrt(sine * sine + cosine * cosine)
    landing = s + h * (v + h / inertia * force) * per_range
    if (s < 0.0 and landing < 0.0) or (s > 1.0 and landing > 1.0):
        return wp.max(0.0, gravity - soft)
    strength = n[int(Number.CONSERVATIVE_STRENGTH)] * per_range
    steepest = float(0.0)
    if field:
        steepest = strength * curves.steepest[variant, joint]
    stiffness = wp.abs(force) * per_range / laws.STRIDE
    if steepest + gravity > soft:
        reach = h * (wp.abs(v) + h / inertia * wp.abs(force)) * per_range
        near = strength * max_stiffness(curves, variant, joint, s - reach, s + reach)
        stiffness = wp.max(stiffness, gravity + wp.min(near, steepest))
    return wp.max(0.0, stiffness - soft)


@wp.func
def force_of(row: int, forces: wp.array[float]) -> float:
    """The force of a row in the last step, 0 where there was none."""
    return wp.where(row >= 0, forces[wp.max(row, 0)], 0.0)


@wp.func
def recall(
    before: Memory,
    n: Numbers,
    rows: wp.vec3i,
    t: float,
    h: float,
    v: float,
    forces: wp.array[float],
    constraint: float,
    actuator: float,
) -> Memory:
    """What the joint remembers of the last step, if one was taken; nothing if it was reset."""
    seen = before[int(State.TIME)]
    if seen < 0.0 or t < seen:
        return Memory()
    out = before
    if t > seen:
        psi = force_of(rows[int(Row.FRICTION)], forces)
        damping = force_of(rows[int(Row.DAMPING)], forces)
        limit = force_of(rows[int(Row.LIMIT)], forces)
        own = psi + damping + before[int(State.STOP_SIDE)] * limit
        out[int(State.FRICTION)] = psi + before[int(State.BESIDE_ROW)]
        out[int(State.UNKNOWN_LOAD)] = constraint - own - actuator
        gap, speed = before[int(State.NEXT_GAP)], before[int(State.NEXT_SPEED)]
        out[int(State.GAP)] = gap
        out[int(State.SPEED)] = speed
        if n[int(Number.BACKLASH_LOAD)] > 0.0:
            side = before[int(State.NEXT_SIDE)]
            after = laws.settle(n[int(Number.BACKLASH_PLAY)], h, side, gap, speed, v)
            out[int(State.GAP)] = after[0]
            out[int(State.SPEED)] = after[1]
        out[int(State.REMEMBERED)] = learned.remember(
            n[int(Number.LEARNED_FORCE_CHANGE)],
            n[int(Number.LEARNED_FORCE_TIME)],
            h,
            v,
            before[int(State.REMEMBERED)],
        )
    return out


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
    """One joint in one world; dimensions (worlds, joints).

    All is read before anything is written, so that a device waits for memory as seldom as it can.
    """
    w, j = wp.tid()
    n = Numbers()
    for number in range(wp.static(len(Number))):
        n[number] = profiles.numbers[number, w, j]
    before = Memory()
    for number in range(wp.static(len(State))):
        before[number] = profiles.state[number, w, j]
    rows = wp.vec3i(profiles.rows[0, w, j], profiles.rows[1, w, j], profiles.rows[2, w, j])
    id, dof = profiles.places[j, int(Place.JOINT)], profiles.places[j, int(Place.DOF)]
    equality = profiles.places[j, int(Place.EQUALITY)]
    equalities, ends, limited = ne[w], ne[w] + nf[w], nl[w]
    t, h = time[w], timestep[w % timestep.shape[0]]
    q, v = qpos[w, profiles.places[j, int(Place.QPOS)]], qvel[w, dof]
    inertia = 1.0 / dof_invweight0[w % dof_invweight0.shape[0], dof]
    limits = jnt_range[w % jnt_range.shape[0], id]
    native = dof_frictionloss[w % dof_frictionloss.shape[0], dof]
    constraint, actuator = qfrc_constraint[w, dof], qfrc_actuator[w, dof]
    applied = qfrc_applied[w, dof]
    ahead = v + h * qacc_warmstart[w, dof]
    memory = recall(before, n, rows, t, h, v, efc_force[w], constraint, actuator)
    held, gap, speed = (
        memory[int(State.FRICTION)],
        memory[int(State.GAP)],
        memory[int(State.SPEED)],
    )

    variant = w % profiles.curves.where.shape[0]
    lo, hi = n[int(Number.RANGE_LO)], n[int(Number.RANGE_HI)]
    s = (q - lo) / (hi - lo)
    curves = values(profiles.curves, variant, j, s)
    joint = Resisting()
    joint.damps = wp.where((disabled & NO_DAMPER) == 0, 1, 0)
    joint.rubs = wp.where((disabled & NO_FRICTION) == 0, 1, 0)

    kinds, ids = efc_type[w], efc_id[w]
    row = find_row(kinds, ids, equalities, ends, rows[int(Row.FRICTION)], FRICTION, dof)
    damping_row = int(-1)
    if equality >= 0:
        expected = rows[int(Row.DAMPING)]
        damping_row = find_row(kinds, ids, 0, equalities, expected, EQUALITY, equality)
    coefficient = n[int(Number.LOAD_DEPENDENT_FRICTION_COEFFICIENT)]
    low, high = n[int(Number.END_STOP_RESTITUTION_LOW)], n[int(Number.END_STOP_RESTITUTION_HIGH)]
    side = wp.where(q - limits[0] < limits[1] - q, 1.0, -1.0)
    stop = int(-1)
    if coefficient > 0.0 or low >= 0.0 or high >= 0.0:
        stop = find_row(kinds, ids, ends, ends + limited, -1, LIMIT, id)

    sine, cosine = n[int(Number.GRAVITY_OFFSET_SIN)], n[int(Number.GRAVITY_OFFSET_COS)]
    spring = float(n[int(Number.GRAVITY_OFFSET_FORCE)])
    if sine != 0.0 or cosine != 0.0:
        spring += sine * wp.sin(q) + cosine * wp.cos(q)
    field = (disabled & NO_SPRING) == 0
    if field:
        spring += n[int(Number.CONSERVATIVE_STRENGTH)] * curves[int(Curve.CONSERVATIVE)]
    yielding = h * implicit_stiffness(
        profiles.curves, variant, j, n, s, field, h, v, spring, inertia
    )
    if joint.damps != 0:
        table = learned.resistance(profiles.tables, variant, j, s, v)
        pushed = learned.learned_force(
            n[int(Number.LEARNED_FORCE_STRENGTH)] * table,
            n[int(Number.LEARNED_FORCE_STIFFNESS)],
            n[int(Number.LEARNED_FORCE_CHANGE)],
            n[int(Number.LEARNED_FORCE_TIME)],
            h,
            v,
            memory[int(State.REMEMBERED)],
        )
        spring += pushed[0]
        yielding += pushed[1]
        joint.damping = n[int(Number.DAMPING_STRENGTH)] * curves[int(Curve.DAMPING)]
    if joint.rubs != 0:
        joint.friction = n[int(Number.FRICTION_STRENGTH)] * curves[int(Curve.FRICTION)]
    if row >= 0:
        joint.friction += native

    load = n[int(Number.BACKLASH_LOAD)]
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
        joint.load = external + memory[int(State.UNKNOWN_LOAD)]

    own = resist(n, curves, joint, v)
    play = n[int(Number.BACKLASH_PLAY)]
    passage = laws.alone()
    force = float(0.0)
    if load > 0.0:
        passage = laws.meet(
            play,
            load,
            n[int(Number.BACKLASH_SHARE)],
            h,
            profiles.inertia[j],
            spring + external,
            v,
            own,
            yielding,
            resist(n, curves, joint, v + speed),
            gap,
            speed,
        )
        force = passage.force + (passage.scale - 1.0) * external
        spring *= passage.scale
        yielding *= passage.scale
    against = passage.resistance * own
    drag = against[0] + yielding
    dry = wp.where(v < 0.0, against[2], against[1])

    beside = float(0.0)
    bound = float(0.0)
    stiffness = float(0.0)
    toward = float(0.0)
    if row >= 0:
        bound = 0.5 * (against[1] + against[2])
        psi = wp.clamp(held, -bound, bound)
        stiffness = laws.STIFF_ROW * inertia
        bristles = passage.resistance * n[int(Number.PRESLIDING_FRICTION_STIFFNESS)]
        if bristles > 0.0:
            breakaway = n[int(Number.PRESLIDING_FRICTION_BREAKAWAY)]
            left = laws.bristle_stiffness_scale(breakaway, psi, bound, v)
            stiffness = laws.bristle_stiffness_scale_in_row(left, h, bristles, inertia)
            if joint.damps != 0:
                rate = n[int(Number.PRESLIDING_FRICTION_DAMPING)]
                drag += passage.resistance * rate * left
            # near slip a soft row that holds so much would cost so much that float32 loses the
            # others: what it held acts beside it, and the row adds what the bristles still can
            if psi * ahead < 0.0 and bound * bound > stiffness * laws.MAX_COST:
                beside = psi
                bound -= wp.abs(psi)
                psi = 0.0
        toward = psi / stiffness - v / h
        force += beside + 0.5 * (against[2] - against[1])  # as the row is symmetric
        dry = 0.0
    implicit = wp.max(h * drag, laws.IDLE_ROW * inertia)
    if damping_row >= 0:
        drag = 0.0
    else:
        spring /= 1.0 + h * yielding / inertia
    force += laws.resisting(dry, drag, v, h, inertia)

    next_gap = float(passage.gap)
    next_speed = float(passage.speed)
    inertia_before = n[int(Number.BACKLASH_HANDLE)]
    if inertia_before > 0.0:
        moved = laws.backlash_force(play, inertia_before, h, applied, v, gap, speed)
        force += moved[0] - applied
        next_gap = moved[1]
        next_speed = moved[2]
    depth = float(0.0)
    if stop >= 0:
        depth = efc_pos[w, stop] - efc_margin[w, stop]

    qfrc_passive[w, dof] += spring + force
    if row >= 0:
        efc_D[w, row] = stiffness
        efc_aref[w, row] = toward
        efc_frictionloss[w, row] = bound
    if damping_row >= 0:
        efc_D[w, damping_row] = implicit
        efc_aref[w, damping_row] = -v / h
    restitution = wp.where(side > 0.0, low, high)
    if stop >= 0 and restitution >= 0.0:
        damping = laws.stop_damping(profiles.rebounds, restitution)
        efc_D[w, stop] = laws.STOP_IMPEDANCE / (1.0 - laws.STOP_IMPEDANCE) * inertia
        efc_aref[w, stop] = (
            -damping / (laws.STOP_IMPEDANCE * h) * side * v - laws.STOP_STIFFNESS / (h * h) * depth
        )
    profiles.rows[int(Row.FRICTION), w, j] = row
    profiles.rows[int(Row.DAMPING), w, j] = damping_row
    profiles.rows[int(Row.LIMIT), w, j] = stop
    memory[int(State.TIME)] = t
    memory[int(State.STOP_SIDE)] = side
    memory[int(State.BESIDE_ROW)] = beside
    memory[int(State.NEXT_SIDE)] = passage.side
    memory[int(State.NEXT_GAP)] = next_gap
    memory[int(State.NEXT_SPEED)] = next_speed
    for number in range(wp.static(len(State))):
        profiles.state[number, w, j] = memory[number]


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
        block_dim=BLOCK,
        device=d.qpos.device,
    )
