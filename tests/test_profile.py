"""A profile's file and text: the way there and back, and the sentence for each mistake."""

import json
from itertools import accumulate

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from joda import _core, schema
from joda.component import Component
from joda.errors import JodaError
from joda.profile import CHANNELS, Channel, Channels, Joint, Profile

HINGE = Joint(name="door", type="hinge", range=(-0.5, 1.5), unit="rad")

# --- there and back

labels = st.text(st.characters(exclude_categories=("C",), exclude_characters=";|[")).map(str.strip)
gaps = st.lists(st.floats(0.01, 1), min_size=1, max_size=6)


def places(gaps) -> tuple:
    """Increasing numbers from 0 to 1 with gaps in these proportions."""
    return (*(part / sum(gaps) for part in accumulate(gaps[:-1], initial=0)), 1)


@st.composite
def components(draw, values) -> Component:
    a, b = places([1, *draw(gaps), 1])[1:3]
    x = places(draw(gaps))
    y = draw(st.lists(values, min_size=len(x), max_size=len(x)))
    return Component(label=draw(labels), interval=(a, b), x=x, y=tuple(y))


@st.composite
def profiles(draw) -> Profile:
    channels = {}
    for name in CHANNELS:
        values = st.floats(-1e15 if name == "conservative" else 0, 1e15)
        listed = draw(st.lists(components(values), max_size=3))
        channels[name] = {
            "combine": draw(st.sampled_from(("sum", "max"))),
            "components": [component.model_dump() for component in listed],
        }
    return Profile.model_validate({"joint": HINGE.model_dump(), "channels": channels})


@settings(deadline=None)
@given(profiles())
def test_a_profile_survives_the_plugins_attributes(profile):
    assert Profile.from_attributes(HINGE, profile.attributes()) == profile


@settings(deadline=None)
@given(profiles())
def test_the_plugin_reads_what_a_profile_writes(profile):
    for name in CHANNELS:
        channel = getattr(profile.channels, name)
        merged = _core.PiecewiseCubic(channel.text(), channel.combine, name != "conservative")
        ends = {end for component in channel.components for end in component.interval}
        assert ends <= set(merged.knots)


@settings(deadline=None)
@given(profiles())
def test_a_profile_survives_its_file(profile):
    text = profile.to_json()
    assert Profile.model_validate_json(text) == profile
    assert json.loads(text) == profile.model_dump(mode="json")


# --- mistakes in the file

CONSERVATIVE, FRICTION = "channels.conservative.components.0", "channels.friction.components.0"
WHERE = "channels.conservative.components[0]"
REMOVED = object()

MISTAKES = {
    "colour: unknown key; remove it or mend its spelling.": {"colour": 1},
    f"{WHERE}.Y: unknown key; remove it or mend its spelling.": {f"{CONSERVATIVE}.Y": [1, 2]},
    "joint: missing; add it.": {"joint": REMOVED},
    f"{WHERE}.y: missing; add it.": {f"{CONSERVATIVE}.y": REMOVED},
    f"{WHERE}.y[1]: must be a finite number.": {f"{CONSERVATIVE}.y": [1, float("nan")]},
    f"{WHERE}.y[0]: must be a number, not 'one'.": {f"{CONSERVATIVE}.y": ["one", 1]},
    f"{WHERE}: y must lie between -1e15 and 1e15.": {f"{CONSERVATIVE}.y": [1, -2e15]},
    f"{WHERE}: x has 2 numbers and y has 3; they must be equally many.": {
        f"{CONSERVATIVE}.y": [1, 2, 3]
    },
    f"{WHERE}: at least two control points are needed.": {f"{CONSERVATIVE}.x": [0]},
    f"{WHERE}: x must begin at 0 and end at 1.": {f"{CONSERVATIVE}.x": [0, 0.9]},
    f"{WHERE}: x must increase, by at least 1e-9 of the joint's range.": {
        f"{CONSERVATIVE}.x": [0, 0.5, 0.5, 1],
        f"{CONSERVATIVE}.y": [0, 0, 0, 0],
    },
    f"{WHERE}: interval must satisfy 0 <= a < b <= 1, in normalised joint position.": {
        f"{CONSERVATIVE}.interval": [0.5, 1.5]
    },
    f"{WHERE}: interval is narrower than 1e-9 of the range.": {
        f"{CONSERVATIVE}.interval": [0.5, 0.50000000001]
    },
    f"{WHERE}.interval: must have 2 numbers, not 3.": {f"{CONSERVATIVE}.interval": [0, 0.5, 1]},
    f"{WHERE}.x: must have at most 2000 numbers, not 2001.": {
        f"{CONSERVATIVE}.x": [k / 2000 for k in range(2001)]
    },
    "channels.friction.components: must have at most 200 components, not 201.": {
        "channels.friction.components": [{"interval": [0, 1], "x": [0, 1], "y": [1, 2]}] * 201
    },
    "channels.friction: the components have 2002 control points together; at most 2000 are "
    "possible.": {
        "channels.friction.components": [
            {"interval": [0, 1], "x": [k / 1000 for k in range(1001)], "y": [1] * 1001}
        ]
        * 2
    },
    f"{WHERE}.label: must not hold ';', '|' or line breaks.": {f"{CONSERVATIVE}.label": "a;b"},
    "channels.friction: components[0].y is negative; friction and damping must not be.": {
        f"{FRICTION}.y": [-1, 1]
    },
    "channels.friction.combine: must be 'sum' or 'max'.": {"channels.friction.combine": "min"},
    "joint: unit must be rad for a hinge and m for a slide.": {"joint.unit": "m"},
    "joint.unit: must be 'rad' or 'm'.": {"joint.unit": "deg"},
    "joint: range must be two increasing numbers.": {"joint.range": [1, 1]},
    "schema_version: this version of joda reads schema_version 1 and 2, the file has 3.": {
        "schema_version": 3
    },
    'effects[0]: the key "effect" is missing; it names the effect.': {"effects": [{}]},
}


