"""The library as a user sees it: listed, pictured, and with templates of their own."""

import json

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex
from scipy.interpolate import PchipInterpolator
from test_cli import fails, joda

from joda import JodaError, templates
from joda.pictures.sheet import sheet
from joda.pictures.style import COLOURS

PAPER = [
    "bistable_mechanism",
    "bistable_mechanism_internal",
    "constant_damping_hinge",
    "constant_friction_hinge",
    "constant_negative_conservative_hinge",
    "constant_positive_conservative_hinge",
    "detent_internal",
    "magnetic_return_to_high_end",
    "magnetic_return_to_low_end",
    "spring_loaded_snap_detent_to_high_end",
    "spring_loaded_snap_detent_to_low_end",
    "spring_return_to_high_end",
    "spring_return_to_low_end",
]
LIBRARY = templates()

CLICK = {
    "name": "my_click",
    "description": "A click that only this drawer has. " * 5,
    "placement": "The middle of the drawer.",
    "channels": {
        "conservative": {"x": [0, 0.2, 0.7, 1], "y": [0.5, -1, 0.25, 0]},
        "friction": {"x": [0, 0.4, 1], "y": [0, 1, 0.3]},
    },
}


@pytest.fixture
def folder(tmp_path):
    """A folder of templates with one, my_click."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "my_click.json").write_text(json.dumps(CLICK))
    return tmp_path / "mine"


def names(figure):
    return [axes.get_title(loc="left").replace("\n", "") for axes in figure.axes]


def cell(figure, name):
    """Lines by channel, and the band of friction or None, of a template's preview."""
    axes = figure.axes[names(figure).index(name)]
    lines = {line.get_label(): line for line in axes.get_lines()}
    bands = [item for item in axes.collections if isinstance(item, PolyCollection)]
    return lines, bands[0] if bands else None


def test_the_list_is_the_papers():
    assert list(LIBRARY) == PAPER
    text = joda("templates").stdout
    assert [line for line in text.splitlines() if line and not line.startswith(" ")] == PAPER


def test_a_template_is_printed_with_its_words_and_channels_no_wider_than_the_terminal(folder):
    text = joda("templates", "my_click", "--templates", folder, COLUMNS="40").stdout
    assert max(map(len, text.splitlines())) <= 40
    words = " ".join(text.split())
    for part in (CLICK["description"], CLICK["placement"], "Channels: conservative, friction"):
        assert part.strip() in words
    assert "damping" not in words
    assert text.startswith("my_click\n")


def test_json_is_what_the_files_hold(folder):
    listed = json.loads(joda("templates", "--templates", folder, "--json").stdout)
    assert len(listed) == 14
    assert CLICK in listed
    assert json.loads(joda("templates", "my_click", "--templates", folder, "--json").stdout) == [
        CLICK
    ]


def test_a_further_folders_template_is_listed_and_pictured(folder):
    found = templates([folder])
    assert sorted(found) == sorted([*PAPER, "my_click"])
    assert names(sheet(found)) == list(found)
    assert "\nmy_click\n" in joda("templates", "--templates", folder).stdout


def test_an_unknown_name_is_answered_with_those_that_exist(folder):
    message = fails("templates", "my_clack", "--templates", folder)
    assert "no template 'my_clack'; there are: 'bistable_mechanism', " in message
    assert "'my_click'" in message
    with pytest.raises(JodaError, match="no template 'my_click'; there are"):
        templates(name="my_click")


def test_a_mistake_in_a_folder_is_one_sentence(folder):
    assert "no such folder of templates" in fails("templates", "--templates", folder / "none")
    (folder / "bad.json").write_text("{")
    assert "bad.json: not JSON" in fails("templates", "--templates", folder)


@pytest.mark.slow
@pytest.mark.parametrize("name", PAPER)
def test_the_curves_are_the_prototypes(name):
    lines, band = cell(sheet(LIBRARY), name)
    channels = LIBRARY[name].channels
    for channel in ("conservative", "damping"):
        curve = getattr(channels, channel)
        assert (channel in lines) == bool(curve)
        if curve:
            u, value = lines[channel].get_data()
            assert set(curve.x) <= set(u)
            np.testing.assert_allclose(value, PchipInterpolator(curve.x, curve.y)(u), atol=1e-12)
            assert to_hex(lines[channel].get_color()) == COLOURS[channel]
    assert bool(band) == bool(channels.friction)
    if band:
        u, value = np.array(band.get_paths()[0].vertices).T
        expected = PchipInterpolator(channels.friction.x, channels.friction.y)(u)
        np.testing.assert_allclose(np.abs(value), expected, atol=1e-12)
        assert (value.min(), value.max()) == (-1, 1)
        assert to_hex(band.get_facecolor()[0]) == COLOURS["friction"]


@pytest.mark.parametrize("count", [1, 6, 13, 20])
def test_nothing_on_the_sheet_overlaps_or_is_cut(count):
    own = LIBRARY["detent_internal"]
    others = ["a_detent_" * 12, "nowheretobreak" * 8, "costs_$5_or_$6", "two words", "x", "y", "z"]
    found = {name: LIBRARY.get(name, own) for name in [*others, *PAPER][:count]}
    figure = sheet(found)
    figure.canvas.draw()
    assert names(figure) == list(found)
    wide, tall = figure.canvas.get_width_height()
    assert wide == 1000
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    boxes += [text.get_window_extent() for text in figure.texts]
    boxes += [legend.get_window_extent() for legend in figure.legends]
    for i, box in enumerate(boxes):
        assert 0 <= box.x0 < box.x1 <= wide
        assert 0 <= box.y0 < box.y1 <= tall
        for other in boxes[:i]:
            apart = box.x0 >= other.x1 or box.x1 <= other.x0
            assert apart or box.y0 >= other.y1 or box.y1 <= other.y0


def test_the_librarys_sheet_is_about_1000_by_700_and_has_one_legend():
    figure = sheet(LIBRARY)
    wide, tall = figure.canvas.get_width_height()
    assert wide == 1000
    assert 600 <= tall <= 720
    (legend,) = figure.legends
    assert [text.get_text().split(" (")[0] for text in legend.get_texts()] == [
        "conservative force",
        "± dry friction",
        "damping",
    ]
    assert not any(axes.get_legend() for axes in figure.axes)


@pytest.mark.slow
def test_the_picture_is_written_and_only_overwritten_when_told_to(tmp_path):
    command = ("templates", "-o", "sheet.png")
    result = joda(*command, cwd=tmp_path)
    assert (result.returncode, result.stdout, result.stderr) == (0, "sheet.png\n", "")
    path = tmp_path / "sheet.png"
    assert path.read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    path.write_bytes(b"mine")
    assert "sheet.png: exists already" in fails(*command, cwd=tmp_path)
    assert path.read_bytes() == b"mine"
    assert joda(*command, "--force", cwd=tmp_path).returncode == 0
    assert path.read_bytes().startswith(b"\x89PNG")


def test_one_templates_picture_shows_that_one(tmp_path):
    templates(output=tmp_path / "all.png")
    templates(name="detent_internal", output=tmp_path / "one.png")
    tall = [
        int.from_bytes((tmp_path / f"{name}.png").read_bytes()[20:24], "big")
        for name in ("all", "one")
    ]
    assert tall[1] < tall[0] / 2
