"""The paired test of held-out segments and runs, and what is implausible to add."""

from dataclasses import replace

import numpy as np
import pytest
from test_compare import door, runs_of, scene_of

from joda.component import Component
from joda.diagnosis.adding import Error
from joda.diagnosis.paired_test import improves, risen
from joda.diagnosis.plausible import Needs, implausible, unvisited_interval, unvisited_shape
from joda.diagnosis.settings import SETTINGS
from joda.effects import StribeckFriction
from joda.measured.reading import read_measured
from joda.measured.visited import unvisited, unvisited_part, visited_share
from joda.profile import Channels
from joda.refining.acceptance import refused


@pytest.mark.parametrize(
    ("before", "after", "better"),
    [
        ([9.0] * 6, [1.0] * 6, True),  # 1 of 64 sign patterns is as good
        ([9.0] * 4 + [1.0], [1.0] * 4 + [9.0], False),  # as good in 2 of 32 and more
        ([9.0] * 3, [1.0] * 3, True),  # few, but none is worse
        ([9.0] * 3, [1.0] * 2 + [20.0], False),
        ([1.4, 1.2], [1.0, 0.9], True),  # few and short, but each is better
        ([1.4, 1.2], [1.0, 2.0], False),
        ([1.0] * 50, [1.1] * 50, False),  # within the noise nothing counts
        ([50.0] + [1.0] * 9, [1.0] + [3.0] * 9, False),  # one window decides nothing
        ([np.inf] * 6, [1.0] * 6, True),
    ],
)
def test_segments_are_better_only_beyond_chance(before, after, better):
    assert improves(np.array(before), np.array(after)) == better


def test_of_many_segments_chance_is_rarely_called_better():
    rng = np.random.default_rng()
    pairs = rng.lognormal(1.0, 1.0, (300, 2, 30))
    assert np.mean([improves(*pair) for pair in pairs]) < 0.1  # 5 %, and chance


def test_the_geometric_mean_of_whole_runs():
    assert risen(np.array([2.0, 8.0]), np.array([4.0, 4.0])) == pytest.approx(1.0)
    assert risen(np.array([0.1, 0.2]), np.array([0.9, 1.0])) == 1.0  # below the noise


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plausible")
    return read_measured(scene_of(door(), folder), "joint", runs_of(door(), folder, 4))


def test_a_force_that_nothing_needs_is_refused(measured):
    needs = Needs(measured).force
    assert 1.0 < needs < 200.0  # pushes of some N·m
    for force, absurd in ((2 * needs, False), (2 * SETTINGS.naming.force_times * needs, True)):
        effect = StribeckFriction(velocity=0.1, y=(force, force))
        reason = implausible(
            Needs(measured), measured.profile.with_effect(effect), "stribeck_friction"
        )
        assert bool(reason) == absurd, reason
        part = Component(
            label="detent_internal", interval=(0.3, 0.6), x=(0, 0.5, 1), y=(0, force, 0)
        )
        profile = measured.profile.with_component("conservative", part)
        assert bool(implausible(Needs(measured), profile, "detent_internal")) == absurd


def test_a_joint_without_resistance_that_moves_by_itself_is_refused(measured):
    friction = measured.profile.channels.friction
    assert friction.components
    bare = measured.profile.model_copy(
        update={"channels": Channels(conservative=measured.profile.channels.conservative)}
    )
    free = measured.with_runs(
        [replace(run, forced=False) for run in measured.runs], range(len(measured.runs))
    )
    assert not implausible(Needs(measured), bare)  # what moves it is recorded
    assert "something may have moved the joint" in implausible(Needs(free), bare)
    assert not implausible(Needs(free), measured.profile)


def test_where_no_run_was_is_told_in_closed_form(measured):
    lo, hi = measured.profile.joint.range
    ends = [(run.position.min(), run.position.max()) for run in measured.runs]
    first = (min(a for a, _ in ends) - lo) / (hi - lo)
    last = (max(b for _, b in ends) - lo) / (hi - lo)
    cut = measured.with_runs(measured.runs[:1], [0])
    away = unvisited(measured)
    assert all(b <= first + 1e-9 or a >= last - 1e-9 for a, b in away)
    assert sum(b - a for a, b in unvisited(cut)) >= sum(b - a for a, b in away)


