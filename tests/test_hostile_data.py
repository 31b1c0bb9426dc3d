"""Data that are not what they seem: right all the same, or one sentence with the remedy.

A good run of a simulated door is written wrongly in one way per row. Every command that reads
measurements says the same of it.
"""

import subprocess
import sys
from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest

import joda
from joda import JodaError
from joda.component import Component
from joda.diagnosis.outcome import read_runs
from joda.measured.comparison import sentences
from joda.measured.excerpts import DURATION, SAMPLES
from joda.measured.reading import read_measured
from joda.measured.run_files import read_measurement
from joda.profile import Channels, Profile, Resistance

SCENE = """<mujoco{angle}><option timestep="{step}"/><worldbody><body>
  <joint name="door" {joint} damping="{damping}" frictionloss="{friction}"/>
  <geom type="box" size=".2 .02 .3" pos=".2 0 0" mass="{mass}"/></body></worldbody></mujoco>"""
HINGE = 'type="hinge" axis="0 0 1" range="{}"'
SLIDE = 'type="slide" axis="1 0 0" range="{}"'


@dataclass(frozen=True)
class Log:
    """A run as numbers; what a row of the table changes."""

    time: np.ndarray
    position: np.ndarray
    force: np.ndarray

    def rows(self, slope="%.15g", separator=","):
        data = np.stack([self.time, self.position, self.force], axis=1)
        return [separator.join(slope % x for x in row) for row in data]

    def text(self, header="time,position,force", **how) -> str:
        return "\n".join([header, *self.rows(**how)]) + "\n"


DOOR = HINGE.format("0 90")


def scene(joint=DOOR, step=0.002, damping=0.3, friction=0.1, mass=8.0, angle=""):
    return SCENE.format(
        joint=joint, step=step, damping=damping, friction=friction, mass=mass, angle=angle
    )


def simulated(xml, seconds=6.0, hertz=100.0, force=1.5, slow=1.0, wave=True) -> Log:
    """MuJoCo's own motion under a force to and fro about the middle of the range."""
    model = mujoco.MjModel.from_xml_string(xml)
    data, h = mujoco.MjData(model), model.opt.timestep
    lo, hi = model.jnt_range[0]
    data.qpos[0] = (lo + hi) / 2
    out = []
    for k in range(int(seconds / h)):
        t = k * h / slow
        away = (data.qpos[0] - (lo + hi) / 2) / (hi - lo)
        push = 1.2 * np.sin(3 * t) + 0.7 * np.sin(7.1 * t + 1) - 2 * away
        data.qfrc_applied[0] = force * (push if wave else 0.5)
        out.append((k * h, data.qpos[0], data.qfrc_applied[0]))
        mujoco.mj_step(model, data)
    t, q, f = np.array(out).T
    time = np.arange(0, t[-1], 1 / hertz)
    noise = 1e-4 * (hi - lo) * np.random.default_rng(1).normal(size=len(time))
    return Log(time, np.interp(time, t, q) + noise, np.interp(time, t, f))


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    folder = tmp_path_factory.mktemp("door")
    plain, profile, path = (folder / name for name in ("plain.xml", "door.json", "door.xml"))
    plain.write_text(scene())
    flat = Component(label="hinge", interval=(0, 1), x=(0, 1), y=(0.05, 0.05))
    joint = joda.context(plain, "door").joint
    channels = Channels(damping=Resistance(components=(flat,)))
    profile.write_text(Profile(joint=joint, channels=channels).to_json())
    joda.attach(plain, [profile], path)
    return path


@pytest.fixture(scope="module")
def good():
    return simulated(scene())


def timed(log: Log, factor=1.0, zero=0.0) -> Log:
    return replace(log, time=zero + factor * log.time)


def finer(log: Log, hertz: float) -> Log:
    """The same run, sampled faster."""
    t = np.arange(0, log.time[-1], 1 / hertz)
    return Log(t, *(np.interp(t, log.time, x) for x in (log.position, log.force)))


def stepped(log: Log, steps) -> np.ndarray:
    """Times in steps that repeat."""
    return np.cumsum(np.resize(steps, len(log.time)))


def placed(log: Log, position) -> Log:
    return replace(log, position=position)


def with_cell(log: Log, column: int, text: str, row: int = 40) -> str:
    """The run with another text in one cell; its line is `row` + 2."""
    rows = log.rows()
    cells = rows[row].split(",")
    cells[column] = text
    rows[row] = ",".join(cells)
    return "\n".join(["time,position,force", *rows]) + "\n"


