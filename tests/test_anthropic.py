"""Asking a model: pictures go out, proposals come in, a failure is a sentence with its cost."""

import base64
import codecs
import html
import json
import os
import re
import shutil
import subprocess
import sys
from io import BytesIO
from pathlib import Path
from urllib.parse import quote

import anthropic
import pytest
from messages_server import able, error, message, serve
from PIL import Image
from test_prompts import TEMPLATES, answers, blank, images, task, texts, turn

import joda
from joda import JodaError
from joda.cli import main
from joda.pictures.sheet import sheet as previews
from joda.pictures.style import png
from joda.profile import Profile
from joda.proposal import Proposal
from joda.propose import Ask, BatchProposer, asking, price, prompt
from joda.propose import anthropic as proposer
from joda.propose import batch as batches
from joda.propose.anthropic import Anthropic, ProposalFailed
from joda.propose.prompt import MAX_TOKENS
from joda.propose.replies import PLAINLY
from joda.propose.service import Credentials

MODEL = "claude-sonnet-5-5"
MODELS = Path(__file__).parents[1] / "models"

HERE = Path(__file__).parent


@pytest.fixture
def server(monkeypatch):
    monkeypatch.setattr(anthropic._base_client, "INITIAL_RETRY_DELAY", 0.001)
    monkeypatch.setenv("ANTHROPIC_API_KEY", "sk-test")
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    for name in ("ANTHROPIC_BASE_URL", "ANTHROPIC_AUTH_TOKEN", "JODA_VLM", "JODA_VLM_PRICE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("JODA_POLL_S", "0.001")
    with serve() as state:
        yield state


def reply(name="refrigerator", number=0, **usage):
    return message(json.dumps(answers(name)[number]), **usage)


def spoilt(**values):
    answer = answers("refrigerator")[0]
    answer["proposal"]["effect_proposals"][0].update(values)
    return message(json.dumps(answer))


def proposed(name="refrigerator", number=0):
    return Proposal.model_validate(answers(name)[number]["proposal"])


def ask(server, *script, turns=(), asked=None, **options):
    server.script[:] = script
    return Anthropic(MODEL, server.url, **options).propose(asked or task(), turns)


def fails(server, *script, **options):
    with pytest.raises(ProposalFailed) as failure:
        ask(server, *script, **options)
    assert "\n" not in str(failure.value) and str(failure.value).endswith(".")
    return failure.value


def test_a_proposal_comes_back_and_the_pictures_went_out(server):
    colours = ["red", "lime", "blue"]
    pictures = [blank(960, 720, colour) for colour in colours]
    answer = ask(server, reply(), asked=task(pictures=pictures, description="holds anywhere"))
    assert answer.proposal == proposed()
    (sent,) = server.requests
    assert sent["model"] == MODEL and "holds anywhere" in texts(sent)
    sheet, *joints = images(sent)
    with Image.open(BytesIO(png(previews(TEMPLATES)))) as drawn:
        assert sheet.tobytes() == drawn.convert("RGB").tobytes()
    assert [each.getpixel((350, 260)) for each in joints] == [
        (255, 0, 0),
        (0, 255, 0),
        (0, 0, 255),
    ]
    assert "enum" in json.dumps(sent["output_config"]) and "temperature" not in sent


def test_later_rounds_replay_the_conversation_and_end_it(server):
    first, second = turn(), turn(number=1)
    answer = ask(server, reply(number=1), turns=[first])
    assert answer.proposal == proposed(number=1)
    answer = ask(server, reply(number=2), turns=[first, second])
    assert answer.proposal is None
    sent = server.requests[-1]
    said = [
        json.loads(m["content"][0]["text"]) for m in sent["messages"] if m["role"] == "assistant"
    ]
    assert [Proposal.model_validate(each["proposal"]) for each in said] == [
        first.proposal,
        second.proposal,
    ]
    assert first.facts in texts(sent) and second.unmet[0] in texts(sent)


def test_usage_is_what_was_spent_and_dollars_follow_the_price(server):
    counts = {
        "input_tokens": 1_000,
        "output_tokens": 4_000,
        "cache_read_input_tokens": 6_000,
        "cache_creation_input_tokens": 2_000,
    }
    usage = ask(server, reply(**counts)).usage
    assert (usage.requests, usage.input_tokens, usage.output_tokens) == (1, 9_000, 4_000)
    assert (usage.cache_read_tokens, usage.cache_write_tokens) == (6_000, 2_000)
    # Sonnet 5.5: 2, 10 and 0.10 dollars per million; writing the cache 1.25 times the input.
    assert usage.dollars == pytest.approx(0.002 + 0.005 + 0.0006 + 0.04)


@pytest.mark.parametrize(
    "model,price,dollars",
    [
        ("claude-haiku-4-5-20251001", None, 0.001 + 0.001),
        ("claude-of-tomorrow", None, None),
        ("claude-of-tomorrow", "3/15", 0.003 + 0.003),
    ],
)
def test_prices_are_known_unknown_or_given(server, monkeypatch, model, price, dollars):
    if price:
        monkeypatch.setenv("JODA_VLM_PRICE", price)
    server.script[:] = [reply()]
    usage = Anthropic(model, server.url).propose(task(), []).usage
    assert usage.dollars == (dollars and pytest.approx(dollars))


@pytest.mark.parametrize("failure", [429, 500, 529])
def test_passing_failures_are_retried_and_counted(server, failure):
    bad = error(failure, "overloaded_error", "Overloaded", retry_after_ms=1)
    answer = ask(server, bad, bad, reply())
    assert answer.proposal == proposed()
    assert answer.usage.requests == len(server.requests) == 3
    assert answer.usage.output_tokens == 200


def test_dropped_connections_and_timeouts_are_retried_and_counted(server):
    answer = ask(server, "drop", "hang", reply(), timeout=0.3)
    assert answer.proposal == proposed()
    assert answer.usage.requests == len(server.requests) == 3


@pytest.mark.parametrize(
    "entry,says",
    [
        (error(529, "overloaded_error", "Overloaded"), r"529: Overloaded.*try again later"),
        (error(429, "rate_limit_error", "Slow down"), r"429: Slow down.*batch"),
        ("drop", "cannot be reached, or breaks off; check the network"),
    ],
)
def test_lasting_failures_are_a_sentence_after_five_requests(server, entry, says):
    failure = fails(server, entry)
    assert re.search(says, str(failure))
    assert failure.usage.requests == len(server.requests) == 5


def test_no_answer_in_time_is_a_sentence(server, monkeypatch):
    monkeypatch.setattr(proposer, "MAX_RETRIES", 0)
    assert "does not answer within 0.2 s" in str(fails(server, "hang", timeout=0.2))


@pytest.mark.parametrize(
    "status,kind,says",
    [
        (400, "invalid_request_error", "--vlm"),
        (402, "billing_error", "credit"),
        (403, "permission_error", "--vlm"),
        (404, "not_found_error", f"another model than '{MODEL}'"),
    ],
)
def test_what_cannot_be_retried_says_what_to_do(server, status, kind, says):
    failure = fails(server, error(status, kind, "No."))
    assert says in str(failure) and f"({status}: No)" in str(failure)
    assert failure.usage.requests == 1 and failure.usage.dollars == 0


def test_a_wrong_key_is_one_sentence(server, monkeypatch):
    monkeypatch.setenv("ANTHROPIC_API_KEY", "sk-wrong")
    failure = fails(server, reply())
    assert "401" in str(failure) and "ANTHROPIC_API_KEY" in str(failure)
    assert "sk-wrong" not in str(failure)


def test_a_missing_key_is_one_sentence(server, monkeypatch):
    monkeypatch.delenv("ANTHROPIC_API_KEY")
    with pytest.raises(JodaError, match="ANTHROPIC_API_KEY is not set"):
        Anthropic()


def test_a_missing_package_is_one_sentence(server, monkeypatch):
    monkeypatch.setitem(sys.modules, "anthropic", None)
    with pytest.raises(JodaError, match=re.escape('pip install ".[vlm]"')):
        Anthropic()


def test_importing_does_not_load_the_package():
    code = "import joda.propose.anthropic, sys; sys.exit('anthropic' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


@pytest.mark.parametrize("name,text", [("JODA_VLM_PRICE", "cheap"), ("JODA_VLM_PRICE", "3")])
def test_an_unreadable_price_is_one_sentence(server, monkeypatch, name, text):
    monkeypatch.setenv(name, text)
    with pytest.raises(JodaError, match=f"{name} is '{text}'"):
        Anthropic()


def test_the_model_is_chosen_by_argument_environment_and_default(server, monkeypatch):
    assert Anthropic().name == f"anthropic:{proposer.DEFAULT_MODEL}"
    monkeypatch.setenv("JODA_VLM", "claude-haiku-5-5")
    assert Anthropic().name == "anthropic:claude-haiku-5-5"
    assert Anthropic("claude-opus-5").name == "anthropic:claude-opus-5"
    assert proposer.DEFAULT_MODEL in price.PRICES


def test_the_default_model_is_one_that_the_package_knows():
    from typing import get_args

    literal, _ = get_args(anthropic.types.ModelParam)
    assert set(price.PRICES) <= set(get_args(literal))


def test_a_refusal_is_a_sentence_and_keeps_its_tokens(server):
    failure = fails(server, message("", "refusal"))
    assert "declined" in str(failure) and failure.usage.input_tokens == 1000
    assert len(server.requests) == 1


def test_a_cut_off_answer_is_asked_for_again_with_more_room(server):
    answer = ask(server, message('{"status": "rev', "max_tokens"), reply())
    assert answer.proposal == proposed() and answer.usage.output_tokens == 400
    assert [sent["max_tokens"] for sent in server.requests] == [MAX_TOKENS, 2 * MAX_TOKENS]
    assert any("cut off" in note for note in answer.notes)


def test_an_answer_cut_off_twice_is_a_sentence(server):
    failure = fails(server, message("{", "max_tokens"))
    assert "cut off after 32000 tokens" in str(failure)
    assert failure.usage.requests == 2 and failure.usage.output_tokens == 400


@pytest.mark.parametrize(
    "bad,quoted",
    [
        (message("Sure! Here is it:"), "not JSON"),
        (message(""), "not JSON"),
        (message('{"status": "complete", "proposal": null}'), "A proposal is due"),
        (
            message('{"status": "revised", "proposal": {}}'),
            "proposal.joint_summary: Field required",
        ),
        (spoilt(effect_name="flux_capacitor"), "'flux_capacitor' is not in the vocabulary"),
        (spoilt(start_ratio=-0.2), "effect_proposals[0].start_ratio"),
        (spoilt(start_ratio=0.9, end_ratio=0.1), "start_ratio must be less than end_ratio"),
    ],
)
def test_an_invalid_answer_is_repaired_by_quoting_what_is_wrong(server, bad, quoted):
    answer = ask(server, bad, reply())
    assert answer.proposal == proposed()
    assert (answer.usage.requests, answer.usage.input_tokens) == (2, 2000)
    first, second = server.requests
    assert second["messages"][:-2] == first["messages"]
    assert quoted in second["messages"][-1]["content"][0]["text"]
    said = "".join(b["text"] for b in bad["content"] if b["type"] == "text")
    assert second["messages"][-2]["content"][0]["text"] == (said or "(no text)")
    assert len(answer.notes) == 1 and quoted in answer.notes[0]


def test_an_answer_that_stays_invalid_is_a_sentence_and_keeps_its_tokens(server):
    failure = fails(server, spoilt(effect_name="flux_capacitor"))
    assert "'flux_capacitor' is not in the vocabulary" in str(failure)
    assert failure.usage.requests == len(server.requests) == 2
    assert failure.usage.input_tokens == 2000 and failure.usage.dollars > 0


def test_tokens_survive_a_failure_after_them(server):
    failure = fails(server, message("{"), error(403, "permission_error", "No."))
    assert failure.usage.input_tokens == 1000 and failure.usage.requests == 2


def test_tokens_survive_an_interruption_after_them(server, monkeypatch):
    def hear(asked, text, wrong):
        monkeypatch.setattr(asking.Tally, "sent", stop)
        return asked

    def stop(tally):
        raise KeyboardInterrupt

    monkeypatch.setattr(prompt, "repair", hear)
    with pytest.raises(KeyboardInterrupt) as stopped:
        ask(server, message("{"))
    assert stopped.value.usage.input_tokens == 1000


def test_content_that_is_no_block_is_passed_over(server):
    odd = reply()
    odd["content"] = ["a text", None, *odd["content"]]
    assert ask(server, odd).proposal == proposed()


@pytest.mark.parametrize("key", ["sk-a/b.c_0123", 'sk-"quoted"-0123', "sk-back\\slash-0123"])
def test_a_key_is_hidden_however_it_is_escaped(monkeypatch, key):
    monkeypatch.setenv("ANTHROPIC_API_KEY", key)
    hide = Credentials("ANTHROPIC", None).hide
    plain = json.dumps({"said": f"é {key} \\u0041 \n"})
    every = "".join(f"\\u{ord(letter):04x}" for letter in key)
    forms = [plain, plain.replace("/", "\\/"), plain.replace(json.dumps(key)[1:-1], every)]
    for text in forms:
        assert json.loads(text)["said"].count(key) == 1
        assert json.loads(hide(text)) == {"said": "é [secret] \\u0041 \n"}
    assert hide(f"no JSON: {key}") == "no JSON: [secret]"


KEY = "sk-proj-Zq9x/W+7aLm3-4kTvB=8sPdYhJ"


@pytest.mark.parametrize(
    "echo",
    [
        KEY[::-1],
        KEY.upper(),
        " ".join(KEY),
        KEY.encode().hex(":"),
        "".join(f"\\x{byte:02x}" for byte in KEY.encode()),
        "".join(f"&#{byte};" for byte in KEY.encode()),
        "".join(f"%{byte:02X}" for byte in KEY.encode()),
        ", ".join(map(str, KEY.encode())),
        base64.b64encode(f"x-api-key: {KEY}".encode()).decode(),
        base64.b32encode(KEY.encode()).decode(),
        base64.b85encode(KEY.encode()).decode(),
        "\\u200d".join(KEY),
        "".join(f"\\\\u{byte:04x}" for byte in KEY.encode()),
        "".join(f"\\u{{{byte:04x}}}" for byte in KEY.encode()),
        "".join(f"\\{byte:03o}" for byte in KEY.encode()),
        " ".join(f"{byte:o}" for byte in KEY.encode()),
        ",".join(f"0x{byte:x}" for byte in KEY.encode()),
        " ".join(f"{byte:08b}" for byte in KEY.encode()),
        "".join(f"\\U{byte:08x}" for byte in KEY.encode()),
        "\u0301".join(KEY),
        codecs.encode(KEY, "rot13"),
        "".join(chr(byte + 0xFEE0) for byte in KEY.encode()),
        quote(quote(KEY, safe=""), safe="").replace("Zq9x", "%2525Zq9x"),
        " and ".join(KEY[k : k + 9] for k in range(0, len(KEY), 9)),
        " then ".join(KEY[k : k + 9] for k in range(0, len(KEY), 9)[::-1]),
    ],
)
def test_an_answer_that_holds_a_key_in_disguise_is_not_shown(monkeypatch, echo):
    monkeypatch.setenv("ANTHROPIC_API_KEY", KEY)
    monkeypatch.setenv("ANTHROPIC_CUSTOM_HEADERS", "X-Title: articulated objects everywhere")
    hide = Credentials("ANTHROPIC", None).hide
    assert hide(f"the key {echo} is wrong") == "[an answer that repeats a secret, not shown]"
    assert hide("objects, articulated: every where") == "objects, articulated: every where"


def test_no_answer_is_hidden_that_only_looks_odd(monkeypatch):
    monkeypatch.setenv("ANTHROPIC_API_KEY", KEY)
    hide = Credentials("ANTHROPIC", None).hide
    for path in sorted(Path(__file__).parent.parent.glob("docs/*.md")):
        said = json.dumps({"said": path.read_text(), "x": [k / 7 for k in range(2000)]})
        assert json.loads(hide(said)) == json.loads(said), path
    assert "sk-proj" in hide("the key must begin with sk-proj")
    assert hide("a" * 2_000_001) == "[an answer of more than two million characters, not shown]"


@pytest.mark.parametrize(
    "echo",
    [
        quote(KEY, safe=""),
        base64.b64encode(KEY.encode()).decode(),
        base64.b64encode(f"Bearer {KEY}".encode()).decode(),
        html.escape(KEY),
        f"{KEY[:17]}\n{KEY[17:]}",
        KEY[:20],
        KEY[-16:],
    ],
)
def test_a_key_is_hidden_in_other_forms_and_in_parts(monkeypatch, echo):
    monkeypatch.setenv("ANTHROPIC_API_KEY", KEY)
    hidden = Credentials("ANTHROPIC", None).hide(f"the key {echo} is wrong, see sk-proj")
    assert "[secret]" in hidden and hidden.endswith("is wrong, see sk-proj")
    assert not any(KEY[k : k + 12] in hidden for k in range(len(KEY) - 11))
    assert echo not in hidden


def test_another_service_is_a_sentence(server):
    assert "does not answer as the Messages API does" in str(fails(server, "page"))


def test_the_server_refuses_a_bad_request(server, monkeypatch):
    monkeypatch.setattr(prompt, "CACHED", {"cache_control": {"type": "forever"}})
    assert "cache_control: unknown" in str(fails(server, reply()))


def test_the_ablation_yields_a_profile(server):
    flat = [{"s": 0, "value": 0.5}, {"s": 1, "value": 0.5}]
    curves = {"conservative": flat, "friction": flat, "damping": flat}
    server.script[:] = [message(json.dumps({**curves, "friction": flat[:1]})), message("{}")]
    with pytest.raises(ProposalFailed, match="three lists"):
        Anthropic(MODEL, server.url).ablate(task())
    server.script[:] = [message(json.dumps(curves))]
    profile, usage = Anthropic(MODEL, server.url).ablate(task())
    assert isinstance(profile, Profile) and usage.requests == 1
    assert profile.channels.damping.components[0].y == (0.5, 0.5)


# What the model can do


@pytest.mark.parametrize("adaptive", [True, False])
def test_a_model_thinks_where_it_decides_how_much_by_itself(server, adaptive):
    server.models[MODEL] = able(adaptive)
    ask(server, reply())
    (sent,) = server.requests
    assert sent.get("thinking") == ({"type": "adaptive"} if adaptive else None)
    assert "effort" not in sent["output_config"]


def test_of_a_model_that_the_service_does_not_know_nothing_is_assumed(server):
    assert "thinking" not in (ask(server, reply()), *server.requests)[1]


def test_effort_is_what_was_asked_for(server):
    server.models[MODEL] = able(True, "low", "high")
    ask(server, reply(), effort="low")
    assert server.requests[0]["output_config"]["effort"] == "low"
    assert "format" in server.requests[0]["output_config"]
    with pytest.raises(JodaError, match=r"takes no effort 'max'; it takes low, high\."):
        ask(server, reply(), effort="max")
    server.models[MODEL] = able(True)
    with pytest.raises(JodaError, match="leave --effort out"):
        ask(server, reply(), effort="low")
    assert len(server.requests) == 1


def test_a_model_that_no_schema_holds_is_asked_in_words(server):
    """And what it says around the object is left out."""
    server.models[MODEL] = able(True, "low", held=False)
    said = json.loads(json.dumps(reply()))
    text = next(block for block in said["content"] if block["type"] == "text")
    text["text"] = f"Here it is:\n```json\n{text['text']}\n```"
    assert ask(server, said).proposal == proposed()
    assert ask(server, said, effort="low").proposal == proposed()
    plain, low = server.requests
    assert "output_config" not in plain and low["output_config"] == {"effort": "low"}
    words = plain["system"][-1]["text"]
    schema = json.loads(words.partition(PLAINLY)[2])
    assert "cache_control" not in plain["system"][-1] and "enum" in json.dumps(schema)
    server.models[MODEL] = able(True)
    ask(server, reply())
    assert schema == server.requests[-1]["output_config"]["format"]["schema"]


@pytest.mark.parametrize("nonsense", [[], {}, {"capabilities": 3}, {"capabilities": {"effort": 1}}])
def test_nonsense_about_a_model_is_none(server, nonsense):
    server.models[MODEL] = nonsense
    assert ask(server, reply()).proposal == proposed()
    assert "thinking" not in server.requests[0]


def test_a_refusal_says_why_if_the_service_does(server):
    why = {"type": "refusal", "category": "bio", "explanation": "Looks like a pump."}
    failure = fails(server, message("", "refusal") | {"stop_details": why})
    assert "declined to answer (Looks like a pump); describe" in str(failure)


# Batches


@pytest.fixture
def asks():
    return [Ask("fridge", task(), []), Ask("oven", task("oven"), [turn("oven")])]


def by_joint(entry):
    """A proposal in round one, complete in round two."""
    later = len(entry["params"]["messages"]) > 1
    return {"type": "succeeded", "message": reply("oven", 1) if later else reply()}


def batch(server, asks, store, **options):
    got = list(Anthropic(MODEL, server.url).propose_many(asks, store, **options))
    assert sorted(name for name, _ in got) == sorted(ask.name for ask in asks)
    return dict(got)


def test_a_batch_answers_every_ask_at_half_the_price(server, asks, tmp_path):
    store, seen, slept = tmp_path / "batch.json", [], []
    server.results, server.looks = by_joint, 2

    def sleep(seconds):
        assert store.exists()
        slept.append(seconds)

    got = batch(server, asks, store, progress=lambda *each: seen.append(each), sleep=sleep)
    assert got["fridge"].proposal == proposed() and got["oven"].proposal is None
    # 1000 in and 200 out at 2 and 10 dollars per million, halved.
    assert got["fridge"].usage.dollars == pytest.approx(0.002)
    assert got["fridge"].usage.requests == 1
    assert seen == [(0, 2), (0, 2), (2, 2)]
    assert slept == [0.001, 0.0015]
    assert len(server.batches) == 1 and not server.requests and not store.exists()
    assert [each["params"]["model"] for each in server.batches[0]] == [MODEL] * 2


def test_a_batch_caches_what_all_joints_share_for_an_hour(server, asks, tmp_path):
    """Writing for an hour costs 2 times the input, for 5 minutes 1.25 times, in a batch half."""
    counts = {
        "cache_creation_input_tokens": 8_000,
        "cache_creation": {"ephemeral_1h_input_tokens": 6_000, "ephemeral_5m_input_tokens": 2_000},
    }
    server.results = lambda entry: {"type": "succeeded", "message": reply(**counts)}
    got = batch(server, asks[:1], tmp_path / "batch.json")["fridge"].usage
    assert got.cache_write_tokens == 8_000 and got.input_tokens == 9_000
    assert got.dollars == pytest.approx((0.002 + 0.024 + 0.005 + 0.002) / 2)
    batch(server, asks[1:], tmp_path / "batch.json")
    for (entry,) in server.batches:
        asked = entry["params"]
        blocks = [*asked["system"], *(b for m in asked["messages"] for b in m["content"])]
        cached = [b["cache_control"] for b in blocks if "cache_control" in b]
        assert cached == [{"type": "ephemeral", "ttl": "1h"}] * 2
        assert [block["type"] for block in blocks if "cache_control" in block] == ["text", "image"]


def test_an_interrupted_batch_is_picked_up_and_not_paid_twice(server, asks, tmp_path):
    store = tmp_path / "batch.json"
    server.results, server.looks = by_joint, 1

    def interrupt(seconds):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        batch(server, asks, store, sleep=interrupt)
    kept = json.loads(store.read_text())["batches"]
    assert [each["id"] for each in kept] == ["batch_0"]
    assert kept[0]["requests"] == [each["custom_id"] for each in server.batches[0]]
    got = batch(server, asks, store)
    assert got["fridge"].proposal == proposed()
    assert len(server.batches) == 1 and not store.exists()


def test_what_was_not_taken_before_an_interruption_comes_again(server, asks, tmp_path):
    store = tmp_path / "batch.json"
    server.results = by_joint
    interrupted = Anthropic(MODEL, server.url).propose_many(asks, store)
    first, _ = next(interrupted)
    second, _ = next(interrupted)  # the first is taken
    interrupted.close()
    (kept,) = json.loads(store.read_text())["batches"]
    assert len(kept["requests"]) == 1
    again = [ask for ask in asks if ask.name == second]
    assert list(batch(server, again, store)) == [second]
    assert len(server.batches) == 1 and not store.exists()
    assert first != second


def test_a_failure_that_was_taken_is_asked_anew_and_not_counted_twice(server, asks, tmp_path):
    store = tmp_path / "batch.json"
    server.results = lambda entry: {"type": "succeeded", "message": message("", "refusal")}
    interrupted = Anthropic(MODEL, server.url).propose_many(asks, store)
    next(interrupted)
    next(interrupted)
    interrupted.close()
    server.results = by_joint
    got = batch(server, asks, store)
    assert not any(isinstance(answer, JodaError) for answer in got.values())
    (anew,) = server.batches[1]
    assert len(server.batches[0]) == 2 and not store.exists()
    assert anew["custom_id"] in {entry["custom_id"] for entry in server.batches[0]}


def test_a_picture_that_is_none_fails_alone(server, asks, tmp_path):
    server.results = by_joint
    bad = Ask("bad", task(pictures=[b"no picture"]), [])
    got = batch(server, [bad, *asks], tmp_path / "batch.json")
    assert "is no image file" in str(got["bad"])
    assert got["fridge"].proposal == proposed() and len(server.batches[0]) == 2


def test_proposers_say_whether_they_take_batches(server):
    from joda.propose.offline import Offline

    assert isinstance(Anthropic(), BatchProposer)
    assert not isinstance(Offline(), BatchProposer)


@pytest.mark.slow
def test_a_request_is_the_same_bytes_in_another_process(server, tmp_path):
    """By its bytes a batch's request is known again: the pictures in it are drawn anew."""
    code = """
import sys
sys.path[:0] = sys.argv[1:]
from test_prompts import answers, task, turn
from joda.propose.anthropic import Anthropic, _key
asked = Anthropic("claude-sonnet-5-5").request(task("oven"), [turn("oven")])
print(_key("oven", asked))
"""
    (tmp_path / "matplotlibrc").write_text(
        "savefig.bbox: tight\nfont.size: 30\nfigure.dpi: 30\nsavefig.facecolor: red\n"
    )
    here = proposer._key("oven", Anthropic(MODEL).request(task("oven"), [turn("oven")]))
    run = subprocess.run(
        [sys.executable, "-c", code, str(HERE), str(HERE / "helpers")],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONHASHSEED": "2", "MPLBACKEND": "svg"},
    )
    assert run.stdout.strip() == here, run.stderr


def test_what_is_new_is_asked_beside_what_is_running(server, asks, tmp_path):
    store = tmp_path / "batch.json"
    server.results, server.looks = by_joint, 1

    def interrupt(seconds):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        batch(server, asks[:1], store, sleep=interrupt)
    got = batch(server, asks, store)
    assert [len(each) for each in server.batches] == [1, 1]
    assert got["oven"].proposal is None and not store.exists()


def test_the_batch_of_other_asks_stays_in_the_store(server, asks, tmp_path):
    store = tmp_path / "batch.json"
    store.write_text('{"batches": [{"id": "batch_77", "requests": ["abc"]}]}')
    server.results = by_joint
    assert batch(server, asks, store)["fridge"].proposal == proposed()
    assert [each["id"] for each in json.loads(store.read_text())["batches"]] == ["batch_77"]


def test_failures_in_a_batch_are_those_of_their_asks(server, tmp_path):
    outcomes = {
        "fine": {"type": "succeeded", "message": reply()},
        "errored": {
            "type": "errored",
            "error": error(400, "invalid_request_error", "Bad.")["body"],
        },
        "expired": {"type": "expired"},
        "canceled": {"type": "canceled"},
        "refused": {"type": "succeeded", "message": message("", "refusal")},
    }
    names = list(outcomes)
    by_wish = {f"wish of {name}": outcome for name, outcome in outcomes.items()}
    server.results = lambda entry: next(
        outcome for wish, outcome in by_wish.items() if wish in texts(entry["params"])
    )
    asks = [Ask(name, task(description=f"wish of {name}"), []) for name in names]
    got = batch(server, asks, tmp_path / "batch.json")
    assert got["fine"].proposal == proposed()
    says = {"errored": "Bad", "expired": "expired", "canceled": "cancelled", "refused": "declined"}
    for name, word in says.items():
        assert isinstance(got[name], ProposalFailed) and word in str(got[name])
    assert got["refused"].usage.dollars == pytest.approx(0.002)


def test_an_invalid_answer_in_a_batch_is_repaired_directly(server, tmp_path):
    server.results = lambda entry: {"type": "succeeded", "message": message("{")}
    server.script[:] = [reply()]
    got = batch(server, [Ask("fridge", task(), [])], tmp_path / "batch.json")["fridge"]
    assert got.proposal == proposed() and got.usage.requests == 2
    assert len(server.batches) == len(server.requests) == 1
    assert got.usage.dollars == pytest.approx(0.002 + 0.004)


def test_large_batches_are_split(server, asks, tmp_path, monkeypatch):
    server.results = by_joint
    monkeypatch.setattr(batches, "MAX_REQUESTS", 1)
    assert batch(server, asks, tmp_path / "batch.json")["fridge"].proposal == proposed()
    assert [len(each) for each in server.batches] == [1, 1]
    monkeypatch.setattr(batches, "MAX_REQUESTS", 100_000)
    size = max(len(json.dumps(each)) for part in server.batches for each in part)
    monkeypatch.setattr(batches, "MAX_BYTES", int(1.5 * size))
    assert batch(server, asks, tmp_path / "batch.json")["fridge"].proposal == proposed()
    assert [len(each) for each in server.batches] == [1, 1, 1, 1]


def test_mistakes_with_batches_are_sentences(server, asks, tmp_path, monkeypatch):
    store = tmp_path / "batch.json"
    with pytest.raises(JodaError, match="the same name"):
        batch(server, [asks[0], Ask("fridge", task("oven"), [])], store)
    store.write_text("{")
    with pytest.raises(JodaError, match=r"batch.json: not JSON"):
        batch(server, asks, store)
    store.unlink()
    monkeypatch.setenv("JODA_POLL_S", "soon")
    with pytest.raises(JodaError, match="JODA_POLL_S is 'soon'"):
        batch(server, asks, store)
    assert not server.paths


def test_a_batch_of_another_account_is_one_sentence(server, asks, tmp_path):
    store = tmp_path / "batch.json"
    server.looks = 1

    def forget(seconds):
        server.batches.clear()

    with pytest.raises(JodaError, match=r"batch.json: the service does not know batch batch_0"):
        batch(server, asks, store, sleep=forget)
    assert store.exists()


def test_a_wrong_key_for_a_batch_is_one_sentence(server, asks, tmp_path, monkeypatch):
    monkeypatch.setenv("ANTHROPIC_API_KEY", "sk-wrong")
    with pytest.raises(JodaError, match="401"):
        batch(server, asks, tmp_path / "batch.json")


def test_nothing_to_ask_asks_nothing(server, tmp_path):
    assert batch(server, [], tmp_path / "batch.json") == {}
    assert not server.paths


# What it will cost


def test_an_estimate_counts_rounds_and_joints_and_asks_nobody(server, tmp_path):
    """In a batch it is half of a file's, per joint."""
    for name in ("oven", "refrigerator"):
        shutil.copy(MODELS / f"{name}.xml", tmp_path)
    options = {"proposer": "anthropic", "vlm": MODEL, "base_url": server.url}
    one = joda.estimate(tmp_path / "oven.xml", **options)
    both = joda.estimate(tmp_path, **options)
    assert (one.joints, both.joints) == (1, 2) and not server.requests
    assert (one.least.requests, one.most.requests, both.most.requests) == (1, 3, 6)
    assert both.least.dollars == pytest.approx(one.least.dollars)
    assert both.least.input_tokens == 2 * one.least.input_tokens
    # Sonnet 5.5: 2 and 10 dollars per million
    spent = one.most
    assert spent.dollars == pytest.approx((2 * spent.input_tokens + 10 * spent.output_tokens) / 1e6)
    assert joda.estimate(tmp_path / "oven.xml", proposer="offline") is None


def test_the_estimate_bounds_what_is_asked(server, tmp_path):
    """Tokens as the upper estimate counts them in the requests that are sent."""
    pictures = [blank(960, 720)] * 5
    expected = Anthropic(MODEL, server.url).estimate(task("oven", pictures=pictures), 3)
    server.script[:] = [reply("oven")]
    for turns in ([], [turn("oven")], [turn("oven"), turn("oven", number=0)]):
        ask(server, reply("oven"), turns=turns, asked=task("oven", pictures=pictures))
    sent = sum(price.tokens(asked) for asked in server.requests)
    assert 0.8 * expected.input_tokens < sent <= expected.input_tokens


def test_the_command_says_what_it_will_cost(server, tmp_path, monkeypatch, capsys):
    def say(*options):
        command = ["generate", str(MODELS / "oven.xml"), "-o", str(tmp_path / "o"), *options]
        monkeypatch.setattr(sys, "argv", ["joda", *command, "--estimate"])
        with pytest.raises(SystemExit) as end:
            main()
        assert end.value.code == 0 and not (tmp_path / "o").exists()
        return capsys.readouterr().out

    asked = ("--proposer", "anthropic", "--vlm", MODEL)
    assert re.search(r"joints: 1, .*: 1 to 3 requests, .* 0\.0\d+ to 0\.\d+ dollars\.", say(*asked))
    told = json.loads(say(*asked, "--json"))
    assert told["most"]["requests"] == 3 and told["proposer"] == f"anthropic:{MODEL}"
    assert "price unknown (JODA_VLM_PRICE sets it)" in say(*asked[:3], "claude-of-tomorrow")
    assert "Nobody would be asked" in say("--proposer", "offline")
    assert not server.requests
