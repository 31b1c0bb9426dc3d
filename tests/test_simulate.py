"""Interactions against closed forms, planted truth, and `joda compare`."""

import json
from pathlib import Path

import numpy as np
import pytest
from test_cli import fails, joda

from joda import JodaError, attach, compare, simulate
from joda.files import read_text
from joda.measured.run_files import read_run
from joda.pictures.offscreen import NoRenderer

MODELS = Path(__file__).parents[1] / "models"
LATCH = Path(__file__).parent / "microwave.latch.json"
MASS = 2.0

SLIDE = f"""
<mujoco><option gravity="0 0 0" timestep="0.001"/>
  <worldbody><body name="box">
    <joint name="j" type="slide" axis="1 0 0" range="0 1" %s/>
    <geom name="box" type="box" size=".1 .1 .1" mass="{MASS}"/></body>%s
  </worldbody>%s
</mujoco>"""


@pytest.fixture
def slide(tmp_path):
    """Writes the slide with attributes of its joint, further bodies, and further elements."""

    def write(joint="", bodies="", more="") -> Path:
        path = tmp_path / "slide.xml"
        path.write_text(SLIDE % (joint, bodies, more))
        return path

    return write


@pytest.fixture(scope="module")
def microwave(tmp_path_factory):
    folder = tmp_path_factory.mktemp("microwave")
    attach(MODELS / "microwave.xml", LATCH, folder / "scene.xml")
    return folder / "scene.xml"


def test_a_push_accelerates_while_it_lasts(slide):
    """F t / m, then uniform motion; the recorded force is the push."""
    run = simulate(slide(), "j", push=3.0, seconds=0.2, duration=0.5).run
    assert run.velocity[-1] == pytest.approx(3.0 * 0.2 / MASS, rel=1e-6)
    assert np.interp(0.1, run.time, run.velocity) == pytest.approx(3.0 * 0.1 / MASS, rel=1e-6)
    assert run.force[run.time < 0.1995] == pytest.approx(3.0)
    assert np.all(run.force[run.time > 0.2005] == 0)


@pytest.mark.parametrize("step", [0.0005, 0.004, 0.05])
def test_an_impulse_changes_the_momentum_by_itself(slide, step):
    path = slide()
    path.write_text(path.read_text().replace('timestep="0.001"', f'timestep="{step}"'))
    run = simulate(path, "j", impulse=-0.3, start=0.8, duration=0.2).run
    assert run.velocity[-1] == pytest.approx(-0.3 / MASS, rel=1e-6)
    assert np.sum(run.force) * step == pytest.approx(-0.3)


def test_released_on_a_spring_it_swings(slide):
    """x = x0 cos(w t) about the spring's rest."""
    path = slide('stiffness="8" springref="0.5"')
    run = simulate(path, "j", release=0.8, duration=2.0).run
    assert run.position == pytest.approx(0.5 + 0.3 * np.cos(2.0 * run.time), abs=2e-3)
    assert np.all(run.force == 0)


def test_a_slow_hand_feels_the_spring_and_the_friction(slide):
    """k q + f on the way there, k q - f on the way back."""
    path = slide('stiffness="20" frictionloss="1.5"')
    run = simulate(path, "j", hand=(0.9, 0.1), speed=0.2, pause=0.5).run
    there = (np.abs(run.velocity - 0.2) < 0.004) & (run.position < 0.85)
    back = (np.abs(run.velocity + 0.2) < 0.004) & (run.position > 0.15)
    assert there.sum() > 1000 and back.sum() > 1000
    assert run.force[there] == pytest.approx(20 * run.position[there] + 1.5, abs=0.05)
    assert run.force[back] == pytest.approx(20 * run.position[back] - 1.5, abs=0.05)
    assert run.position[-1] == pytest.approx(0.1, abs=0.01)


def test_a_hand_rests_where_it_is_told_to(slide):
    run = simulate(slide('damping="5"'), "j", hand=(0.6, 0.2), speed=0.5, pause=1.0).run
    held = np.abs(run.velocity) < 1e-3
    assert np.isclose(run.position[held], 0.6, atol=0.01).sum() > 500
    assert run.position[-1] == pytest.approx(0.2, abs=0.01)