def mixed(log: Log) -> str:
    """Two clocks, their rows in turn."""
    rows, others = log.rows(), timed(log, zero=100.0).rows()
    both = [row for pair in zip(rows, others, strict=True) for row in pair]
    return "\n".join(["time,position,force", *both]) + "\n"


def joined(log: Log, zero: float) -> str:
    """Two recordings in one file, the second counted from `zero`."""
    return log.text() + "\n".join(timed(log, zero=zero).rows()) + "\n"


def comma(log: Log, separator: str) -> str:
    """Decimals as in most of Europe."""
    rows = [row.replace(".", ",") for row in log.rows(separator=separator)]
    return "\n".join([separator.join(["time", "position", "force"]), *rows]) + "\n"


REFUSED = {
    # --- times
    "ms": (
        lambda g: timed(g, 1e3).text(),
        "time goes from 0 to 5990 in steps of 10: too far apart",
        "milliseconds, divide it by 1000",
    ),
    "ms of 5 kHz": (
        lambda g: timed(finer(g, 5000), 1e3).text(),
        "to 5989.8 in steps of 0.2: as seconds, the joint would take",
        "milliseconds, divide it by 1000",
    ),
    "us": (
        lambda g: timed(g, 1e6).text(),
        "in steps of 1e+04",
        "microseconds, divide it by 1000000",
    ),
    "ns": (
        lambda g: timed(g, 1e9).text(),
        "in steps of 1e+07",
        "nanoseconds, divide it by 1000000000",
    ),
    "epoch in ms": (
        lambda g: timed(g, 1e3, 1.7e12).text(),
        "from 1.7e+12",
        "milliseconds, divide it by 1000",
    ),
    "epoch in us": (
        lambda g: timed(g, 1e6, 1.7e15).text(),
        "from 1.7e+15",
        "microseconds, divide it by 1000000",
    ),
    "epoch in ns": (
        lambda g: timed(g, 1e9, 1.7e18).text(slope="%.20g"),
        "from 1.7e+18",
        "nanoseconds, divide it by",
    ),
    "epoch of few digits": (
        lambda g: timed(g, 1, 1.7e9).text(slope="%.9g"),
        "line 3: time does not increase: it is 1700000000 as",
        "more digits",
    ),
    "frame counter": (
        lambda g: timed(g, 100).text(slope="%.6f"),
        "in steps of 1, as if it counted samples or frames",
        "divide it by the sampling rate in Hz",
    ),
    "counter that starts late": (
        lambda g: replace(g, time=41000.0 + np.arange(len(g.time))).text(slope="%.9g"),
        "time goes from 41000 to 41599 in steps of 1, as if it counted",
        "divide it by the sampling rate in Hz",
    ),
    "counter of frames, some lost": (
        lambda g: replace(g, time=stepped(g, [1] * 7 + [2] * 2 + [5])).text(),
        "mostly in steps of 1, as if it counted samples or frames",
        "divide it by the sampling rate in Hz",
    ),
    "ms that jitter": (
        lambda g: replace(g, time=stepped(g, [8, 9, 8, 10, 7])).text(),
        "in steps of 8: too far apart",
        "milliseconds, divide it by 1000",
    ),
    "ms of 60 Hz": (
        lambda g: replace(g, time=stepped(g, [17, 16, 17])).text(),
        "in steps of 17: too far apart",
        "milliseconds, divide it by 1000",
    ),
    "ms of 1 kHz that are no integers": (
        lambda g: replace(g, time=stepped(g, [1.02, 0.97, 1.01])).text(),
        "in steps of 1.01: too far apart",
        "milliseconds, divide it by 1000",
    ),
    "steps of 10 s": (
        lambda g: timed(g, 1e3).text(),
        "in steps of 10",
        "or record at 30 Hz or more",
    ),
    "hours": (
        lambda g: timed(g, 1 / 3600).text(),
        "in steps of 2.8e-06 s, closer than any encoder",
        "multiply it by 3600",
    ),
    "denormal times": (
        lambda g: timed(g, 1e-310).text(),
        "line 3: time does not increase",
        "it is 0 in all rows",
    ),
    "constant time": (
        lambda g: timed(g, 0, 5).text(),
        "line 3: time does not increase: it is 5 in all rows",
        "seconds",
    ),
    "recordings joined": (
        lambda g: joined(g, 0.0),
        "line 602: time does not increase: it goes back from 5.99 to 0",
        "cut the file there into two",
    ),
    "clocks joined": (
        lambda g: joined(g, 1.7e9),
        "after 5.99 s there is none for 1.7e+09 s",
        "cut the file there into two",
    ),
    "clocks mixed": (
        mixed,
        "line 4: time does not increase: it goes back from 100 to 0.01, and in 599 rows",
        "a file of its own",
    ),
    "turned round": (
        lambda g: Log(g.time[::-1], g.position, g.force).text(),
        "line 3: time does not increase: it goes back from 5.99 to 5.98, and in all rows",
        "turn their order",
    ),
    # --- positions and forces
    "degrees": (
        lambda g: placed(g, np.rad2deg(g.position)).text(),
        "look like degrees",
        "multiply them by π/180",
    ),
    "encoder ticks": (
        lambda g: placed(g, np.round(g.position * 4096)).text(),
        "whole numbers far beyond the range",
        "ticks per turn",
    ),
    "negative sign": (
        lambda g: placed(g, -g.position).text(),
        "lie in minus the range 0 to 1.571 rad",
        "turn their sign",
    ),
    "another zero": (
        lambda g: placed(g, g.position + 9).text(),
        "fit into the range 0 to 1.571 rad only if shifted",
        "measure them from the joint's zero",
    ),
    "1e300": (
        lambda g: with_cell(g, 1, "1e300"),
        "line 42: position is '1e300', too large to be meant",
        "must be a number",
    ),
    "force of 1e25": (
        lambda g: with_cell(g, 2, "1e25"),
        "the force is up to 1e+25 N·m",
        "correct it, in N·m",
    ),
    "1e20": (
        lambda g: with_cell(g, 1, "1e20"),
        "1 of 600 samples lie outside the range",
        "remove wrong samples",
    ),
    "an escape": (
        lambda g: with_cell(g, 1, "\x1b[2J1"),
        "line 42: position is '\\x1b[2J1'",
        "must be a number",
    ),
    "milliradians": (
        lambda g: placed(g, 1e3 * g.position).text(),
        "of 600 samples lie outside the range 0 to 1.571 rad, the first at 0 s, by up to",
        "check their unit (rad) and zero",
    ),
    "inf": (lambda g: with_cell(g, 1, "inf"), "line 42: position is 'inf'", "must be a number"),
    "nan": (
        lambda g: with_cell(g, 2, "nan"),
        "line 42: force is 'nan'",
        "where it is not known leave the cell empty",
    ),
    "thousands": (
        lambda g: with_cell(g, 1, "1_0"),
        "line 42: position is '1_0'",
        "must be a number",
    ),
    # --- files
    "UTF-16 little, mark": (
        lambda g: b"\xff\xfe" + g.text().encode("utf-16-le"),
        "looks like UTF-16",
        "save it as UTF-8",
    ),
    "UTF-16 big, mark": (
        lambda g: b"\xfe\xff" + g.text().encode("utf-16-be"),
        "looks like UTF-16",
        "save it as UTF-8",
    ),
    "UTF-16 little": (
        lambda g: g.text().encode("utf-16-le"),
        "looks like UTF-16",
        "save it as UTF-8",
    ),
    "UTF-16 big": (lambda g: g.text().encode("utf-16-be"), "looks like UTF-16", "save it as UTF-8"),
    "Latin-1": (
        lambda g: ("# winkel in °\n" + g.text()).encode("latin-1"),
        "not a UTF-8 text file (byte 12, line 1)",
        "in Latin-1 or Windows-1252 perhaps, save it as UTF-8",
    ),
    "NUL": (
        lambda g: with_cell(g, 2, "1\0").encode(),
        "there is a NUL byte (byte",
        "write it anew",
    ),
    "decimal commas": (
        lambda g: comma(g, ","),
        "line 2: 5 cells, the header has 3 columns",
        "write decimals with a point",
    ),
    "spaces": (
        lambda g: g.text("time position force", separator=" "),
        "line 1: no header row with time and position",
        "must name the columns",
    ),
    "empty": (lambda g: "", "empty, no header row", "time and position"),
    "header only": (lambda g: "time,position,force\n", "0 samples", "needs at least 4"),
    "no header": (
        lambda g: g.text().split("\n", 1)[1],
        "line 1: no header row with time and position (or position and force) but '0, ",
        "must name the columns",
    ),
    "twice": (
        lambda g: g.text("time,position,position"),
        "line 1: column 'position' is there twice",
        "",
    ),
    "German": (
        lambda g: g.text("Zeit,Winkel,Kraft"),
        "but 'Zeit, Winkel, Kraft'",
        "must name the columns",
    ),
    "half German": (
        lambda g: g.text("Zeit,position,Kraft"),
        "no column 'force'; it has position, Zeit, Kraft",
        "a timed run needs time (s)",
    ),
    "a cell too many": (
        lambda g: with_cell(g, 2, "1,2"),
        "line 42: 4 cells, the header has 3 columns",
        "",
    ),
    "an open quote": (
        lambda g: with_cell(g, 2, '"1'),
        "line 42: force begins with a quote",
        "not closed",
    ),
}
"""How a file is made of a good run, what is said of it, and the remedy."""

