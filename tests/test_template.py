"""The effect templates: complete, well-formed, and behaving in simulation as they say."""

import json

import numpy as np
import pytest
from joints import component, flat, load, run

from joda.errors import JodaError
from joda.template import read_templates

TEMPLATES = read_templates()
NAMES = (
    "constant_friction_hinge",
    "constant_damping_hinge",
    "constant_positive_conservative_hinge",
    "constant_negative_conservative_hinge",
    "detent_internal",
    "bistable_mechanism",
    "bistable_mechanism_internal",
    "magnetic_return_to_low_end",
    "magnetic_return_to_high_end",
    "spring_return_to_low_end",
    "spring_return_to_high_end",
    "spring_loaded_snap_detent_to_low_end",
    "spring_loaded_snap_detent_to_high_end",
)


def rest(name: str, start: float) -> float:
    """Where a damped joint with the template on its whole range comes to rest from `start`."""
    curve = TEMPLATES[name].channels.conservative
    model, data = load(component((0, 1), curve.x, curve.y), damping=flat(1.0), inertia=0.05)
    data.qpos[0] = start
    run(model, data, 15)
    return float(data.qpos[0])


def test_the_library_is_the_papers():
    assert set(TEMPLATES) == set(NAMES)


@pytest.mark.parametrize(
    ("name", "ends"),
    [
        ("detent_internal", {0.1: 0.5, 0.9: 0.5}),
        ("bistable_mechanism", {0.45: 0, 0.55: 1}),
        ("bistable_mechanism_internal", {0.1: 0.25, 0.45: 0.25, 0.55: 0.75, 0.9: 0.75}),
        ("magnetic_return_to_low_end", {0.3: 0, 0.8: 0}),
        ("magnetic_return_to_high_end", {0.2: 1, 0.7: 1}),
        ("spring_return_to_low_end", {0.1: 0, 1.0: 0}),
        ("spring_return_to_high_end", {0.0: 1, 0.9: 1}),
        ("spring_loaded_snap_detent_to_low_end", {0.55: 0, 0.65: 1.0}),
        ("spring_loaded_snap_detent_to_high_end", {0.45: 1, 0.35: 0.0}),
        ("constant_positive_conservative_hinge", {0.1: 1}),
        ("constant_negative_conservative_hinge", {0.9: 0}),
    ],
)
def test_a_template_drives_the_joint_where_it_says(name, ends):
    for start, end in ends.items():
        assert rest(name, start) == pytest.approx(end, abs=0.02)


@pytest.mark.parametrize("name", [name for name in NAMES if name.endswith("_to_high_end")])
def test_high_end_templates_mirror_those_of_the_low_end(name):
    high = TEMPLATES[name].channels.conservative
    low = TEMPLATES[name.replace("high", "low")].channels.conservative
    assert high.x == pytest.approx(1 - np.array(low.x[::-1]))
    assert high.y == pytest.approx(-np.array(low.y[::-1]))


def test_another_folder_adds_and_replaces(tmp_path):
    content = json.loads(TEMPLATES["detent_internal"].model_dump_json())
    for name in ("my_click", "detent_internal"):
        text = json.dumps({**content, "name": name, "description": "mine"})
        (tmp_path / f"{name}.json").write_text(text)
    templates = read_templates([tmp_path])
    assert len(templates) == 14
    assert templates["my_click"].description == templates["detent_internal"].description == "mine"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "other"}, "name: must be the file's name, 'click'."),
        ({"descripton": "x"}, "descripton: unknown key; remove it or mend its spelling."),
        (
            {"channels": {"friction": {"x": [0, 1], "y": [-1, 0]}}},
            "channels: friction.y is negative",
        ),
        (
            {"channels": {"friction": {"x": [0, 1], "y": [2, 0]}}},
            "the largest magnitude in y must be 1",
        ),
        ({"channels": {}}, "give at least one of conservative, friction and damping"),
        ({"channels": {"friction": {"x": [0, 0], "y": [1, 0]}}}, "x must begin at 0 and end at 1"),
    ],
)
def test_a_bad_template_is_refused_in_one_sentence(tmp_path, change, message):
    content = json.loads(TEMPLATES["detent_internal"].model_dump_json(exclude_none=True))
    (tmp_path / "click.json").write_text(json.dumps({**content, "name": "click", **change}))
    with pytest.raises(JodaError) as error:
        read_templates([tmp_path])
    assert message in str(error.value)


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(JodaError, match="no such folder of templates"):
        read_templates([tmp_path / "none"])
