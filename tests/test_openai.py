"""Any server that speaks OpenAI's chat API: asked as it can be, and never believed unseen."""

import json
import logging
import re
import sys
import traceback
from io import BytesIO
from pathlib import Path

import openai
import pytest
from chat_server import Chat, completion, pictures, refusal, words
from messages_server import KEY, serve
from PIL import Image
from test_hostile_text import harmless
from test_prompts import TEMPLATES, answers, blank, task, turn

from joda import JodaError, generate
from joda.cli import main
from joda.pictures.sheet import sheet
from joda.pictures.style import png
from joda.plain import LONGEST
from joda.profile import Profile
from joda.proposal import Proposal
from joda.propose import BatchProposer, replies
from joda.propose import openai as proposer
from joda.propose.asking import ProposalFailed, ProposalInterrupted
from joda.propose.openai import OpenAI
from joda.propose.prompt import MAX_TOKENS
from joda.propose.session import NONE, Session

MODELS = Path(__file__).parents[1] / "models"


@pytest.fixture
def server(monkeypatch):
    monkeypatch.setattr(openai._base_client, "INITIAL_RETRY_DELAY", 0.001)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    for name in ("OPENAI_API_KEY", "OPENAI_BASE_URL", "OPENAI_CUSTOM_HEADERS", "OPENAI_LOG"):
        monkeypatch.delenv(name, raising=False)
    for name in ("ANTHROPIC_API_KEY", "JODA_VLM", "JODA_VLM_PRICE"):
        monkeypatch.delenv(name, raising=False)
    with serve(Chat) as state:
        state.address = f"{state.url}/v1"
        yield state


def text(name="refrigerator", number=0):
    return json.dumps(answers(name)[number])


def proposed(name="refrigerator", number=0):
    return Proposal.model_validate(answers(name)[number]["proposal"])


def ask(server, *script, turns=(), asked=None, **options):
    server.script[:] = script
    return OpenAI("qwen-test", server.address, **options).propose(asked or task(), turns)


def fails(server, *script, **options):
    with pytest.raises(ProposalFailed) as failure:
        ask(server, *script, **options)
    said = str(failure.value)
    assert "\n" not in said and said.endswith(".") and harmless(said) and len(said) <= LONGEST
    return failure.value


def without_schema(asked):
    """A server that holds no answer to a schema."""
    if "response_format" in asked:
        return refusal(400, "response_format.type must be text")
    return completion(text())


def test_a_proposal_comes_back_and_the_pictures_went_out(server):
    shown = [blank(960, 720, colour) for colour in ("red", "lime", "blue")]
    answer = ask(
        server, completion(text()), asked=task(pictures=shown, description="holds anywhere")
    )
    assert answer.proposal == proposed() and answer.notes == []
    (sent,) = server.requests
    assert sent["model"] == "qwen-test" and "holds anywhere" in words(sent)
    assert sent["max_tokens"] == MAX_TOKENS and "temperature" not in sent
    assert sent["response_format"]["json_schema"]["schema"] == replies.schema(TEMPLATES)
    first, *joints = pictures(sent)
    with Image.open(BytesIO(png(sheet(TEMPLATES)))) as drawn:
        assert first.tobytes() == drawn.convert("RGB").tobytes()
    colours = [each.getpixel((350, 260)) for each in joints]
    assert colours == [(255, 0, 0), (0, 255, 0), (0, 0, 255)]


def test_later_rounds_replay_the_conversation_and_end_it(server):
    first, second = turn(), turn(number=1)
    assert ask(server, completion(text(number=1)), turns=[first]).proposal == proposed(number=1)
    assert ask(server, completion(text(number=2)), turns=[first, second]).proposal is None
    sent = server.requests[-1]
    said = [json.loads(m["content"]) for m in sent["messages"] if m["role"] == "assistant"]
    assert [Proposal.model_validate(each["proposal"]) for each in said] == [
        first.proposal,
        second.proposal,
    ]
    assert first.facts in words(sent) and second.unmet[0] in words(sent)