RIGHT = {
    "plain": (lambda g: g.text(), ""),
    "CRLF": (lambda g: g.text().replace("\n", "\r\n").encode(), ""),
    "CR": (lambda g: g.text().replace("\n", "\r").encode(), ""),
    "byte order mark": (lambda g: "\ufeff" + g.text(), ""),
    "semicolons": (lambda g: g.text("time;position;force", separator=";"), ""),
    "semicolons, decimal commas": (lambda g: comma(g, ";"), ""),
    "tabs": (lambda g: g.text("time\tposition\tforce", separator="\t"), ""),
    "quoted": (
        lambda g: '"' + g.text().strip().replace(",", '","').replace("\n", '"\n"') + '"',
        "",
    ),
    "a separator at the end": (lambda g: "\n".join(row + "," for row in g.text().split()), ""),
    "a separator at the end of rows": (
        lambda g: "time,position,force\n" + "\n".join(row + "," for row in g.rows()),
        "",
    ),
    "blanks": (lambda g: g.text(" Time , POSITION , force ", separator=" , "), ""),
    "denormal forces": (lambda g: with_cell(g, 2, "4e-324", 0), ""),
    "epoch": (
        lambda g: timed(g, 1, 1.7e9).text(),
        "time begins at 1700000000 s, and is counted from there",
    ),
    "before 1970": (
        lambda g: timed(g, 1, -1.7e9).text(),
        "time begins at -1700000000 s, and is counted",
    ),
    "torque": (lambda g: g.text("time,position,torque"), "column 'torque' is not read"),
}
"""How a file is made, and what is noted."""


