import subprocess
import sys
from itertools import pairwise

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_hex, to_rgb
from scipy.interpolate import PchipInterpolator

from joda.component import Component
from joda.errors import JodaError
from joda.pictures.draw import draw
from joda.pictures.style import COLOURS, write_png
from joda.profile import Channel, Channels, Joint, Profile, Resistance

HINGE = Joint(name="door", type="hinge", range=(-0.5, 1.5), unit="rad")
SLIDE = Joint(name="drawer", type="slide", range=(0, 1), unit="m")

LATCH = Component(
    label="latch", interval=(0.25, 0.75), x=(0, 0.3, 0.6, 1), y=(0.5, -2.0, 1.0, 0.25)
)
GRIP = Component(label="grip", interval=(0, 1), x=(0, 1), y=(0.2, 0.6))
GREASE = Component(label="grease", interval=(0, 1), x=(0, 0.5, 1), y=(0.1, 0.1, 0.4))


def profile(
    conservative=(LATCH,), friction=(GRIP,), damping=(GREASE,), joint=HINGE, combine="sum"
) -> Profile:
    return Profile(
        joint=joint,
        channels=Channels(
            conservative=Channel(components=conservative, combine=combine),
            friction=Resistance(components=friction),
            damping=Resistance(components=damping),
        ),
    )


def latch(s):
    """The latch by SciPy: zero outside its interval."""
    u = (np.asarray(s) - 0.25) / 0.5
    inside = PchipInterpolator(LATCH.x, LATCH.y)(np.clip(u, 0, 1))
    return np.where((u >= 0) & (u <= 1), inside, 0)


def curve(axes, label):
    (line,) = [line for line in axes.get_lines() if str(line.get_label()).startswith(label)]
    return line.get_xdata(), line.get_ydata(), line


def texts(axes):
    return [text.get_text() for text in axes.texts]


def test_red_curve_is_the_conservative_torque():
    force = draw(profile()).axes[0]
    q, value, line = curve(force, "conservative torque")
    s = (q + 0.5) / 2
    away = (np.abs(s - 0.25) > 1e-9) & (np.abs(s - 0.75) > 1e-9)
    np.testing.assert_allclose(value[away], latch(s[away]), atol=1e-12)
    assert (q[0], q[-1]) == (-0.5, 1.5)
    red, green, blue = to_rgb(line.get_color())
    assert red > 0.6 > 0.3 > max(green, blue)


def test_jumps_at_the_ends_of_a_component_are_upright():
    q, value, _ = curve(draw(profile(joint=SLIDE)).axes[0], "conservative force")
    for edge, before, after in ((0.25, 0.0, 0.5), (0.75, 0.25, 0.0)):
        assert value[q < edge][-1] == pytest.approx(before, abs=1e-9)
        assert value[q > edge][0] == pytest.approx(after, abs=1e-9)
        assert q[q > edge][0] - q[q < edge][-1] < 1e-12


def test_components_that_touch_do_not_spike_where_they_meet():
    left = Component(interval=(0, 0.5), x=(0, 1), y=(1, 1))
    right = Component(interval=(0.5, 1), x=(0, 1), y=(1, 1))
    _, value, _ = curve(draw(profile(conservative=(left, right))).axes[0], "conservative")
    assert set(value) == {1.0}


def test_a_component_of_a_millionth_of_the_range_is_drawn():
    peak = Component(interval=(0.5, 0.500001), x=(0, 0.5, 1), y=(0, 3, 0))
    _, value, _ = curve(draw(profile(conservative=(peak,))).axes[0], "conservative")
    assert value.max() == pytest.approx(3)


def test_the_maximum_of_a_channel_is_drawn_where_it_combines_by_maximum():
    other = Component(interval=(0, 1), x=(0, 1), y=(0.75, 0.75))
    figure = draw(profile(conservative=(LATCH, other), combine="max", joint=SLIDE))
    q, value, _ = curve(figure.axes[0], "conservative")
    np.testing.assert_allclose(value, np.maximum(latch(q), 0.75), atol=1e-12)
    assert "conservative\n(max)" in texts(figure.axes[1])


