"""How a joint behaves against closed forms: a mass on a slide of one metre."""

from itertools import pairwise

import mujoco
import numpy as np
import pytest

from joda import context
from joda.component import Component
from joda.interaction.behaviour import AT_END, STARTS, behaviour
from joda.interaction.hand import pull
from joda.interaction.pulling import GRIP, grip
from joda.profile import Channel, Channels, Profile, Resistance

SLIDE = """
<mujoco><compiler angle="radian"/><worldbody><body>
  <joint name="j" type="slide" axis="1 0 0" range="{0} {1}" ref="{2}"/>
  <geom type="box" size=".1 .1 .1" mass="{mass}"/></body></worldbody></mujoco>"""
SPACING = 1 / 60


def curve(y, interval=(0.0, 1.0), x=None) -> Component:
    """Through these values, evenly spaced unless x says otherwise."""
    values = tuple(float(value) for value in y)
    places = tuple(np.linspace(0, 1, len(values)).tolist()) if x is None else tuple(x)
    return Component(interval=interval, x=places, y=values)


def steady(value: float) -> Component:
    return curve((value, value))


def mirrored(component: Component, sign: int) -> Component:
    a, b = component.interval
    return Component(
        interval=(1 - b, 1 - a),
        x=tuple(1 - x for x in reversed(component.x)),
        y=tuple(sign * y for y in reversed(component.y)),
    )


def joint(folder, conservative=(), friction=(), damping=(), *, mass=1.0, mirror=False, ref=0.0):
    """Context and profile; the mirrored one is closed at its high end."""
    if mirror:
        conservative = [mirrored(c, -1) for c in conservative]
        friction, damping = ([mirrored(c, 1) for c in part] for part in (friction, damping))
    path = folder / "slide.xml"
    path.write_text(
        SLIDE.format(*((-1, 0) if mirror else (0, 1)), -ref if mirror else ref, mass=mass)
    )
    found = context(path, "j")
    channels = Channels(
        conservative=Channel(components=tuple(conservative)),
        friction=Resistance(components=tuple(friction)),
        damping=Resistance(components=tuple(damping)),
    )
    return found, Profile(joint=found.joint, channels=channels)


def behave(folder, *args, **kwargs):
    return behaviour(*joint(folder, *args, **kwargs))


def goes(behaved) -> list[str]:
    return [stretch.goes for stretch in behaved.let_go]


@pytest.mark.parametrize("friction", [1.0, 4.0, 7.0])
def test_a_magnet_pulls_from_where_it_exceeds_friction(tmp_path, friction):
    """10 N (1 - s / 0.4) against f: it closes up to s = 0.4 (1 - f / 10)."""
    found = behave(tmp_path, [curve((-10, 0), (0, 0.4))], [steady(friction)], [steady(2)])
    assert goes(found) == ["stays", "low_end", "stays"]
    boundary = 0.4 * (1 - friction / 10)
    _, closes, stays = found.let_go
    assert closes.start[1] <= boundary + 0.1 * SPACING
    assert stays.start[0] >= boundary - 0.1 * SPACING
    assert stays.start[0] - closes.start[1] == pytest.approx(SPACING, abs=1e-3)
    assert stays.start[1] == 1


def test_friction_alone_holds_everywhere(tmp_path):
    found = behave(tmp_path, friction=[steady(5)])
    assert [(s.start, s.goes) for s in found.let_go] == [((0, 1), "stays")]
    assert (found.settles_at, found.fastest) == ((), None)
    assert found.opening.middle == pytest.approx(5, rel=0.02)
    assert found.closing.middle == pytest.approx(5, rel=0.02)
    assert (found.opening.arrived, found.opening.snaps_at) == (True, ())


def test_a_toggle_has_two_sides(tmp_path):
    found = behave(tmp_path, [curve((-5, 5))], [steady(0.01)], [steady(3)])
    lows = [s for s in found.let_go if s.goes == "low_end"]
    highs = [s for s in found.let_go if s.goes == "high_end"]
    assert (len(lows), len(highs)) == (1, 1)
    assert lows[0].start[1] == pytest.approx(0.5 - SPACING, abs=1e-3)
    assert highs[0].start[0] == pytest.approx(0.5 + SPACING, abs=1e-3)
    assert found.after(0.2).goes == "low_end" and found.after(0.9).goes == "high_end"