def written(folder, make, log: Log):
    path, content = folder / "run.csv", make(log)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.slow
@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_meant_is_refused_with_the_remedy(name, door, good, tmp_path):
    make, said, remedy = REFUSED[name]
    path, out = written(tmp_path, make, good), tmp_path / "new.xml"
    told = set()
    for command in (
        lambda: joda.compare(door, "door", [path]),
        lambda: joda.diagnose(door, "door", [path]),
        lambda: joda.improve(door, "door", [path], out),
        lambda: joda.refine(door, "door", [path], out),
    ):
        with pytest.raises(JodaError) as error:
            command()
        told.add(str(error.value))
    (sentence,) = told
    assert "run.csv" in sentence
    assert said in sentence
    assert remedy in sentence
    assert "\n" not in sentence
    assert sentence.endswith(".")
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("name", RIGHT)
def test_what_can_only_be_meant_in_one_way_is_read_so(name, door, good, tmp_path):
    make, noted = RIGHT[name]
    path = written(tmp_path, make, good)
    run = read_measurement(path)
    np.testing.assert_allclose(run.time, good.time, atol=3e-7)  # digits of an epoch
    np.testing.assert_allclose(run.position, good.position, rtol=1e-12)
    if run.forced:
        np.testing.assert_allclose(run.force[1:], good.force[1:], rtol=1e-12)
    notes = read_measured(door, "door", [path]).notes
    notes = [note for note in notes if "something drove it" not in note]  # its force is not read
    assert len(notes) == bool(noted)
    assert all(noted in note for note in notes)