def document(edits: dict) -> str:
    """A valid composed.json after the edits, dotted key to value."""
    component = {"label": "latch", "interval": [0, 1], "x": [0, 1], "y": [1, 2]}
    channels = {
        name: {"combine": "sum", "components": [dict(component)]}
        for name in ("conservative", "friction")
    }
    out = {"schema_version": 1, "joint": HINGE.model_dump(mode="json"), "channels": channels}
    for key, value in edits.items():
        *folders, last = (int(part) if part.isdigit() else part for part in key.split("."))
        place = out
        for folder in folders:
            place = place[folder]
        if value is REMOVED:
            del place[last]
        else:
            place[last] = value
    return json.dumps(out)


def read_error(path) -> str:
    with pytest.raises(JodaError) as caught:
        Profile.read(path)
    return str(caught.value)


def test_a_valid_file_is_read(tmp_path):
    path = tmp_path / "composed.json"
    path.write_text(document({}))
    assert Profile.read(path).channels.friction.components[0].label == "latch"


@pytest.mark.parametrize(("sentence", "edits"), MISTAKES.items())
def test_each_mistake_in_a_file_has_its_sentence(tmp_path, sentence, edits):
    path = tmp_path / "composed.json"
    path.write_text(document(edits))
    assert read_error(path) == f"{path}: {sentence}"


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"{joint: 1}", "not JSON (key must be a string at line 1 column 2)."),
        (b"", "not JSON (EOF while parsing a value at line 1 column 0)."),
        (b"[]", "must be an object."),
        (
            b'{"a": "\xff"}',
            "not a UTF-8 text file (byte 7, line 1); if it is text, in Latin-1 or Windows-1252 "
            "perhaps, save it as UTF-8.",
        ),
    ],
)
def test_what_is_no_json_document_has_its_sentence(tmp_path, content, sentence):
    path = tmp_path / "composed.json"
    path.write_bytes(content)
    assert read_error(path) == f"{path}: {sentence}"


def test_a_missing_file_has_its_sentence(tmp_path):
    path = tmp_path / "composed.json"
    assert read_error(path) == f"{path}: cannot be read (No such file or directory)."


# --- the largest channels


def line(a: float, b: float, points: int) -> Component:
    """A straight line of a component through so many control points."""
    x = tuple(k / (points - 1) for k in range(points))
    return Component(interval=(a, b), x=x, y=x)


LARGEST = {
    "components": (200, 2, "the channel has 201 components; at most 200 are possible"),
    "control points": (20, 100, "the channel has 2002 control points; at most 2000 are possible"),
}


