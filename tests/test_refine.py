"""refine: what it needs, what it says where that is missing, and what it leaves."""

import json
import re
import subprocess
import sys
from dataclasses import dataclass, fields, replace
from inspect import signature
from pathlib import Path

import mujoco
import numpy as np
import pytest
from refine_table import MODELS, STEP, cabinet, cabinet_profile, planted, released
from scenes import attached, model_of, write
from scipy.optimize import least_squares

from joda import JodaError, Profile, attach, compare, context, refine
from joda.commands import refine as refine_file
from joda.commands.refine import ITERATIONS, Refined, _beyond, _settled
from joda.component import Component
from joda.effects import GravityOffset
from joda.estimation.profile_parameters import Parameters
from joda.measured.quasi_static import static_force
from joda.measured.run_files import write_run
from joda.measured.runs import Run
from joda.profile import Channels, Joint, Resistance
from joda.refining.refinement import extrapolated
from joda.scenes.scene import read_profiles

RUN = "time,position\n" + "".join(f"{0.01 * k},{0.3 + 0.001 * k}\n" for k in range(40))
CABINET = Path(MODELS, "cabinet.xml").read_text()
JOINT = 'range="0 1.6"/>'
NUDGE = [-0.003, -0.25], [0.003, 0.25]
"""How far (rad, rad/s) the measured start of a run may be off: three errors of the smoother."""


def python(code, folder):
    return subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True)


def test_importing_joda_does_not_import_jax(tmp_path):
    done = python("import joda, sys; print('jax' in sys.modules)", tmp_path)
    assert done.stdout == "False\n"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"runs": []}, "no runs"),
        ({"fit": ("values", "shape")}, "'shape' is none of values, intervals"),
        ({"joint": "window"}, "window"),
        ({"model": "in.xml"}, "carries no profile"),
        ({"output": "run.csv"}, "run.csv"),
    ],
)
def test_a_mistake_is_answered_before_any_file_is_written(change, said, tmp_path):
    attached(tmp_path)
    write(tmp_path, RUN, "run.csv")
    arguments = {"model": "out.xml", "joint": "door", "runs": ["run.csv"], "output": "new.xml"}
    arguments |= change
    for key in ("model", "output"):
        arguments[key] = tmp_path / Path(arguments[key])
    arguments["runs"] = [tmp_path / run for run in arguments["runs"]]
    before = sorted(tmp_path.iterdir())
    with pytest.raises(JodaError, match=said):
        refine(**arguments)
    assert sorted(tmp_path.iterdir()) == before


def command(folder, *arguments, joint="door"):
    """Runs `joda refine` on a joint of scene.xml, in a process of its own without a terminal."""
    words = ["joda", "refine", "scene.xml", "--joint", joint, "-o", "better.xml", *arguments]
    return python(f"import sys\nsys.argv = {words!r}\nfrom joda.cli import main\nmain()", folder)


def recorded(folder, runs, name) -> list[str]:
    """Writes the runs; the names of the files."""
    names = [f"{name}{k}.csv" for k in range(len(runs))]
    for file, run in zip(names, runs, strict=True):
        write_run(folder / file, run)
    return names


def content(folder) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@dataclass(frozen=True)
class Door:
    """What the command made of a scene and of measured runs."""

    folder: Path
    done: subprocess.CompletedProcess
    start: Profile
    held: list[Run]

    @property
    def told(self) -> dict:
        return json.loads(self.done.stdout)

    @property
    def history(self) -> dict:
        return json.loads((self.folder / "better.history.json").read_text())

    def replayed(self, scene: str, nudged=False) -> float:
        """RMS error of a scene that MuJoCo steps from where the held-out runs were let go.

        Nudged: from the start near there that suits each run best.
        """
        model, errors = model_of(self.folder / scene), []
        for run in self.held:
            # runs start at hundredths of the range, which is far more than their noise
            start = np.array([1.6 * round(run.position[0] / 1.6, 2), 0.0])
            assert abs(start[0] - run.position[0]) < 0.005

            def error(by, run=run, start=start):
                return replay(model, run, start + by) - run.position

            by = least_squares(error, [0, 0], bounds=NUDGE).x if nudged else np.zeros(2)
            errors.append(error(by))
        return float(np.sqrt(np.mean(np.square(errors))))