def test_usage_is_what_the_server_says_and_dollars_follow_the_given_price(server, monkeypatch):
    usage = ask(server, completion(text(), usage=(8000, 500), cached=6000)).usage
    assert (usage.requests, usage.input_tokens, usage.output_tokens) == (1, 8000, 500)
    assert (usage.cache_read_tokens, usage.dollars) == (6000, None)
    monkeypatch.setenv("JODA_VLM_PRICE", "3/15")
    usage = ask(server, completion(text(), usage=(8000, 500), cached=6000)).usage
    assert usage.dollars == pytest.approx((2000 * 3 + 6000 * 0.3 + 500 * 15) / 1e6)


@pytest.mark.parametrize("usage", [None, ("8", 1), (-1, 5), (10, 10**12), (10, 5, 11)])
def test_what_is_not_counted_has_no_price(server, monkeypatch, usage):
    monkeypatch.setenv("JODA_VLM_PRICE", "3/15")
    body = completion(text(), usage=None)
    if usage:
        prompt, output, *cached = usage
        body["usage"] = {"prompt_tokens": prompt, "completion_tokens": output}
        body["usage"]["prompt_tokens_details"] = {"cached_tokens": cached[0] if cached else 0}
    answer = ask(server, body)
    assert answer.proposal == proposed()
    assert (answer.usage.requests, answer.usage.input_tokens) == (1, 0)
    assert answer.usage.dollars is None


def test_a_server_without_schemas_is_asked_in_words_from_then_on(server):
    server.script[:] = [without_schema]
    asking = OpenAI("qwen-test", server.address)
    for _ in range(2):
        answer = asking.propose(task(), ())
        assert answer.proposal == proposed()
    assert answer.usage.requests == 1
    assert ["response_format" in sent for sent in server.requests] == [True, False, False]
    told = server.requests[-1]["messages"][0]["content"]
    held = told[told.index(proposer.PLAINLY) + len(proposer.PLAINLY) :]
    assert json.loads(held) == replies.schema(TEMPLATES)


@pytest.mark.parametrize(
    "status,says",
    [(422, "Unprocessable"), (500, "Failed to parse grammar"), (501, "json_schema: to do")],
)
def test_a_server_that_chokes_on_the_schema_is_asked_in_words(server, status, says):
    bad = refusal(status, says, retry_after_ms=1)
    answer = ask(server, lambda asked: bad if "response_format" in asked else completion(text()))
    server.script[:] = [completion(text())]
    assert answer.proposal == proposed() and "response_format" not in server.requests[-1]


@pytest.mark.parametrize(
    "says,room",
    [
        ("Unsupported parameter: 'max_tokens'; use 'max_completion_tokens'.", 16_000),
        ("max_tokens is too large: the maximum context length is 8192 tokens", None),
    ],
)
def test_room_is_asked_for_as_the_server_wants_it(server, says, room):
    server.script[:] = [
        lambda asked: refusal(400, says) if "max_tokens" in asked else completion(text())
    ]
    assert OpenAI("o-test", server.address).propose(task(), ()).proposal == proposed()
    sent = server.requests[-1]
    assert sent.get("max_completion_tokens") == room and "response_format" in sent


@pytest.mark.parametrize(
    "around",
    [
        "{}",
        "```json\n{}\n```",
        "<think>A door {{or a lid}}?</think>\n{}",
        "weighs it ...</think>{}",
        "Here it is: {} Good luck!",
    ],
)
def test_what_stands_around_an_answer_is_taken_off(server, around):
    answer = ask(server, completion(around.format(text())))
    assert answer.proposal == proposed() and answer.usage.requests == 1


def test_an_answer_in_parts_is_put_together(server):
    whole = text()
    parts = [{"type": "text", "text": whole[:50]}, 3, {"type": "text", "text": whole[50:]}]
    assert ask(server, completion(parts)).proposal == proposed()


