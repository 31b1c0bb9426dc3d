"""What a hand-held gauge tells: effects hidden in quasi-static curves, by analytic laws."""

import secrets
from pathlib import Path

import numpy as np
import pytest

from joda.diagnosis.findings import Diagnosis
from joda.diagnosis.verdict import diagnosed
from joda.measured.reading import read_measured

SPAN, FRICTION = 1.5, 0.2
MODEL = f"""<mujoco><compiler angle="radian"/><worldbody><body>
<joint name="door" type="hinge" axis="0 0 1" range="0 {SPAN}" limited="true"
 damping="0.1" frictionloss="{FRICTION}"/>
<inertial pos=".2 0 0" mass="2" diaginertia=".02 .02 .02"/><geom size=".1" mass="0"/>
</body></worldbody></mujoco>"""


def said(folder: Path, law, ways=(1, -1), noise=0.02) -> Diagnosis:
    """The diagnosis of a curve, N·m, of a joint with a further force law(s, direction)."""
    seed = secrets.randbits(32)
    print("seed", seed)
    rng = np.random.default_rng(seed)
    there = np.linspace(0.02, 0.98 * SPAN, 150)
    q = np.concatenate([there[::way] for way in ways])
    d = np.repeat(ways, len(there))
    force = FRICTION * d - law(q / SPAN, d) + rng.normal(0, noise, len(q))
    rows = "\n".join(f"{a:.5f},{b:.4f}" for a, b in zip(q, force, strict=True))
    (folder / "curve.csv").write_text("position,force\n" + rows + "\n")
    (folder / "model.xml").write_text(MODEL)
    return diagnosed(read_measured(folder / "model.xml", "door", [folder / "curve.csv"])).diagnosis


def test_a_true_model_is_adequate(tmp_path):
    assert said(tmp_path, lambda s, d: 0 * s).verdict == "adequate"


LAWS = {
    "detent_internal": lambda s, d: -1.5 * (s - 0.5) / 0.05 * np.exp(0.5 - (s - 0.5) ** 2 / 0.005),
    "constant_friction_hinge": lambda s, d: -0.5 * d * ((s > 0.3) & (s < 0.6)),
    "spring_return_to_low_end": lambda s, d: -0.3 - s,
    "magnetic_return_to_low_end": lambda s, d: -2 / (1 + s / 0.06) ** 2,
}


@pytest.mark.parametrize("effect", LAWS)
def test_a_hidden_force_is_named(tmp_path, effect):
    found = said(tmp_path, LAWS[effect])
    assert found.verdict == "missing_effect", found
    assert found.effects[0].effect == effect
    assert found.effects[0].held_out_error_after < 0.4 * found.effects[0].held_out_error_before
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
