"""The paper's cases: their trials and baselines against planted truth, and that each one parts."""

import json
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from test_cli import fails, joda

from joda import attach, context, experiments
from joda.commands.experiments.base import Latch, LetGo, Press, bundled
from joda.commands.experiments.baselines import Baseline, fit_forces, fit_motions
from joda.commands.experiments.gallery import Shown, gallery, span
from joda.commands.experiments.subject import Subject
from joda.commands.experiments.table import CASES
from joda.commands.experiments.trial import WAYS, try_case
from joda.component import Component
from joda.profile import Channel, Channels, Profile, Resistance
from joda.scenes.model import load_model

ROOT = Path(__file__).parents[1]
SLIDE = """
<mujoco><option timestep="0.001"/><worldbody><body>
  <joint name="j" type="slide" axis="1 0 0" range="0 1"/>
  <geom type="box" size=".1 .1 .1" mass="1"/></body></worldbody></mujoco>"""
PLANTED = Baseline(friction=1.5, damping=4.0, stiffness=12.0, rest=0.25)


@pytest.fixture
def slide(tmp_path):
    path = tmp_path / "slide.xml"
    path.write_text(SLIDE)
    return path


def with_profile(path, *conservative, friction=0.3, damping=3.0) -> Subject:
    """The slide with components of force, and constant friction and damping."""
    found = context(path, "j")
    profile = Profile(
        joint=found.joint,
        channels=Channels(
            conservative=Channel(components=conservative),
            friction=Resistance(components=(curve(friction, friction),)),
            damping=Resistance(components=(curve(damping, damping),)),
        ),
    )
    scene = path.with_name("scene.xml")
    attach(path, profile, scene, force=True)
    return Subject(found, load_model(scene))


def curve(*y, interval=(0.0, 1.0)) -> Component:
    x = tuple(np.linspace(0, 1, len(y)).tolist())
    return Component(interval=interval, x=x, y=tuple(map(float, y)))


# --- baselines
@pytest.mark.parametrize("rest", [0.0, 0.25, 1.0])
def test_forces_of_a_spring_and_friction_are_recovered(slide, rest):
    found = context(slide, "j")
    planted = Baseline(friction=1.5, damping=4.0, stiffness=12.0, rest=rest)
    fitted = fit_forces(planted.profile(found), found, spring=True)
    assert vars(fitted) == pytest.approx(vars(planted), abs=1e-6)


def test_a_constant_takes_the_mean_of_friction_and_damping(slide):
    found = context(slide, "j")
    profile = Profile(
        joint=found.joint,
        channels=Channels(
            friction=Resistance(components=(curve(0, 2),)),
            damping=Resistance(components=(curve(6, 2),)),
        ),
    )
    fitted = fit_forces(profile, found, spring=False)
    assert (fitted.friction, fitted.damping, fitted.stiffness) == pytest.approx((1, 4, 0), rel=1e-3)


def test_gravity_is_none_of_the_fitted_forces():
    path = bundled("oven.xml")
    found = context(path, "door")
    planted = Baseline(friction=2.0, damping=1.0, stiffness=9.0, rest=0.3)
    fitted = fit_forces(planted.profile(found), found, spring=True)
    assert vars(fitted) == pytest.approx(vars(planted), rel=1e-4)


def test_motions_of_a_baseline_are_recovered(slide):
    """From the forces of something else, by what the planted one does."""
    found = context(slide, "j")
    planted = PLANTED.subject(slide, found)
    motions = [planted.let_go(s, 4.0) for s in (0.05, 0.5, 0.9)]
    start = Baseline(0.5, 1.0).profile(found)
    fitted = fit_motions(start, slide, found, motions, (), spring=True)
    ours = fitted.subject(slide, found)
    for s, motion in zip((0.05, 0.5, 0.9), motions, strict=True):
        assert ours.let_go(s, 4.0).position == pytest.approx(motion.position, abs=0.01)