DOUBTED = {
    "constant position": (
        lambda g: placed(g, np.full(len(g.time), 0.5)).text(),
        "the joint hardly moved, 0 rad of 1.57; record a run in which it moves",
    ),
    "constant velocity": (
        lambda g: "\n".join(["time,position,force,velocity", *(f"{row},0" for row in g.rows())]),
        "the velocity is not the derivative of the position; correct it",
    ),
    "force turned": (
        lambda g: replace(g, force=-g.force).text(),
        "but only if its sign is turned",
    ),
    "time by another name": (
        lambda g: g.text("Zeit,position,force"),
        "column 'Zeit' is not read, and without time this is a quasi-static curve; if it is the "
        "time, name it 'time'",
    ),
    "a pause": (
        lambda g: joined(g, 8.0),
        "a gap of 2.01 s after 5.99 s, where 10 ms is usual; cut the file there into two",
    ),
}
"""How a file is made, and the note of what cannot be refused for sure."""


@pytest.mark.parametrize("name", DOUBTED)
def test_what_is_doubtful_is_said_and_used(name, door, good, tmp_path):
    make, noted = DOUBTED[name]
    path = written(tmp_path, make, good)
    assert any(noted in note for note in read_measured(door, "door", [path]).notes)


@pytest.mark.long
def test_where_no_window_can_be_replayed_no_nan_is_said(door, good, tmp_path):
    path = written(tmp_path, lambda g: replace(g, time=0.4 * np.arange(len(g.time))).text(), good)
    found = joda.compare(door, "door", [path])
    assert found.rmse_window is None
    assert not any("nan" in said for said in (*found.notes, *sentences(found)))


BUTTON = scene(SLIDE.format("0 0.003"), step=0.0002, damping=0.2, friction=0.02, mass=0.005)
ODD = {
    "a button that goes 3 mm in 15 ms": (BUTTON, lambda: pressed(BUTTON)),
    "a slow door, 60 s": (scene(step=0.005), lambda: pushed_slowly()),
    "30 Hz": (scene(), lambda: simulated(scene(), hertz=30)),
    "more than a turn": (
        scene(HINGE.format("0 1800")),
        lambda: simulated(scene(HINGE.format("0 1800")), force=20, slow=2),
    ),
    "a range of 4 degrees": (
        scene(HINGE.format("-2 2"), damping=3),
        lambda: simulated(scene(HINGE.format("-2 2"), damping=3), slow=0.5),
    ),
    "10 kHz": (scene(step=0.0005), lambda: simulated(scene(step=0.0005), seconds=2, hertz=1e4)),
    "a constant force": (scene(), lambda: simulated(scene(), seconds=1.5, wave=False)),
    "a fifth of the range only": (scene(), lambda: simulated(scene(), force=0.4)),
}
"""The scene, and what is right of it although it is unusual."""


def pressed(xml) -> Log:
    """A light button under a constant push, from one end to the other."""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    out = []
    for k in range(75):
        data.qfrc_applied[0] = 0.2
        out.append((k * model.opt.timestep, data.qpos[0], 0.2))
        mujoco.mj_step(model, data)
    t, q, f = np.array(out).T
    assert np.ptp(q) > 0.0028
    return Log(t, q + 1e-6 * np.random.default_rng(2).normal(size=len(t)), f)


def pushed_slowly() -> Log:
    """A door opened in a minute, with the force that this takes (closed form)."""
    t = np.arange(0, 60, 0.01)
    rate = np.pi / 60
    wave = rate * t
    q, v, a = 0.75 - 0.7 * np.cos(wave), 0.7 * rate * np.sin(wave), 0.7 * rate**2 * np.cos(wave)
    inertia = 8 / 12 * (0.4**2 + 0.04**2) + 8 * 0.2**2
    force = inertia * a + 0.3 * v + 0.1
    return Log(t, q + 1e-4 * np.random.default_rng(3).normal(size=len(t)), force)


@pytest.mark.slow
@pytest.mark.parametrize("name", ODD)
def test_what_is_unusual_but_right_raises_no_doubt(name, tmp_path):
    xml, make = ODD[name]
    model, path = tmp_path / "model.xml", written(tmp_path, lambda log: log.text(), make())
    model.write_text(xml)
    measured = read_measured(model, "door", [path])
    light = {doubt for doubt in measured.context.warnings if "lighter than foam" in doubt}
    assert set(measured.notes) <= light  # a button with the geom of a door
    found = joda.compare(model, "door", [path])
    span = np.ptp(measured.profile.joint.range)
    assert found.rmse_window < 1e-2 * span