def replay(model: mujoco.MjModel, run: Run, start) -> np.ndarray:
    """Positions of the door at the times of a run, from a position and a velocity."""
    data, path = mujoco.MjData(model), []
    data.qpos[0], data.qvel[0] = start
    steps = round(run.time[-1] / model.opt.timestep)
    for _ in range(steps + 1):
        path.append(data.qpos[0])
        mujoco.mj_step(model, data)
    return np.interp(run.time, model.opt.timestep * np.arange(steps + 1), path)


@pytest.fixture(scope="module")
def door(tmp_path_factory) -> Door:
    """The paper's case: a door that is held too much, three measured runs, four held out."""
    folder = tmp_path_factory.mktemp("door")
    _, start, train, held = cabinet(0)
    write(folder, CABINET.replace('timestep="0.002"', f'timestep="{STEP}"'))
    attach(folder / "in.xml", start, folder / "scene.xml")
    runs = recorded(folder, train, "run")
    checks = [word for name in recorded(folder, held, "held") for word in ("--check", name)]
    done = command(folder, *runs, *checks, "--iterations", "9", "--json")
    return Door(folder, done, start, held)


class TestThePapersDoor:
    def test_the_command_succeeds_and_prints_nothing_but_json(self, door):
        assert (door.done.returncode, door.done.stderr) == (0, "")
        assert set(door.told) == {field.name for field in fields(Refined)}

    def test_it_leaves_the_four_files_that_it_names(self, door):
        told = [door.told[key] for key in ("scene", "composed", "picture", "history")]
        assert told == [
            f"better.{kind}" for kind in ("xml", "composed.json", "png", "history.json")
        ]
        new = {name for name in content(door.folder) if name.startswith("better")}
        assert new == set(told)

    def test_the_scene_carries_the_profile_that_is_written_beside_it(self, door):
        model_of(door.folder / "better.xml")
        carried = read_profiles(door.folder / "better.xml")["door"]
        beside = Profile.read(door.folder / "better.composed.json")
        assert (carried.joint, carried.channels) == (beside.joint, beside.channels)
        assert carried.channels != door.start.channels

    def test_the_changes_name_the_support_that_was_too_strong(self, door):
        (support,) = (line for line in door.told["changes"] if line.startswith("support"))
        assert "force -6.5 → -2." in support

    def test_the_scene_replayed_in_mujoco_from_rest_is_far_nearer_the_held_out_runs(self, door):
        was, now = door.replayed("scene.xml"), door.replayed("better.xml")
        assert was == pytest.approx(door.told["checked"][0], rel=0.02)
        assert now < was / 50

    def test_the_error_told_is_that_of_a_replay_from_the_starts_that_suit_best(self, door):
        """A search from rest may stop short of them, but not much, and it is never much nearer."""
        now, told = door.replayed("better.xml", nudged=True), door.told["checked"][1]
        assert 0.7 * now < told < 1.05 * now

    def test_the_fitted_runs_come_down_to_the_noise(self, door):
        assert door.told["noise"] == pytest.approx(5e-4 * 1.6, rel=0.1)
        assert door.told["before"] > 100 * door.told["after"]
        assert door.told["after"] < 1.5 * door.told["noise"]

    def test_the_history_has_all_iterations(self, door):
        rows = door.history["iterations"]
        assert 0 < len(rows) == door.told["iterations"] <= 9
        assert all(row["stage"] and np.isfinite(row["rmse"]) for row in rows)
        assert rows[-1]["stage"] == "whole runs"
        assert rows[-1]["rmse"] < rows[0]["rmse"]
        assert not door.history["interrupted"]

    def test_the_history_repeats_what_was_told(self, door):
        for key, name in {
            "rmse_before": "before",
            "rmse_after": "after",
            "noise_floor": "noise",
            "held_out": "checked",
            "unseen": "unseen",
        }.items():
            assert door.history[key] == door.told[name]

    def test_the_magnet_that_no_run_has_passed_is_unseen_and_stays(self, door):
        unseen = door.told["unseen"]
        assert set(unseen) == {"conservative", "friction", "damping"}
        for a, b in (pair for pairs in unseen.values() for pair in pairs):
            assert 0 <= a < b <= 1
        (magnet,) = unseen["conservative"]
        assert magnet == pytest.approx([0, 0.12], abs=0.02)
        assert unseen["friction"] == unseen["damping"] == [[0, pytest.approx(0.35)]]  # unvisited
        carried = read_profiles(door.folder / "better.xml")["door"].channels.conservative
        magnets = [channel.components[0] for channel in (carried, door.start.channels.conservative)]
        np.testing.assert_allclose(magnets[0].y, magnets[1].y, rtol=0.05, atol=0.02)

    def test_the_picture_is_a_png(self, door):
        assert (door.folder / "better.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"

    def test_a_second_run_is_refused_and_changes_nothing(self, door):
        before = content(door.folder)
        again = command(door.folder, "run0.csv")
        assert (again.returncode, again.stdout) == (2, "")
        assert "better.xml exists already" in again.stderr.replace(":", "")
        assert again.stderr.count("\n") == 1
        assert content(door.folder) == before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("files", "says"),
    [
        (("still.csv", "--force"), "still.csv: The runs visit only 0 % of the joint's range."),
        (
            ("run0.csv", "--check", "run0.csv", "--force"),
            "run0.csv: is fitted too; what is held out",
        ),
        (("run0.csv", "--check", "better.xml", "--force"), "better.xml: is read here"),
    ],
)
def test_what_cannot_be_fitted_or_held_out_is_a_sentence(files, says, tmp_path):
    found = context(write(tmp_path, CABINET), "door")
    profile = cabinet_profile(found, 2.5, 0.4)
    attach(tmp_path / "in.xml", profile, tmp_path / "scene.xml")
    recorded(tmp_path, released(found, profile, (0.8,), np.random.default_rng(0)), "run")
    rows = "".join(f"{0.01 * k:g},0.4\n" for k in range(200))
    write(tmp_path, "time,position\n" + rows, "still.csv")
    (tmp_path / "better.xml").write_bytes((tmp_path / "run0.csv").read_bytes())
    before = content(tmp_path)
    done = command(tmp_path, *files)
    assert (done.returncode, done.stdout) == (2, "") and done.stderr.count("\n") == 1
    assert says in " ".join(done.stderr.split())
    assert content(tmp_path) == before


