"""The prompt says all there is to say, in few tokens, and begins the same for every joint."""

import io
import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from messages_server import Wrong, check, picture
from PIL import Image

from joda import JodaError, compile, context, render
from joda.interaction.behaviour import behaviour
from joda.pictures.draw import draw
from joda.pictures.sheet import sheet
from joda.pictures.style import png
from joda.profile import Profile
from joda.proposal import EffectProposal, JointSummary, Proposal, RefineFactor, Strength
from joda.propose import Task, Turn, prompt, replies
from joda.propose.file import FileProposer
from joda.propose.price import tokens
from joda.template import read_templates

MODELS = Path(__file__).parents[1] / "models"
EXCHANGES = Path(__file__).parent / "exchanges"
TEMPLATES = read_templates()


def blank(width, height, colour="white"):
    out = io.BytesIO()
    Image.new("RGB", (width, height), colour).save(out, format="PNG")
    return out.getvalue()


@pytest.fixture(scope="module")
def previews():
    return png(sheet(TEMPLATES))


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Of the refrigerator; blank ones where nothing can render."""
    try:
        paths = render(MODELS / "refrigerator.xml", "door", tmp_path_factory.mktemp("pictures"))
    except JodaError:
        return [blank(960, 720)] * 5
    return [path.read_bytes() for path in paths]


@cache
def known(name):
    return context(MODELS / f"{name}.xml", "door")


def task(name="refrigerator", pictures=(), description=""):
    return Task(known(name), TEMPLATES, pictures, description)


def answers(name):
    return json.loads((EXCHANGES / f"{name}.json").read_text())


@cache
def finished(name, number):
    proposal = Proposal.model_validate(answers(name)[number]["proposal"])
    found = task(name).context
    profile = compile(proposal, found)
    shown = behaviour(found, profile)
    flat = (np.array(found.joint.range), np.zeros(2))
    return Turn(
        proposal=proposal,
        profile=profile,
        behaviour=shown,
        picture=lambda: png(draw(profile, flat)),
        facts=shown.describe(found),
        unmet=["closes by itself near the shut position: let go at 3 % of the way it stays"],
    )


def turn(name="refrigerator", number=0, complaint=""):
    return replace(finished(name, number), complaint=complaint)


def body(asked):
    return {"model": "claude-test", **asked}


def images(asked):
    blocks = [block for each in asked["messages"] for block in each["content"]]
    return [picture(block) for block in blocks if block["type"] == "image"]


def texts(asked):
    blocks = [*asked["system"], *(b for each in asked["messages"] for b in each["content"])]
    return "\n".join(block["text"] for block in blocks if block["type"] == "text")


def plain(message):
    """A message without its marks for the cache, which may move."""
    blocks = [{k: v for k, v in b.items() if k != "cache_control"} for b in message["content"]]
    return {**message, "content": blocks}


def test_every_template_is_in_the_vocabulary_with_its_channels_and_placement():
    text = prompt.system(TEMPLATES)
    for name, template in TEMPLATES.items():
        line = next(each for each in text.splitlines() if each.startswith(f"- {name} ["))
        assert template.description in line and template.placement in line
        for channel in ("conservative", "friction", "damping"):
            has = getattr(template.channels, channel) is not None
            assert (channel in line.split("]")[0].split("[")[1]) == has


@pytest.mark.parametrize("part", [Proposal, JointSummary, EffectProposal, Strength, RefineFactor])
def test_every_field_of_the_answer_is_explained(part):
    text = (Path(__file__).parents[1] / "prompts" / "schema.md").read_text()
    for name in part.model_fields:
        assert re.search(rf"\b{name}\b", text), name


def test_the_labels_mean_what_the_compiler_makes_of_them():
    from joda.compiling import BANDS

    text = prompt.system(TEMPLATES)
    for label, (low, high) in BANDS.items():
        assert re.search(rf"^- {label}: {f'{low:g} to {high:g}' if high else '0'}$", text, re.M)


def test_nothing_is_left_to_fill_in():
    asked = prompt.request(task(), [turn(complaint="too strong at the end")])
    assert not re.search(r"\$\w", texts(asked))
    assert '"too strong at the end"' in texts(asked)


def test_a_user_may_write_dollars_and_braces():
    asked = prompt.request(task(description="costs $5 {x}"), [turn(complaint="worth $effects?")])
    assert "costs $5 {x}" in texts(asked) and "worth $effects?" in texts(asked)


def test_the_schema_is_one_that_structured_output_supports_and_every_exchange_obeys_it():
    import jsonschema

    check(body(prompt.request(task(), [])))
    schema = replies.schema(TEMPLATES)
    for path in EXCHANGES.glob("*.json"):
        for answer in json.loads(path.read_text()):
            jsonschema.validate(answer, schema)
    wrong = answers("oven")[0]
    wrong["proposal"]["effect_proposals"][0]["effect_name"] = "flux_capacitor"
    with pytest.raises(jsonschema.ValidationError, match="flux_capacitor"):
        jsonschema.validate(wrong, schema)


def test_the_check_refuses_what_the_service_refuses():
    asked = body(prompt.request(task(), []))
    asked["output_config"]["format"]["schema"]["properties"]["status"]["minLength"] = 1
    with pytest.raises(Wrong, match="minLength"):
        check(asked)
    asked = body(prompt.request(task(), [turn()]))
    del asked["messages"][1]
    with pytest.raises(Wrong, match="alternate"):
        check(asked)


@pytest.mark.slow
def test_three_rounds_stay_within_twelve_thousand_tokens(pictures, previews):
    asked_of = task(pictures=pictures, description="It shall close by itself near the end.")
    turns = [turn(), turn(number=1)]
    for rounds in range(3):
        asked = prompt.request(asked_of, turns[:rounds], previews)
        check(body(asked))
        assert 6_000 < tokens(asked) <= 12_000
        assert sum("cache_control" in json.dumps(message) for message in asked["messages"]) >= 1


def test_pictures_keep_their_content_and_proportions(previews):
    first = Image.new("RGB", (960, 720), (200, 30, 30))
    first.paste((30, 30, 200), (480, 0, 960, 720))
    out = io.BytesIO()
    first.save(out, format="PNG")
    sent = images(prompt.request(task(pictures=[out.getvalue()]), [], previews))
    assert [each.size for each in sent] == [
        (1000, Image.open(io.BytesIO(previews)).height),
        (704, 528),
    ]
    assert sent[1].getpixel((100, 240)) == (200, 30, 30)
    assert sent[1].getpixel((600, 240)) == (30, 30, 200)


def test_more_pictures_are_smaller_ones():
    few = prompt.request(task(pictures=[blank(960, 720)] * 5), [])
    many = prompt.request(task(pictures=[blank(960, 720)] * 20), [])
    assert images(many)[0].size == (352, 264)
    assert tokens(many) < 1.1 * tokens(few)


def test_tokens_of_a_picture_are_its_patches():
    without = tokens(prompt.request(task(), []))
    asked = prompt.request(task(pictures=[blank(280, 56)]), [])
    assert 20 < tokens(asked) - without < 20 + 60  # 10 x 2 patches, and the words above


def test_system_and_sheet_are_the_same_bytes_for_all_joints(previews):
    one = prompt.request(task(description="holds anywhere"), [turn()], previews)
    other = prompt.request(task("oven"), [], previews)
    assert one["system"] == other["system"]
    assert one["output_config"] == other["output_config"]
    assert one["messages"][0]["content"][:2] == other["messages"][0]["content"][:2]
    assert one["messages"][0]["content"][1]["cache_control"] == {"type": "ephemeral"}
    assert one["messages"][0]["content"][2:] != other["messages"][0]["content"][2:]


def test_a_round_continues_the_one_before(pictures, previews):
    asked_of, turns = task(pictures=pictures), [turn(), turn(number=1)]
    first, second, third = (prompt.request(asked_of, turns[:n], previews) for n in range(3))
    assert second["messages"][0] == first["messages"][0]
    assert [plain(each) for each in third["messages"][:2]] == [
        plain(each) for each in second["messages"][:2]
    ]
    # Round one's facts stay, its picture goes: it comes after the facts, the last that is cached.
    assert plain(second["messages"][2])["content"][:-1] == plain(third["messages"][2])["content"]
    assert len(images(third)) == len(images(second)) == len(images(first)) + 1
    assert Proposal.model_validate(
        json.loads(third["messages"][3]["content"][0]["text"])["proposal"]
    ) == (turns[1].proposal)


def test_the_joint_is_described_with_its_gravity_and_references():
    oven = task("oven")
    text = texts(prompt.request(oven, []))
    assert oven.context.describe() in text
    gravity = re.search(r"gravity at s: (.*)", text)[1].split(", ")
    assert [float(each.split(": ")[1]) for each in gravity] == pytest.approx(
        [oven.context.gravity_force[k] for k in (0, 5, 10, 15, 20)], rel=0.01
    )
    assert "if gravity_can_be_ignored" in text
    assert "gravity at s: none" in texts(prompt.request(task(), []))


def test_a_picture_that_is_none_is_one_sentence():
    with pytest.raises(JodaError, match="is no image file"):
        prompt.request(task(pictures=[b"no picture"]), [])


MISTAKES = {
    "not json": ("{", "not JSON"),
    "no object": ("[]", "status"),
    "status": ('{"status": "fine", "proposal": null}', "status"),
    "no proposal": ('{"status": "revised", "proposal": null}', "^proposal: "),
    "complete at once": ('{"status": "complete", "proposal": null}', "due"),
}


@pytest.mark.parametrize("reply,says", MISTAKES.values(), ids=MISTAKES.keys())
def test_what_is_wrong_with_an_answer_is_said(reply, says):
    with pytest.raises(JodaError, match=says):
        replies.parse(reply, task(), [])


def changed(**values):
    answer = answers("refrigerator")[0]
    answer["proposal"]["effect_proposals"][0].update(values)
    return json.dumps(answer)


@pytest.mark.parametrize(
    "values,says",
    [
        ({"start_ratio": -0.1}, r"effect_proposals\[0\].start_ratio"),
        ({"start_ratio": 0.5, "end_ratio": 0.4}, "start_ratio must be less"),
        ({"confidence": 7}, "confidence"),
        ({"effect_name": "flux_capacitor"}, "not in the vocabulary; there are: bistable"),
    ],
)
def test_what_a_schema_cannot_say_is_checked(values, says):
    with pytest.raises(JodaError, match=says):
        replies.parse(changed(**values), task(), [])


def test_the_joint_is_given_not_chosen():
    answer = answers("refrigerator")[0]
    answer["proposal"]["joint_summary"]["joint_name"] = "Door (left)"
    assert replies.parse(json.dumps(answer), task(), []).joint_summary.joint_name == "door"
    answer["proposal"]["joint_summary"]["joint_type"] = "prismatic"
    with pytest.raises(JodaError, match="revolute"):
        replies.parse(json.dumps(answer), task(), [])


def test_complete_ends_unless_the_user_complains():
    reply = '{"status": "complete", "proposal": null}'
    assert replies.parse(reply, task(), [turn()]) is None
    with pytest.raises(JodaError, match="due"):
        replies.parse(reply, task(), [turn(complaint="too weak")])


def test_the_ablation_names_no_template_and_yields_a_profile():
    asked = prompt.ablation(task(pictures=[blank(960, 720)], description="holds anywhere"))
    check(body(asked))
    assert not any(name in texts(asked) for name in TEMPLATES)
    assert "reference:" not in texts(asked) and "holds anywhere" in texts(asked)
    flat = [{"s": 0, "value": 1.5}, {"s": 1, "value": 1.5}]
    pull = [{"s": 0, "value": -2}, {"s": 0.1, "value": 0}, {"s": 1, "value": 0}]
    reply = {"conservative": pull, "friction": flat, "damping": flat}
    profile = replies.parse_ablation(json.dumps(reply), task())
    assert isinstance(profile, Profile)
    assert profile.channels.conservative.components[0].y == (-2, 0, 0)
    for wrong in (reply | {"friction": pull}, {"friction": flat}, reply | {"damping": flat[:1]}):
        with pytest.raises(JodaError):
            replies.parse_ablation(json.dumps(wrong), task())


def test_a_file_is_proposed_once(tmp_path):
    path = tmp_path / "proposal.json"
    path.write_text(json.dumps(answers("oven")[0]["proposal"]))
    proposer = FileProposer(path)
    assert proposer.propose(task("oven"), []).proposal == turn("oven").proposal
    assert proposer.propose(task("oven"), [turn("oven")]).proposal is None
    with pytest.raises(JodaError, match="edit it"):
        proposer.propose(task("oven"), [turn("oven", complaint="too weak")])
    with pytest.raises(JodaError, match="cannot be read"):
        FileProposer(tmp_path / "none.json").propose(task("oven"), [])