@pytest.mark.parametrize(("count", "points", "sentence"), LARGEST.values(), ids=LARGEST)
@pytest.mark.parametrize("combine", ["sum", "max"])
def test_the_largest_channel_is_read_and_one_more_is_refused(count, points, sentence, combine):
    parts = tuple(line(k / count, (k + 1) / count, points) for k in range(count))
    channel = Channel(combine=combine, components=parts)
    assert _core.PiecewiseCubic(channel.text(), combine)(0.99)[0] == pytest.approx(
        0.99 * count % 1 or 1
    )
    with pytest.raises(ValueError) as caught:
        _core.PiecewiseCubic(f"{channel.text()}; {line(0, 1, 2).text()}", combine)
    assert str(caught.value) == sentence
    profile = Profile(joint=HINGE, channels=Channels(conservative=channel))
    with pytest.raises(JodaError, match=r"^joint 'door': conservative takes no more: .* at most"):
        profile.with_component("conservative", line(0, 1, 2))
    with pytest.raises(JodaError, match="at most"):
        text = f"{channel.text()}; {line(0, 1, 2).text()}"
        Profile.from_attributes(HINGE, {"conservative": text})


def test_the_schema_states_the_limits():
    definitions = schema("composed")["$defs"]
    for name in ("Channel", "Resistance"):
        assert definitions[name]["properties"]["components"]["maxItems"] == 200
        assert "at most 2000 control points" in definitions["Channel"]["description"]
    for name in ("Component", "StribeckFriction"):
        for key in "xy":
            assert definitions[name]["properties"][key]["maxItems"] == 2000


# --- mistakes in the plugin's attributes: the reader in Python, then the plugin's own


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("0 1", 'conservative: expected "label: a b | x ... | y ...", got "0 1".'),
        ("0 | 0 1 | 1 1", f"{WHERE}.interval[1]: missing; add it."),
        ("0 1 | 0 1 | 1 one", f"{WHERE}.y[1]: must be a number, not 'one'."),
        ("0 1 | 0 1 | 1 nan", f"{WHERE}.y[1]: must be a finite number."),
    ],
)
def test_each_mistake_in_attributes_has_its_sentence(text, sentence):
    with pytest.raises(JodaError) as caught:
        Profile.from_attributes(HINGE, {"conservative": text})
    assert str(caught.value) == f"joint 'door': {sentence}"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "a: 0 1 | 0 1",
            'component 1 "a": expected "label: a b | x ... | y ...", got "a: 0 1 | 0 1"',
        ),
        (
            "é" * 30,
            f'component 1: expected "label: a b | x ... | y ...", got "{"é" * 20}..."',
        ),
        (
            "0 | 0 1 | 1 1",
            "component 1: expected the two numbers of the interval before the first |",
        ),
        ("0 1 | 0 1 | 1 1; b: 0 1 | 0 1 | 1 one", 'component 2 "b": "one" is not a finite number'),
        ("0 1 | 0 1 | 1 nan", 'component 1: "nan" is not a finite number'),
        (
            "0.5 1.5 | 0 1 | 1 1",
            "component 1: the interval must satisfy 0 <= a < b <= 1, in normalised joint position",
        ),
        (
            "0.5 0.50000000001 | 0 1 | 1 1",
            "component 1: the interval is narrower than 1e-9 of the range",
        ),
        ("0 1 | 0 | 1", "component 1: at least two control points are needed"),
        ("0 1 | 0 1 | 1", "component 1: x has 2 numbers and y has 1; they must be equally many"),
        ("0 1 | 0 0.9 | 1 1", "component 1: x must begin at 0 and end at 1"),
        (
            "0 1 | 0 0.5 0.5 1 | 1 1 1 1",
            "component 1: x must increase, by at least 1e-9 of the joint's range",
        ),
        ("0 1 | 0 1 | 1 2e15", "component 1: y must lie between -1e15 and 1e15"),
        ("0 1 | 0 1 | 1 -1", "component 1: values of friction and damping must not be negative"),
    ],
)
def test_each_mistake_has_its_sentence_in_the_plugin(text, sentence):
    with pytest.raises(ValueError) as caught:
        _core.PiecewiseCubic(text, nonnegative=True)
    assert str(caught.value) == sentence


def test_the_plugin_combines_by_sum_or_max():
    with pytest.raises(ValueError, match=r'^must be "sum" or "max", got "min"$'):
        _core.PiecewiseCubic("", "min")