@pytest.mark.parametrize("failure", [429, 500, 503])
def test_passing_failures_are_retried_and_counted(server, failure):
    bad = refusal(failure, "Overloaded", retry_after_ms=1)
    answer = ask(server, bad, bad, completion(text()))
    assert answer.proposal == proposed()
    assert answer.usage.requests == len(server.requests) == 3


def test_dropped_connections_and_timeouts_are_retried_and_counted(server):
    answer = ask(server, "drop", "hang", completion(text()), timeout=0.3)
    assert answer.proposal == proposed()
    assert answer.usage.requests == len(server.requests) == 3


def spoilt(**values):
    answer = answers("refrigerator")[0]
    answer["proposal"]["effect_proposals"][0].update(values)
    return completion(json.dumps(answer))


FAILURES = {
    "no key": (refusal(401, f"Incorrect API key: {KEY}"), 1, "401: .*set OPENAI_API_KEY to a"),
    "no credit": (refusal(402, "Pay."), 1, r"\(402: Pay\); see to the account's credit"),
    "no model": (refusal(404, "model not found"), 1, "404: model not found.*ends in /v1, and the"),
    "no pictures": (refusal(400, "no image input"), 2, r"\(400: no image input\); choose another"),
    "many requests": (refusal(429, "Slow", retry_after_ms=1), 5, r"429: Slow\); wait a while"),
    "broken": (refusal(500, "Oops", retry_after_ms=1), 5, r"500: Oops\); try again later"),
    "hung up": ("drop", 5, "127.0.0.1:.* cannot be reached, or breaks off; start the server"),
    "refused": (completion(None, refusal="I can't.\x1b[2J"), 1, "declined to answer"),
    "filtered": (completion("", "content_filter"), 1, "qwen-test declined to answer; describe"),
    "cut off": (completion('{"status": "rev', "length"), 2, "cut off after 32000 tokens"),
    "no JSON": (completion("I like doors."), 2, "not even when told what is wrong: It is not JSON"),
    "nothing": (completion(None), 2, "It is not JSON"),
    "a tool": (completion(None, "tool_calls"), 2, "It is not JSON"),
    "wrong schema": (completion('{"status": "revised"}'), 2, "proposal: Input should be an object"),
    "no effect": (spoilt(effect_name="\x1b]8;;x"), 2, r"'\\u001b\]8;;x' is not in the vocabulary"),
    "infinity": (spoilt(confidence=1e999), 2, "should be a finite number"),
    "a page": ("page", 1, "does not answer as the chat API does; check --base-url"),
    "a list": ([1], 1, "does not answer as the chat API does"),
    "a half": ({"status": 200, "headers": {}, "body": b'{"id": ['}, 1, "does not answer as"),
    "brackets": ({"status": 200, "headers": {}, "body": b"[" * 10**5}, 1, "does not answer as"),
    "no choices": (completion("x") | {"choices": None}, 1, "does not answer as"),
    "nested": (completion("[" * 10**5), 2, "It is not JSON"),
    "a long error": (refusal(403, "e" * 10**6), 1, "use another key"),
    "an error in a list": (refusal(403, [1, {"x": "\x1b"}]), 1, "use another key"),
    "no reason": ({"status": 403, "headers": {}, "body": None}, 1, "no reason given"),
    "bare words": ({"status": 403, "headers": {}, "body": {"error": "No."}}, 1, r"\(403: No\)"),
    "detail": ({"status": 403, "headers": {}, "body": {"detail": "No."}}, 1, r"\(403: No\)"),
}


@pytest.mark.sweep(6)
@pytest.mark.parametrize("name", FAILURES)
def test_a_failure_is_a_sentence_and_keeps_its_cost(server, name):
    entry, requests, says = FAILURES[name]
    failure = fails(server, entry)
    assert re.search(says, str(failure)), failure
    assert failure.usage.requests == len(server.requests) == requests


