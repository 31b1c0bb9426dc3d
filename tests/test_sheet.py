"""The contact sheet of a folder, and going through its doubtful joints."""

import base64
import io
import json
import re
import secrets
import shutil
from html.parser import HTMLParser
from xml.etree import ElementTree

import mujoco
import pytest
from PIL import Image
from test_generate import command_line, without_a_key, without_rendering  # noqa: F401

from joda import Decision, JodaError, generate_all
from joda.propose import session
from joda.propose.history import History
from joda.propose.sheet import Entry, sheet

HOSTILE = "</script><script>alert(1)</script>\"'><img src=x onerror=alert(2)>\u202e"
BOX = """<mujoco model="m"><compiler angle="radian"/><worldbody>
  <body name="a"><joint name="{name}" axis="0 0 1" range="0 1.5"/>
    <geom type="box" size=".2 .01 .2" pos=".2 0 0" mass="2"/></body>{more}</worldbody></mujoco>"""
SECOND = """<body name="drawer" pos="0 3 0"><joint name="drawer" type="slide" axis="1 0 0"
  range="0 .3"/><geom type="box" size=".2 .2 .1" mass="2"/></body>"""


class Page(HTMLParser):
    """What a browser makes of a page: its elements, and their text."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.text = [], ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_data(self, data):
        self.text += data

    def all(self, name):
        return [attributes for tag, attributes in self.tags if tag == name]


@pytest.fixture
def models(tmp_path):
    """A hinge with a hostile name and a slide, both of which nothing tells much of."""
    folder = tmp_path / "models"
    folder.mkdir()
    name = HOSTILE.replace("&", "&amp;").replace("<", "&lt;").replace('"', "&quot;")
    (folder / "two.xml").write_text(BOX.format(name=name, more=SECOND.replace("drawer", "q")))
    (folder / "broken.xml").write_text("<mujoco><worldbody><body></worldbody></mujoco>")
    return folder


@pytest.mark.usefixtures("without_a_key")
def test_a_folder_ends_with_a_page_that_needs_nothing_else_and_obeys_no_name(models, tmp_path):
    done = generate_all(models, tmp_path / "out", rounds=1)
    text = (tmp_path / "out" / "sheet.html").read_text()
    page = Page(text)
    assert len(page.all("article")) == len(done) == 3
    assert len(page.all("script")) == 1 and not any("onerror" in a for _, a in page.tags)
    assert "\u202e" not in text and "alert(1)" in page.text
    sources = [a.get("src") or a.get("href") for _, a in page.tags if {"src", "href"} & a.keys()]
    assert sources and not any(re.match(r"\w+:(?!image/jpeg)", each) for each in sources)
    cards = [a for a in page.all("article") if a.get("class") != "failed"]
    made = {k: one for k, one in done.items() if not isinstance(one, JodaError)}
    for card, one in zip(cards, made.values(), strict=True):
        last = one.history.rounds[-1]
        assert card["data-kind"] == last.recognised.title
        assert float(card["data-likely"]) == last.sure
        assert int(card["data-lacking"]) == len(last.unmet)
        assert all(sentence in page.text for sentence in (*last.met, *last.unmet))
        assert str((one.folder / "scene.xml").resolve()) in page.text
    for link in page.all("a"):
        assert (tmp_path / "out" / link["href"]).is_file()
    pictures = [a["src"].partition("base64,")[2] for a in page.all("img")]
    sizes = [Image.open(io.BytesIO(base64.b64decode(each))).size for each in pictures]
    assert set(sizes) <= {(480, 171)} and len(text) < 60_000


def test_every_behaviour_is_in_the_history_as_met_or_unmet(tmp_path):
    """A drawer that a weld holds: by itself it would do what is said, in the scene it does not."""
    (tmp_path / "m").mkdir()
    held = SECOND + '<body name="b"><geom size=".01" pos="5 5 5"/></body>'
    text = BOX.format(name="door", more=held).replace(
        "</worldbody>", '</worldbody><equality><weld body1="drawer"/></equality>'
    )
    (tmp_path / "m" / "a.xml").write_text(text)
    done = generate_all(tmp_path / "m", tmp_path / "out", joint="drawer", rounds=1,
                        describe="it stays wherever it is left")  # fmt: skip
    history = History.read(done["a/drawer"].folder / "history.json")
    last = history.rounds[-1]
    said = {"It can be opened and closed by hand", "It stays wherever it is left"}
    assert said <= {sentence.partition(": no,")[0] for sentence in last.unmet}
    assert not said & {sentence.rstrip(".") for sentence in last.met}
    (note,) = (note for note in last.notes if note.startswith("By itself it "))
    assert "can be opened and closed by hand, " in note and "stays wherever it is left" in note
    assert note.endswith("acts on joint 'drawer'.")


def test_what_overlaps_all_along_the_way_has_its_remedy(tmp_path):
    """A panel drawn into a block of the world cannot move; with the remedy it does what it did."""
    (tmp_path / "m").mkdir()
    block = '<geom type="box" size=".1 .1 .1" pos=".02 0 0"/>'
    text = BOX.format(name="door", more=block)
    (tmp_path / "m" / "a.xml").write_text(text)
    last = generate_all(tmp_path / "m", tmp_path / "out", rounds=1)["a/door"].history.rounds[-1]
    told = " ".join(last.notes)
    assert last.unmet and '<contact><exclude body1="..." body2="..."/></contact>' in told
    assert 'here "world" and "a"' in told
    passing = '</worldbody><contact><exclude body1="world" body2="a"/></contact>'
    (tmp_path / "m" / "a.xml").write_text(text.replace("</worldbody>", passing))
    again = generate_all(tmp_path / "m", tmp_path / "again", rounds=1)["a/door"]
    assert not again.history.rounds[-1].unmet


def test_another_joint_is_where_the_keyframe_has_it(tmp_path):
    """A block that a slide of its own takes out of a door's way at home, and into it else."""
    (tmp_path / "m").mkdir()
    block = """<body name="block" pos=".3 .2 0"><joint name="aside" type="slide" axis="0 0 1"
      range="0 2" frictionloss="500"/><geom type="box" size=".05 .05 .05" mass="1"/></body>"""
    text = BOX.format(name="door", more=block)
    home = '<keyframe><key name="home" qpos="0 1"/></keyframe></mujoco>'
    behaved = []
    for text_ in (text, text.replace("</mujoco>", home)):
        (tmp_path / "m" / "a.xml").write_text(text_)
        done = generate_all(tmp_path / "m", tmp_path / "out", joint="door", rounds=1, force=True)
        behaved.append(done["a/door"].history.rounds[-1].behaviour)
    assert "touches 'block'" in behaved[0].touched and behaved[1].touched == ""


