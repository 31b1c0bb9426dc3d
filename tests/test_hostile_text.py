"""Those who mean harm: names, files and answers that would act on who reads them.

What cannot be used is refused in one sentence; what can is shown escaped. Nothing acts on the
terminal, a page, the XML or another file. `TEXTS` are hostile names, `FILES` hostile files,
`ANSWERS` what a hostile service answers, `MODELS` hostile MJCF.
"""

import ast
import json
import logging
import os
import re
import shlex
import traceback
from pathlib import Path
from xml.sax.saxutils import quoteattr

import mujoco
import numpy as np
import pytest
from forked import Forked
from messages_server import KEY, error, message, serve
from PIL import Image
from test_prompts import answers, task
from workshop import RUN, check_whole, contents, fill

import joda
from joda import JodaError, Profile
from joda.component import MAX_VALUE, Component
from joda.diagnosis.findings import read_diagnosis
from joda.files import LARGEST, file_name
from joda.pictures.page import page, paragraph, picture, table
from joda.plain import LONGEST, one_line, plain
from joda.propose.anthropic import Anthropic, ProposalFailed
from joda.propose.history import History
from joda.propose.requirements import read_requirements
from joda.propose.session import NONE, Session
from joda.scenes.scene import read_profiles
from joda.terminal.progress import progress_bar, spinner

CLI = Path(joda.__file__).parent / "cli"
ACTS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2028\u2029\u2066-\u2069\U000e0041]")

TEXTS = {
    "colours": "\x1b[31;1mred\x1b[0m",
    "a link": "\x1b]8;;http://example.org\x1b\\click\x1b]8;;\x1b\\",
    "one-byte escapes": "\x9b2J\x9d0;title\x9c",
    "a bell and more": "a\x07\x08\x7f\x0b",
    "a carriage return": "evil\rdoor",
    "turned around": "\u202ecod.exe\u2066",
    "line separators": "a\u2028b\u0085c",
    "unseen tags": "a\U000e0041b\u200b\ufeff",
    "rich markup": "[bold]x[/] [/no] [link=http://example.org]y",
    "HTML": "<script>alert(1)</script><img src=x onerror=alert(1)>\"'&amp;",
    "Markdown": "**b** [x](javascript:alert(1)) | `c`",
    "XML": '</config>"/><plugin plugin="x"/> -- --> ]]> <!-- &lt;',
    "a path": "../../../evil",
    "an absolute path": "/etc/passwd",
    "mathematics": r"$\frac{$ x_{$",
    "a format": "{0} {x.__class__} %s %n ${HOME} `id`",
    "a very long name": "n" * 1000,
}
WRITABLE = [name for name, text in TEXTS.items() if not re.search("[\x00-\x08\x0b-\x1f]", text)]
"""Names that XML can hold."""
DOOR = """<mujoco><compiler angle="radian"/><worldbody>
  <body><joint name={} range="0 1.5"/><geom type="box" size=".3 .02 .2" mass="1"/></body>
  <body><joint name="other" range="0 1"/><geom size=".1" mass="1"/></body>
</worldbody></mujoco>"""


def door(name="door"):
    """A model with a joint of that name; control characters as the numbers that MuJoCo reads."""
    return DOOR.format(re.sub("[\x00-\x1f]", lambda m: f"&#{ord(m[0])};", quoteattr(name)))


def profile(name="door", label="rub"):
    joint = {"name": name, "type": "hinge", "range": [0, 1.5], "unit": "rad"}
    part = {"label": label, "interval": [0, 1], "x": [0, 1], "y": [1, 1]}
    return {"joint": joint, "channels": {"friction": {"components": [part]}}}


def harmless(text):
    """Whether nothing in the text acts on a terminal."""
    return not ACTS.search(text)


@pytest.fixture(scope="module")
def forked(tmp_path_factory):
    server = Forked(tmp_path_factory.mktemp("cache"))
    yield server
    server.close()


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    folder = tmp_path_factory.mktemp("good")
    fill(folder)
    return folder


