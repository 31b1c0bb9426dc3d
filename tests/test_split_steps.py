"""Effects with a state, however MuJoCo's step is taken: in halves, looked at, copied, restored."""

import mujoco
import numpy as np
import pytest
from joints import DISCRETE, SPRING, flat, has, needs
from mujoco import rollout
from test_corners import MASS, H, pushed, slide

ALL = (
    "presliding_friction stiffness=300 damping=0.4 breakaway=0.5; backlash play=0.02 inertia=0.05;"
    f"stribeck_friction velocity=0.05: {flat(0.4)}; load_dependent_friction coefficient=0.1;"
    f"asymmetric_friction direction=negative: {flat(0.2)}; quadratic_damping direction=both: "
    f"{flat(0.5)}"
)
BEHIND = ALL.replace("inertia=0.05", "inertia=0.5 side=motor share=0.7")
SIDES = pytest.mark.parametrize("effects", [ALL, BEHIND], ids=["handle", "load"])
INTEGRATORS = ("Euler", "implicit", "implicitfast")
STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def wobble(time):
    return 3 * np.sin(7 * time) + 2 * np.sin(17 * time)


def path_of(model, step, count=500):
    """Positions and plugin states under `wobble`, where `step` sets the force and steps."""
    data = mujoco.MjData(model)
    rows = []
    for _ in range(count):
        step(model, data, wobble(data.time))
        rows.append([*data.qpos, *data.plugin_state])
    return np.array(rows)


def whole(model, data, force):
    data.qfrc_applied[0] = force
    mujoco.mj_step(model, data)


def split(model, data, force):
    data.qfrc_applied[0] = force
    mujoco.mj_step1(model, data)
    mujoco.mj_step2(model, data)


def between(model, data, force):
    mujoco.mj_step1(model, data)
    data.qfrc_applied[0] = force
    mujoco.mj_step2(model, data)


def with_forward(model, data, force):
    """Looks at the state in every way before the step."""
    data.qfrc_applied[0] = -2 * force
    mujoco.mj_forward(model, data)
    data.qfrc_applied[0] = force
    for _ in range(3):
        mujoco.mj_forward(model, data)
    mujoco.mj_inverse(model, data)
    mujoco.mj_step1(model, data)
    whole(model, data, force)


def in_a_copy(model, data, force):
    """Goes on in a copy that is made between the halves of a step, and comes back."""
    other = mujoco.MjData(model)
    data.qfrc_applied[0] = force
    mujoco.mj_step1(model, data)
    mujoco.mj_copyData(other, model, data)
    mujoco.mj_step2(model, other)
    mujoco.mj_copyData(data, model, other)


def by_state(model, data, force):
    """Takes the step in other data that know the state only, and takes the state back."""
    other = mujoco.MjData(model)
    state = np.empty(mujoco.mj_stateSize(model, STATE))
    for source, target in ((data, other), (other, data)):
        if source is other:
            whole(model, other, force)
        mujoco.mj_getState(model, source, state, STATE)
        mujoco.mj_setState(model, target, state, STATE)


STEPS = [split, with_forward, pytest.param(in_a_copy, marks=needs("mj_copyData")), by_state]
"""Ways to take a step."""
ROUNDING = 0 if has(SPRING) else 1e-12
"""Before 3.3.6, MuJoCo's own friction too goes on a little differently after mj_forward."""


@pytest.mark.slow
@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("integrator", INTEGRATORS)
@SIDES
def test_however_a_step_is_taken_it_is_the_same(integrator, step, effects):
    model, _ = slide(effects, friction=0.5, integrator=integrator)
    expected = path_of(model, whole)
    assert np.ptp(expected[:, 0]) > 0.1
    np.testing.assert_allclose(path_of(model, step), expected, rtol=0, atol=ROUNDING)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@SIDES
def test_looking_does_not_advance_a_state(integrator, effects):
    model, data = slide(effects, friction=0.5, integrator=integrator)
    pushed(model, data, 0.3, 2)
    pushed(model, data, 0.004, -40)
    before = data.plugin_state.copy()
    assert (before[:3] != 0).all()
    mujoco.mj_step1(model, data)
    mujoco.mj_inverse(model, data)
    for _ in range(5):
        mujoco.mj_forward(model, data)
        np.testing.assert_array_equal(data.plugin_state, before)
    mujoco.mj_inverse(model, data)
    assert data.qfrc_inverse[0] == pytest.approx(-40, abs=1e-9)
    np.testing.assert_array_equal(data.plugin_state, before)
    mujoco.mj_resetData(model, data)
    assert not data.plugin_state.any()


def test_a_rollout_goes_on_from_the_state():
    model, data = slide(ALL, friction=0.5, integrator="Euler")
    expected = path_of(model, whole, 400)
    half = rollout.rollout(model, data, _state(model), _pushes(0, 200), control_spec=int(APPLIED))[
        0
    ][:, -1]
    rest = rollout.rollout(model, data, half, _pushes(200, 400), control_spec=int(APPLIED))[0]
    assert rest[0, :, 1] == pytest.approx(expected[200:, 0], abs=1e-12)


APPLIED = mujoco.mjtState.mjSTATE_QFRC_APPLIED


def _state(model):
    state = np.empty((1, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    mujoco.mj_getState(model, mujoco.MjData(model), state[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    return state


def _pushes(first, last):
    return wobble(H * np.arange(first, last))[None, :, None]


@pytest.mark.parametrize(
    "integrator", ["Euler", "implicitfast", pytest.param("discrete", marks=needs(DISCRETE))]
)
def test_a_force_set_between_the_halves_of_a_step_goes_through_the_play(integrator):
    """The part is moved by the first step's h^2 F / m and no more, until the handle meets it."""
    force, inertia, play = 4.0, 0.3, 0.1
    model, data = slide(f"backlash play={play} inertia={inertia}", integrator=integrator)
    for _ in range(int(0.98 * np.sqrt(play * inertia / force) / H)):
        between(model, data, force)
    assert data.qpos[0] == pytest.approx(H**2 * force / MASS, rel=1e-3)
    assert abs(data.qvel[0]) < 1e-12
    expected = path_of(model, whole)[:, 0]
    assert np.abs(path_of(model, between)[:, 0] - expected).max() < 1e-3 * np.ptp(expected)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_a_force_set_between_the_halves_of_a_step_moves_a_part_without_its_load(integrator):
    """One step late."""
    effect = "backlash play=0.1 inertia=0.6 side=motor share=0.5"
    model, data = slide(effect, integrator=integrator)
    for _ in range(20):
        between(model, data, 4.0)
    assert data.qvel[0] == pytest.approx(20 * H * 4.0 / (MASS - 0.6), rel=1e-9)
    expected = path_of(model, whole)[:, 0]
    assert np.abs(path_of(model, between)[:, 0] - expected).max() < 0.02 * np.ptp(expected)


def test_a_force_set_by_the_control_callback_goes_through_the_play():
    model, _ = slide("backlash play=0.1 inertia=0.3", integrator="Euler")
    expected = path_of(model, whole)[:, 0]
    data, path = mujoco.MjData(model), []
    mujoco.set_mjcb_control(lambda m, d: d.qfrc_applied.__setitem__(0, wobble(d.time)))
    try:
        for _ in range(500):
            mujoco.mj_step(model, data)
            path.append(data.qpos[0])
    finally:
        mujoco.set_mjcb_control(None)
    assert np.abs(path - expected).max() < 1e-3 * np.ptp(expected)