def planted_runs(folder, turned=1.0):
    """A profile from which strengths are off, and runs with the force recorded, perhaps turned."""
    case = planted("detent_internal", int(np.random.default_rng().integers(1000)))
    lo, hi = case.found.joint.range
    text = BARE.format(
        kind=case.found.joint.type, lo=lo, hi=hi, inertia=case.found.equivalent_inertia, step=STEP
    )
    attach(write(folder, text, "bare.xml"), case.start, folder / "scene.xml")
    runs = [replace(run, force=turned * run.force) for run in case.runs]
    return recorded(folder, runs, "run")


BARE = """<mujoco>
  <compiler angle="radian"/>
  <option timestep="{step}" gravity="0 0 0"/>
  <worldbody><body><joint name="joint" type="{kind}" axis="0 1 0" range="{lo} {hi}"/>
    <inertial pos="0 0 0" mass="{inertia}" diaginertia="{inertia} {inertia} {inertia}"/>
  </body></worldbody>
</mujoco>"""


@pytest.mark.slow
def test_a_force_of_the_other_sign_bends_nothing(tmp_path):
    done = command(tmp_path, *planted_runs(tmp_path, -1.0), joint="joint")
    assert (done.returncode, done.stdout) == (2, "")
    assert "not written, as" in done.stderr
    assert not (tmp_path / "better.xml").exists()