# --- what is shown


@pytest.mark.parametrize("name", TEXTS)
def test_what_is_shown_acts_on_nothing_and_is_the_same_json(name):
    text = TEXTS[name]
    shown = plain(text)
    assert harmless(shown) and plain(shown) == shown
    assert json.loads(plain(json.dumps([text], ensure_ascii=False))) == [text]
    assert plain("\ud800\x1b") == r"\ud800\u001b"
    html = page(text, paragraph(text), table([text], [[text]]), picture(b"", text))
    assert harmless(html)
    kept = {"p", "table", "tr", "th", "td", "img", "title", "h1", "html", "meta", "style"}
    assert set(re.findall(r"<(\w+)", html)) == kept and " onerror=" not in html.replace("x on", "")
    assert re.fullmatch(r"[\w][\w.-]{0,60}", file_name(text))


def test_letters_of_all_scripts_stay():
    text = "Tür дверь 扉 دَر می‌خواهم 👩‍👧 é\n\tx"
    assert plain(text) == text


def test_a_sentence_is_one_line_of_bounded_length():
    for text in TEXTS.values():
        said = str(JodaError(f"file.json: {text}\n{text * 300}: give another name."))
        assert harmless(said) and "\n" not in said and len(said) <= LONGEST
        assert said.startswith("file.json: ") and said.endswith(": give another name.")
        assert one_line(said) == said


def test_only_say_prints():
    for path in CLI.glob("*.py"):
        calls = [n for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Call)]
        names = {ast.unparse(call.func) for call in calls}
        assert path.name == "say.py" or not names & {"print", "sys.stdout.write", "typer.echo"}


@pytest.mark.parametrize("name", TEXTS)
def test_progress_obeys_nothing(name, capfd, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "3000")
    with spinner("task") as told:
        told(TEXTS[name])
    with progress_bar() as bar:
        bar(1, 2, TEXTS[name])
    shown = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", capfd.readouterr().err).replace("\r", "")
    assert harmless(shown) and one_line(TEXTS[name]).rstrip() in shown


# --- names


@pytest.mark.slow
@pytest.mark.parametrize("name", TEXTS)
def test_a_joints_name(name, forked, tmp_path):
    folder = tmp_path / "work"
    folder.mkdir()
    (folder / "m.xml").write_text(door(TEXTS[name]))
    (folder / "c.json").write_text(json.dumps(profile()))
    written = ["attach", "m.xml", "c.json", "--joint", "#0", "-o", "s.xml"]
    for command in (["context", "m.xml", "--joint", "#0"], ["context", "m.xml", "--joint", "no"]):
        ended = forked.run(command, folder, 60)
        assert ended.status == 2 * (command[-1] == "no")
        assert plain(TEXTS[name]) in ended.stdout + ended.stderr
        assert harmless(ended.stdout + ended.stderr)
    ended = forked.run(written, folder, 60)
    assert harmless(ended.stdout + ended.stderr) and "Traceback" not in ended.stderr
    assert os.listdir(tmp_path) == ["work"]
    if name in WRITABLE or name == "a carriage return":
        assert ended.status == 0, ended.stderr
        assert harmless((folder / "s.xml").read_text().replace(TEXTS[name], "", 1))
        assert list(read_profiles(folder / "s.xml")) == [TEXTS[name]]
        assert mujoco.MjModel.from_xml_path(str(folder / "s.xml")).nbody == 3
    else:
        assert "a name in it is not XML; give it another one." in ended.stderr