def test_an_effect_is_not_placed_where_nobody_was(measured):
    lo, hi = measured.profile.joint.range
    own = measured.runs[0]
    high = lo + (hi - lo) * np.linspace(0.6, 0.9, len(own.time))
    near = measured.with_runs([replace(own, position=high)], [0])
    a, b = unvisited_part(near, (0.0, 0.3))[0]
    assert (a, b) == (0.0, 0.3)
    assert visited_share(near, (0.0, 0.3)) == 0.0
    assert "hardly any run visited s = 0.00 to 0.30" in unvisited_interval(near, (0.0, 0.3))
    assert unvisited_interval(measured, None) is None
    assert unvisited_interval(near, (0.0, 1.0)) is None  # a law, not a place


@pytest.mark.parametrize(
    ("x", "y", "said"),
    [
        ((0, 0.4, 0.8, 1), (1, 1, 1, 1), None),  # as it is where runs were
        ((0, 0.4, 0.8, 1), (1, 1, 2, 2), None),
        ((0, 0.4, 0.8, 1), (-1, -1, 1, 1), "its force turns or begins at s = 0.6"),
        ((0, 0.4, 0.8, 1), (1, 1, -0.05, -0.05), None),  # as good as nothing
        ((0, 0.55, 0.8, 1), (1, 1, 4, 5), "its force would be 5 times as much at s = 1.00"),
        ((0, 0.55, 0.8, 1), (0, 0, 1, 1), "its force turns or begins at s = 0.60"),
        ((0, 0.1, 0.3, 1), (3, -1, 1, 1), "its force turns or begins at s = 0.0"),  # below, too
    ],
)
def test_no_effect_turns_or_grows_where_no_run_was(measured, x, y, said):
    lo, hi = measured.profile.joint.range
    own = measured.runs[0]
    there = lo + (hi - lo) * np.linspace(0.2, 0.5, len(own.time))
    seen = measured.with_runs([replace(own, position=there)], [0])
    part = Component(label="detent_internal", interval=(0, 1), x=x, y=y)
    profile = measured.profile.with_component("conservative", part)
    reason = unvisited_shape((seen,), profile, "detent_internal", measured.profile)
    assert reason is None if said is None else reason.startswith(said), reason
    assert unvisited_shape((seen, measured), profile, "detent_internal", measured.profile) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("whole", "segments", "apart", "said"),
    [
        ((0.1, 0.01), (0.05, 0.002), None, None),
        ((0.1, 0.01), (0.05, 0.002), (0.1, 0.104), None),
        ((0.1, 0.01), (0.05, 0.002), (0.1, 0.2), "held out (--check) is 0.2 with it"),
        ((0.1, 0.2), (0.05, 0.06), None, "the free-run error is 0.2 instead of 0.1"),
        ((0.1, 0.2), (0.05, 0.002), None, None),  # near a barrier whole runs part
        ((0.731, 0.775), (0.413, 0.396), None, "free-run error is 0.775 instead of 0.731"),
        ((0.1, 0.1), (0.05, 0.05), None, "free-run error is 0.1 instead of 0.1"),
        ((0.415, 0.694), (0.342, 0.14), None, "would still be 0.694 instead of 0.415"),
        ((0.75, 0.454), (0.34, 0.174), None, "of what was fitted would still be 0.174"),
        ((0.0004, 0.0005), (0.0004, 0.0005), None, None),  # all of it noise
    ],
)
def test_refine_writes_nothing_that_is_worse(whole, segments, apart, said, tmp_path):
    measured = read_measured(scene_of(door(), tmp_path), "joint", runs_of(door(), tmp_path, 1))
    held = apart and (Error(apart[0], 0.01), Error(apart[1], 0.01))
    fitted = tuple(Error(*both) for both in zip(whole, segments, strict=True))
    same = measured.profile, measured.profile
    reason = refused(fitted, held or None, 1e-3, same, Needs(measured))
    assert (reason is None) if said is None else (said in reason)


@pytest.mark.parametrize(("times", "left", "hopeless"), [(2, 0.1, 0), (5, 0.1, 1), (5, 0.005, 0)])
def test_a_fit_that_changes_all_and_explains_little_is_refused(times, left, hopeless, tmp_path):
    """Friction of another joint: what is left is hundreds of times the noise."""
    measured = read_measured(scene_of(door(), tmp_path), "joint", runs_of(door(), tmp_path, 1))
    channels = measured.profile.channels
    stiff = channels.friction.model_copy(
        update={
            "components": tuple(
                part.model_copy(update={"y": tuple(times * y for y in part.y)})
                for part in channels.friction.components
            )
        }
    )
    after = measured.profile.model_copy(
        update={"channels": channels.model_copy(update={"friction": stiff})}
    )
    fitted = Error(0.5, 0.4), Error(0.4, left)
    reason = refused(fitted, None, 1e-3, (measured.profile, after), Needs(measured))
    assert bool(reason) == hopeless
    assert not reason or f"friction would be {times} times what it was" in reason