def test_a_fit_seeks_where_it_belongs(slide):
    """Profile that holds; it belongs at rest at the low end, and a spring can do that."""
    found = context(slide, "j")
    hold = Baseline(friction=5.0, damping=1.0)
    motions = [hold.subject(slide, found).let_go(s, 4.0) for s in (0.3, 0.8)]
    fitted = fit_motions(hold.profile(found), slide, found, motions, (0.0, 0.0), spring=True)
    trial = LetGo({0.3: 0.0, 0.8: 0.0}, seconds=4.0)
    subject = fitted.subject(slide, found)
    assert trial.number(subject, trial.motions(subject)) < 0.03


def test_a_baseline_moves_natively_as_the_same_profile_does(slide):
    found = context(slide, "j")
    native = PLANTED.subject(slide, found)
    attach(slide, PLANTED.profile(found), slide.with_name("scene.xml"))
    ours = Subject(found, load_model(slide.with_name("scene.xml")))
    assert native.model.nplugin == 0 and ours.model.nplugin == 1
    for s in (0.0, 0.6, 1.0):
        one, other = native.let_go(s, 3.0), ours.let_go(s, 3.0)
        assert one.position == pytest.approx(other.position, abs=5e-3)


def test_usual_friction_creeps_and_the_stiffest_hardly(slide):
    slide.write_text(SLIDE.replace('axis="1 0 0"', 'axis="0 0 1"'))
    found, hold = context(slide, "j"), Baseline(friction=20.0, damping=1.0)
    drift = {
        usual: 0.5 - hold.subject(slide, found, usual).let_go(0.5, 5.0).position[-1]
        for usual in (True, False)
    }
    assert drift[True] > 0.01
    assert 0 <= drift[False] < 1e-4


# --- trials
def test_let_go_counts_the_worst_place(slide):
    """Friction holds it everywhere: off by 0.2 m at one place, by 0.05 m at another."""
    subject = with_profile(slide, friction=5.0)
    trial = LetGo({0.3: 0.3, 0.45: 0.5, 0.8: 0.6}, seconds=0.5)
    assert trial.number(subject, trial.motions(subject)) == pytest.approx(0.2, abs=1e-3)


def test_press_is_the_speed_of_the_slower_way(slide):
    """A hand is followed by a damped slide, and outrun past a hump, both ways."""
    trial = Press(seconds=3.0)
    plain, hump = with_profile(slide), curve(0, -60, 0, 60, 0, interval=(0.4, 0.6))
    assert trial.number(plain, trial.motions(plain)) == pytest.approx(1.0, abs=0.05)
    snapping = with_profile(slide, hump)
    assert trial.number(snapping, trial.motions(snapping)) > 3
    one_way = with_profile(slide, curve(0, -60, 0, 0, 0, interval=(0.4, 0.6)), friction=8.0)
    assert trial.number(one_way, trial.motions(one_way)) < 3


class Shutting(Latch):
    """The robot's work done already: at rest before the latch, and in it."""

    def motions(self, subject):
        return [subject.let_go(s, 0.02) for s in (0.3, 0.0)]


def test_a_latch_is_what_makes_it_harder_to_open(slide):
    trial = Shutting(("", ""), start=0.0)
    plain = with_profile(slide, friction=2.0)
    assert trial.number(plain, trial.motions(plain)) == pytest.approx(1.0, abs=0.02)
    held = with_profile(slide, curve(-8, -8, 0, interval=(0, 0.1)), friction=2.0)
    drag = 3.0 * held.span / 3.0  # damping times the hand's speed
    expected = (8 + 2 + drag) / (2 + drag)
    assert trial.number(held, trial.motions(held)) == pytest.approx(expected, rel=0.1)