@pytest.mark.usefixtures("without_a_key", "quick")
def test_review_asks_the_least_sure_first_and_keeps_each_decision(models, tmp_path):
    out, asked = tmp_path / "out", []
    first = generate_all(models, out, rounds=1)
    made = {k: one for k, one in first.items() if not isinstance(one, JodaError)}
    likely = {k: one.history.rounds[-1].sure for k, one in made.items()}

    def decide(label, one):
        asked.append(label)
        return Decision() if len(asked) == 1 else None

    generate_all(models, out, rounds=1, resume=True, review=decide)
    assert asked == sorted(likely, key=lambda k: (likely[k], k))[:2]
    kept = History.read(made[asked[0]].folder / "history.json")
    assert kept.reviewed and kept.rounds == made[asked[0]].history.rounds
    asked_again = []
    generate_all(models, out, rounds=1, resume=True,
                 review=lambda label, one: asked_again.append(label))  # fmt: skip
    assert asked_again == asked[1:]


@pytest.mark.slow
@pytest.mark.usefixtures("without_a_key", "quick")
def test_the_command_takes_kinds_words_and_mistakes(joda, models, tmp_path, monkeypatch):
    out = tmp_path / "out"
    joda("generate", models, "-o", out, "--rounds", "1")
    answers = "k contraption\nk cabinet door\nk push button\n9\nit clicks into 3 positions\n"
    monkeypatch.setattr("sys.stdin", io.StringIO(answers))
    _, told, _ = joda("generate", models, "-o", out, "--rounds", "1", "--resume", "--review")
    assert (
        "there is no kind of joint 'contraption'; there are: " in told and "There is no 9." in told
    )
    histories = [json.loads(p.read_text()) for p in sorted(out.rglob("history.json"))]
    assert "a cabinet door is a hinge, the joint is none" in told
    assert {h["kind"] for h in histories} == {"", "push button"}
    assert {h["description"] for h in histories} == {"", "it clicks into 3 positions"}
    chosen = next(h for h in histories if h["kind"])
    assert chosen["rounds"][-1]["recognised"]["title"] == "push button"
    text = (out / "sheet.html").read_text()
    assert "push button" in text and "It clicks into 3 positions" in text
    for path in out.rglob("scene.xml"):
        mujoco.MjModel.from_xml_path(str(path))


@pytest.mark.usefixtures("without_a_key", "quick")
def test_a_decision_that_comes_to_nothing_leaves_all_as_it_was(models, tmp_path, monkeypatch):
    out = tmp_path / "out"
    generate_all(models, out, joint="q", rounds=1)
    before = {p: p.read_bytes() for p in out.rglob("*.json")}

    def fail(*arguments, **options):
        raise JodaError("it will not be simulated.")

    real = session.behaviour
    said = []

    def decide(label, made):
        said.append(" ".join(made.notes))
        monkeypatch.setattr(session, "behaviour", fail if len(said) == 1 else real)
        return Decision(describe="it stays wherever it is left") if len(said) == 1 else None

    generate_all(models, out, joint="q", rounds=1, resume=True, review=decide)
    assert said[1] == "it will not be simulated."
    assert {p: p.read_bytes() for p in out.rglob("*.json")} == before


