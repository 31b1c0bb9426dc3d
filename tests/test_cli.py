"""The commands as a user types them: what they print, what they leave, how they fail."""

import contextlib
import io
import json
import os
import shlex
import signal
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from unittest import mock

import jsonschema
import mujoco
import numpy as np
import pytest

from joda import COMMANDS, JodaError, Profile, bench, demo, plot
from joda.cli import app, main
from joda.commands.refine import Refined
from joda.pictures.cost import draw_growth
from joda.pictures.cost import profile as plotted
from joda.scenes.hinges import hinges, without_plugin
from joda.terminal.say import say_viewer

MODELS = Path(__file__).parents[1] / "models"
LATCH = Path(__file__).parent / "microwave.latch.json"


def joda(*arguments, cwd=None, **environment):
    """Runs the command line in a process of its own."""
    return subprocess.run(
        [sys.executable, "-c", "from joda.cli import main; main()", *map(str, arguments)],
        capture_output=True,
        text=True,
        cwd=cwd,
        env={**os.environ, **environment},
    )


def fails(*arguments, cwd=None) -> str:
    """The one sentence that a mistake is answered with; in this process, where joda is loaded."""
    out, told = io.StringIO(), io.StringIO()
    kept = signal.getsignal(signal.SIGINT), sys.unraisablehook
    with (
        contextlib.chdir(cwd or "."),
        mock.patch.object(sys, "argv", ["joda", *map(str, arguments)]),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(told),
        pytest.raises(SystemExit) as ended,
    ):
        main()
    signal.signal(signal.SIGINT, kept[0])
    sys.unraisablehook = kept[1]
    assert (ended.value.code, out.getvalue()) == (2, ""), told.getvalue()
    assert told.getvalue().startswith("joda: ")
    assert told.getvalue().count("\n") == 1
    return told.getvalue()


@pytest.fixture
def folder(tmp_path):
    for path in (MODELS / "microwave.xml", LATCH):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


def test_without_arguments_it_shows_its_help():
    assert joda().stdout == joda("--help").stdout
    assert joda().returncode == 0


def test_the_commands_are_told_in_one_line_each_on_a_narrow_terminal():
    lines = joda("--help", COLUMNS="80").stdout.partition("Commands:\n")[2].splitlines()
    assert sorted(line.split()[0] for line in lines) == sorted(COMMANDS)
    assert not [line for line in lines if "..." in line or not line.endswith(".")]


def test_it_says_which_version_it_is():
    version = f"joda {metadata.version('joda')} with MuJoCo {mujoco.__version__}\n"
    assert joda("--version").stdout == version


def test_a_renderer_that_mujoco_does_not_know_is_one_sentence():
    result = joda("schema", MUJOCO_GL="nonsense")
    assert result.returncode == 2
    assert "joda: MUJOCO_GL=nonsense cannot be used here" in result.stderr
    assert "Traceback" not in result.stderr


