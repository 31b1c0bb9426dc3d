"""What a hand-held gauge tells is added: effects hidden in quasi-static curves."""

import json

import numpy as np
import pytest
from gauging import FRICTION, LAWS, SPAN, gauged

from joda import add, diagnose, improve
from joda.commands.add import sentences as told_added
from joda.commands.improve import sentences as told
from joda.diagnosis.adding import error
from joda.diagnosis.split import parted
from joda.measured.quasi_static import static_force
from joda.measured.reading import read_measured

NOISE = 0.02


def modelled(scene, s, direction):
    """The force that slowly moves a scene's joint, N·m."""
    measured = read_measured(scene, "door", [scene.parent / "curve.csv"])
    return static_force(measured.profile, measured.context, SPAN * s, direction)


def off(scene, law):
    """RMS error of a scene's force against the truth, both directions, N·m."""
    s = np.linspace(0.03, 0.97, 300)
    wrong = [modelled(scene, s, way) - (way * FRICTION - law(s, way)) for way in (1, -1)]
    return float(np.sqrt(np.mean(np.square(wrong))))


@pytest.mark.slow
@pytest.mark.parametrize("effect", LAWS)
def test_a_hidden_force_is_added(tmp_path, effect):
    gauged(tmp_path, LAWS[effect], noise=NOISE)
    model, curve, said = (tmp_path / name for name in ("model.xml", "curve.csv", "said.json"))
    diagnose(model, "door", [curve], json=said)
    found = add(model, "door", said, [curve], tmp_path / "new.xml")
    assert found.added
    assert (found.before.whole, found.unit) == (None, "N·m")
    assert found.after.window < min(0.4 * found.before.window, 1.5 * NOISE)
    assert found.held_out == "every fourth stretch of the curve"
    assert off(tmp_path / "new.xml", LAWS[effect]) < 0.2 * off(model, LAWS[effect])
    first = told_added(found)[0]
    assert f"force {found.before.window:.3g} → {found.after.window:.3g} N·m RMS" in first
    json.dumps(found.as_json())


@pytest.mark.slow
def test_what_does_not_help_is_not_added(tmp_path):
    gauged(tmp_path, lambda s, d: 0 * s, noise=NOISE)
    model, curve, said = (tmp_path / name for name in ("model.xml", "curve.csv", "said.json"))
    diagnose(model, "door", [curve], json=said)
    found = add(model, "door", said, [curve], tmp_path / "new.xml", effect="detent_internal")
    assert not found.added
    assert told_added(found)[0].startswith("Not added: a click-stop (detent)")
    assert f"force {found.before.window:.3g} N·m" in told_added(found)[0]


@pytest.mark.long
def test_two_hidden_forces_are_added_one_after_the_other(tmp_path):
    def law(s, d):
        return LAWS["detent_internal"](s, d) + LAWS["spring_return_to_low_end"](s, d)

    gauged(tmp_path, law, noise=NOISE)
    report = tmp_path / "report.html"
    model, curve = tmp_path / "model.xml", tmp_path / "curve.csv"
    found = improve(model, "door", [curve], tmp_path / "new.xml", report=report)
    errors = [step.error.window for step in found.steps]
    assert errors == sorted(errors, reverse=True)
    assert {step.effect for step in found.steps[1:]} >= {"detent_internal"}, told(found)
    assert errors[-1] < 1.5 * NOISE
    assert off(tmp_path / "new.xml", law) < 0.1 * off(tmp_path / "model.xml", law)
    head, columns = told(found)[:2]
    assert "every fourth stretch of the curve" in head
    assert columns.split() == ["model", "force"]
    assert "force" in report.read_text()


def test_every_sample_of_few_curves_is_fitted_or_held_out(tmp_path):
    measured = gauged(tmp_path, LAWS["detent_internal"])
    train, held = parted(measured)
    (whole,), (kept,), (left,) = measured.curves, train.curves, held.curves
    together = np.concatenate([kept.curve.position, left.curve.position])
    assert sorted(together) == sorted(whole.curve.position)
    assert 0.2 < len(left.direction) / len(whole.direction) < 0.3
    assert {1, -1} <= set(left.direction)  # some of either direction


def test_of_four_curves_the_fourth_is_held_out(tmp_path):
    for name in "abcd":
        gauged(tmp_path, LAWS["detent_internal"])
        (tmp_path / "curve.csv").rename(tmp_path / f"{name}.csv")
    files = [tmp_path / f"{name}.csv" for name in "abcd"]
    train, held = parted(read_measured(tmp_path / "model.xml", "door", files))
    assert [one.curve.name for one in held.curves] == ["d.csv"]
    assert [one.curve.name for one in train.curves] == ["a.csv", "b.csv", "c.csv"]


def test_the_error_of_another_profile_is_its_own(tmp_path):
    """As `joda compare` of that scene says."""
    measured = gauged(tmp_path, LAWS["spring_return_to_low_end"])
    bare = measured.profile.model_copy(update={"channels": type(measured.profile.channels)()})
    force = measured.curves[0].curve.force
    assert error(measured, bare).window == pytest.approx(np.sqrt(np.mean(force**2)), rel=0.02)
    assert error(measured).window != pytest.approx(error(measured, bare).window, rel=0.02)


def test_to_few_samples_nothing_is_added(tmp_path):
    gauged(tmp_path, lambda s, d: 0 * s, noise=NOISE)
    model, curve, said = (tmp_path / name for name in ("model.xml", "curve.csv", "said.json"))
    rows = curve.read_text().splitlines()
    curve.write_text("\n".join(rows[:1] + rows[1:150:25]) + "\n")
    found = diagnose(model, "door", [curve], json=said)
    assert found.verdict == "insufficient_data"
    assert found.next_experiment == (
        "Measure more: at some 20 places of the whole range or more, in both directions."
    )
    effect = "spring_return_to_low_end"
    assert not add(model, "door", said, [curve], tmp_path / "new.xml", effect=effect).added
    assert len(improve(model, "door", [curve], tmp_path / "newer.xml").steps) == 1
