"""Refining in the whole scene: the same answer as of the joint by itself, and what that cannot."""

import numpy as np
import pytest
from refine_table import STEP, planted, pushed, quiet_rig

from joda.field import evaluate
from joda.joints.parameters import Parameters
from joda.joints.single import single
from joda.measured.runs import Run
from joda.measured.scene_log import SceneRun
from joda.mjx.shooting import Scene
from joda.profile import CHANNELS
from joda.refining.engine import JointEngine
from joda.refining.scene import SceneEngine
from joda.refining.shooting import Shooting

SURE = 2e-5
"""Noise of positions, as a part of the range."""


@pytest.fixture(scope="module")
def both():
    """A planted door from its wrong start: by itself in C++, and as a scene in MJX."""
    seed = int(np.random.default_rng().integers(2**31))
    case = planted("detent_internal", seed)
    span, model = case.found.joint.range, quiet_rig(case.found, case.start)
    rng, width = np.random.default_rng(seed), float(np.ptp(span))
    force = float(np.abs(case.runs[0].force).max()) / 2
    hands = [
        pushed(quiet_rig(case.found, case.true), width, force, rng, pace, 2.5) for pace in (2, 1)
    ]
    noise = SURE * width
    runs = [
        Run("run", h.time, h.position + rng.normal(0, noise, len(h.time)), None, h.force, True)
        for h in hands
    ]
    own = single(case.found, case.start, model, 0)
    by_itself = JointEngine(own, span, runs, noise, STEP)
    nothing = np.zeros((len(runs[0].time), 0))
    together = [
        SceneRun(
            **vars(run),
            joints=(0,),
            positions=run.position[:, None],
            commands=nothing,
            forces=run.force[:, None],
        )
        for run in runs
    ]
    scene = Scene(model, {case.found.joint.name: case.start}, (0,), ("gravity_offset",))
    parameters = Parameters(case.start, ("values", "intervals", "inertia", "gravity"))
    engines = by_itself, SceneEngine(scene, 0, span, together, noise, own.inertia)
    return case, [Shooting(engine, parameters) for engine in engines]


@pytest.mark.long
def test_both_engines_move_alike_and_have_the_same_slopes(both):
    _, (alone, scene) = both
    parameters = alone.parameters
    rng = np.random.default_rng()
    theta = parameters.start + 0.02 * rng.normal(size=len(parameters.start))
    n = len(theta)
    unknowns = alone._unknowns(parameters.start, parameters.doubt)
    found = []
    for one in (alone, scene):
        judge = one.judge(0.4)
        own = judge.linear(one.mover, unknowns, theta, judge.windows.start)
        found.append((own.r, own.J, own.S))
    (r, J, S), (other, slopes, turns) = found
    assert np.median(np.abs(r - other)) < 0.01 * np.median(np.abs(r))
    for mine, theirs in ((J, slopes), (S, turns)):
        size = np.sqrt(np.median(mine**2)) + 1e-9
        assert np.median(np.abs(mine - theirs)) < 0.01 * size
    assert J.shape[2] == n


@pytest.mark.long
def test_both_engines_find_the_same_numbers(both):
    case, shootings = both
    found = []
    for one in shootings:
        theta = one.parameters.start
        for length in (0.1, 0.4):
            judge = one.judge(length)
            theta = one.fit_windows(judge, theta, one.parameters.doubt, 12)
        found.append(one.parameters.written(theta, exact=True))
    grid = np.linspace(0, 1, 201)
    for name in CHANNELS:
        curves = [evaluate(getattr(p.channels, name), grid)[0] for p in (*found, case.true)]
        peak = np.abs(curves[2]).max()
        assert np.abs(curves[0] - curves[1]).max() < 1e-3 * peak, name
        assert np.sqrt(np.mean((curves[1] - curves[2]) ** 2)) < 0.05 * peak, name