@pytest.mark.long
def test_runs_are_set_right_as_the_corrections_say(tmp_path):
    wrong = float(np.random.default_rng().uniform(0.4, 0.6))
    runs = planted_runs(tmp_path, wrong)
    text = json.dumps({"joints": {"joint": {"force_scale": 1 / wrong}}})
    write(tmp_path, text, "scene.corrections.json")
    given = ("--corrections", "scene.corrections.json", "--json")
    before = content(tmp_path)
    done = command(tmp_path, *runs, *given, "--scene", joint="joint")
    assert done.returncode == 2 and "here the whole scene is simulated" in done.stderr
    assert content(tmp_path) == before
    done = command(tmp_path, *runs, *given, joint="joint")
    assert (done.returncode, done.stderr) == (0, "")
    told, beside = json.loads(done.stdout), tmp_path / "better.corrections.json"
    assert Path(told["corrections"]).name == beside.name
    assert told["windows"][1] < 2 * told["noise"] < 5 * told["noise"] < told["windows"][0]
    after = compare(
        tmp_path / "better.xml", "joint", [tmp_path / name for name in runs], corrections=beside
    )
    assert after.rmse == pytest.approx(told["after"], rel=1e-3)


def test_what_changes_where_no_run_was_is_said():
    def rubbing(y):
        part = Component(label="rub", interval=(0, 1), x=(0, 0.5, 1), y=(y, y, y))
        channels = Channels(friction=Resistance(components=(part,)))
        joint = Joint(name="j", type="hinge", range=(0, 2), unit="rad")
        return Profile(joint=joint, channels=channels)

    away = [(0.0, 0.3), (0.8, 1.0)]
    assert not extrapolated(rubbing(0.1), rubbing(0.12), away)  # not by much
    assert not extrapolated(rubbing(0.1), rubbing(0.3), [])
    (told,) = extrapolated(rubbing(0.1), rubbing(0.3), away)
    assert "No run was at s = 0.00 to 0.30 and s = 0.80 to 1.00: there the friction is" in told
    assert "from 0.1 to 0.3 N·m" in told