@pytest.mark.parametrize("count", [1, 3, 5])
def test_detents_are_found_at_their_centres(tmp_path, count):
    edges = np.linspace(0.05, 0.95, count + 1)
    clicks = [curve((0, 8, 0, -8, 0), (a, b)) for a, b in pairwise(edges)]
    found = behave(tmp_path, clicks, [steady(0.2)], [steady(3)])
    assert found.settles_at == pytest.approx((edges[1:] + edges[:-1]) / 2, abs=0.01)


@pytest.mark.parametrize("way", ["opening", "closing"])
def test_a_barrier_is_passed_up_to_the_strength_of_a_hand(tmp_path, way):
    """A hand does 60 N on a slide."""
    sign = -1 if way == "opening" else 1
    for barrier, passes in [(0.9 * GRIP, True), (1.1 * GRIP, False)]:
        wall = curve((0, sign * barrier, sign * barrier, 0), (0.4, 0.6))
        found = behave(tmp_path, [wall], [steady(0.5)], [steady(1)], mass=0.3)
        pulled = getattr(found, way)
        assert pulled.arrived is passes
        assert pulled.force == pytest.approx(min(barrier + 0.5 + 1 / 3, GRIP), rel=0.02)
        assert 0.4 < pulled.at < 0.6
        assert getattr(found, "closing" if way == "opening" else "opening").arrived


def test_the_hand_takes_on_twice_the_weight(tmp_path):
    path = tmp_path / "lift.xml"
    path.write_text(SLIDE.format(0, 1, 0, mass=20).replace("1 0 0", "0 0 1"))
    assert grip(context(path, "j")) == pytest.approx(2 * 20 * 9.81)
    assert grip(joint(tmp_path)[0]) == GRIP


@pytest.mark.parametrize("mass", [0.5, 4.0])
@pytest.mark.parametrize("force", [2.0, 10.0])
def test_closing_under_a_constant_force_is_a_free_fall(tmp_path, force, mass):
    """Over d = 0.99 m: arrives with sqrt(2 F d / m) after sqrt(2 m d / F)."""
    found = behave(tmp_path, [steady(-force)], mass=mass)
    way = 1 - AT_END
    assert found.fastest.start > 0.95
    assert found.fastest.speed == pytest.approx(np.sqrt(2 * force * way / mass), rel=0.02)
    assert found.fastest.seconds == pytest.approx(np.sqrt(2 * mass * way / force), rel=0.02)


def test_closing_against_damping_is_at_terminal_speed(tmp_path):
    found = behave(tmp_path, [steady(-5)], damping=[steady(20)])
    assert found.fastest.speed == pytest.approx(5 / 20, rel=0.02)


def test_the_speed_of_closing_is_that_of_arrival(tmp_path):
    """5 N all the way against 2 N s/m, and 50 N s/m over the last fifth: 0.1 m/s, not 1 m/s."""
    brake = curve((50, 50), (0, 0.2))
    found = behave(tmp_path, [steady(-5)], damping=[steady(2), brake])
    assert found.fastest.speed == pytest.approx(5 / 52, rel=0.03)


def test_a_joint_runs_ahead_of_the_hand_past_a_barrier(tmp_path):
    hump = curve((0, -40, 0, 40, 0), (0.45, 0.55))  # 1600 N/m, the hand has 1000 N/m
    found = behave(tmp_path, [hump], [steady(0.2)], [steady(2)], mass=0.2)
    (at,) = found.opening.snaps_at
    assert 0.45 < at < 0.55
    gentle = curve((0, -40, 0, 40, 0), (0.2, 0.8))  # 270 N/m
    assert behave(tmp_path, [gentle], [steady(0.2)], [steady(2)], mass=0.2).opening.snaps_at == ()