def test_no_answer_in_time_is_a_sentence(server, monkeypatch):
    monkeypatch.setattr(proposer, "MAX_RETRIES", 0)
    assert "does not answer within 0.2 s" in str(fails(server, "hang", timeout=0.2))


def test_a_server_that_is_not_there_is_a_sentence(server, monkeypatch):
    monkeypatch.setattr(proposer, "MAX_RETRIES", 0)
    with pytest.raises(
        ProposalFailed, match=r"http://127\.0\.0\.1:1 cannot be reached, or breaks off; start"
    ) as no:
        OpenAI("qwen-test", "http://127.0.0.1:1/v1?token=hidden").propose(task(), ())
    assert "hidden" not in str(no.value)


def test_a_wrong_path_says_where_it_mostly_is(server):
    server.address = server.url
    assert "--base-url, which mostly ends in /v1" in str(fails(server, completion(text())))


@pytest.mark.parametrize("entry,quoted", [
    (completion("Sure!"), "not JSON"),
    (spoilt(start_ratio=0.9, end_ratio=0.1), "start_ratio must be less than end_ratio"),
])  # fmt: skip
def test_an_invalid_answer_is_repaired_by_quoting_what_is_wrong(server, entry, quoted):
    answer = ask(server, entry, completion(text()))
    assert answer.proposal == proposed() and answer.usage.input_tokens == 2000
    assert quoted in server.requests[1]["messages"][-1]["content"] and quoted in answer.notes[0]


