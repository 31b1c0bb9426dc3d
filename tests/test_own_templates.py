"""A template that nobody has written a law for: its effect is found, told and added."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from hidden_cases import read
from wheel import SCENE, pushed

from joda import JodaError, add, attach, diagnose
from joda.component import Component
from joda.diagnosis.hypotheses import hypotheses
from joda.diagnosis.indistinguishable import indistinguishable, kinds_of
from joda.diagnosis.selection import Selection
from joda.diagnosis.units import units_of
from joda.estimation.problem import segments_for
from joda.hidden import draw
from joda.profile import Channel, Channels, Joint, Profile
from joda.template import read_templates

NAME = "cam_with_three_teeth"
U = np.linspace(0, 1, 13)
TEETH = np.round(np.sin(6 * np.pi * U), 9) + 0.0


@pytest.fixture
def templates(tmp_path):
    folder = tmp_path / "effects"
    folder.mkdir()
    content = {
        "name": NAME,
        "description": "A cam whose three teeth draw the joint to three places.",
        "placement": "Anywhere.",
        "title": "a worn cam",
        "shows": "it is drawn to three places",
        "channels": {"conservative": {"x": U.tolist(), "y": TEETH.tolist()}},
    }
    (folder / f"{NAME}.json").write_text(json.dumps(content))
    return folder


@pytest.mark.slow
def test_it_is_diagnosed_and_added_without_code(tmp_path, templates, rng):
    size, (a, b) = rng.uniform(0.15, 0.25), (rng.uniform(0.1, 0.3), rng.uniform(0.7, 0.9))
    teeth = Component(label=NAME, interval=(a, b), x=tuple(U), y=tuple(size * TEETH))
    true = Profile(
        joint=Joint(name="wheel", type="hinge", range=(-1.5, 1.5), unit="rad"),
        channels=Channels(conservative=Channel(components=(teeth,))),
    )
    (tmp_path / "plain.xml").write_text(SCENE)
    attach(tmp_path / "plain.xml", true, tmp_path / "true.xml", native="keep")
    runs = [tmp_path / f"run{k}.csv" for k in range(4)]
    for number, path in enumerate(runs):
        pushed(tmp_path / "true.xml", rng, number, path)
    line = tmp_path / "plain.xml", "wheel", runs
    found = diagnose(*line, templates=[templates], json=tmp_path / "d.json")
    assert found.verdict == "missing_effect", found.summary
    first = found.effects[0]
    assert first.effect == NAME and "lacks a worn cam" in found.summary
    assert "A worn cam at q" in first.explanation and "it is drawn to three" in first.explanation
    assert first.magnitude == pytest.approx(size, rel=0.1)
    assert first.interval == pytest.approx((a, b), abs=0.03)
    model, joint, files = line
    added = add(
        model, joint, tmp_path / "d.json", files, tmp_path / "new.xml", templates=[templates]
    )
    assert added.added, added.reason
    assert added.after.window < 0.3 * added.before.window
    with pytest.raises(JodaError, match=f"no effect '{NAME}'"):  # without the folder
        add(model, joint, tmp_path / "d.json", files, tmp_path / "no.xml")


def test_one_way_it_is_not_told_from_the_other_kind(tmp_path):
    """A resistance of one's own is the same as a force where the joint goes one way only."""
    content = {
        "name": "wedge_rub",
        "description": "Two wedges that rub.",
        "placement": "Anywhere.",
        "channels": {"friction": {"x": [0, 1], "y": [0, 1]}},
    }
    (tmp_path / "wedge_rub.json").write_text(json.dumps(content))
    names = "wedge_rub", "quadratic_damping", "constant_positive_conservative_hinge"
    found = [SimpleNamespace(hypothesis=SimpleNamespace(effect=name)) for name in names]
    ranking = SimpleNamespace(candidates=found, n_effective=1000)
    weighed = Selection("missing_effect", (0.9, 0.05, 0.01), (10.0, (0.1, 1.0, 2.0)), names)
    kinds = kinds_of(ranking, read_templates([tmp_path]))
    assert indistinguishable(ranking, weighed, 0, kinds) == names[2:]
    assert indistinguishable(ranking, weighed, 0, {}) == ()  # moved both ways


@pytest.mark.slow
def test_every_template_has_a_hypothesis(tmp_path, templates):
    """Of each channel that it has one strength, and where it acts."""
    measured = read(draw(3, "quadratic_damping"))[0]
    content = json.loads((templates / f"{NAME}.json").read_text())
    rough = {"x": [0, 0.5, 1], "y": [0, 1, 0]}
    content["channels"] |= {"friction": rough, "damping": rough}
    (templates / f"{NAME}.json").write_text(json.dumps(content))
    every = hypotheses(
        units_of(segments_for(measured), measured), read_templates([templates]), measured.profile
    )
    (own,) = [one for one in every if one.effect == NAME]
    assert own.trials.shape[1] == len(own.unknowns.low) == 5  # three strengths and two ends
    x = np.array([2.0, 0.5, 0.25, 0.2, 0.8])
    channels = own.write(measured.profile, x).channels
    parts = [getattr(channels, name).components[-1] for name in ("conservative", "friction")]
    assert all(part.label == NAME and part.interval == (0.2, 0.8) for part in parts)
    assert max(parts[1].y) == pytest.approx(0.5 * max(parts[0].y))
    assert own.magnitude(x) == pytest.approx(max(parts[0].y))


@pytest.mark.parametrize("name", ["magnetic_strip", "magnetic_return_to_low_end", "constant_rub"])
def test_a_name_like_one_of_the_librarys_makes_no_law(tmp_path, name):
    """What a template is told to be is what its curves are, whatever it is called."""
    measured = read(draw(3, "quadratic_damping"))[0]
    content = {
        "name": name,
        "description": "A strip of magnets that push and pull.",
        "placement": "Anywhere.",
        "channels": {"conservative": {"x": U.tolist(), "y": TEETH.tolist()}},
    }
    (tmp_path / f"{name}.json").write_text(json.dumps(content))
    units = units_of(segments_for(measured), measured)
    every = hypotheses(units, read_templates([tmp_path]), measured.profile)
    (own,) = [one for one in every if one.effect == name]
    part = own.write(measured.profile, np.array([2.0, 0.2, 0.8])).channels.conservative
    assert part.components[-1].y == pytest.approx(2 * units.force * TEETH)