def test_first_middle_and_last_are_of_those_parts_of_the_way(tmp_path):
    """Plateaus of friction: 8 N, 2 N, 5 N from the closed end."""
    parts = [
        curve((v, v), place) for v, place in [(8, (0, 0.15)), (2, (0.151, 0.849)), (5, (0.85, 1))]
    ]
    found = behave(tmp_path, friction=parts, damping=[steady(1)], mass=0.1)
    one, other = found.opening, found.closing
    assert (one.middle, other.middle) == pytest.approx((2 + 1 / 3, 2 + 1 / 3), rel=0.03)
    assert (one.first, one.last) == pytest.approx((8 + 1 / 3, 5 + 1 / 3), rel=0.1)
    assert (other.first, other.last) == pytest.approx((5 + 1 / 3, 8 + 1 / 3), rel=0.1)


def test_a_joint_closed_at_its_high_end_is_the_mirror_image(tmp_path):
    parts = (
        [
            curve((-12, -3, 0), (0, 0.3)),
            curve((0, 6, 0, -6, 0), (0.5, 0.8)),
            curve((2, 4), (0.9, 1)),
        ],
        [steady(1), curve((0, 2), (0.2, 0.6))],
        [curve((4, 1))],
    )
    low, high = (behave(tmp_path, *parts, mirror=mirror) for mirror in (False, True))
    assert (low.closed_end, high.closed_end) == ("low_end", "high_end")
    swap = {"low_end": "high_end", "high_end": "low_end"}
    turned = [
        ((round(1 - b, 4), round(1 - a, 4)), swap.get(goes, goes))
        for (a, b), goes in ((s.start, s.goes) for s in reversed(high.let_go))
    ]
    assert turned == [((round(s.start[0], 4), round(s.start[1], 4)), s.goes) for s in low.let_go]
    assert {"low_end", "high_end", "settles", "stays"} <= {s.goes for s in low.let_go}
    assert [1 - s for s in reversed(high.settles_at)] == pytest.approx(low.settles_at, abs=2e-4)
    assert high.fastest.start == pytest.approx(1 - low.fastest.start, abs=2e-4)
    assert high.fastest.speed == pytest.approx(low.fastest.speed, rel=1e-3)
    for one, other in ((low.opening, high.opening), (low.closing, high.closing)):
        assert other.force == pytest.approx(one.force, rel=1e-3)
        assert other.at == pytest.approx(1 - one.at, abs=1e-3)
        assert (other.first, other.middle, other.last) == pytest.approx(
            (one.first, one.middle, one.last), rel=1e-3, abs=1e-3
        )


def test_the_facts_are_told_in_words(tmp_path):
    found, given = joint(tmp_path, [curve((-10, 0), (0, 0.4))], [steady(4)], [steady(2)])
    text = behaviour(found, given).describe(found)
    assert "s = 0.0167 to 0.233: closes" in text
    assert "opening it slowly by hand: at most" in text
    blocked = behaviour(found, joint(tmp_path, [steady(-2 * GRIP)])[1]).describe(found)
    assert "impossible, stuck at s = 0.00 with 60 N" in blocked


def test_every_start_belongs_to_exactly_one_stretch(tmp_path):
    found = behave(tmp_path, [curve((-12, 5, -5, 3, 8))], [steady(1)], [steady(2)])
    inside = [
        sum(a - 1e-4 <= s <= b + 1e-4 for a, b in (x.start for x in found.let_go)) for s in STARTS
    ]
    assert inside == [1] * len(STARTS)


@pytest.mark.parametrize("way", [0.002, 0.02, 0.5])
def test_a_hand_soon_pulls_with_all_its_strength_at_what_does_not_move(way):
    """Also at a button, whose way is short, so that its slow target would take half a minute."""
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body><joint type="slide" axis="1 0 0" range="0 {way}" '
        'damping="1e7"/><geom size=".05" mass=".2"/></body></worldbody></mujoco>'
    )
    motion = pull(model, 0, 0.0, way, 60.0, 1000.0, 3.0)
    assert motion.force.max() == pytest.approx(60.0)
    assert motion.time[-1] < 10.5