def test_review_goes_with_a_folder(joda, models, tmp_path):
    status, _, err = joda("generate", models / "two.xml", "-o", tmp_path / "o", "--review")
    assert status == 2 and "--review goes with a folder of models" in err


def test_a_page_of_a_thousand_joints_is_quick_and_small(tmp_path):
    entries = [
        Entry(f"m/{k}", joint="j", folder=tmp_path / str(k), kind="drawer", likely=0.5)
        for k in range(1000)
    ]
    assert len(sheet(entries, tmp_path, "many")) < 2_000_000


FRAME = '<geom type="box" size=".03 .01 .2" pos=".41 {depth} 0"/>'


def test_what_overlaps_its_frame_only_when_closed_is_told_with_its_remedy(tmp_path):
    """A door whose edge is drawn some millimetres into the stop of a frame that is fixed."""
    (tmp_path / "m").mkdir()
    depth = secrets.SystemRandom().uniform(0.012, 0.017)  # they overlap by 3 to 8 mm
    text = BOX.format(name="door", more=FRAME.format(depth=depth))
    (tmp_path / "m" / "a.xml").write_text(text)
    last = generate_all(tmp_path / "m", tmp_path / "out", rounds=1)["a/door"].history.rounds[-1]
    told = " ".join(last.notes)
    assert "'a' touches 'world' from s = 0.00 to 0.0" in told
    assert "mounted on MuJoCo lets pass, but not where that is fixed" in told
    assert told.endswith('<exclude body1="..." body2="..."/></contact>, here "world" and "a".')
    # what can move is not what the door is mounted on
    carried = f'<body name="wall"><freejoint/>{FRAME.format(depth=depth)}'
    moving = text.replace(FRAME.format(depth=depth), "").replace(
        "<worldbody>", "<worldbody>" + carried
    )
    (tmp_path / "m" / "a.xml").write_text(moving.replace("</worldbody>", "</body></worldbody>"))
    other = generate_all(tmp_path / "m", tmp_path / "other", rounds=1, joint="door")["a/door"]
    assert not any("mounted" in note for note in other.history.rounds[-1].notes)


def test_every_round_has_its_picture_of_what_came_true(tmp_path):
    """The first round of our oven lacks something, and the second does not."""
    from test_generate import OVEN

    (tmp_path / "m").mkdir()
    shutil.copy(OVEN, tmp_path / "m")
    done = generate_all(tmp_path / "m", tmp_path / "out", proposer="offline")["oven/door"]
    rounds = done.history.rounds
    assert len(rounds) > 1 and rounds[0].unmet and not rounds[-1].unmet
    for round in rounds:
        root = ElementTree.fromstring(round.picture)
        wide, high = (float(root.get(size)) for size in ("width", "height"))
        texts = [element.text for element in root.iter("{http://www.w3.org/2000/svg}text")]
        told = " ".join(" ".join(texts).split())
        for mark, sentences in (("\u2713", round.met), ("\u2717", round.unmet)):
            assert sum(text.startswith(mark) for text in texts) == len(sentences)
            assert all(f"{mark} {sentence}" in told for sentence in sentences)
        # the strip is as wide as the picture, and closes where the joint does
        strip = [r for r in root.iter("{http://www.w3.org/2000/svg}rect") if r.get("x")]
        assert sum(float(r.get("width")) for r in strip) == pytest.approx(wide, abs=1)
        assert len(strip) == len(round.behaviour.let_go)
        assert all(0 <= float(e.get("y")) <= high for e in root.iter() if e.get("y"))
    page = Page((tmp_path / "out" / "sheet.html").read_text())
    shown = [image["src"] for image in page.all("img") if "svg" in image["src"]]
    drawn = [base64.b64decode(source.split(",")[1]).decode() for source in shown]
    assert drawn == [round.picture for round in rounds]
    assert (
        f"round 1: {len(rounds[0].met)} of {len(rounds[0].met) + len(rounds[0].unmet)}" in page.text
    )


def test_a_round_says_how_many_behaviours_came_true(joda, tmp_path):
    from test_generate import OVEN

    out = tmp_path / "out"
    status, said, _ = joda("generate", OVEN, "--proposer", "offline", "--rounds", "1", "-o", out)
    (first,) = History.read(out / "history.json").rounds
    came, of = len(first.met), len(first.met) + len(first.unmet)
    assert status == 0 and f"{came} of {of} behaviours came true, but not these:\n  ! It " in said
