"""What a hand-held gauge tells: effects hidden in quasi-static curves, by analytic laws."""

from pathlib import Path

import numpy as np
import pytest
from gauging import FRICTION, LAWS, SCENE, gauged

from joda import add, compare, diagnose
from joda.diagnosis.findings import Diagnosis
from joda.diagnosis.verdict import diagnosed
from joda.measured.comparison import Comparison, sentences


def said(folder: Path, law, **kind) -> Diagnosis:
    """The diagnosis of a curve of a joint with a further force law(s, direction)."""
    return diagnosed(gauged(folder, law, **kind)).diagnosis


def test_a_true_model_is_adequate(tmp_path):
    assert said(tmp_path, lambda s, d: 0 * s).verdict == "adequate"


@pytest.mark.slow
@pytest.mark.parametrize("effect", LAWS)
def test_a_hidden_force_is_named(tmp_path, effect):
    found = said(tmp_path, LAWS[effect])
    assert found.verdict == "missing_effect", found
    assert found.effects[0].effect == effect
    # the gauge's noise alone is a third of what a magnet makes
    assert found.effects[0].held_out_error_after < 0.5 * found.effects[0].held_out_error_before
    assert found.unit == "N·m"


@pytest.mark.slow
def test_asymmetric_friction_is_named_with_what_is_the_same(tmp_path):
    found = said(tmp_path, lambda s, d: -0.3 * (d > 0))
    names = [effect.effect for effect in found.effects[:2]]
    assert set(names) == {"asymmetric_friction", "constant_negative_conservative_hinge"}


def test_one_direction_only_names_a_resistance_and_a_force(tmp_path):
    found = said(tmp_path, lambda s, d: -0.5 * ((s > 0.3) & (s < 0.6)), ways=(1,))
    both = {found.effects[0].effect, *found.effects[0].indistinguishable_from}
    assert both & {"constant_friction_hinge", "position_dependent_friction"}
    assert "constant_negative_conservative_hinge" in both
    assert found.next_experiment == "Measure the way back too, as slowly."


@pytest.mark.slow
def test_uneven_friction_does_not_decide_what_is_named(tmp_path):
    """A latch on a part of the range, beside forces that are many times the gauge's noise."""
    found = said(
        tmp_path, lambda s, d: -3 / (1 + s / 0.03) ** 2, ways=(1,), noise=0.004, uneven=0.08
    )
    first = found.effects[0]
    likely = {first.effect, *first.indistinguishable_from}
    assert likely & {"magnetic_return_to_low_end", "spring_loaded_snap_detent_to_low_end"}, found
    assert found.next_experiment == "Measure the way back too, as slowly."


def clicks(per_click: float, samples: int):
    """A force that goes up and down once in so many samples."""
    return lambda s, d: np.sin(2 * np.pi * s * samples / per_click + 1.0)


def compared(folder: Path, law, **kind) -> Comparison:
    measured = gauged(folder, law, **kind)
    return compare(folder / "model.xml", "door", [folder / measured.curves[0].curve.name])


@pytest.mark.slow
@pytest.mark.sweep(2)
@pytest.mark.parametrize("per_click", [2.3, 3.0, 4.0])
@pytest.mark.parametrize("apart", [0.0, 0.3])
def test_clicks_as_narrow_as_the_samples_are_no_noise(tmp_path, per_click, apart):
    """Found where the way back is at the same places; elsewhere they may be noise: no all-clear."""
    kind = {"noise": 0.01, "samples": 60, "apart": apart}
    found = compared(tmp_path, clicks(per_click, 60), **kind)
    assert found.curves_adequacy in {"beyond_noise", "not_enough_data" if apart else None}
    assert "no fault of the model" not in " ".join(sentences(found))
    assert not [place for place in found.failing_force if place.by == "direction"]
    told = said(tmp_path, clicks(per_click, 60), **kind)
    assert told.verdict in {"unexplained", "insufficient_data" if apart else None}
    assert "leaves less than" not in told.summary