@pytest.mark.slow
def test_what_is_printed_meets_a_full_disk_a_closed_pipe_and_an_old_terminal():
    command = [sys.executable, "-c", "from joda.cli import main; main()"]
    with open("/dev/full", "w") as full:
        done = subprocess.run([*command, "schema"], stdout=full, stderr=subprocess.PIPE, text=True)
    told = "joda: what is printed: cannot be written or read (No space left on device).\n"
    assert (done.returncode, done.stderr) == (2, told)
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as closed:
        done = subprocess.run([*command, "schema"], stdout=closed, stderr=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (1, b"")
    done = joda("context", MODELS / "é°.xml", "--joint", "j", PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "\\xe9\\xb0.xml: no such file" in done.stderr


def test_attach_then_plot(folder):
    result = joda("attach", "microwave.xml", "microwave.latch.json", "-o", "scene.xml", cwd=folder)
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.splitlines()[-1] == "scene.xml"
    mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    result = joda("plot", "scene.xml", cwd=folder)
    assert result.stdout == "scene.png\n"
    assert (folder / "scene.png").read_bytes()[:4] == b"\x89PNG"


def test_the_viewer_is_started_by_the_python_that_has_joda(tmp_path, monkeypatch, capsys):
    other = tmp_path / "python"  # the same file, but not the environment's
    other.symlink_to(sys.executable)
    options = "-m mujoco.viewer '--mjcf=my oven/scene.xml'\n"
    for folder, python in ((Path(sys.executable).parent, "python"), (tmp_path, sys.executable)):
        monkeypatch.setenv("PATH", str(folder))
        say_viewer(Path("my oven/scene.xml"))
        assert capsys.readouterr().out == f"See it move: {python} {options}"
    monkeypatch.setattr(sys, "executable", str(tmp_path / "a folder" / "python"))
    say_viewer(Path("scene.xml"))
    told = shlex.split(capsys.readouterr().out.removeprefix("See it move: "))
    assert told == [sys.executable, "-m", "mujoco.viewer", "--mjcf=scene.xml"]


def test_context_is_printed_and_written(folder):
    result = joda("context", "microwave.xml", "--joint", "door", "--json", "c.json", cwd=folder)
    assert (result.returncode, result.stderr) == (0, "")
    assert "door, a hinge between microwave and door" in result.stdout
    assert "0 to 1.92 rad (0.0 to 110.0 degrees)" in result.stdout
    content = json.loads((folder / "c.json").read_text())
    assert content["joint"]["name"] == "door"
    again = ("context", "microwave.xml", "--joint", "door", "--json", "c.json")
    assert "c.json: exists already" in fails(*again, cwd=folder)
    printed = joda("context", "microwave.xml", "--joint", "door", "--json", "-", cwd=folder)
    assert json.loads(printed.stdout) == content and not (folder / "-").exists()


@pytest.mark.parametrize("joints", [["door"], ["door", "door2"]])
@pytest.mark.parametrize("command", ["compare", "diagnose"])
def test_numbers_are_printed_for_scripts(tmp_path, command, joints):
    """As in the file, and nothing else."""
    rows = [f"{t / 50},0.5,0.5" for t in range(40)]
    names = [f"position:{joint}" for joint in joints] if len(joints) > 1 else ["position", "force"]
    (tmp_path / "run.csv").write_text("\n".join([",".join(["time", *names]), *rows]) + "\n")
    box = '<geom type="box" size=".3 .01 .2" mass="2"/>'
    doors = (f'<body><joint name="{joint}" range="0 1.5"/>{box}</body>' for joint in joints)
    scene = f"<mujoco><compiler angle='radian'/><worldbody>{''.join(doors)}</worldbody></mujoco>"
    (tmp_path / "scene.xml").write_text(scene)
    options = [word for joint in joints for word in ("--joint", joint)]
    line = command, "scene.xml", "run.csv", *options
    written = joda(*line, "--json", "out.json", cwd=tmp_path)
    assert written.returncode == 0, written.stderr
    printed = joda(*line, "--json", "-", cwd=tmp_path)
    assert json.loads(printed.stdout) == json.loads((tmp_path / "out.json").read_text())
    assert not (tmp_path / "-").exists()


def test_mistakes_are_one_sentence_and_leave_nothing(folder):
    before = sorted(folder.iterdir())
    (folder / "bad.json").write_text('{"joint": {"name": "door"')
    composed = "microwave.latch.json"
    attach = ("attach", "microwave.xml", composed, "-o")
    assert "no such file" in fails("attach", "nothing.xml", composed, "-o", "s.xml", cwd=folder)
    assert "bad.json: not JSON" in fails(
        "attach", "microwave.xml", "bad.json", "-o", "s.xml", cwd=folder
    )
    assert "exists already; choose another name or add --force" in fails(
        *attach, "microwave.xml", cwd=folder
    )
    assert "does not exist; create it first" in fails(*attach, "no/s.xml", cwd=folder)
    assert "hinges and slides of the model: 'door'" in fails(
        *attach, "s.xml", "--joint", "dor", cwd=folder
    )
    assert "carries no profile" in fails("plot", "microwave.xml", cwd=folder)
    assert "carries no profile; attach one first" in fails("bench", "microwave.xml", cwd=folder)
    assert "Missing" in fails("attach", cwd=folder)
    assert "No such option" in fails("plot", composed, "--colour", "red", cwd=folder)
    assert "No such command 'bend'" in fails("bend", cwd=folder)
    assert "replace" in fails(*attach, "s.xml", "--native", "drop", cwd=folder)
    (folder / "bad.json").unlink()
    assert sorted(folder.iterdir()) == before


def test_the_schema_describes_the_file():
    schema = json.loads(joda("schema", "composed").stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    good = json.loads(LATCH.read_text())
    validator.validate(good)
    with pytest.raises(jsonschema.ValidationError):
        validator.validate({**good, "chanels": {}})


def test_the_templates_schema_fits_the_library():
    validator = jsonschema.Draft202012Validator(json.loads(joda("schema", "template").stdout))
    for path in (MODELS.parent / "templates").glob("*.json"):
        validator.validate(json.loads(path.read_text()))


def test_a_hand_written_file_with_only_the_fixed_keys_is_valid(tmp_path):
    channel = {"combine": "sum", "components": []}
    content = {
        "schema_version": 1,
        "joint": {"name": "door", "type": "hinge", "range": [0, 1.5], "unit": "rad"},
        "channels": {name: channel for name in ("conservative", "friction", "damping")},
        "effects": [],
    }
    (tmp_path / "composed.json").write_text(json.dumps(content))
    assert Profile.read(tmp_path / "composed.json").joint.range == (0, 1.5)


class TestDemo:
    def test_the_door_stays_half_way_and_shuts_itself_and_the_plain_one_falls_open(self, tmp_path):
        result = demo(tmp_path / "out")
        assert result.plain_ends == pytest.approx((1.57, 1.57), abs=0.02)
        half, nearly = result.joda_ends
        assert half == pytest.approx(result.starts[0], abs=0.002)
        assert abs(nearly) < 0.002
        assert result.plain_force < 0 < result.joda_force
        assert len(result.history.rounds) >= 2  # there was something to mend
        assert not result.history.rounds[-1].unmet
        for path in (result.plain, result.scene, result.picture, result.folder / "profile.png"):
            assert path.is_file()

    def test_it_prints_what_happened_as_json(self, tmp_path):
        result = joda("demo", "-o", tmp_path / "out", "--json")
        assert json.loads(result.stdout)["joda_ends"][1] < 0.002

    def test_it_works_where_nothing_can_render(self, tmp_path):
        result = joda("demo", "-o", tmp_path / "out", MUJOCO_GL="disabled")
        assert result.returncode == 0
        assert "2.5 s later: without a profile at 90.0" in result.stdout

    def test_it_overwrites_only_when_told_to(self, tmp_path):
        (tmp_path / "mine.txt").write_text("mine")
        assert "exists already; choose another folder with -o or add --force" in fails(
            "demo", "-o", tmp_path
        )
        assert joda("demo", "-o", tmp_path, "--force").returncode == 0
        assert (tmp_path / "mine.txt").read_text() == "mine"


class TestBench:
    """Only what is measured is tested here, not how fast it is."""

    def test_rows_are_ratios_of_times(self, folder, monkeypatch):
        monkeypatch.setattr("joda.commands.bench.ROUNDS", 3)
        joda("attach", "microwave.xml", "microwave.latch.json", "-o", "scene.xml", cwd=folder)
        for rows in (bench(), bench(folder / "scene.xml")):
            for row in rows:
                assert np.isfinite(row.ratio)  # of differences, negative on a busy machine
                assert row.microseconds[0] > 0
        assert "one" not in bench(folder / "scene.xml")[0].what

    def test_the_native_scene_has_no_plugin_and_the_same_joints(self, folder):
        from joda.scenes.scene import read_profiles

        joda("attach", "microwave.xml", "microwave.latch.json", "-o", "scene.xml", cwd=folder)
        native = without_plugin(folder / "scene.xml", read_profiles(folder / "scene.xml"), True)
        assert (native.nplugin, native.neq, native.njnt) == (0, 0, 4)
        assert native.dof_damping[0] > 0.1
        assert native.dof_frictionloss[0] == pytest.approx(0.07, rel=1e-6)

    @pytest.mark.long
    def test_the_plot_shows_how_the_cost_grows(self, folder, monkeypatch):
        monkeypatch.setattr("joda.pictures.cost.ROUNDS", 2)
        monkeypatch.setattr("joda.pictures.cost.JOINTS", (1, 3))
        growth = draw_growth(folder / "cost.png")
        assert (folder / "cost.png").read_bytes().startswith(b"\x89PNG")
        assert growth.joints == (1, 3) and min(growth.ours + growth.rows) > 0
        assert len(growth.by_components) == len(growth.components)
        with pytest.raises(JodaError, match="exists already"):
            draw_growth(folder / "cost.png")
        assert [len(plotted(n).channels.friction.components) for n in (3, 96)] == [1, 32]

    def test_worlds_are_of_warp(self, folder):
        result = joda("bench", "--worlds", "2", cwd=folder)
        assert result.returncode == 2
        assert "--worlds is of --warp; add --warp." in result.stderr
        assert "leave out the scene" in fails("bench", "a.xml", "--plot", "b.png", cwd=folder)

    def test_hinges_differ_only_in_what_acts_on_them(self):
        plain, native, ours = (hinges(3, kind) for kind in ("plain", "native", "joda"))
        assert plain.nv == native.nv == ours.nv == 3
        assert (plain.dof_frictionloss == 0).all()
        assert ours.nplugin == 3


@pytest.mark.parametrize(("kind", "unit"), [("hinge", "rad"), ("slide", "m")])
def test_refine_tells_errors_in_the_joints_unit(kind, unit, tmp_path, monkeypatch, capsys):
    content = json.loads(LATCH.read_text())
    content["joint"].update(type=kind, unit=unit)
    (tmp_path / "composed.json").write_text(json.dumps(content))
    files = {"scene": "better.xml", "picture": "better.png", "history": "better.history.json"}
    result = Refined(
        **{name: tmp_path / path for name, path in files.items()},
        composed=tmp_path / "composed.json",
        corrections=None,
        changes=(),
        before=0.02,
        after=0.001,
        windows=(0.01, 0.0008),
        noise=0.0005,
        checked=(0.03, 0.002),
        unseen={"friction": ((0.1, 0.25),), "damping": ()},
        iterations=4,
        notes=("A note.",),
    )
    monkeypatch.setattr("joda.commands.refine.refine", lambda *_, **__: result)
    command = ["refine", "scene.xml", "run.csv", "--joint", "door", "-o", "better.xml"]
    app("refine")(command, standalone_mode=False)
    assert capsys.readouterr().out.splitlines() == [
        "Nothing changed.",
        f"Position error: 0.02 → 0.001 {unit} RMS after 4 iterations; "
        f"the measurement's noise is 0.0005 {unit}.",
        f"Segment error (0.4 s horizon): 0.01 → 0.0008 {unit}.",
        f"On the runs held out: 0.03 → 0.002 {unit} RMS.",
        "The data tell little of friction at s = 0.10 to 0.25: it is hardly measured there.",
        "A note.",
        *(str(getattr(result, name)) for name in ("scene", "composed", "picture", "history")),
    ]


class TestPlot:
    def test_a_profile_file(self, folder):
        assert plot(folder / "microwave.latch.json") == folder / "microwave.latch.png"

    def test_a_joint_must_be_chosen_where_several_carry_profiles(self, tmp_path):
        (tmp_path / "two.xml").write_text(TWO)
        with pytest.raises(
            JodaError, match="several joints carry a profile; choose with --joint: 'a', 'b'"
        ):
            plot(tmp_path / "two.xml")
        with pytest.raises(JodaError, match="joint 'c' carries no profile; these do: 'a', 'b'"):
            plot(tmp_path / "two.xml", joint="c")
        assert plot(tmp_path / "two.xml", joint="b") == tmp_path / "two.b.png"


TWO = """
<mujoco><extension><plugin plugin="joda.joint_dynamics">
  <instance name="p"><config key="damping" value="0 1 | 0 1 | 1 1"/></instance>
  <instance name="q"><config key="damping" value="0 1 | 0 1 | 1 1"/></instance></plugin></extension>
  <worldbody>
    <body><joint name="a" range="0 90"/><geom size=".1"/><plugin instance="p"/></body>
    <body><joint name="b" range="0 90"/><geom size=".1"/><plugin instance="q"/></body>
  </worldbody></mujoco>"""