def test_tokens_survive_an_interruption_after_them(server, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    server.script[:] = [completion("{")]
    create = OpenAI._create
    monkeypatch.setattr(
        OpenAI, "_create", lambda self, *a: create(self, *a) if not server.requests else stop()
    )
    with pytest.raises(ProposalInterrupted) as stopped:
        OpenAI("qwen-test", server.address).propose(task(), ())
    assert stopped.value.usage.input_tokens == 1000


LEAKS = {
    "in an error": refusal(403, f"bad key {KEY}; authorization: Bearer {KEY}"),
    "in a refusal": completion(None, refusal=f"not with {KEY}"),
    "in an answer": completion(f"your key is {KEY}"),
    "in a proposal": spoilt(reason=f"{KEY} tells me"),
    "in a wrong proposal": spoilt(effect_name=KEY),
}


@pytest.mark.sweep(4)
@pytest.mark.parametrize("name", LEAKS)
def test_the_key_is_told_nobody(name, server, tmp_path, caplog, monkeypatch):
    monkeypatch.setenv("OPENAI_API_KEY", KEY)
    caplog.set_level(logging.DEBUG)
    server.script[:] = [LEAKS[name]]
    session = Session.start(tmp_path / "out", MODELS / "refrigerator.xml", "door", pictures=NONE)
    asking, told = OpenAI("qwen-test", server.address), ""
    try:
        session.ask(asking)
    except JodaError:
        told = traceback.format_exc()
    assert server.requests and (told or name == "in a proposal")
    kept = [path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()]
    assert kept and not [content for content in kept if KEY.encode() in content]
    logged = [record.getMessage() for record in caplog.records]
    sent = words(server.requests[-1])  # with what is wrong with the answer
    shown = "\n".join([told, repr(asking), str(vars(session)), sent, *logged])
    assert logged and KEY not in shown and "[secret]" in shown


def test_the_key_is_sent_only_if_there_is_one(server, monkeypatch):
    assert ask(server, completion(text())).proposal  # the server takes "none"
    monkeypatch.setenv("OPENAI_API_KEY", "sk-wrong")
    failure = fails(server, completion(text()))
    assert "401" in str(failure) and "sk-wrong" not in str(failure)


@pytest.mark.parametrize(
    "url",
    ["127.0.0.1:8000", "ftp://x/v1", "http://", "http://[::1", "http://x:99999/", "http://x /v1",
     "http://x/\x1b[2J"],
)  # fmt: skip
def test_an_address_that_is_none_is_one_sentence(server, url):
    with pytest.raises(JodaError, match=r"--base-url.* is none; give one such as http") as wrong:
        OpenAI("qwen-test", url)
    assert harmless(str(wrong.value))


def test_mistakes_are_sentences(server, monkeypatch):
    with pytest.raises(JodaError, match=r"OPENAI_API_KEY is not set.*--base-url"):
        OpenAI("gpt-test")
    with pytest.raises(JodaError, match="needs the name of a model; give it with --vlm"):
        OpenAI(None, server.address)
    with pytest.raises(JodaError, match=r"a password.*OPENAI_CUSTOM_HEADERS") as secret:
        OpenAI("x", "http://me:hidden@127.0.0.1/v1")
    assert "hidden" not in str(secret.value)
    monkeypatch.setenv("OPENAI_API_KEY", "sk-é")
    with pytest.raises(JodaError, match="OPENAI_API_KEY holds characters that no key has"):
        OpenAI("x", server.address)
    monkeypatch.setitem(sys.modules, "openai", None)
    with pytest.raises(JodaError, match="OpenAI-compatible server needs the package"):
        OpenAI("x", server.address)


def test_effort_and_model_are_passed_on(server, monkeypatch):
    ask(server, completion(text()), effort="low")
    assert server.requests[0]["reasoning_effort"] == "low"
    monkeypatch.setenv("JODA_VLM", "llava")
    assert OpenAI(None, server.address).name == "openai:llava"
    assert not isinstance(OpenAI(None, server.address), BatchProposer)


def test_the_ablation_yields_a_profile(server):
    flat = [{"s": 0, "value": 0.5}, {"s": 1, "value": 0.5}]
    curves = {"conservative": flat, "friction": flat, "damping": flat}
    server.script[:] = [completion(json.dumps(curves))]
    profile, usage = OpenAI("qwen-test", server.address).ablate(task())
    assert isinstance(profile, Profile) and usage.requests == 1


def test_the_whole_command(server, tmp_path, monkeypatch, capsys):
    """Two rounds, then complete; the history says who was asked and what it took."""
    changed = answers("oven")[0]
    changed["proposal"]["effect_proposals"][0]["refineFactor"]["conservative"] = 0.8
    bodies = [completion(text("oven")), completion(json.dumps(changed))]
    server.script[:] = [*bodies, completion('{"status": "complete", "proposal": null}')]
    monkeypatch.setattr("joda.propose.session.render", lambda *_, **__: [])
    arguments = ["generate", str(MODELS / "oven.xml"), "--joint", "door", "-o", str(tmp_path / "o")]
    options = ["--proposer", "openai", "--vlm", "qwen-test", "--base-url", server.address]
    monkeypatch.setattr(sys, "argv", ["joda", *arguments, *options, "--effort", "low", "--json"])
    with pytest.raises(SystemExit) as end:
        main()
    told = json.loads(capsys.readouterr().out)
    assert end.value.code == 0
    assert [round["proposer"] for round in told["rounds"]] == ["openai:qwen-test"] * 2
    assert told["usage"]["requests"] == len(server.requests) == 3


def test_options_of_models_are_not_for_rules(tmp_path):
    for option in ({"vlm": "x"}, {"base_url": "http://x"}, {"effort": "low"}):
        with pytest.raises(JodaError, match="are of the proposers anthropic and openai, not of"):
            generate(MODELS / "oven.xml", "door", tmp_path / "o", proposer="offline", **option)
    with pytest.raises(JodaError, match="effort is 'huge'; give one of low, medium"):
        generate(MODELS / "oven.xml", "door", tmp_path / "o", proposer="openai", effort="huge")
    assert not (tmp_path / "o").exists()