@pytest.mark.slow
def test_what_changes_from_sample_to_sample_clears_nothing(tmp_path):
    """Measured one way only, and either way at other places."""
    for kind in ({"ways": (1,)}, {"apart": 0.5}):
        found = compared(tmp_path, clicks(2.05, 40), noise=0.01, samples=40, **kind)
        assert found.curves_adequacy != "within_noise", kind
        told = said(tmp_path, clicks(2.05, 40), noise=0.01, samples=40, **kind)
        assert told.verdict != "adequate", kind


@pytest.mark.slow
@pytest.mark.parametrize("samples", [15, 40, 150])
def test_curves_of_a_true_model_are_cleared(tmp_path, samples):
    found = [compared(tmp_path, lambda s, d: 0 * s, samples=samples) for _ in range(40)]
    # about nine of ten are
    assert sum(one.curves_adequacy == "within_noise" for one in found) >= 28
    assert any("no fault of the model" in " ".join(sentences(one)) for one in found)


def test_a_place_with_few_samples_is_beyond_the_noise(tmp_path):
    narrow = 0.6 / 24
    found = compared(tmp_path, lambda s, d: 0.5 * (abs(s - 0.5) < narrow), noise=0.01, samples=24)
    assert found.curves_adequacy == "beyond_noise"


def test_a_coarse_gauge_clears_nothing_below_its_steps(tmp_path):
    """A gauge in steps of 0.5 N·m on a bump of 0.22."""
    gauged(tmp_path, lambda s, d: 0 * s)
    q = np.concatenate([np.linspace(0.05, 1.45, 100), np.linspace(1.45, 0.05, 100)])
    way = np.repeat([1.0, -1.0], 100)
    force = np.round((FRICTION * way + 0.22 * np.exp(-(((q - 0.8) / 0.1) ** 2))) / 0.5) * 0.5
    force += np.where(way > 0, 0.5, -0.5) * (force == 0)  # it reads ±0.5 everywhere
    rows = "\n".join(f"{a:.4f},{b:.3f}" for a, b in zip(q, force, strict=True))
    (tmp_path / "coarse.csv").write_text(f"position,force\n{rows}\n")
    scene = SCENE.replace(f'frictionloss="{FRICTION}"', 'frictionloss="0.5"')
    (tmp_path / "model.xml").write_text(scene)
    line = tmp_path / "model.xml", "door", [tmp_path / "coarse.csv"]
    found = compare(*line)
    assert found.curves[0].noise_floor_force > 0.14
    assert found.curves_adequacy == "not_enough_data"
    assert diagnose(*line).verdict == "insufficient_data"


@pytest.mark.parametrize("wobbles", ["friction", "force"])
def test_what_either_way_tells_again_is_the_joints(tmp_path, wobbles):
    """3.3 samples a click, a third of the friction: as friction or as a force by position."""

    def law(s, d):
        return 0.07 * np.sin(2 * np.pi * s * 75 / 3.3) * (d if wobbles == "friction" else 1.0)

    found = compared(tmp_path, law, noise=0.008, samples=75)
    assert found.curves_adequacy == "beyond_noise"
    assert found.curves[0].noise_floor_force < 0.02


@pytest.mark.slow
def test_a_force_in_grams_is_doubted(tmp_path):
    measured = gauged(tmp_path, lambda s, d: -14 * d)
    assert any("in another unit" in note for note in measured.notes)
    told = diagnosed(measured).diagnosis
    assert told.summary.startswith("Best guess") and "see to its unit first" in told.summary
    (tmp_path / "said.json").write_text(told.to_json())
    line = tmp_path / "model.xml", "door", tmp_path / "said.json", [tmp_path / "curve.csv"]
    refused = add(*line, tmp_path / "new.xml")
    assert not refused.added and "see to its unit first" in refused.reason
    assert add(*line, tmp_path / "new.xml", effect=told.effects[0].effect).added