@pytest.mark.slow
def test_gravity_that_is_fitted_is_written(tmp_path):
    rng = np.random.default_rng()
    text = CABINET.replace('timestep="0.002"', f'timestep="{STEP}"')
    found = context(write(tmp_path, text, "bare.xml"), "door")
    start = cabinet_profile(found, 2.5, 0.4)
    tilt = GravityOffset(cos=float(rng.uniform(0.3, 0.6)), sin=float(rng.uniform(-0.5, -0.3)))
    attach(tmp_path / "bare.xml", start, tmp_path / "scene.xml")
    train, held = (
        released(found, start.with_effect(tilt), places, rng)
        for places in ((0.35, 0.55, 0.8), (0.45, 0.7))
    )
    runs, checks = recorded(tmp_path, train, "run"), recorded(tmp_path, held, "held")
    checks = [word for name in checks for word in ("--check", name)]
    done = command(tmp_path, *runs, *checks, "--fit", "gravity", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    (offset,) = read_profiles(tmp_path / "better.xml")["door"].effects
    at = np.linspace(*found.joint.range)
    wrong = (offset.cos - tilt.cos) * np.cos(at) + (offset.sin - tilt.sin) * np.sin(at)
    assert np.abs(wrong).max() < 0.1
    told = json.loads(done.stdout)
    again = compare(tmp_path / "better.xml", "door", [tmp_path / name for name in checks[1::2]])
    assert again.rmse == pytest.approx(told["checked"][1], rel=1e-3)
    assert told["checked"][1] < 3 * told["noise"]


def test_a_curve_of_a_tenth_of_the_force_is_asked_about(tmp_path):
    found = context(write(tmp_path, CABINET), "door")
    profile = cabinet_profile(found, 2.5, 0.4)
    attach(tmp_path / "in.xml", profile, tmp_path / "scene.xml")
    q = np.linspace(0.02, 1.58, 80)
    there, back = (static_force(profile, found, at, way) for at, way in ((q, 1.0), (q[::-1], -1.0)))
    rows = zip([*q, *q[::-1]], 0.1 * np.concatenate([there, back]), strict=True)
    write(tmp_path, "position,force\n" + "".join(f"{a},{b}\n" for a, b in rows), "curve.csv")
    done = command(tmp_path, "curve.csv")
    assert (done.returncode, done.stdout) == (2, "")
    assert "10 times the measured one: see to its unit first" in done.stderr


def test_the_command_line_fits_as_long_as_the_function():
    own = signature(refine_file.command).parameters["iterations"].default
    assert own == ITERATIONS == signature(refine).parameters["iterations"].default


def test_inertia_and_gravity_that_stay_are_not_written(tmp_path):
    scene = write(tmp_path, CABINET)
    found, model = context(scene, "door"), model_of(scene)
    parameters = Parameters(cabinet_profile(found, 2.5, 0.4), ("inertia", "gravity"))
    theta = np.array([0.0006, 2e-5, -1e-4])
    as_it_was = _settled(parameters, theta)
    assert not as_it_was.any()
    assert not parameters.written(as_it_was).effects
    also, said = _beyond(parameters, as_it_was, model, 0, found)
    assert not also
    assert said == ["Inertia: as it is, 0.1743 kg·m², within 0.1 %.", "Gravity: as it is."]
    theta = np.array([0.002, 2e-5, 0.03])
    assert np.array_equal(_settled(parameters, theta), theta)
    assert "armature" in _beyond(parameters, theta, model, 0, found)[0]


@pytest.mark.long
def test_inertia_and_bounce_are_found_and_end_in_the_joints_attributes(tmp_path):
    rng = np.random.default_rng(0)
    heavy = write(tmp_path, CABINET.replace(JOINT, JOINT[:-2] + ' armature="0.1"/>'), "heavy.xml")
    found = context(heavy, "door")
    true = cabinet_profile(found, 2.5, 0.4)
    runs = recorded(tmp_path, released(found, true, (0.55, 0.8), rng), "run")
    text = CABINET.replace(JOINT, JOINT[:-2] + ' solreflimit="0.02 0.3"/>')
    text = text.replace('timestep="0.002"', f'timestep="{STEP}"')
    attach(write(tmp_path, text), true, tmp_path / "scene.xml")
    done = command(tmp_path, *runs, "--fit", "damping_ratio,inertia", "--iterations", "8")
    assert (done.returncode, done.stderr) == (0, "")
    model = model_of(tmp_path / "better.xml")
    assert model.jnt_solref[0] == pytest.approx([0.02, 1.0], rel=0.1)
    assert model.dof_armature[0] == pytest.approx(0.1, rel=0.1)
    lines = done.stdout.splitlines()
    assert lines[0] == "Nothing changed."
    told = r"→ (\S+) rad RMS after (\d+) iterations; the measurement's noise is (\S+) rad"
    after, iterations, noise = map(float, re.search(told, lines[1]).groups())
    assert after < 1.1 * noise and 1 <= iterations <= 8
    assert any(line.startswith("Inertia: 0.1743 → 0.2") for line in lines)
    assert lines[-4:] == [
        f"better.{kind}" for kind in ("xml", "composed.json", "png", "history.json")
    ]
