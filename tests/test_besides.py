"""What acts on a joint besides itself is said, and then a model is never cleared."""

import pytest
from test_compare import SCENE, door, runs_of, scene_of

from joda import compare
from joda.measured.comparison import sentences

BODY = '<body name="other" pos="1 0 0"><joint name="wheel" axis="0 1 0"/><geom size=".1"/></body>'
FIXED = '<tendon><fixed name="{}" {}><joint joint="joint" coef="1"/></fixed></tendon>'
EQUAL = "<equality>{}</equality>"
ELEMENTS = {
    "tendon 'band'": FIXED.format("band", 'stiffness="2"'),
    "tendon 'rope'": FIXED.format("rope", 'damping="2"'),
    "equality 'gear'": EQUAL.format('<joint name="gear" joint1="joint" joint2="wheel"/>'),
    "an equality": EQUAL.format('<joint joint1="joint" polycoef="0.5 0 0 0 0"/>'),
    "equality 'rod'": EQUAL.format(
        '<connect name="rod" body1="part" body2="other" anchor="0 0 0"/>'
    ),
    "a medium": '<option density="50" wind="0 8 0"/>',
}


def scene_with(folder, extra):
    text = SCENE.format(native='damping="0.5" frictionloss="0.3"').replace(
        "<body>", '<body name="part">'
    )
    text = text.replace("</worldbody>", f"{BODY}</worldbody>{extra}")
    (folder / "scene.xml").write_text(text)
    return folder / "scene.xml"


@pytest.mark.parametrize("named", ELEMENTS)
def test_what_a_replay_leaves_out_is_said(named, tmp_path):
    runs = runs_of(door(), tmp_path, 3, 2)
    found = compare(scene_with(tmp_path, ELEMENTS[named]), "joint", runs)
    (note,) = [note for note in found.notes if "leaves that out" in note]
    assert named in note
    assert found.adequacy.verdict != "within_noise"
    assert "no fault of the model" not in " ".join(sentences(found))


def test_other_tendons_and_joda_s_own_are_none(tmp_path):
    runs = runs_of(door(), tmp_path, 3, 1)
    wheel = EQUAL.format('<joint joint1="wheel" polycoef="0 0 0 0 0"/>')
    attached = compare(scene_of(door(), tmp_path), "joint", runs)
    assert not [note for note in attached.notes if "leaves that out" in note]
    for extra in (FIXED.format("slack", ""), wheel):
        found = compare(scene_with(tmp_path, extra), "joint", runs)
        assert not [note for note in found.notes if "leaves that out" in note]