def test_band_is_the_force_plus_and_minus_dry_friction():
    force = draw(profile(joint=SLIDE)).axes[0]
    (band,) = [c for c in force.collections if isinstance(c, PolyCollection)]
    edge = band.get_paths()[0].vertices
    for s in (0.1, 0.3, 0.5, 0.65, 0.9):
        grid = np.unique(edge[:, 0])
        x = grid[np.argmin(np.abs(grid - s))]
        y = edge[edge[:, 0] == x, 1]
        friction = 0.2 + 0.4 * x
        assert y.min() == pytest.approx(latch(x) - friction, abs=1e-9)
        assert y.max() == pytest.approx(latch(x) + friction, abs=1e-9)
    low, high = force.get_ylim()
    assert low < edge[:, 1].min()
    assert high > edge[:, 1].max()


def test_gravity_is_the_blue_dashed_line_and_inside_the_panel():
    q = np.linspace(-0.5, 1.5, 7)
    balance = 40 * np.cos(q)
    force = draw(profile(), gravity=(q, balance)).axes[0]
    x, y, line = curve(force, "gravity equilibrium")
    np.testing.assert_array_equal(x, q)
    np.testing.assert_array_equal(y, balance)
    assert line.get_linestyle() == "--"
    red, green, blue = to_rgb(line.get_color())
    assert blue > 0.6 > max(red, green)
    assert force.get_ylim()[1] > 40


def test_no_gravity_line_and_no_band_unless_there_is_one():
    force = draw(profile(friction=())).axes[0]
    assert force.get_legend_handles_labels()[1] == ["conservative torque"]
    assert not force.collections


def test_damping_has_its_own_panel():
    damping = draw(profile()).axes[2]
    q, value, _ = curve(damping, "damping")
    expected = PchipInterpolator(GREASE.x, GREASE.y)((q + 0.5) / 2)
    np.testing.assert_allclose(value, expected, atol=1e-12)


def test_second_axis_runs_from_0_to_1_over_the_range():
    figure = draw(profile())
    figure.canvas.draw()
    force = figure.axes[0]
    (top,) = force.child_axes
    left, right = force.get_xlim()
    s_left, s_right = top.get_xlim()
    assert np.interp(-0.5, (left, right), (s_left, s_right)) == pytest.approx(0, abs=1e-12)
    assert np.interp(1.5, (left, right), (s_left, s_right)) == pytest.approx(1)
    assert top.get_xlabel() == "normalised position s"


@pytest.mark.parametrize(
    ("joint", "labels"),
    [
        (HINGE, ["torque\n(N·m)", "damping\n(N·m·s/rad)", "joint position q (rad)"]),
        (SLIDE, ["force\n(N)", "damping\n(N·s/m)", "joint position q (m)"]),
    ],
)
def test_axes_name_quantity_and_unit(joint, labels):
    force, _, damping = draw(profile(joint=joint)).axes
    assert [force.get_ylabel(), damping.get_ylabel(), damping.get_xlabel()] == labels


@pytest.mark.parametrize(
    ("peak", "unit", "number"),
    [
        (2e-3, "mN", 2),
        (0.5, "N", 0.5),
        (2000, "N", 2000),
        (2e4, "kN", 20),
        (2e-13, "pN", 0.2),
        (9e14, "TN", 900),
    ],
)
def test_ticks_are_in_the_fitting_multiple_of_the_unit(peak, unit, number):
    flat = Component(interval=(0, 1), x=(0, 1), y=(peak, peak))
    force = draw(profile(conservative=(flat,), friction=(), joint=SLIDE)).axes[0]
    assert force.get_ylabel() == f"force\n({unit})"
    assert float(force.yaxis.get_major_formatter()(peak)) == pytest.approx(number)


def test_one_bar_per_component_in_its_place_and_its_channel_s_colour():
    figure = draw(profile())
    bars = figure.axes[1].patches
    places = [(bar.get_x(), bar.get_x() + bar.get_width()) for bar in bars]
    assert places == [(0.0, 1.0), (-0.5, 1.5), (-0.5, 1.5)]
    assert [to_hex(bar.get_edgecolor()) for bar in bars] == list(COLOURS.values())
    assert len({bar.get_y() for bar in bars}) == 3
    assert {"latch", "grip", "grease"} <= set(texts(figure.axes[1]))