def test_a_name_in_reports_pictures_and_files_names(forked, tmp_path):
    name = TEXTS["a path"] + TEXTS["HTML"] + TEXTS["mathematics"] + TEXTS["turned around"] + "\x9b"
    folder = tmp_path / "work"
    folder.mkdir()
    (folder / "m.xml").write_text(door(name))
    (folder / "<b>$\\x.csv").write_text(RUN)
    for number, joint in enumerate(("#0", "other")):
        (folder / "c.json").write_text(json.dumps(profile(label="$\\frac{<b>")))
        new = ["attach", "m.xml" if not number else "s.xml", "c.json", "--joint", joint]
        assert forked.run([*new, "-o", "s.xml", "--force"], folder, 60).status == 0
    for command in (
        ["compare", "s.xml", "<b>$\\x.csv", "--joint", "#0", "--report", "r.html", "-o", "r.png"],
        ["plot", "s.xml", "--joint", name],
        ["simulate", "s.xml", "--joint", "#0", "--release", "1", "--duration", ".2", "-o", "m.csv"],
    ):
        ended = forked.run(command, folder, 60)
        assert ended.status == 0 and harmless(ended.stdout + ended.stderr), ended.stderr
    html = (folder / "r.html").read_text()
    assert harmless(html) and "<b>" not in html and "&lt;b&gt;$\\x.csv" in html
    assert len(list(folder.glob("s.*.png"))) == 1 and os.listdir(tmp_path) == ["work"]
    for path in folder.iterdir():
        check_whole(path)


FORGED = "\nForged: all is well"
LINES = {"joint": "door" + FORGED, "body": "leaf\r\t" + FORGED, "geom": "[red]pane" + FORGED}
CELLAR = """<mujoco><compiler angle="radian"/><worldbody>
  <body name={body}><joint name={joint} axis="0 0 1" range="0 1.5"/>
    <geom name={geom} type="box" size=".3 .02 .2" pos=".3 0 0" mass="1"/></body>
  <body name={body2} pos=".3 .35 0"><geom name={geom2} type="box" size=".1 .1 .1"/></body>
</worldbody></mujoco>"""
SAYS = {
    "context": "context m.xml --joint #0",
    "attach": "attach m.xml c.json --joint #0 -o new.xml",
    "generate": "generate m.xml --joint #0 -o gen --proposer offline --rounds 1",
    "revise": "revise gen --feedback 'it slams' --proposer offline",
    "compare": "compare m.xml r.csv --joint #0 --report r.html -o r.png",
    "diagnose": "diagnose m.xml r.csv --joint #0",
    "improve": "improve m.xml r.csv --joint #0 -o better.xml",
    "simulate": "simulate m.xml --joint #0 --push 5 --duration .5 -o m.csv",
    "plot": "plot new.xml",
    "not found": "context m.xml --joint no",
}


@pytest.mark.long
def test_a_name_of_several_lines_forges_none(forked, tmp_path):
    def quoted(text):
        return re.sub("[\x00-\x1f]", lambda m: f"&#{ord(m[0])};", quoteattr(text))

    names = {key: quoted(text) for key, text in LINES.items()}
    names |= {key + "2": quoted(text + "2") for key, text in LINES.items()}
    (tmp_path / "m.xml").write_text(CELLAR.format(**names))
    (tmp_path / "c.json").write_text(json.dumps(profile()))
    time = np.arange(0, 4, 0.01)
    rows = zip(time, 0.35 + 0.3 * np.sin(2 * time), strict=True)
    (tmp_path / "r.csv").write_text("time,position\n" + "".join(f"{t},{q}\n" for t, q in rows))
    said = ""
    for name, command in SAYS.items():
        ended = forked.run(shlex.split(command), tmp_path, 120)
        assert ended.status == 2 * (name == "not found"), ended.stderr
        said += ended.stdout + ended.stderr
    assert harmless(said) and r"door\nForged: all is well" in said and "[red]pane" in said
    assert not [text for text in said.splitlines() if text.startswith("Forged")]
    facts = json.loads((tmp_path / "gen" / "history.json").read_text())["rounds"][0]["facts"]
    assert not [text for text in facts.splitlines() if text.startswith("Forged")]


