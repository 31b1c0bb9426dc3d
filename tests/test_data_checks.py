"""Mistakes in measurements are found and named; good measurements raise none.

Every share is measured on fresh random runs; the seed is printed where a test fails.
"""

import re
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain
from pathlib import Path

import mujoco
import numpy as np
import pytest

from joda import context, templates
from joda.component import Component
from joda.interaction.hand import pull
from joda.joints.rig import rig
from joda.measured.data_checks import data_checks
from joda.measured.run_files import read_run
from joda.measured.runs import QuasiStatic, Run
from joda.measured.smoothing import resolution
from joda.profile import Channel, Channels, Joint, Profile, Resistance
from joda.scenes.context import Context
from joda.scenes.motion import Motion, release

ROOT = Path(__file__).parents[1]
DATA = ROOT.parent / "shared" / "data"
COUNT = 60
"""Runs of which a share is measured."""
SEED = int(np.random.SeedSequence().entropy % 2**32)
FINE = 0.001
"""Timestep of the simulated motions, s."""


@dataclass(frozen=True)
class Joined:
    """A joint and a motion of it."""

    found: Context
    motion: Motion
    kind: str

    @property
    def span(self) -> float:
        return self.found.joint.range[1] - self.found.joint.range[0]


@pytest.fixture
def rng():
    print("seed", SEED)
    return np.random.default_rng(SEED)


# --- joints and their motions
@cache
def read(file: str) -> Context:
    return context(ROOT / "models" / file, "#0")


def bare(kind: str, limits: tuple[float, float], inertia: float, weight: float = 0.0) -> Context:
    """A joint; `weight` (N·m or N) is the most that gravity does to it."""
    hinge = kind == "hinge"
    found = read("knob.xml" if hinge else "drawer.xml")
    places = np.linspace(*limits, len(found.positions))
    force = -weight * (np.sin(places) if hinge else np.ones(len(places)))
    return found.model_copy(
        update={
            "joint": Joint(name="j", type=kind, range=limits, unit="rad" if hinge else "m"),
            "positions": tuple(places),
            "inertia": (inertia,) * len(places),
            "equivalent_inertia": inertia,
            "gravity_force": tuple(force),
            "gravity_scale": float(np.abs(force).max()),
        }
    )


def random_joint(rng) -> tuple[Context, Profile, float]:
    """A joint, a profile with a random template, and the force that matters there."""
    kind = rng.choice(["hinge", "slide"])
    span = rng.uniform(1.0, 2.2) if kind == "hinge" else rng.uniform(0.2, 0.6)
    lo = rng.choice([0.0, 0.0, -rng.uniform(0.1, 0.9)]) * span
    inertia = 10 ** rng.uniform(-1.5, 0) * (1 if kind == "hinge" else 5)
    force = inertia * span * rng.uniform(8, 30)
    found = bare(kind, (lo, lo + span), inertia, rng.choice([0, 0.3]) * force)
    name = rng.choice(sorted(templates()))
    middle, width = rng.uniform(0.3, 0.7), rng.uniform(0.2, 0.4)
    curve = templates()[name].channels.conservative
    parts = ()
    if curve:
        y = tuple(force * np.array(curve.y))
        interval = (middle - width / 2, middle + width / 2)
        parts = (Component(label="it", interval=interval, x=curve.x, y=y),)

    def constant(value: float) -> Resistance:
        flat = Component(label="all", interval=(0, 1), x=(0, 1), y=(value, value))
        return Resistance(components=(flat,))

    channels = Channels(
        conservative=Channel(components=parts),
        friction=constant(force * rng.uniform(0.02, 0.15)),
        damping=constant(inertia * rng.uniform(0.3, 4)),
    )
    return found, Profile(joint=found.joint, channels=channels), force


def pushed(model, found: Context, force: float, rng, seconds=4.0) -> Motion:
    """A hand pushes the joint to and fro between random places, at random speeds."""
    data, (lo, hi) = mujoco.MjData(model), found.joint.range
    places, times = [rng.uniform(0.2, 0.8)], [0.0]
    while times[-1] < seconds:
        places.append(rng.uniform(0.1, 0.35) if places[-1] > 0.5 else rng.uniform(0.65, 0.9))
        times.append(times[-1] + rng.uniform(0.4, 1.2))
    data.qpos[0] = lo + places[0] * (hi - lo)
    stiffness = 150 * found.equivalent_inertia
    damping = np.sqrt(stiffness * found.equivalent_inertia)
    out = []
    for t in np.arange(0, seconds, FINE):
        target = lo + (hi - lo) * np.interp(t, times, places)
        push = stiffness * (target - data.qpos[0]) - damping * data.qvel[0]
        push = float(np.clip(push, -2 * force, 2 * force))
        out.append((t, data.qpos[0], data.qvel[0], push))
        data.qfrc_applied[0] = push
        mujoco.mj_step(model, data)
    return Motion(*np.array(out).T)


