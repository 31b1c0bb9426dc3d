"""What a hand-held gauge tells: effects hidden in quasi-static curves, by analytic laws."""

from pathlib import Path

import pytest
from gauging import LAWS, gauged

from joda.diagnosis.findings import Diagnosis
from joda.diagnosis.verdict import diagnosed


def said(folder: Path, law, **kind) -> Diagnosis:
    """The diagnosis of a curve of a joint with a further force law(s, direction)."""
    return diagnosed(gauged(folder, law, **kind)).diagnosis


def test_a_true_model_is_adequate(tmp_path):
    assert said(tmp_path, lambda s, d: 0 * s).verdict == "adequate"


@pytest.mark.parametrize("effect", LAWS)
def test_a_hidden_force_is_named(tmp_path, effect):
    found = said(tmp_path, LAWS[effect])
    assert found.verdict == "missing_effect", found
    assert found.effects[0].effect == effect
    # the gauge's noise alone is a third of what a magnet makes
    assert found.effects[0].held_out_error_after < 0.5 * found.effects[0].held_out_error_before
    assert found.unit == "N·m"


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


def test_uneven_friction_does_not_decide_what_is_named(tmp_path):
    """A latch on a part of the range, beside forces that are many times the gauge's noise."""
    found = said(
        tmp_path, lambda s, d: -3 / (1 + s / 0.03) ** 2, ways=(1,), noise=0.004, uneven=0.08
    )
    first = found.effects[0]
    likely = {first.effect, *first.indistinguishable_from}
    assert likely & {"magnetic_return_to_low_end", "spring_loaded_snap_detent_to_low_end"}, found
    assert found.next_experiment == "Measure the way back too, as slowly."