def test_a_hand_is_no_faster_than_its_speed_and_no_stronger_than_its_strength(slide):
    run = simulate(slide('damping="5"'), "j", hand=(0.9,), speed=0.3, strength=2.0).run
    assert run.velocity.max() == pytest.approx(0.3, rel=0.01)
    run = simulate(slide('damping="5"'), "j", hand=(0.9,), speed=3.0, strength=2.0, force=True).run
    assert np.abs(run.force).max() == pytest.approx(2.0)
    assert run.velocity.max() == pytest.approx(2.0 / 5, rel=0.01)


def test_a_hand_gives_up_where_its_strength_is_exhausted(slide):
    run = simulate(slide('stiffness="100" damping="30"'), "j", hand=(0.9,), strength=20.0).run
    assert run.position[-1] == pytest.approx(0.2, abs=0.005)
    assert run.force[-1] == pytest.approx(20.0)


def test_a_hand_that_is_done_lets_go(slide):
    path = slide('stiffness="20" damping="8"')
    run = simulate(path, "j", hand=(0.5,), speed=0.5, duration=6.0).run
    assert run.time[-1] == pytest.approx(6.0)
    assert run.force[-1] == 0
    assert run.position[-1] == pytest.approx(0.0, abs=1e-3)


def test_opening_goes_from_the_closed_end_to_the_other_in_ten_seconds(slide):
    run = simulate(slide('damping="5" ref="1"').rename(slide().with_name("r.xml")), "j", open=True)
    assert (run.run.position[0], run.run.position[-1]) == pytest.approx((0, 1), abs=0.01)
    assert run.run.time[-1] == pytest.approx(10.0, abs=0.5)


def test_sudden_motion_is_where_a_barrier_lets_go(slide, tmp_path):
    """A spring pushes back up to s = 0.5 and forward beyond: there the box outruns the hand."""
    from joda.component import Component
    from joda.profile import Channel, Channels, Joint, Profile, Resistance

    hump = Component(interval=(0.3, 0.7), x=(0, 0.45, 0.55, 1), y=(0, -30, 30, 0))
    drag = Component(interval=(0, 1), x=(0, 1), y=(4, 4))
    profile = Profile(
        joint=Joint(name="j", type="slide", range=(0, 1), unit="m"),
        channels=Channels(
            conservative=Channel(components=(hump,)), damping=Resistance(components=(drag,))
        ),
    )
    attach(slide(), profile, tmp_path / "scene.xml")
    done = simulate(tmp_path / "scene.xml", "j", hand=(1.0,), speed=0.3, stiffness=150)
    ((a, b),) = done.fast
    assert 0.45 < np.interp(a, done.run.time, done.run.position) < 0.6
    inside = (done.run.time >= a) & (done.run.time <= b)
    assert np.all(np.abs(done.run.velocity[inside]) > 3 * 0.3)
    assert np.abs(done.run.velocity[~inside]).max() <= 3 * 0.3 + 1e-9
    assert (
        simulate(slide('damping="4"'), "j", hand=(1.0,), speed=0.3, output=tmp_path / "b.csv").fast
        == ()
    )


PUSHER = """
<body name="pusher" pos="-0.25 0 0"><joint name="p" type="slide" axis="1 0 0"/>
<geom name="pusher" type="sphere" size=".1" mass="1"/></body>"""
MOTOR = '<actuator><motor name="drive" joint="p"/></actuator>'


def test_the_force_of_a_robot_is_that_of_its_contact(slide, tmp_path):
    """A motor of 2 N against damping: both at 2 N / c, and 2 N between them."""
    path = slide('damping="8"', PUSHER, MOTOR)
    (tmp_path / "drive.csv").write_text("time,drive\n0,2\n1.5,2\n")
    done = simulate(path, "j", robot=tmp_path / "drive.csv")
    run = done.run
    steady = (run.time > 2.0) & (run.position < 0.85)
    assert steady.sum() > 500
    assert run.force[steady] == pytest.approx(2.0, abs=0.02)
    assert run.velocity[steady] == pytest.approx(2.0 / 8, rel=0.02)
    assert run.time[-1] == pytest.approx(1.5 + 2.0)
    assert "contact with pusher is part of it" in " ".join(done.sentences)


