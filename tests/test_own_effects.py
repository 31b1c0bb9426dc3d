"""An effect whose card is written outside of the package: it is found, and told in its words."""

from collections.abc import Iterator

import numpy as np
import pytest
from wheel import SCENE, pushed

from joda import diagnose
from joda.effects import EFFECTS, Effect, LearnedForce
from joda.effects.guesses import STRENGTH, TRIAL, InitialGuess, Units

NAME = "root_drag"


class RootDrag(Effect):
    """Drag that grows with the root of speed, executed as a table over speed."""

    NAME = "drag that grows with the root of speed"
    KIND = "resistance"
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
