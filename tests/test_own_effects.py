"""An effect whose card is written outside of the package: it is found, and told in its words."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from wheel import SCENE, pushed

from joda import JodaError, diagnose
from joda.diagnosis.hypotheses import hypotheses
from joda.diagnosis.hypotheses.effects import from_effects
from joda.diagnosis.overlap import divided, places
from joda.diagnosis.plausible import Needs
from joda.diagnosis.units import units_of
from joda.effects import EFFECTS, Effect, LearnedForce
from joda.effects.guesses import STRENGTH, TRIAL, InitialGuess, Units
from joda.estimation.problem import segments_for
from joda.measured.reading import read_measured

NAME = "root_drag"


class RootDrag(Effect):
    """Drag that grows with the root of speed, executed as a table over speed."""

    NAME = "drag that grows with the root of speed"
    KIND = "resistance"
    WRITTEN_AS = "learned_force"
    DESCRIPTION = "A film of grease that thins as it is sheared."
    LAW = "force -y sign(v) sqrt(|v|)"
    SOURCE = "power-law fluid: Ostwald 1925, de Waele 1923"
    SHOWS = "Slow motions lose more than in proportion to their speed, fast ones less."

    @classmethod
    def guesses(cls, joint: Units) -> Iterator[InitialGuess]:
        """Of the same size everywhere."""
        rising = joint.speed * np.geomspace(0.01, 4.0, 11)
        speeds = np.concatenate([-rising[::-1], [0.0], rising])
        unit = joint.force / joint.speed**0.5

        def effect(x):
            y = unit * x[0] * np.sign(speeds) * np.sqrt(np.abs(speeds))
            return LearnedForce(velocities=tuple(speeds), y=(tuple(y),))

        yield InitialGuess([STRENGTH], [[TRIAL]], effect, lambda x: unit * x[0], "N·m·(s/rad)^0.5")


def gaining(x):
    """A table that adds energy."""
    return LearnedForce(velocities=(-1.0, 0.0, 1.0), y=((1.0, 0.0, -1.0),))


GAINING = InitialGuess([STRENGTH], [[TRIAL]], gaining, lambda x: x[0], "N·m")


@pytest.fixture
def measured(tmp_path, monkeypatch, rng):
    """A wheel and a short run of it, where the card is known."""
    scene = tmp_path / "wheel.xml"
    scene.write_text(SCENE)
    pushed(scene, rng, 0, tmp_path / "run.csv", steps=1000)
    monkeypatch.setitem(EFFECTS, NAME, RootDrag)
    return read_measured(scene, "wheel", [tmp_path / "run.csv"])


def dragged(measured, size):
    """The joint's profile with the drag as its card writes it."""
    (guess,) = RootDrag.guesses(units_of(segments_for(measured), measured))
    return measured.profile.with_effect(guess.effect([size]))


def test_it_exerts_no_more_than_the_runs_can_need(measured):
    """As every effect: what its card writes is told from the rest of the profile."""
    needs = Needs(measured)
    little, much = (dragged(measured, size) for size in (0.1, 100.0))
    assert needs.exerted(little, NAME) > 0 and needs.allow(little, NAME)
    assert not needs.allow(much, NAME)
    own, others = divided(little, NAME)
    assert own.effects == little.effects and not others.effects


def test_a_memory_exerts_force_too(measured):
    """Of a place that the joint was at most as far from as it goes, or goes until it forgets."""
    needs, (one,) = Needs(measured), dragged(measured, 1e-6).effects
    drawn = one.model_copy(update={"memory": "position", "time": 0.1, "gain": 50.0})
    exerted = needs.exerted(measured.profile.with_effect(drawn), NAME)
    assert exerted == pytest.approx(50 * min(0.1 * needs.speed, needs.travel), rel=1e-3)


def test_only_speeds_that_the_joint_had_count(measured):
    needs, size = Needs(measured), 0.1
    exerted = needs.exerted(dragged(measured, size), NAME)
    units = units_of(segments_for(measured), measured)
    root = units.force * size * (needs.speed / units.speed) ** 0.5
    assert exerted == pytest.approx(root, rel=0.1)  # as a line between two points of the table


def test_it_is_there_once_whichever_way_it_acts(measured, monkeypatch):
    """A profile has one table: a second one would take its place."""

    def both(cls, joint):
        (guess,) = RootDrag.guesses(joint)
        yield from (replace(guess, direction=way) for way in ("positive", "negative"))

    monkeypatch.setitem(EFFECTS, NAME, type("Ways", (RootDrag,), {"guesses": classmethod(both)}))
    units = units_of(segments_for(measured), measured)
    offered = [
        [h for h in hypotheses(units, {}, profile) if h.effect == NAME]
        for profile in (measured.profile, dragged(measured, 0.1))
    ]
    assert [len(some) for some in offered] == [2, 0]


def test_where_it_acts_is_where_its_table_is(measured):
    (one,) = dragged(measured, 0.1).effects
    part = measured.profile.with_effect(one.model_copy(update={"interval": (0.2, 0.6)}))
    assert places(part, NAME) == [(0.2, 0.6)]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"WRITTEN_AS": None}, "its guesses make 'learned_force', but a profile lists it as"),
        (
            {"guesses": classmethod(lambda cls, joint: iter([GAINING]))},
            "a trial of its guesses makes no effect: y must not have the sign opposite",
        ),
        ({"KIND": "friction"}, "the KIND on its card is 'friction', not one of force, resistance"),
        (
            {"guesses": classmethod(lambda cls, joint: iter([replace(GAINING, trials=[[]])]))},
            "each trial of a guess needs 1 values",
        ),
    ],
)
def test_a_card_that_makes_something_else_is_told_so(measured, monkeypatch, change, said):
    monkeypatch.setitem(EFFECTS, NAME, type("Wrong", (RootDrag,), change))
    with pytest.raises(JodaError, match=f"effect '{NAME}': {said}"):
        list(from_effects(units_of(segments_for(measured), measured)))


@pytest.mark.slow
def test_it_is_diagnosed_by_its_card_alone(tmp_path, monkeypatch, rng):
    size = rng.uniform(0.08, 0.16)

    def drag(speed):
        return size * np.sign(speed) * abs(speed) ** 0.5

    scene = tmp_path / "wheel.xml"
    scene.write_text(SCENE)
    runs = [tmp_path / f"run{k}.csv" for k in range(3)]
    for number, path in enumerate(runs):
        pushed(scene, rng, number, path, drag, steps=2000)
    monkeypatch.setitem(EFFECTS, NAME, RootDrag)
    found = diagnose(scene, "wheel", runs)
    first = found.effects[0]
    assert found.verdict == "missing_effect" and first.effect == NAME, found.summary
    assert first.magnitude == pytest.approx(size, abs=max(3 * first.magnitude_error, 0.05 * size))
    assert RootDrag.NAME in found.summary
