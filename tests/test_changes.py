"""What changed between two profiles, as a list and as a picture."""

import numpy as np
import pytest

from joda.component import Component
from joda.field import evaluate
from joda.pictures.changes import changes, overlay
from joda.profile import CHANNELS, Channel, Channels, Joint, JointLimitHint, Profile, Resistance


def part(label="latch", interval=(0.0, 0.1), y=(-2.0, 0.0)):
    return Component(label=label, interval=interval, x=(0.0, 1.0), y=y)


def profile(force=(), friction=(), damping=(), combine="sum", kind="hinge", **more):
    unit = "rad" if kind == "hinge" else "m"
    return Profile(
        joint=Joint(name="door", type=kind, range=(0.2, 1.7), unit=unit),
        channels=Channels(
            conservative=Channel(combine=combine, components=tuple(force)),
            friction=Resistance(components=tuple(friction)),
            damping=Resistance(components=tuple(damping)),
        ),
        **more,
    )


GREASE = part("grease", (0.0, 1.0), (0.5, 0.5))


@pytest.mark.parametrize(
    "before,after,says",
    [
        ({"force": [part()]}, {"force": [part()]}, []),
        ({}, {"force": [part()]}, ["latch at s = 0 to 0.1: force -2 N·m added"]),
        ({"force": [part()]}, {}, ["latch at s = 0 to 0.1: force removed"]),
        (
            {"force": [part()]},
            {"force": [part(y=(-3.0, 0.0))]},
            ["latch at s = 0 to 0.1: force -2 → -3 N·m"],
        ),
        (
            {"force": [part()]},
            {"force": [part(y=(2.0, 0.0))]},
            ["latch at s = 0 to 0.1: force -2 → 2 N·m"],
        ),
        (
            {"force": [part()]},
            {"force": [part(interval=(0.0, 0.05))]},
            ["latch at s = 0 to 0.05, before 0 to 0.1: force as strong"],
        ),
        (
            {"force": [part()]},
            {"force": [part(y=(-2.0, -1.0))]},
            ["latch at s = 0 to 0.1: force another curve, as strong"],
        ),
        (
            {"damping": [GREASE], "friction": [GREASE]},
            {"friction": [GREASE], "damping": [part("grease", (0.0, 1.0), (0.5, 0.75))]},
            ["grease at s = 0 to 1: damping 0.5 → 0.75 N·m·s/rad"],
        ),
        (
            {"force": [part(interval=(k / 10, k / 10 + 0.1)) for k in range(3)]},
            {"force": [part(interval=(k / 10, k / 10 + 0.1)) for k in (1, 2)]},
            ["latch at s = 0 to 0.1: force removed"],
        ),
        (
            {"force": [part()]},
            {"force": [part()], "combine": "max"},
            ["force: components combined by max, not sum"],
        ),
    ],
)
def test_every_change_is_a_line(before, after, says):
    assert changes(profile(**before), profile(**after)) == says


def test_slides_are_in_newtons():
    lines = changes(profile(kind="slide"), profile([part()], damping=[GREASE], kind="slide"))
    assert [line.split()[-2] for line in lines] == ["N", "N·s/m"]


def test_the_end_stops_are_a_line():
    hint = JointLimitHint(selected_side="low_end", elasticity="weak")
    bare, stopped = profile(), profile(joint_limit_hint=hint)
    assert changes(bare, stopped) == ["end stops: weak elasticity at the low end"]
    assert changes(stopped, bare) == ["end stops: as the model has them"]


def test_the_picture_shows_what_the_profiles_are():
    before = profile([part()], [GREASE])
    after = profile([part(y=(-3.0, 0.0))], [GREASE], [GREASE])
    gravity = np.linspace(0.2, 1.7, 21), np.linspace(0.0, 5.0, 21)
    figure = overlay(before, after, gravity)
    panels = dict(zip(CHANNELS, figure.axes, strict=True))
    for name, axes in panels.items():
        lines = {line.get_label(): line for line in axes.lines}
        for label, shown in (("before", before), ("after", after)):
            q, value = lines[label].get_data()
            assert (q[0], q[-1]) == pytest.approx((0.2, 1.7))
            wanted = evaluate(getattr(shown.channels, name), (q - 0.2) / 1.5)[0]
            assert value == pytest.approx(wanted, abs=1e-9)
        assert lines["before"].get_linestyle() == "--"
    drawn = {line.get_label(): line for line in panels["conservative"].lines}
    assert drawn["balances gravity"].get_data()[1] == pytest.approx(gravity[1])
    units = [axes.get_ylabel() for axes in figure.axes]
    assert units == ["force (N·m)", "friction (N·m)", "damping (N·m·s/rad)"]