@pytest.mark.long
def test_a_million_samples_stay_within_the_memory_for_them(door, tmp_path):
    """The peak of the whole process, its imports included; a run of 20 s at 50 kHz."""
    path = tmp_path / "run.csv"
    t = np.arange(1_000_000) / 50_000
    data = np.stack([t, 0.75 + 0.6 * np.sin(t), 0.1 * np.cos(t)], axis=1)
    np.savetxt(path, data, "%.6f", ",", header="time,position,force", comments="")
    code = (
        "import re, sys, joda\n"
        "from joda.diagnosis.outcome import read_runs\n"
        "from joda.estimation.problem import segments_for\n"
        "scene, run = sys.argv[1:]\n"
        "if run[0] == '-': segments_for(read_runs(scene, 'door', [run[1:]]))\n"
        "else: joda.compare(scene, 'door', [run])\n"
        # ru_maxrss would count what pytest had before the child began
        "print(re.search(r'VmHWM:\\s*(\\d+)', open('/proc/self/status').read())[1])"
    )
    for run in (path, f"-{path}"):
        command = [sys.executable, "-c", code, str(door), str(run)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        assert int(done.stdout) < 500 * 1024


def test_a_long_run_is_cut_down_evenly_and_said_to_be(door, tmp_path):
    log = simulated(scene(), seconds=5)
    count = 60
    time = np.arange(count * len(log.time)) * 0.01
    long = Log(time, *(np.tile(x, count) for x in (log.position, log.force)))
    measured = read_runs(door, "door", [written(tmp_path, lambda log: log.text(), long)])
    assert sum(len(run.time) for run in measured.runs) <= SAMPLES
    assert sum(np.ptp(run.time) for run in measured.runs) <= DURATION
    begins = [run.time[0] for run in measured.runs]
    np.testing.assert_allclose(np.diff(begins), np.diff(begins).mean(), atol=0.02)
    assert begins[0] == 0 and measured.runs[-1].time[-1] == pytest.approx(time[-1])
    assert any("are fitted to, in" in note for note in measured.notes)


def test_a_run_too_long_to_replay_is_refused_before_it_is(tmp_path):
    model = tmp_path / "fine.xml"
    model.write_text(scene(step=1e-6))
    path = written(tmp_path, lambda log: log.text(), simulated(scene(), seconds=6))
    with pytest.raises(JodaError, match=r"are 6e.06 of the scene's timesteps of 1e-06 s, which is"):
        joda.compare(model, "door", [path])


@pytest.mark.parametrize(
    ("angle", "limits", "said"),
    [
        (" radian", "0 90", "0 to 90 rad is 14.3 turns; if degrees are meant"),
        (" radian", "-180 180", "-180 to 180 rad is 57.3 turns; if degrees are meant"),
        ("", "0 1.57", 'is 0 to 1.57 degrees; if 1.57 rad are meant, add angle="radian"'),
        ("", "0 1.5708", 'is 0 to 1.571 degrees; if 1.571 rad are meant, add angle="radian"'),
        ("", "-1.92 0", "if -1.92 rad are meant"),
        ("", "0 90", ""),
        ("", "0 1080", ""),
        (" radian", "0 31.4159", ""),
        (" radian", "0 6.2832", ""),
        (" radian", "0 0.05", ""),
        (" radian", "-0.02 0.02", ""),
        ("", "0 2.5", ""),
        ("", "-3 3", ""),
    ],
)
def test_a_range_in_the_wrong_unit_is_suspected_aloud(angle, limits, said, good, tmp_path):
    model = tmp_path / "model.xml"
    compiler = f'><compiler angle="{angle.strip()}"/' if angle else ""
    model.write_text(scene(HINGE.format(limits), angle=compiler))
    found = joda.context(model, "door")
    doubt = " ".join(found.warnings)
    assert said in doubt
    assert bool(doubt) == bool(said)
    if limits == "0 90" and said:
        path = written(tmp_path, lambda log: log.text(), good)
        assert doubt in read_measured(model, "door", [path]).notes
    if limits == "0 1.57":
        path = written(tmp_path, lambda log: log.text(), good)
        with pytest.raises(JodaError, match='add angle="radian" to <compiler>'):
            joda.compare(model, "door", [path])


def test_the_command_says_it_in_one_line_with_status_2(door, good, tmp_path):
    path = written(tmp_path, REFUSED["ms"][0], good)
    command = [sys.executable, "-m", "joda", "compare", door, path, "--joint", "door"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("joda: run.csv: time goes from 0 to 5990 in steps of 10")
    assert done.stderr.count("\n") == 1