@pytest.mark.parametrize("name", WRITABLE)
def test_a_label_round_trips_or_is_refused(name, tmp_path):
    label = TEXTS[name].replace("|", "/").replace(";", ",")
    (tmp_path / "m.xml").write_text(door())
    (tmp_path / "c.json").write_text(json.dumps(profile(label=label)))
    if plain(label) != label:
        with pytest.raises(JodaError, match="label: must not hold control characters or what"):
            Profile.read(tmp_path / "c.json")
        return
    joda.attach(tmp_path / "m.xml", tmp_path / "c.json", tmp_path / "s.xml")
    found = read_profiles(tmp_path / "s.xml")["door"]
    assert found.channels.friction.components[0].label == label
    joda.attach(tmp_path / "s.xml", found, tmp_path / "t.xml")
    assert read_profiles(tmp_path / "t.xml") == {"door": found}


# --- files


def changed(*path, to):
    """What makes a file's content one in which something is another."""

    def change(content):
        content = json.loads(json.dumps(content))
        node = content
        for key in path[:-1]:
            node = node[key]
        node[path[-1]] = to
        return json.dumps(content)

    return change


PART = ("channels", "conservative", "components")
BIG = "9" * 5000
FILES = {
    "deep brackets": ("composed", lambda c: "[" * 10**5, "not JSON (recursion limit exceeded"),
    "a long integer": (
        "composed",
        lambda c: json.dumps(c).replace('"schema_version": 1', f'"schema_version": {BIG}'),
        "not JSON (number out of range",
    ),
    "a lone surrogate": (
        "composed",
        lambda c: json.dumps(c | {"x": "\ud800"}),
        "not JSON (unexpected end of hex escape",
    ),
    "a key that acts": (
        "composed",
        lambda c: json.dumps(c | {"\x1b[2J[/]": 1}),
        "\\u001b[2J[/]: unknown key; remove it",
    ),
    "a long key": ("composed", lambda c: json.dumps(c | {"k" * 10**6: 1}), "kk: unknown key;"),
    "a long label": (
        "composed",
        changed(*PART, 0, "label", to="x" * 10**6),
        "label: String should have at most 10000 characters.",
    ),
    "a NUL": ("composed", changed(*PART, 0, "label", to="a\0"), "must not hold ';', '|' or line"),
    "thousands of components": (
        "composed",
        lambda c: changed(*PART, to=c["channels"]["conservative"]["components"] * 3000)(c),
        "must have at most 200 components",
    ),
    "a great range": (
        "composed",
        changed("joint", "range", to=[-1e308, 1e308]),
        "joint: range must lie between -1e+06 and 1e+06 and be 1e-09 wide.",
    ),
    "a tiny range": ("composed", changed("joint", "range", to=[0, 5e-324]), "and be 1e-09 wide."),
    "a great force": (
        "composed",
        changed(*PART, 0, "y", to=[1e308] * 6),
        "y must lie between -1e15 and 1e15",
    ),
    "a great effect": (
        "composed",
        changed("effects", to=[{"effect": "added_inertia", "inertia": 1e308}]),
        "inertia must lie between -1e15 and 1e15.",
    ),
    "an effect that acts": (
        "composed",
        changed("effects", to=[{"effect": "\x1b[2J"}]),
        "there is no effect '\\x1b[2J'; known are",
    ),
    "thousands of effects": (
        "proposal",
        lambda c: changed("effect_proposals", to=c["effect_proposals"][:1] * 5000)(c),
        "5000 effects are proposed; a joint has at most 100.",
    ),
    "a great factor": (
        "proposal",
        changed("effect_proposals", 0, "refineFactor", to={"friction": 1e308}),
        "refineFactor.friction: must be less than or equal to 100.",
    ),
    "a long reason": (
        "proposal",
        changed("effect_proposals", 0, "reason", to="r" * 10**6),
        "reason: String should have at most 10000 characters.",
    ),
    "a template that is a path": (
        "proposal",
        changed("effect_proposals", 0, "effect_name", to="../../\x1b]8;;x"),
        "../../\\u001b]8;;x",
    ),
    "pictures from elsewhere": (
        "history",
        changed("pictures", to=["../../../../etc/passwd"]),
        "pictures: must be names of files in pictures/, not paths.",
    ),
    "a model with a NUL": (
        "history",
        changed("model", to="a\0b"),
        "model: must be a path; there is a NUL in it.",
    ),
    "a finding that acts": (
        "diagnosis",
        changed("effects", 0, "effect", to="\x1b[2J/../x"),
        "\\u001b[2J/../x",
    ),
    "a long finding": ("diagnosis", changed("effects", 0, "effect", to="e" * 10**6), "eee"),
    "an interval of great numbers": (
        "diagnosis",
        changed("effects", 0, "interval", to=[1e308, -1e308]),
        "interval must be two increasing numbers from 0 to 1",
    ),
}
PATHS = {"history": "gen/history.json"}
READS = {
    "composed": "attach microwave.xml composed.json --joint door -o new.xml",
    "proposal": "compile proposal.json --model microwave.xml --joint door -o new.json",
    "history": "revise gen --feedback weaker",
    "diagnosis": "add scene.xml run.csv --joint door --diagnosis diagnosis.json -o new.xml",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_a_file_is_refused_in_a_sentence(name, good, forked):
    kind, change, sentence = FILES[name]
    path = good / PATHS.get(kind, f"{kind}.json")
    content = path.read_text()
    try:
        path.write_text(change(json.loads(content)))
        before = contents(good)
        ended = forked.run(READS[kind].split(), good, 60)
        assert contents(good) == before
    finally:
        path.write_text(content)
    assert ended.status == 2 and not ended.stdout
    assert sentence in ended.stderr and harmless(ended.stderr)
    assert ended.stderr.count("\n") == 1 and len(ended.stderr) < LONGEST + 20


def test_a_file_without_end_is_not_read(tmp_path):
    path = tmp_path / "c.json"
    with path.open("wb") as file:
        file.truncate(LARGEST + 10**6)
    for read in (Profile.read, read_diagnosis, History.read):
        with pytest.raises(JodaError, match=r"has 21 MB; a file of this kind has at most 20 MB\."):
            read(path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["HTML", "a link", "turned around", "rich markup", "XML"])
def test_a_proposals_words_are_shown_escaped(name, good, forked, tmp_path):
    proposal = json.loads((good / "proposal.json").read_text())
    proposal["effect_proposals"][0]["reason"] = TEXTS[name]
    proposal["joint_summary"]["motion_description"] = TEXTS[name]
    (tmp_path / "p.json").write_text(json.dumps(proposal))
    model = str(good / "microwave.xml")
    command = ["generate", model, "--joint", "door", "--proposer", "p.json", "-o", "out"]
    ended = forked.run([*command, "--rounds", "1"], tmp_path, 60)
    assert ended.status == 0, ended.stderr
    assert f": {plain(TEXTS[name])}\n" in ended.stdout and harmless(ended.stdout + ended.stderr)
    for path in (tmp_path / "out").glob("*.json"):
        assert harmless(path.read_text())
    history = History.read(tmp_path / "out" / "history.json")
    assert history.rounds[0].proposal.effect_proposals[0].reason == TEXTS[name]


# --- models

ENTITIES = "".join(f'<!ENTITY e{k + 1} "{f"&e{k};" * 10}">' for k in range(9))
MODELS = {
    "entities in entities": f'<!DOCTYPE m [<!ENTITY e0 "lol">{ENTITIES}]>' + door("&e9;"),
    "an external entity": '<!DOCTYPE m [<!ENTITY x SYSTEM "secret.txt">]>'
    + door().replace("<worldbody>", "&x;<worldbody>", 1),
    "a large entity": f'<!DOCTYPE m [<!ENTITY a "{"A" * 10**5}">]>'
    + door().replace("<worldbody>", "&a;" * 10**4 + "<worldbody>", 1),
    "a large attribute": door("n" * 10**6),
    "a large comment": f"<!--{'-x' * 10**6}-->" + door(),
    "deep elements": door().replace("<body>", "<body>" * 10**4, 1),
    "a great mass": door().replace('mass="1"', 'mass="1e308"'),
    "a great range": door().replace("0 1.5", "-1e308 1e308"),
    "an endless include": door().replace("<worldbody>", '<include file="/dev/zero"/><worldbody>'),
    "itself": door().replace("<worldbody>", '<include file="m.xml"/><worldbody>'),
}
REFUSED = {
    "a large attribute": "has a name of 1000000 letters; give at most 1000.",
    "deep elements": "Element nesting is too deep.",
    "a great mass": "has a mass or an inertia of inf kg or kg·m²; MuJoCo computes with at most",
    "an endless include": "Empty file '/dev/zero'",
    "itself": "already included",
}


@pytest.mark.parametrize("name", MODELS)
def test_a_model_is_bounded_or_refused(name, forked, tmp_path):
    text = MODELS[name].replace("&amp;e9;", "&e9;")
    (tmp_path / "m.xml").write_text(text)
    (tmp_path / "secret.txt").write_text("SECRET")
    (tmp_path / "c.json").write_text(json.dumps(profile()))
    command = ["attach", "m.xml", "c.json", "--joint", "#0", "-o", "s.xml"]
    ended = forked.run(command, tmp_path, 30)
    assert not ended.interrupted and ended.stderr.count("\n") == (ended.status == 2)
    if name in REFUSED:
        assert ended.status == 2 and REFUSED[name] in ended.stderr
        return
    assert ended.status == 0, ended.stderr
    scene = (tmp_path / "s.xml").read_text()
    assert "SECRET" not in scene and "lol" not in scene.replace('"lol"', "")
    assert len(scene) < len(text) + 10**4
    if "entit" in name:
        assert "it declares an entity, which MuJoCo does not expand" in ended.stdout
    if name == "a great range":
        ended = forked.run(["context", "m.xml", "--joint", "#0"], tmp_path, 30)
        assert "joint 'door': range must lie between" in ended.stderr


# --- the service that is asked


def good_answer(**values):
    answer = answers("refrigerator")[0]
    answer["proposal"]["effect_proposals"][0].update(values)
    return answer


def thousands():
    answer = good_answer()
    answer["proposal"]["effect_proposals"] *= 2000
    return answer


NO_MESSAGE = "does not answer as the Messages API does; check --base-url or ANTHROPIC_BASE_URL."
GREAT = message(json.dumps(good_answer()), input_tokens=10**400)
ANSWERS = {
    "deep brackets": (message("[" * 10**5), "It is not JSON (maximum recursion depth"),
    "deep in the proposal": (
        message('{"status":"revised","proposal":' + "[" * 900 + "]" * 900 + "}"),
        "recursion limit exceeded",
    ),
    "a long integer": (message(f'{{"status": {BIG}}}'), "It is not JSON (Exceeds the limit"),
    "a great number": (
        message(json.dumps(good_answer(confidence=1e308))),
        "confidence: Input should be less than or equal to 1.",
    ),
    "infinity": (message(json.dumps(good_answer(confidence=1e999))), "should be a finite number"),
    "thousands of effects": (message(json.dumps(thousands())), "a joint has at most 100."),
    "a long reason": (message(json.dumps(good_answer(reason="r" * 10**6))), "at most 10000"),
    "a lone surrogate": (message(json.dumps(good_answer(reason="\ud800"))), "Invalid JSON"),
    "a name that acts": (
        message(json.dumps(good_answer(effect_name="\x1b]8;;x"))),
        "'\\u001b]8;;x' is not in the vocabulary",
    ),
    "no content": (message("") | {"content": None}, NO_MESSAGE),
    "a text for content": (message("") | {"content": "x"}, NO_MESSAGE),
    "no text": (message(None), NO_MESSAGE),
    "great counts": (GREAT, NO_MESSAGE),
    "words for counts": (message("", input_tokens="\x1b"), NO_MESSAGE),
    "no counts": (message("", output_tokens=None), NO_MESSAGE),
    "fewer than none": (message("", output_tokens=-1), NO_MESSAGE),
    "JSON that is cut off": ({"status": 200, "headers": {}, "body": b'{"id": ['}, NO_MESSAGE),
    "brackets too deep": ({"status": 200, "headers": {}, "body": b"[" * 10**5}, NO_MESSAGE),
    "a list": ([1], NO_MESSAGE),
    "a long error": (error(400, "x", "e" * 10**6), "choose another model with --vlm."),
    "an error that acts": (error(400, "x", "\x1b[2J\r\n[/]"), "\\u001b[2J\\r [/]"),
    "an error that is none": ({"status": 400, "headers": {}, "body": None}, "no reason given"),
}
LEAKS = {
    "in an error": error(400, "x", f"bad x-api-key {KEY}; authorization: Bearer {KEY}"),
    "in a refusal": error(401, "authentication_error", f"invalid x-api-key: {KEY}"),
    "in a list": {"status": 403, "headers": {}, "body": {"error": {"message": [KEY]}}},
    "in an answer": message(f"your key is {KEY}"),
    "in a proposal": message(json.dumps(good_answer(reason=f"{KEY} tells me"))),
    "in a wrong proposal": message(json.dumps(good_answer(effect_name=KEY))),
}


@pytest.fixture
def server(monkeypatch):
    import anthropic

    monkeypatch.setattr(anthropic._base_client, "INITIAL_RETRY_DELAY", 0.001)
    monkeypatch.setenv("ANTHROPIC_API_KEY", KEY)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    for name in ("BASE_URL", "AUTH_TOKEN", "CUSTOM_HEADERS", "LOG"):
        monkeypatch.delenv(f"ANTHROPIC_{name}", raising=False)
    with serve() as state:
        yield state


@pytest.mark.slow
@pytest.mark.parametrize("name", ANSWERS)
def test_an_answer_is_refused_in_a_sentence(name, server):
    server.script[:], sentence = [ANSWERS[name][0]], ANSWERS[name][1]
    with pytest.raises(ProposalFailed) as failure:
        Anthropic("claude-test", server.url).propose(task(), ())
    said = str(failure.value)
    assert sentence in said and harmless(said) and "\n" not in said and len(said) <= LONGEST


@pytest.mark.parametrize("name", LEAKS)
def test_the_key_is_told_nobody(name, server, tmp_path, caplog):
    caplog.set_level(logging.DEBUG)
    server.script[:] = [LEAKS[name]]
    model = Path(__file__).parents[1] / "models" / "refrigerator.xml"
    session = Session.start(tmp_path / "out", model, "door", pictures=NONE)
    proposer, told = Anthropic("claude-test", server.url), ""
    try:
        session.ask(proposer)
    except JodaError:
        told = traceback.format_exc()
    assert server.requests and (told or name == "in a proposal")
    kept = [path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()]
    assert kept and not [text for text in kept if KEY.encode() in text]
    logged = [record.getMessage() for record in caplog.records]
    shown = "\n".join([told, repr(proposer), str(vars(session)), *logged])
    assert logged and KEY not in shown
    assert "[secret]" in shown


def test_other_secrets_are_told_nobody(server, monkeypatch):
    monkeypatch.setenv("ANTHROPIC_CUSTOM_HEADERS", "Proxy-Authorization: Basic abcdefgh")
    server.script[:] = [error(400, "x", "got abcdefgh and Basic abcdefgh")]
    with pytest.raises(ProposalFailed, match=r"got \[secret\] and \[secret\]"):
        Anthropic("claude-test", f"{server.url}/").propose(task(), ())
    with pytest.raises(JodaError, match="holds a user name or a password, which logs") as failure:
        Anthropic("claude-test", "http://me:hidden@127.0.0.1:1")
    assert "hidden" not in str(failure.value)
    with pytest.raises(ProposalFailed, match=r"http://127\.0\.0\.1:1 cannot be reached") as failure:
        Anthropic("claude-test", "http://127.0.0.1:1/?token=hidden").propose(task(), ())
    assert "hidden" not in str(failure.value)
    monkeypatch.setenv("ANTHROPIC_API_KEY", "sk-é\x1b")
    with pytest.raises(JodaError, match="holds characters that no key has; set it anew") as failure:
        Anthropic("claude-test", server.url)
    assert "sk-" not in str(failure.value)


def test_a_batchs_answer_that_is_no_message(server, tmp_path, monkeypatch):
    from joda.propose import Ask

    monkeypatch.setenv("JODA_POLL_S", "0.001")
    bodies = iter([message("x") | {"content": None}, None])
    refusal = {"type": "errored", "error": error(400, "x", f"bad {KEY}")["body"]}

    def result(entry):
        body = next(bodies)
        return {"type": "succeeded", "message": body} if body else refusal

    server.results = result
    asks = [Ask(name, task(), ()) for name in ("a", "b")]
    proposer = Anthropic("claude-test", server.url)
    said = sorted(str(e) for _, e in proposer.propose_many(asks, tmp_path / "batch.json"))
    assert said == [
        "the service refuses the request (bad [secret]).",
        "the service's answer is no message; ask again.",
    ]


def test_the_largest_numbers_that_a_file_may_hold_are_drawn(tmp_path):
    largest = Component(interval=(0, 1), x=(0, 1), y=(MAX_VALUE, MAX_VALUE)).model_dump()
    content = profile() | {"channels": {"conservative": {"components": [largest] * 200}}}
    content["joint"]["range"] = [-1e6, 1e6]
    (tmp_path / "c.json").write_text(json.dumps(content))
    with Image.open(joda.plot(tmp_path / "c.json")) as drawn:
        assert drawn.format == "PNG"


WORDS = {
    "a name that is no text": (
        ["context", "m\udcff.xml"],
        r"'m\udcff.xml' is not UTF-8; rename the",
    ),
    "a wish without end": (
        ["generate", "oven.xml", "-o", "new", "--describe", "x" * 20_000],
        "joda: description: String should have at most 10000 characters.\n",
    ),
    "a complaint without end": (
        ["revise", "gen", "--feedback", "x" * 20_000],
        "joda: feedback has 20000 characters; say it in at most 10000.\n",
    ),
    "a file's name that acts": (
        ["context", "\x1b[2J\r.xml"],
        r"joda: \u001b[2J\r.xml: no such file",
    ),
    "a format that joda has not": (
        ["export", "oven.xml", "-o", "new", "--to", "obj"],
        "joda: Invalid value for '--to': 'obj' is not one of 'native', 'urdf', 'sdf', 'usd'. Try",
    ),
    "a command that acts": (["\x1b[2J"], r"No such command '\x1b[2J'. Try --help."),
}


@pytest.mark.parametrize("name", WORDS)
def test_words_of_a_command_line_are_refused_in_a_sentence(name, good, forked):
    arguments, sentence = WORDS[name]
    joint = ["--joint", "door"] if arguments[0] in ("context", "generate") else []
    before = contents(good)
    ended = forked.run([*arguments, *joint], good, 60)
    assert ended.status == 2 and not ended.stdout and contents(good) == before
    assert sentence in ended.stderr and harmless(ended.stderr) and ended.stderr.count("\n") == 1


def test_no_text_takes_long_to_read(forked, tmp_path):
    """Patterns that look for one word and then another are slow where both are repeated."""
    assert [
        one.name for one in read_requirements("it stays where it is left; " + "shut when " * 10**4)
    ]
    read_requirements(f"it clicks in {'9' * 9000} positions")
    spaces = (
        door().replace("<joint ", f"<joint{' ' * 10**5}", 1).replace('5"/>', f'5"{" " * 10**5}/>')
    )
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "door.xml").write_text(spaces)
    (tmp_path / "models" / "comments.xml").write_text("<!--" * 10**6)
    (tmp_path / "models" / "includes.xml").write_text("<mujoco>" + "<include " * 10**6)
    command = ["generate", "models", "-o", "out", "--proposer", "offline", "--rounds", "1"]
    ended = forked.run(command, tmp_path, 25)
    assert not ended.interrupted and "door/door: " in ended.stdout, ended.stderr
