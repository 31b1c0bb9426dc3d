"""Revision in words: what is complained about changes, the rest stays to the byte."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from messages_server import message
from PIL import Image
from test_generate import (  # noqa: F401
    MODELS,
    OVEN,
    command_line,
    reply,
    service,
    whole,
    without_a_key,
    without_rendering,
)
from test_prompts import answers, texts

from joda import JodaError, generate, revise
from joda.profile import CHANNELS, Profile
from joda.propose import Answer

pytestmark = pytest.mark.usefixtures("quick")

COMPLAINT = "the damping is too weak"


@pytest.fixture(scope="module")
def generated(tmp_path_factory):
    """A generation without pictures, to be copied."""
    folder = tmp_path_factory.mktemp("generated")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MUJOCO_GL", "disabled")
        shutil.copy(OVEN, folder / "oven.xml")
        generate(folder / "oven.xml", "door", folder / "out", proposer="offline")
    return folder


@pytest.fixture
def folder(generated, tmp_path):
    shutil.copytree(generated, tmp_path / "own")
    return tmp_path / "own" / "out"


def composed(folder):
    return Profile.read(folder / "composed.json")


def test_it_changes_what_is_complained_about_and_nothing_else(folder, joda):
    before, rounds = composed(folder), whole(folder).rounds
    status, out, err = joda("revise", folder, "--feedback", COMPLAINT)
    assert (status, err) == (0, "")
    after = composed(folder)
    for name in CHANNELS:
        same = getattr(before.channels, name) == getattr(after.channels, name)
        assert same == (name != "damping")
    (old,), (new,) = before.channels.damping.components, after.channels.damping.components
    assert max(new.y) > 1.2 * max(old.y)
    first = out.splitlines()[0]
    assert first.startswith("constant_damping_hinge at s = 0 to 1: damping ") and "→" in first
    assert f"{max(old.y):.3g} → {max(new.y):.3g} N·m·s/rad" in first
    last = whole(folder).rounds[-1]
    assert last.complaint == COMPLAINT and last.number == len(rounds) + 1
    assert whole(folder).rounds[:-1] == rounds


def test_its_picture_shows_both(folder):
    result = revise(folder, COMPLAINT)
    assert result.picture == folder / "before_after.png"
    with Image.open(result.picture) as picture:
        pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3).astype(int)
    colours = {"before": (0x88, 0x88, 0x88), "after": (0x1F, 0x8A, 0x70)}
    for colour in colours.values():
        assert (np.abs(pixels - colour).max(axis=1) < 12).sum() > 200
    assert len(result.changes) == 1


def test_the_scene_has_the_revised_profile(folder):
    from joda import read_profiles

    revise(folder, COMPLAINT)
    (profile,) = read_profiles(folder / "scene.xml").values()
    assert profile.channels == composed(folder).channels


def test_revisions_follow_on_each_other(folder):
    start = max(composed(folder).channels.damping.components[0].y)
    revise(folder, COMPLAINT)
    first = max(composed(folder).channels.damping.components[0].y)
    revise(folder, COMPLAINT)
    assert max(composed(folder).channels.damping.components[0].y) / first == pytest.approx(
        first / start, rel=0.01
    )


def test_it_needs_a_generation(tmp_path, joda):
    status, out, err = joda("revise", tmp_path, "--feedback", COMPLAINT)
    assert (status, out) == (2, "") and err.count("\n") == 1
    assert "holds no history.json; make it with: joda generate" in err
    with pytest.raises(JodaError, match="feedback is empty"):
        revise(tmp_path, " ")


def test_a_generation_without_a_proposal_is_a_sentence(tmp_path, quick):
    class Never:
        name = "never"

        def propose(self, task, turns):
            raise JodaError("never.")

    with pytest.raises(JodaError):
        generate(OVEN, "door", tmp_path / "out", proposer=Never())
    with pytest.raises(JodaError, match="holds no proposal yet; go on with: joda generate"):
        revise(tmp_path / "out", COMPLAINT)


def snapshot(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_what_is_not_understood_changes_nothing(folder, joda):
    before = snapshot(folder)
    status, out, err = joda("revise", folder, "--feedback", "make it nicer")
    assert (status, out) == (2, "") and err.count("\n") == 1
    assert snapshot(folder) == before


def test_an_edit_is_not_lost_unless_forced(folder, joda):
    path = folder / "composed.json"
    edited = path.read_text().replace("constant_damping_hinge", "my own grease")
    path.write_text(edited)
    before = snapshot(folder)
    status, _, err = joda("revise", folder, "--feedback", COMPLAINT)
    assert status == 2 and "composed.json: was edited since it was generated" in err
    assert "add --force" in err and snapshot(folder) == before
    assert joda("revise", folder, "--feedback", COMPLAINT, "--force")[0] == 0
    assert "my own grease" not in path.read_text()


def test_a_missing_file_is_no_edit(folder):
    before = (folder / "composed.json").read_bytes()
    (folder / "composed.json").unlink()
    with pytest.raises(JodaError, match="does not understand"):
        revise(folder, "make it nicer")
    assert (folder / "composed.json").read_bytes() == before


def test_a_file_cannot_be_revised(folder):
    with pytest.raises(JodaError, match="cannot be revised in words; edit it instead"):
        revise(folder, COMPLAINT, proposer=folder / "proposal.json")


def test_a_proposer_that_has_nothing_to_change_is_a_sentence(folder):
    class Content:
        name = "content"

        def propose(self, task, turns):
            assert turns[-1].complaint == COMPLAINT
            return Answer(None)

    with pytest.raises(JodaError, match=f"content has nothing to propose for '{COMPLAINT}'"):
        revise(folder, COMPLAINT, proposer=Content())


@pytest.mark.slow
def test_a_model_is_told_the_users_words(server, joda, tmp_path, quick):
    fridge, folder = MODELS / "refrigerator.xml", tmp_path / "out"
    server.script[:] = [reply()]
    generate(fridge, "door", folder, rounds=1)
    first = composed(folder)
    answer = answers("refrigerator")[0]
    effects = answer["proposal"]["effect_proposals"]
    number = next(k for k, e in enumerate(effects) if e["strength"]["friction"] != "none")
    factors = {"conservative": 1, "friction": 2, "damping": 1}
    effects[number]["refineFactor"] = factors
    server.script[:] = [message(json.dumps(answer))]
    status, out, _ = joda("revise", folder, "--feedback", "it drifts; hold it better")
    assert status == 0 and "Asked 2 times: 2000 tokens in" in out
    said = texts(server.requests[-1])
    prompt = (Path(__file__).parents[1] / "prompts" / "revision.md").read_text()
    assert '"it drifts; hold it better"' in said
    assert prompt.split("$complaint")[1].strip()[:60] in said
    assert first.channels.conservative == composed(folder).channels.conservative
    assert first.channels.damping == composed(folder).channels.damping
    assert first.channels.friction != composed(folder).channels.friction
    last = whole(folder).rounds[-1]
    assert last.complaint == "it drifts; hold it better" and last.usage.requests == 1
    server.script[:] = [reply(number=2)]
    generate(fridge, "door", folder, resume=True)
    assert '"it drifts; hold it better"' in texts(server.requests[-1]), "it stays in the talk"


def test_a_failed_revision_is_counted_and_changes_nothing(server, joda, tmp_path):
    server.script[:] = [reply()]
    generate(MODELS / "refrigerator.xml", "door", tmp_path / "out", rounds=1)
    before = snapshot(tmp_path / "out")
    server.script[:] = [message("", "refusal")]
    status, _, err = joda("revise", tmp_path / "out", "--feedback", "hold it better")
    assert status == 2 and "declined" in err
    after = snapshot(tmp_path / "out")
    assert {name for name in before if before[name] != after[name]} == {"history.json"}
    assert whole(tmp_path / "out").usage.requests == 2