def simulated(rng) -> list[Joined]:
    """Three motions of a random joint: let go, pulled slowly, pushed to and fro."""
    found, profile, force = random_joint(rng)
    model, (lo, hi) = rig(found, profile), found.joint.range
    model.opt.timestep = FINE
    start, seconds = lo + rng.uniform(0.1, 0.95) * (hi - lo), rng.uniform(1.5, 4)
    ends = (lo, hi) if rng.random() < 0.5 else (hi, lo)
    slow = pull(model, 0, *ends, 3 * force, 60 * found.equivalent_inertia, rng.uniform(2, 6))
    return [
        Joined(found, release(model, 0, start, seconds), "let go"),
        Joined(found, slow, "pulled"),
        Joined(found, pushed(model, found, force, rng), "pushed"),
    ]


def closed_form(rng) -> Joined:
    """A damped swing about the middle of the range."""
    span, rate = rng.uniform(0.5, 2), rng.uniform(2, 8)
    found = bare("hinge", (0, span), 0.1)
    t = np.arange(0, 4, FINE)
    decay, middle = rng.uniform(0.1, 0.5), rng.uniform(0.45, 0.55) * span
    wave = rng.uniform(0.2, 0.42) * span * np.exp((1j * rate - decay) * t)
    velocity = ((1j * rate - decay) * wave).real
    return Joined(found, Motion(t, middle + wave.real, velocity, 0 * t), "let go")


@cache
def pool(seed: int) -> list[Joined]:
    """Motions in which the joint moves: by more than a sixth of its range."""
    rng = np.random.default_rng(seed)
    all_of_them = [one for _ in range(25) for one in simulated(rng)]
    all_of_them += [closed_form(rng) for _ in range(8)]
    return [one for one in all_of_them if np.ptp(one.motion.position) > one.span / 6]