def test_a_light_joint_is_simulated_in_smaller_steps(slide, tmp_path):
    """Its hand is as firm as it should be: the scene keeps its timestep otherwise."""
    path = slide('stiffness="300" damping="1"')
    path.write_text(path.read_text().replace(f'mass="{MASS}"', 'mass="0.002"'))
    done = simulate(path, "j", hand=(0.05,), speed=0.05)
    assert np.diff(done.run.time).max() == pytest.approx(np.sqrt(0.05 * 0.002 / 1000), rel=1e-6)
    assert "simulated in steps of 0.32 ms" in done.sentences[-1]
    assert done.run.position[-1] == pytest.approx(0.05, abs=1e-3)


def test_a_button_begins_at_rest_on_its_stop(slide):
    """A spring presses it: nothing moves until the hand does."""
    path = slide('stiffness="300" springref="-0.1" damping="1"')
    run = simulate(path, "j", hand=(0.05,), speed=0.02).run
    assert np.abs(run.velocity[run.time < 0.05]).max() < 0.02


def test_a_scene_begins_at_home(slide):
    path = slide("", PUSHER, '<keyframe><key name="home" qpos="0.3 -2"/></keyframe>')
    run = simulate(path, "j", push=1e-9, duration=0.1).run
    assert run.position == pytest.approx(0.3, abs=1e-6)


@pytest.mark.sweep(3)
@pytest.mark.parametrize(
    "what",
    [
        {"release": 0.1},
        {"push": 1.5, "seconds": 0.4},
        {"push": -2.0, "start": 1.0},
        {"impulse": 0.1},
        {"hand": (1.2, 0.0)},
        {"open": True},
    ],
    ids=lambda what: next(iter(what)),
)
def test_a_scene_compared_with_its_own_run_has_no_error(microwave, tmp_path, what):
    done = simulate(microwave, "door", **what, output=tmp_path / "run.csv")
    found = compare(microwave, "door", [done.csv])
    assert found.rmse < 1e-3 * 1.92
    assert found.rmse_window < 1e-3 * 1.92


def test_the_arm_pushes_the_microwave_and_the_joint_by_itself_follows_its_force(
    microwave, tmp_path
):
    path = np.array([[0, 0, 0, 0], [1, 0.61, 0.79, -0.89], [1.4, 0.95, 1.1, -1.4]])
    lines = [",".join(f"{x:g}" for x in row) for row in path]
    (tmp_path / "push.csv").write_text(
        "\n".join(["time,arm_pan,arm_shoulder,arm_elbow", *lines]) + "\n"
    )
    done = simulate(
        microwave, "door", robot=tmp_path / "push.csv", start=1.0, output=tmp_path / "run.csv"
    )
    assert done.run.position[-1] < 0.6
    assert done.run.force.min() < -0.5
    assert compare(microwave, "door", [done.csv]).rmse < 2e-3 * 1.92


def test_the_run_is_one_that_other_commands_read(microwave, tmp_path):
    done = simulate(microwave, "door", hand=(0.5,), output=tmp_path / "run.csv")
    read = read_run(done.csv)
    assert read.forced
    for name in ("time", "position", "velocity", "force"):
        assert getattr(read, name) == pytest.approx(getattr(done.run, name), abs=1e-8)
    assert "a hand takes it" in read_text(done.csv).splitlines()[0]


@pytest.mark.long
def test_a_film_shows_the_motion(microwave, tmp_path):
    from PIL import Image

    film = tmp_path / "door.gif"
    simulate(microwave, "door", hand=(1.2,), output=tmp_path / "run.csv", gif=film)
    with Image.open(film) as made:
        assert made.n_frames == pytest.approx(2.2 * 20, abs=4)
        first = np.asarray(made.convert("RGB")).astype(int)
        made.seek(made.n_frames - 1)
        assert np.mean(np.abs(np.asarray(made.convert("RGB")) - first) > 30) > 0.05


