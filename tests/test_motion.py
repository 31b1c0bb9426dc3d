"""Playing a scene: contact forces, stops that a joint leans on, sudden motion, samples."""

import mujoco
import numpy as np
import pytest

from joda.scenes.motion import Motion, fast, leaning, outside, play, usual_speed

MASS = 3.0
VERTICAL = """
<mujoco><worldbody>{floor}<body pos="0 0 1">
  <joint name="j" type="slide" axis="0 0 1" range="{range}" damping="{damping}"/>
  <geom type="sphere" size=".1" mass="3"/></body></worldbody></mujoco>"""


def vertical(floor="", span="-0.5 0.5", damping=0):
    text = VERTICAL.format(floor=floor, range=span, damping=damping)
    return mujoco.MjModel.from_xml_string(text)


def motion(velocity, step=0.01) -> Motion:
    velocity = np.asarray(velocity, float)
    time = step * np.arange(len(velocity))
    return Motion(time, step * np.cumsum(velocity), velocity, np.zeros(len(velocity)))


def test_a_contact_that_carries_the_weight_is_a_force_from_outside():
    model = vertical('<geom type="plane" size="1 1 1" pos="0 0 0.7"/>', damping=20)
    played = play(model, 0, -0.15, duration=2.0)
    assert played.force[0] == 0
    assert played.force[-1] == pytest.approx(MASS * 9.81, rel=1e-3)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert outside(model, data, 0) == 0


def test_the_stop_of_the_joint_itself_is_not_outside():
    played = play(vertical(damping=20), 0, -0.4, duration=2.0)
    assert played.position[-1] == pytest.approx(-0.5, abs=0.01)
    assert np.all(played.force == 0)


def test_what_leans_on_its_stop_begins_at_rest():
    model = vertical(damping=20)
    start = leaning(model, 0, -0.5)
    assert -0.51 < start < -0.5
    assert np.ptp(play(model, 0, start, duration=0.5).position) < 1e-6
    assert np.ptp(play(model, 0, -0.5, duration=0.5).position) > 1e-4


def test_what_leans_on_nothing_begins_where_it_should():
    model = vertical()
    assert leaning(model, 0, 0.5) == 0.5  # falls away from that stop
    assert leaning(model, 0, -0.2) == -0.2


def test_samples_may_be_further_apart_than_steps():
    model = vertical(damping=3)
    fine, coarse = (play(model, 0, 0.4, duration=0.4, stride=k) for k in (1, 10))
    assert len(coarse.time) == 21
    for name in ("time", "position", "velocity"):
        assert getattr(coarse, name) == pytest.approx(getattr(fine, name)[::10])


def test_sudden_motion_is_above_three_times_the_usual_and_near_intervals_are_one():
    velocity = np.ones(100)
    velocity[20:24] = -3.5
    velocity[26:28] = 4
    velocity[60:70] = 3.01
    velocity[90] = 2.99
    found = fast(motion(velocity), 1.0)
    assert found == (pytest.approx((0.20, 0.27)), pytest.approx((0.60, 0.69)))
    assert fast(motion(velocity), 2.0) == ()
    assert fast(motion([5, 5, 1, 5]), 1.0) == (pytest.approx((0.0, 0.03)),)


def test_the_usual_speed_is_the_mean_while_it_moves():
    assert usual_speed(motion([0, 0, 2, -2, 4, 0.001])) == pytest.approx(8 / 3)
    assert usual_speed(motion([0, 0])) == 0