@pytest.mark.parametrize("count", [1, 12, 40])
def test_every_component_has_a_bar_and_every_label_stays_inside_the_strip(count):
    labels = ["x", "a $long$ label_that says " + "very " * 20 + "much", "", "$\\frac{1}{2}$ %&#^"]
    components = tuple(
        Component(
            label=labels[i % 4],
            interval=(i / (count + 1), (i + 2) / (count + 1)),
            x=(0, 1),
            y=(1, 2),
        )
        for i in range(count)
    )
    figure = draw(profile(conservative=(), friction=components, damping=()))
    figure.canvas.draw()
    strip = figure.axes[1]
    assert len(strip.patches) == count
    frame = strip.get_window_extent()
    shown = [text for text in strip.texts if text.get_text() not in ("", "friction")]
    assert len(shown) == sum(bool(component.label) for component in components)
    for text in shown:
        box = text.get_window_extent()
        assert frame.x0 <= box.x0
        assert box.x1 <= frame.x1
    for text in shown:
        assert any(label.startswith(text.get_text().rstrip("…")) for label in labels if label)
    heights = sorted(text.get_window_extent().y0 for text in shown)
    assert all(upper - lower > 15 for lower, upper in pairwise(heights))


def test_a_picture_of_up_to_12_components_is_1200_by_900():
    for count in (0, 1, 12):
        figure = draw(profile(conservative=(LATCH,) * count, friction=(), damping=()))
        assert figure.canvas.get_width_height() == (1200, 900)


def test_names_are_shown_as_written_and_long_ones_do_not_run_into_the_range():
    name = "cup_board $x_1$ " * 20
    joint = HINGE.model_copy(update={"name": name})
    figure = draw(profile(joint=joint))
    figure.canvas.draw()
    title, tail = figure.texts
    assert title.get_text().startswith("cup_board $x_1$ cup_board")
    assert title.get_text().endswith("…")
    assert not title.get_parse_math()
    assert title.get_window_extent().x1 < tail.get_window_extent().x0
    assert tail.get_text() == "hinge · −0.5 to 1.5 rad (−28.65° to 85.94°)"


def test_an_empty_profile_says_so():
    figure = draw(Profile(joint=SLIDE))
    force, strip, damping = figure.axes
    assert "no conservative force, no dry friction" in texts(force)
    assert texts(strip) == ["no components"]
    assert texts(damping) == ["no damping"]
    assert not np.any(curve(force, "conservative")[1])
    assert not np.any(curve(damping, "damping")[1])


def test_a_users_matplotlibrc_does_not_change_the_picture(tmp_path):
    import matplotlib

    write_png(draw(profile()), tmp_path / "plain.png")
    with matplotlib.rc_context({"text.usetex": True, "lines.linewidth": 9, "font.size": 30}):
        write_png(draw(profile()), tmp_path / "custom.png")
    assert (tmp_path / "plain.png").read_bytes() == (tmp_path / "custom.png").read_bytes()


def test_a_script_without_glyphs_is_no_warning(tmp_path):
    joint = HINGE.model_copy(update={"name": "冰箱门"})
    write_png(draw(profile(joint=joint)), tmp_path / "door.png")


def test_write_png_writes_a_png_of_1200_by_900(tmp_path):
    path = tmp_path / "profile.png"
    write_png(draw(profile()), path)
    content = path.read_bytes()
    assert content.startswith(b"\x89PNG\r\n\x1a\n")
    assert [int.from_bytes(content[i : i + 4], "big") for i in (16, 20)] == [1200, 900]


def test_write_png_keeps_a_file_that_is_there_already(tmp_path):
    path = tmp_path / "profile.png"
    path.write_bytes(b"mine")
    figure = draw(profile())
    with pytest.raises(JodaError) as error:
        write_png(figure, path)
    assert str(error.value) == f"{path}: exists already; choose another name or add --force."
    assert path.read_bytes() == b"mine"
    write_png(figure, path, force=True)
    assert path.read_bytes().startswith(b"\x89PNG")


def test_write_png_names_a_folder_that_is_missing(tmp_path):
    with pytest.raises(JodaError, match="does not exist; create it first"):
        write_png(draw(profile()), tmp_path / "missing" / "profile.png")


def test_importing_joda_and_the_plotter_loads_no_matplotlib():
    code = "import joda, joda.pictures.draw, sys; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