# --- how they are recorded
def recorded(one: Joined, rng) -> Run:
    """A good record: fast enough, with noise, or an encoder, or both; time perhaps uneven."""
    motion, visited = one.motion, np.ptp(one.motion.position)
    rate = 10 ** rng.uniform(np.log10(50), 3)
    top = np.abs(motion.velocity).max()
    rate = min(max(rate, top / (0.07 * visited)), 1000.0)
    held = rng.choice([0, rng.uniform(0, 1)])  # before it moves
    time = np.arange(-held, motion.time[-1], 1 / rate)
    if rng.random() < 0.5:
        time = time + rng.uniform(-0.1, 0.1, len(time)) / rate
    q = np.interp(time, motion.time, motion.position)
    noise = 10 ** rng.uniform(-5, -3) * one.span
    encoder, noisy = rng.choice([(False, True), (True, False), (True, True)])
    q = q + noisy * rng.normal(0, noise, len(q))
    if encoder:
        turn = 2 * np.pi * (1 if one.found.joint.type == "hinge" else 0.02)
        step = min(turn / 10 ** rng.uniform(3, 4.7), visited / 60)
        q = step * np.round(q / step)
    velocity = force = None
    if rng.random() < 0.5:
        velocity = np.interp(time, motion.time, motion.velocity)
        velocity = velocity * rng.uniform(0.98, 1.02) + rng.normal(0, 0.01 * top, len(time))
    forced = bool(np.any(motion.force))
    force = np.interp(time, motion.time, motion.force)
    force = force + forced * rng.normal(0, 0.02 * np.abs(motion.force).max(), len(time))
    if forced and rng.random() < 0.3:
        force[rng.integers(len(force)) :][: len(force) // 8] = np.nan
    return Run("run.csv", time, q, velocity, force, forced)


def good(rng, kinds=("let go", "pulled", "pushed"), accept=lambda one: True) -> tuple[Joined, Run]:
    some = [one for one in pool(SEED) if one.kind in kinds and accept(one)]
    one = some[rng.integers(len(some))]
    return one, recorded(one, rng)


def kinds_in(run, found: Context) -> set[str]:
    return {one.kind for one in data_checks(run, found)}


# --- mistakes
def full(one: Joined) -> bool:
    """Whether a motion takes a good part of the range."""
    return bool(np.ptp(one.motion.position) > 0.4 * one.span)


def hinges(one: Joined) -> bool:
    return one.found.joint.type == "hinge"


def from_zero(one: Joined) -> bool:
    return one.found.joint.range[0] == 0


def resampled(run: Run, keep) -> Run:
    velocity = None if run.velocity is None else run.velocity[keep]
    return replace(
        run,
        time=run.time[keep],
        position=run.position[keep],
        velocity=velocity,
        force=run.force[keep],
    )


def degrees(one, run, rng):
    factor = 180 / np.pi if hinges(one) else 1000
    return replace(run, position=factor * run.position)


def mirrored(one, run, rng):
    return replace(run, position=-run.position)


def shifted(one, run, rng):
    """By so much that it could not as well have been mirrored."""
    lo, hi = one.found.joint.range
    shifted = run.position + hi - run.position.max() + rng.uniform(0.15, 3) * one.span
    return None if -shifted.max() > lo - 0.1 * one.span else replace(run, position=shifted)


def cut_off(one, run, rng):
    """Recorded on a joint whose range is larger than the model's; or a few samples are wrong."""
    position, (lo, hi) = run.position.copy(), one.found.joint.range
    if rng.random() < 0.5:
        about = (lo + hi) / 2
        position = about + (position - about) * 1.3 * one.span / np.ptp(position)
        position += about - (position.max() + position.min()) / 2
    else:
        wrong = rng.integers(0, len(position), 3)
        position[wrong] = hi + rng.uniform(0.3, 3, 3) * one.span
    return replace(run, position=position)


def dropped(one, run, rng):
    keep = np.flatnonzero(rng.random(len(run.time)) > rng.uniform(0.15, 0.5))
    return resampled(run, keep)


def interrupted(one, run, rng):
    n = len(run.time)
    long = max(round(rng.uniform(0.05, 0.2) * n), 8)
    at = rng.integers(5, n - long - 5)
    return resampled(run, np.r_[:at, at + long : n])


def strayed(one, run, rng):
    """Single values that a bus or an encoder got wrong, by 10 % of what was visited or more."""
    n, visited = len(run.position), np.ptp(run.position)
    position = run.position.copy()
    wrong = rng.choice(np.arange(5, n - 5, 4), rng.integers(1, 4), replace=False)
    lo, hi = one.found.joint.range
    way = np.where(position[wrong] > (lo + hi) / 2, -1, 1)
    position[wrong] += way * rng.uniform(0.3, 0.5, len(wrong)) * visited
    return replace(run, position=position)


def turned_force(one, run, rng):
    return replace(run, force=-run.force)


def repeated(one, run, rng):
    """Of an encoder so coarse that it mostly repeats anyway, nothing could be told."""
    n = len(run.time)
    if np.mean(np.diff(run.position) == 0) > 0.3:
        return None
    if rng.random() < 0.5:
        latest = np.arange(n) // rng.integers(2, 6)
        source = np.searchsorted(latest, latest)
    else:
        new = rng.random(n) > rng.uniform(0.25, 0.5)
        new[0] = True
        source = np.maximum.accumulate(np.where(new, np.arange(n), 0))
    return replace(run, position=run.position[source])


def coarse(one, run, rng):
    step = np.ptp(run.position) / rng.uniform(8, 30)
    return replace(run, position=step * np.round(run.position / step))


def seldom(one, run, rng):
    """As few samples as make the fastest move an eighth of the way or more."""
    visited = np.ptp(run.position)
    for every in range(1, len(run.time) // 20):
        for start in range(every):
            some = resampled(run, np.arange(start, len(run.time), every))
            if np.abs(np.diff(some.position)).max() > 0.125 * visited:
                return some
    return None


def other_velocity(one, run, rng):
    motion = one.motion
    velocity = np.interp(run.time, motion.time, motion.velocity)
    what = rng.choice([0, 1, 3] if one.kind == "pulled" else 4)  # at constant speed none is late
    if what == 0:
        velocity = velocity * rng.choice([180 / np.pi, np.pi / 180, 2, 0.5, 1000, 60 / (2 * np.pi)])
    elif what == 1:
        velocity = -velocity
    elif what == 2:
        delay = max(rng.uniform(0.05, 0.12), 5 * np.median(np.diff(run.time)))
        velocity = np.interp(run.time - delay, motion.time, motion.velocity)
    else:
        velocity = run.position * 3.0
    return replace(run, velocity=velocity)


def at_rest(one, run, rng):
    rest = run.position[0] + 1e-3 * one.span * rng.normal(0, 0.1, len(run.time))
    return replace(run, position=rest, velocity=None)


def few(one, run, rng):
    return resampled(run, np.arange(rng.integers(4, 19)))


def wrapped(one, run, rng):
    """The zero is in the middle of the motion, and angles count from 0 to a turn."""
    turn = rng.choice([2 * np.pi, 360.0])
    position = (run.position - (run.position.min() + run.position.max()) / 2) * turn / (2 * np.pi)
    return replace(run, position=position % turn, velocity=None)


MISTAKES = {
    "wrapped": (wrapped, dict(accept=hinges)),
    "degrees": (degrees, dict(accept=hinges)),
    "millimetres": (degrees, dict(accept=lambda one: not hinges(one))),
    "sign": (mirrored, dict(accept=lambda one: from_zero(one) and full(one))),
    "zero": (shifted, {}),
    "outside": (cut_off, {}),
    "stray": (strayed, {}),
    "uneven_time": (dropped, {}),
    "gap": (interrupted, {}),
    "force_sign": (turned_force, dict(kinds=("pushed",), accept=full)),
    "stale": (repeated, {}),
    "resolution": (coarse, {}),
    "slow_sampling": (seldom, dict(kinds=("let go", "pushed"))),
    "velocity": (other_velocity, {}),
    "still": (at_rest, {}),
    "short": (few, {}),
}


FATAL = {"wrapped", "degrees", "millimetres", "sign", "zero", "short"}


@pytest.mark.long
@pytest.mark.parametrize("kind", MISTAKES)
def test_a_mistake_is_found_and_named(kind, rng):
    mistake, choice = MISTAKES[kind]
    named = []
    while len(named) < COUNT:
        one, run = good(rng, **choice)
        if (wrong := mistake(one, run, rng)) is not None:
            named.append([s for s in data_checks(wrong, one.found) if s.kind == kind])
    assert np.mean([len(s) == 1 for s in named]) >= 0.95
    for check in chain(*named):
        assert check.sentence.startswith("run.csv: ")
        assert check.sentence.endswith(".")
        assert "\n" not in check.sentence and "nan" not in check.sentence
        assert check.fatal == (kind in FATAL) or kind == "outside"


@pytest.mark.slow
def test_a_good_run_passes_every_check(rng):
    raised = []
    for _ in range(5 * COUNT):
        one, run = good(rng)
        raised.append([s.sentence for s in data_checks(run, one.found)])
    assert np.mean([not s for s in raised]) >= 0.99, list(chain(*raised))


# --- where a number is known
def swinging(rng, hertz=200.0, rate=4.0) -> tuple[Context, Run]:
    """A hinge of 0 to 1.5 rad that swings twice in its middle."""
    t = np.arange(0, 4 * np.pi / rate, 1 / hertz)
    q = 0.75 + 0.6 * np.sin(rate * t) + rng.normal(0, 1e-4, len(t))
    return bare("hinge", (0, 1.5), 0.2), Run("swing.csv", t, q, None, 0 * t, False)


def the_one(run, found: Context, kind: str):
    return next(s for s in data_checks(run, found) if s.kind == kind)


def test_a_shift_is_told_by_how_much_at_least(rng):
    found, run = swinging(rng)
    told = the_one(replace(run, position=run.position + 1.0), found, "zero")
    shift = float(re.search(r"shifted by (-[0-9.]+)", told.sentence)[1])
    assert shift == pytest.approx(-0.85, abs=0.001)
    assert "the range 0 to 1.5 rad" in told.sentence


def test_a_run_whose_zero_is_a_little_off_is_told_so_and_used(rng):
    found, run = swinging(rng)
    told = the_one(replace(run, position=run.position + 0.225), found, "zero")
    assert not told.fatal and "their zero may be off, which joda diagnose tells" in told.sentence
    assert float(re.search(r"shifted by (-[0-9.]+)", told.sentence)[1]) == pytest.approx(
        -0.075, abs=0.001
    )


def test_a_shift_in_degrees_is_told_as_both(rng):
    found, run = swinging(rng)
    wrong = replace(run, position=np.rad2deg(run.position + 1.0))
    assert kinds_in(wrong, found) == {"degrees", "zero"}


def test_single_wrong_samples_are_counted_and_do_not_hide_the_rest(rng):
    found, run = swinging(rng)
    q = run.position.copy()
    q[[50, 200]] = 90.0
    assert "2 of 629 samples" in the_one(replace(run, position=q), found, "outside").sentence
    assert kinds_in(replace(run, position=q), found) == {"outside"}


def test_a_gap_is_told_where_and_how_long(rng):
    found, run = swinging(rng)
    keep = (run.time < 1.0) | (run.time >= 1.5)
    told = the_one(resampled(run, keep), found, "gap").sentence
    assert "0.505 s after 0.995 s, where 5 ms is usual" in told


def test_the_factor_and_the_delay_of_a_velocity_are_told(rng):
    found, run = swinging(rng)
    velocity = 2.4 * np.cos(4 * run.time)
    assert kinds_in(replace(run, velocity=velocity), found) == set()
    for wrong, said in (
        (np.rad2deg(velocity), "is 57.3 times"),
        (-velocity, "is -1 times"),
        (2.4 * np.cos(4 * (run.time - 0.1)), "is late by 100 ms"),
        (run.position, "is not the derivative"),
    ):
        assert said in the_one(replace(run, velocity=wrong), found, "velocity").sentence


def test_a_motion_that_turns_every_few_samples_is_sampled_too_slowly(rng):
    found, run = swinging(rng, hertz=10)
    fast = replace(run, position=0.75 + 0.6 * np.sin(2 * np.arange(len(run.time))))
    assert "turns every few samples" in the_one(fast, found, "slow_sampling").sentence


SHARES = {
    "inertia": (1, 0.1, 0.1, 0.2),
    "friction": (0.1, 1, 0.2, 0.2),
    "spring": (0.3, 0.2, 0.1, 3),
}


@pytest.mark.slow
@pytest.mark.parametrize("most", SHARES)
def test_a_turned_force_is_told_whatever_the_force_mostly_overcomes(most, rng):
    for _ in range(COUNT // 2):
        rate, t = rng.uniform(2, 6), np.arange(0, 5, 0.004)
        q = 0.4 * np.sin(rate * t) + 0.15 * np.sin(1.7 * rate * t + 1)
        v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
        weights = np.array(SHARES[most]) * rng.uniform(0.7, 1.4, 4)
        parts = (a / a.std(), np.sign(v), v / v.std(), q / q.std())
        force = weights @ parts + rng.normal(0, 0.05, len(t))
        inertia = weights[0] / a.std() * rng.uniform(0.5, 2)  # the model's may be wrong
        found = bare("hinge", (-0.6, 0.6), inertia)
        run = Run("run.csv", t, q + rng.normal(0, 1e-4, len(t)), None, force, True)
        assert kinds_in(run, found) == set()
        assert kinds_in(replace(run, force=-force), found) == {"force_sign"}


def test_a_constant_force_says_nothing_of_its_sign(rng):
    found, run = swinging(rng)
    for force in (-2.0, 2.0):
        hung = replace(run, force=np.full(len(run.time), force), forced=True)
        assert kinds_in(hung, found) == set()


def gauged(rng, back: bool) -> tuple[Context, QuasiStatic]:
    """A door with a spring and friction, its force read at some places, there and back."""
    count = rng.integers(12, 60)
    q = np.linspace(0.02, 1.4, count) + rng.uniform(-0.2, 0.2, count) * 1.4 / count
    way = np.ones(count)
    if back:
        q, way = np.append(q, q[::-1] + 0.003), np.append(way, -way)
    force = rng.uniform(-3, 3) + rng.uniform(-2, 2) * q + way + rng.normal(0, 0.1, len(q))
    return bare("hinge", (0, 1.5), 0.2), QuasiStatic("gauge.csv", q, force)


def test_a_curve_is_judged_too(rng):
    for _ in range(COUNT):
        found, curve = gauged(rng, back=True)
        turned = replace(curve, force=-curve.force)
        assert kinds_in(curve, found) == set()
        assert kinds_in(turned, found) == {"force_sign"}
        assert kinds_in(replace(curve, position=np.rad2deg(curve.position)), found) == {"degrees"}
        assert kinds_in(replace(curve, position=-curve.position), found) == {"sign"}
    few = QuasiStatic("gauge.csv", curve.position[:4], curve.force[:4])
    assert kinds_in(few, found) == {"short"}


def test_of_a_curve_in_one_direction_no_sign_of_the_force_is_doubted(rng):
    for _ in range(COUNT):
        found, curve = gauged(rng, back=False)
        assert kinds_in(replace(curve, force=-curve.force), found) == set()


@pytest.mark.parametrize("step", [1e-6, 2e-4, 0.01])
def test_the_step_of_an_encoder_is_found(step, rng):
    q = 0.7 * np.sin(np.arange(0, 20, 1e-3)) + rng.normal(0, 1e-7, 20000)
    found = resolution(step * np.round(q / step))
    assert found == pytest.approx(step if step > 1e-5 else 0, rel=0.01)  # too fine to be seen
    assert resolution(q) == 0


@pytest.mark.parametrize("digits", [5, 7, 12])
def test_a_steady_motion_is_no_encoders_steps(digits, rng):
    for count in (12, 30, 200):
        for _ in range(30):
            noise = rng.normal(0, 3e-4, count)
            q = 0.5 + rng.uniform(0.75, 3.75) * 5e-3 * np.arange(count)
            assert resolution(np.round(q + noise, digits)) < 3e-5
            assert resolution(q) == 0


def test_an_encoders_steps_are_found_behind_rounded_decimals(rng):
    q = 0.7 * np.sin(np.arange(0, 20, 1e-3))
    step = 2 * np.pi / 4096
    assert resolution(np.round(step * np.round(q / step), 4)) == pytest.approx(step, rel=0.01)


def test_whatever_the_numbers_are_something_readable_is_said(rng):
    found = bare("hinge", (0, 1), 1.0)
    for _ in range(3 * COUNT):
        n = rng.integers(4, 120)
        time = np.cumsum(rng.choice([1e-3, rng.exponential(1.0)], n))
        position = (
            np.zeros(n),
            rng.normal(0, 10 ** rng.uniform(-6, 6), n),
            np.linspace(0, 1, n),
            rng.choice([0.0, 1.0], n),
            rng.choice([-5.0, 10.0], n),
        )[rng.integers(5)]
        force = rng.choice([0.0, rng.choice([0.0, 1.0]), np.nan], n)
        velocity = rng.integers(2) * rng.normal(size=n)
        curve = QuasiStatic("odd.csv", position, np.nan_to_num(force))
        for run in (Run("odd.csv", time, position, velocity, force, True), curve):
            for check in data_checks(run, found):
                assert "nan" not in check.sentence


# --- real joints
@pytest.mark.skipif(not DATA.exists(), reason="the data are not in the repository")
@pytest.mark.parametrize("folder", ["emps", "encoder_pendulum_free_swing", "pr2_cabinet_doors"])
def test_real_runs_raise_nothing_fatal(folder):
    for path in sorted((DATA / folder).glob("*.csv")):
        run = read_run(path)
        kind, inertia = ("slide", 95.0) if folder == "emps" else ("hinge", 0.3)
        edge = 0.05 * np.ptp(run.position)
        found = bare(kind, (run.position.min() - edge, run.position.max() + edge), inertia)
        assert not data_checks(run, found)


def test_a_joint_that_gains_speed_by_itself_was_driven(rng):
    found, run = swinging(rng)
    grows = replace(run, position=0.75 + (run.position - 0.75) * (0.4 + 0.15 * run.time))
    told = the_one(grows, found, "driven").sentence
    assert "no force is recorded: something drove it" in told
    fast, slow = map(float, re.findall(r"at ([0-9.]+) rad/s", told))
    assert fast > 1.25 * slow
    for fades in (1.0, 1.0 - 0.2 * run.time, 1.0 - 0.29 * run.time):
        calm = replace(run, position=0.75 + (run.position - 0.75) * fades)
        assert not [one for one in data_checks(calm, found) if one.kind == "driven"]
    pushed = replace(grows, force=0 * run.time, forced=True)
    assert not [one for one in data_checks(pushed, found) if one.kind == "driven"]


@pytest.mark.parametrize(
    ("clock", "turns", "told"),
    [(60, 1, "time were in minutes"), (1, 2 * np.pi, "positions were in turns")],
)
def test_a_velocity_tells_the_unit_of_the_others(rng, clock, turns, told):
    found, run = swinging(rng)
    velocity = 0.6 * 4.0 * np.cos(4.0 * run.time)
    wrong = replace(run, time=run.time / clock, position=run.position / turns, velocity=velocity)
    sentence = the_one(wrong, found, "velocity").sentence
    assert f"as if {told}" in sentence and "leave the column out" not in sentence