def test_without_a_renderer_all_but_the_film_is_made(microwave, tmp_path, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    with pytest.raises(NoRenderer):
        simulate(microwave, "door", release=0.5, output=tmp_path / "a.csv", gif=tmp_path / "a.gif")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "a.png"]


@pytest.mark.long
def test_the_command_writes_and_tells(microwave, tmp_path):
    result = joda("simulate", microwave, "--joint", "door", "--push", "-2", "--start", "0.5",
                  "--for", "0.3", "-o", "run.csv", cwd=tmp_path)  # fmt: skip
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.splitlines()[-2:] == ["run.csv", "run.png"]
    assert "pushed with -2 N·m for 0.3 s, from 0.5 rad (28.6 degrees)" in result.stdout
    again = ("simulate", microwave, "--joint", "door", "--release", "0.5", "-o", "run.csv")
    assert "exists already; choose another name or add --force" in fails(*again, cwd=tmp_path)
    told = json.loads(joda(*again, "--force", "--json", cwd=tmp_path).stdout)
    assert (told["csv"], told["unit"], told["seconds"]) == ("run.csv", "rad", pytest.approx(3.0))


@pytest.mark.sweep(3)
@pytest.mark.parametrize(
    ("alone", "says"),
    [
        (["--release"], "let go at 0.96 rad"),
        (["--push"], "pushed with 3.19 N·m"),
        (["--impulse"], "an impulse of 0.135"),
        (["--hand"], "from 0 rad (0.0 degrees) to 1.92 rad (110.0 degrees), then to 0 rad"),
    ],
)
@pytest.mark.parametrize("last", [True, False])
def test_an_interaction_may_stand_alone(microwave, tmp_path, alone, says, last):
    options = ["--joint", "door", "-o", "run.csv"]
    given = [*options, *alone] if last else [*alone, *options]
    result = joda("simulate", microwave, *given, cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert says in result.stdout


@pytest.mark.sweep(5)
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "give exactly one of --release, --push"),
        (["--release", "0.2", "--push", "1"], "not --release and --push"),
        (["--release", "30"], "--release 30 is outside the range of joint 'door', 0 to 1.92 rad"),
        (["--hand", "a,b"], "--hand is 'a,b'; give positions"),
        (["--hand", "0.5,9"], "--hand 9 is outside the range"),
        (["--push", "1", "--speed", "2"], "--speed goes with --hand or --open, not --push"),
        (["--push", "nan"], "--push is nan; give a number"),
        (["--push", "strong"], "--push is 'strong'; give a number, or nothing"),
        (["--push", "1", "--duration", "0"], "--duration is 0; give more than 0"),
        (["--robot", "none.csv"], "none.csv: cannot be read"),
        (["--release", "0.2", "-o", "run.png"], "is the name of its picture"),
    ],
)
def test_mistakes_are_one_sentence_and_leave_nothing(microwave, tmp_path, arguments, sentence):
    told = fails("simulate", microwave, "--joint", "door", *arguments, cwd=tmp_path)
    assert sentence in told
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("time,arm\n0,1\n", "it needs time and actuators of the scene ('arm_pan', 'arm_sh"),
        ("0,1\n", "no header row with time and actuators of the scene"),
        ("time,arm_pan\n0,0\n0,1\n", "line 3: time does not increase"),
        ("time,arm_pan\n0,\n1,1\n", "line 2: arm_pan is empty"),
        ("time,arm_pan\n0,x\n", "line 2: arm_pan is 'x'; it must be a number"),
    ],
)
def test_targets_that_cannot_be_read(microwave, tmp_path, text, sentence):
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(JodaError, match=r"t\.csv") as error:
        simulate(microwave, "door", robot=tmp_path / "t.csv")
    assert sentence in str(error.value)


def test_an_unstable_scene_is_one_sentence(slide, tmp_path, monkeypatch, capfd):
    path = slide('stiffness="-1e9"', PUSHER, '<option integrator="Euler"/>')
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        JodaError, match=r"unstable at .*, where joint 'j' runs away: make the scen"
    ):
        simulate(path, "j", release=0.5)
    assert capfd.readouterr() == ("", "")
    assert not list(tmp_path.glob("MUJOCO_LOG*"))