def test_predicted_is_zero_for_the_object_itself():
    case = next(case for case in CASES if case.name == "cabinet_improved")
    path = bundled(case.model)
    found = context(path, case.joint)
    other = Baseline(0.4, 1.2).subject(path, found)
    truth = case.trial.reference()
    assert case.trial.number(other, truth) == pytest.approx(0.0, abs=1e-9)
    assert case.trial.number(other, case.trial.motions(other)) > 1.0


def test_a_case_is_separated_only_if_no_number_of_a_baseline_is_as_good():
    less = CASES[1]
    assert less.better == "less"
    assert less.separates((0.1, 0.2), (0.3, 0.9))
    assert not less.separates((0.1, 0.4), (0.3, 0.9))
    more = CASES[0]
    assert more.better == "more"
    assert more.separates((5, 9), (1, 4.9))
    assert not more.separates((5, 9), (1, 5))


# --- the cases
@pytest.mark.sweep(2)
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_case_parts_a_profile_from_both_baselines(case, tmp_path):
    """With a seed that the gallery has not."""
    tried = try_case(case, "12", tmp_path)
    for way in WAYS[1:]:
        assert case.separates([tried.numbers["joda"]], [tried.numbers[way]]), tried.numbers
    assert case.separates([tried.numbers["joda"]], [tried.numbers["usual"]])


def test_the_robot_and_the_positions_are_of_the_models():
    for case in CASES:
        model = mujoco.MjModel.from_xml_path(str(bundled(case.model)))
        lo, hi = model.joint(case.joint).range
        for name in ("release", "start"):
            assert lo <= case.show.get(name, lo) <= hi
        if "robot" in case.show:
            assert bundled(case.show["robot"]).is_file()


# --- the gallery
def test_the_gallery_is_what_its_numbers_make():
    """Nobody has edited docs/gallery.md, and it shows every case, each separated over 10 seeds."""
    numbers = json.loads((ROOT / "docs" / "gallery.json").read_text())
    assert list(numbers) == [case.name for case in CASES]
    shown = [Shown.from_json(case, numbers[case.name]) for case in CASES]
    assert all(one.separated and len(one.numbers["joda"]) == 10 for one in shown)
    text = (ROOT / "docs" / "gallery.md").read_text()
    assert gallery(shown, "gallery") == text
    for link in re.findall(r"\]\(([^#)]+)\)", text):
        assert (ROOT / "docs" / link).exists(), link


def test_spans_are_short():
    assert span([1.2345, 1.2345]) == "1.23"
    assert span([0.00001, 12.345]) == "< 0.001 to 12.3"


@pytest.mark.long
def test_the_command_leaves_a_gallery_whose_commands_run(tmp_path):
    result = joda("experiments", "switch", "--seeds", "1", "-o", "out", cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, "")
    assert "yes" in result.stdout
    assert result.stdout.splitlines()[-2:] == ["out/gallery.md", "out/gallery.json"]
    text = (tmp_path / "out" / "gallery.md").read_text()
    (line,) = re.findall(r"^    joda (simulate .*)$", text, re.MULTILINE)
    assert joda(*line.split(), cwd=tmp_path).returncode == 0
    folder = tmp_path / "out" / "gallery"
    for name in ("switch.png", "switch/scene.xml", "switch/constant.xml", "switch/spring.xml"):
        assert (folder / name).is_file()
    spring = load_model(folder / "switch" / "spring.xml")
    told = json.loads((tmp_path / "out" / "gallery.json").read_text())["switch"]
    assert spring.dof_frictionloss[0] == pytest.approx(
        told["baselines"]["spring"]["friction"], rel=1e-4
    )
    again = fails("experiments", "switch", "-o", "out", cwd=tmp_path)
    assert "exists already; choose another folder with -o or add --force" in again
    assert "there is no case 'door'; there are: lighter" in fails("experiments", "door")


@pytest.mark.slow
def test_it_works_where_nothing_can_render(tmp_path, monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    done = experiments(["switch"], tmp_path, seeds=1)
    assert not done.cases[0].film
    assert ".gif" not in done.gallery.read_text()
