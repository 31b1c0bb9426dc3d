"""How well refinement does: the figures of docs/refine.md.

python tests/benchmarks refine_table            the paper's case, ten seeds
python tests/benchmarks refine_table planted    every template planted and recovered, twenty seeds
python tests/benchmarks refine_table planted 3 detent_internal    three seeds of one
python tests/benchmarks refine_table robust 200 --seed 7    from far off: unseen runs, see `robust`
"""

import multiprocessing
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from joda import context, templates
from joda.commands.refine import ITERATIONS
from joda.component import Component
from joda.estimation.profile_parameters import Parameters, gravity_scale
from joda.field import evaluate
from joda.joints.joint_model import joint_model
from joda.joints.rig import rig
from joda.measured.runs import Run
from joda.profile import CHANNELS, Channel, Channels, Joint, Profile, Resistance
from joda.refining.engine import JointEngine, noise
from joda.refining.fitting import Problem
from joda.scenes.context import Context
from joda.scenes.motion import Motion, release

MODELS = str(Path(__file__).parents[2] / "models")
STEP = 0.005
SECONDS = 2.0
NOISE = 5e-4
"""Of the measured position, as a part of the range."""
PACES = (4.0, 2.0, 1.0)
"""A slow run, a faster one, a fast one: together they tell friction from damping."""
WITHIN = 1.5
"""Error on unseen runs that is nearly the true profile's, in units of that."""
NEAR = 0.01
"""How far from a jump curves are compared."""


# --- the paper's case: a cabinet door whose profile holds too much at its open end
def cabinet_profile(found: Context, support: float, friction: float) -> Profile:
    """A magnet at the closed end, support (N·m) towards the open one, friction, damping."""
    magnet = (-3.0, -2.16, -1.14, -0.42, -0.12, 0.0)
    hold = (0.0, -support, -support)
    return Profile(
        joint=found.joint,
        channels=Channels(
            conservative=Channel(
                components=(
                    Component(label="magnet", interval=(0, 0.12), x=MAGNET, y=magnet),
                    Component(label="support", interval=(0.6, 1), x=(0, 0.3, 1), y=hold),
                )
            ),
            friction=Resistance(components=(_flat("friction", friction),)),
            damping=Resistance(components=(_flat("damping", 1.2),)),
        ),
    )


MAGNET = (0.0, 0.08, 0.2, 0.4, 0.7, 1.0)


def _flat(label: str, value: float) -> Component:
    return Component(label=label, interval=(0, 1), x=(0, 1), y=(value, value))


def quiet_rig(found: Context, profile: Profile, step: float = STEP) -> mujoco.MjModel:
    """The joint alone in MuJoCo with the plugin, its solver converged."""
    model = rig(found, profile)
    model.opt.timestep, model.opt.tolerance = step, 1e-14
    return model


def measured(motion, span: float, rng: np.random.Generator, forced: bool = False) -> Run:
    """A run as an encoder would have recorded it."""
    position = motion.position + rng.normal(0, NOISE * span, len(motion.time))
    return Run("run.csv", motion.time, position, None, motion.force, forced)


def released(found: Context, profile: Profile, places, rng) -> list[Run]:
    """Runs of letting the joint go at some normalised positions."""
    model, (lo, hi) = quiet_rig(found, profile), found.joint.range
    return [measured(release(model, 0, lo + s * (hi - lo), SECONDS), hi - lo, rng) for s in places]


def cabinet(seed: int):
    """Context, profile to start from, three runs and four that are held out."""
    found = context(MODELS + "/cabinet.xml", "door")
    true, start = cabinet_profile(found, 2.5, 0.4), cabinet_profile(found, 6.5, 0.6)
    rng = np.random.default_rng(seed)
    train = released(found, true, (0.35, 0.55, 0.8), rng)
    return found, start, train, released(found, true, (0.3, 0.45, 0.7, 0.9), rng)


def problem_of(found: Context, start: Profile, runs, kinds=("values", "intervals")):
    """The fit of a profile to runs."""
    joint = joint_model(found, start, quiet_rig(found, start), 0)
    parameters = Parameters(start, kinds, gravity=gravity_scale(found, start))
    span = found.joint.range
    engine = JointEngine(joint, span, runs, noise(runs, float(np.ptp(span))), STEP)
    return Problem(engine, parameters)


def missed(found: Context, profile: Profile, runs, windows: bool = False) -> float:
    """RMS misfit of whole runs, or of segments of 0.4 s, rad or m."""
    one = problem_of(found, profile, runs)
    return one.shooting.rms(one.long if windows else one.whole, one.parameters.start)


# --- planted profiles
@dataclass(frozen=True)
class Planted:
    """A joint with a known profile, another to start from, and runs."""

    found: Context
    true: Profile
    start: Profile
    runs: list[Run]


WHOLE = ("constant_", "spring_return_")
LOW, HIGH = "_to_low_end", "_to_high_end"


def place(name: str, rng: np.random.Generator) -> tuple[float, float]:
    """A place where the template is typically found."""
    if name == "bistable_mechanism" or name.startswith("spring_return"):
        return 0.0, 1.0
    if name.startswith("constant_"):
        return rng.uniform(0.15, 0.3), rng.uniform(0.65, 0.85)
    width = rng.uniform(0.12, 0.3)
    if name.endswith(LOW):
        return 0.0, width
    if name.endswith(HIGH):
        return 1 - width, 1.0
    width = rng.uniform(0.2, 0.4)
    middle = rng.uniform(0.3, 0.7)
    return middle - width / 2, middle + width / 2


def moved(interval, rng, most: float = 0.03) -> tuple[float, float]:
    """A slightly other place; ends at the ends of the range stay there."""
    (a, b), by = interval, rng.uniform(-most, most, 2)
    a, b = (np.clip(a + by[0], 0.01, 0.9) if a > 0 else a), (b + by[1] if b < 1 else b)
    return a, (np.clip(b, a + 0.05, 0.99) if b < 1 else b)


def bare(kind: str, span: float, inertia: float, weight: float = 0.0) -> Context:
    """A joint whose gravity pulls with a force, on hinges at the middle of the range."""
    hinge = kind == "hinge"
    joint = Joint(name="joint", type=kind, range=(0, span), unit="rad" if hinge else "m")
    found = context(MODELS + ("/knob.xml" if hinge else "/drawer.xml"), "#0")
    n = len(found.positions)
    positions = np.linspace(0, span, n)
    pull = weight * np.cos(positions - span / 2) if hinge else np.full(n, weight)
    return found.model_copy(
        update={
            "joint": joint,
            "positions": tuple(positions),
            "inertia": (inertia,) * n,
            "equivalent_inertia": inertia,
            "gravity_force": tuple(pull),
            "gravity_scale": abs(weight),
        }
    )


def planted(
    name: str, seed: int, off: float = 2.0, shift: float = 0.03, pull: float = 0.0
) -> Planted:
    """A template at a random place and strength, besides constant friction and damping.

    Args:
        name: of the template.
        seed: of all that is random.
        off: by which factor strengths are off at most to start from.
        shift: by how much, in normalised position, ends of intervals are.
        pull: of gravity at most, in units of the template's force.
    """
    rng = np.random.default_rng([seed, *name.encode()])
    kind = ("hinge", "slide")[seed % 2]
    span = rng.uniform(1.0, 2.0) if kind == "hinge" else rng.uniform(0.2, 0.5)
    inertia = rng.uniform(0.05, 1.0) if kind == "hinge" else rng.uniform(0.5, 5.0)
    force = inertia * span * rng.uniform(10, 40)
    found = bare(kind, span, inertia, pull * force * rng.uniform(-1, 1) if pull else 0.0)
    size = {
        "conservative": force,
        "friction": force * rng.uniform(0.1, 0.3),
        "damping": inertia * rng.uniform(4, 12),
    }
    constant = {
        "friction": force * rng.uniform(0.05, 0.2),
        "damping": inertia * rng.uniform(1.0, 4.0),
    }
    interval = place(name, rng)
    at = moved(interval, rng, shift)
    curves = templates()[name].channels

    def profile(interval, factor) -> Profile:
        out = {}
        for channel in CHANNELS:
            parts = []
            if channel in constant:
                parts.append(_flat("constant", constant[channel] * factor()))
            if curve := getattr(curves, channel):
                y = tuple(size[channel] * factor() * np.array(curve.y))
                parts.append(Component(label=name, interval=interval, x=curve.x, y=y))
            cls = Channel if channel == "conservative" else Resistance
            out[channel] = cls(components=tuple(parts))
        return Profile(joint=found.joint, channels=Channels(**out))

    true = profile(interval, lambda: 1.0)
    start = profile(at, lambda: off ** rng.uniform(-1, 1))
    model = quiet_rig(found, true)
    runs = [measured(pushed(model, span, force, rng, pace), span, rng, True) for pace in PACES]
    return Planted(found, true, start, runs)


def pushed(model: mujoco.MjModel, span: float, force: float, rng, pace=1.0, seconds: float = 8.0):
    """A hand pushes the joint to and fro between random places, at random speeds, all recorded.

    `pace` times 0.3 to 1.2 s are taken from one end to the other.
    """
    data = mujoco.MjData(model)
    data.qpos[0] = rng.uniform(0.1, 0.9) * span
    mujoco.mj_forward(model, data)
    inertia = float(data.M[0])
    stiffness = 200 * inertia
    damping = 2 * 0.5 * np.sqrt(stiffness * inertia)
    places, times = [data.qpos[0] / span], [0.0]
    low = bool(places[0] > 0.5)
    while times[-1] < seconds:
        places.append(rng.uniform(0.0, 0.12) if low else rng.uniform(0.88, 1.0))
        times.append(times[-1] + pace * rng.uniform(0.3, 1.2))
        low = not low
    out = []
    for k in range(round(seconds / STEP) + 1):
        t = k * STEP
        target = span * np.interp(t, times, places)
        push = stiffness * (target - data.qpos[0]) - damping * data.qvel[0]
        push = float(np.clip(push, -2 * force, 2 * force))
        out.append((t, data.qpos[0], data.qvel[0], push))
        data.qfrc_applied[0] = push
        mujoco.mj_step(model, data)
    return Motion(*np.array(out).T)


def robust(seed: int) -> tuple[str, list[float], float]:
    """A random profile refined from far off: strengths by up to five times, places by 0.1.

    Returns:
        the template; the errors on six unseen runs of 2 s, of what the true profile misses there:
        in windows before and after, of whole runs after; seconds.
    """
    name = sorted(templates())[seed % len(templates())]
    case = planted(name, seed, off=5.0, shift=0.1, pull=0.5)
    rng = np.random.default_rng([seed, 1])
    span, model = float(np.ptp(case.found.joint.range)), quiet_rig(case.found, case.true)
    force = float(np.abs(case.runs[0].force).max()) / 2
    hands = [pushed(model, span, force, rng, pace, SECONDS) for pace in (*PACES, *PACES)]
    held = [measured(hand, span, rng, True) for hand in hands]
    begun = time.time()
    problem = problem_of(case.found, case.start, case.runs)
    theta = problem.fit(ITERATIONS).theta
    spent, after = time.time() - begun, problem.parameters.written(theta)
    profiles = case.start, after, case.true
    first, last, least = (missed(case.found, one, held, windows=True) for one in profiles)
    whole = missed(case.found, after, held) / missed(case.found, case.true, held)
    return name, [first / least, last / least, whole], spent


def robust_table(count: int = 200, *seed: str) -> None:
    first = int(seed[-1]) if seed else int(np.random.default_rng().integers(2**30))
    print(f"--seed {first}; errors on unseen runs, in units of what the true profile misses")
    rows = []
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for k, row in enumerate(pool.imap(robust, range(first, first + int(count)))):
            rows.append(row)
            mark = "  " if row[1][1] <= WITHIN else "! "
            numbers = "".join(f"{number:8.2f}" for number in row[1])
            print(f"{first + k:12} {mark}{row[0]:40}{numbers}  {row[2]:.1f} s", flush=True)
    print(
        "\n| template | before | after | largest | within 1.5 | whole runs, median | within 1.5 |"
    )
    print("|---|---|---|---|---|---|---|")
    for name in [*sorted({row[0] for row in rows}), "all"]:
        before, after, whole = np.array([row[1] for row in rows if name in (row[0], "all")]).T
        good, all_good = (f"{np.sum(x <= WITHIN)} of {len(x)}" for x in (after, whole))
        numbers = f"{np.median(before):.1f} | {np.median(after):.2f} | {after.max():.2f}"
        print(f"| {name} | {numbers} | {good} | {np.median(whole):.2f} | {all_good} |")


def recovery(case: Planted, iterations: int = ITERATIONS):
    """`errors` of what a fit makes of the start."""
    problem = problem_of(case.found, case.start, case.runs)
    theta = problem.fit(iterations).theta
    return errors(case, problem.parameters.written(theta))


def errors(case: Planted, after: Profile):
    """RMS and largest error of each channel over the visited range, in units of its peak.

    Where a curve jumps, `NEAR` on either side is left out: there any shift is as large as the jump.
    """
    span = np.ptp(case.found.joint.range)
    visited = np.concatenate([run.position for run in case.runs]) / span
    s = np.linspace(max(visited.min(), 0), min(visited.max(), 1), 401)
    out = {}
    for name in CHANNELS:
        true, found = (evaluate(getattr(p.channels, name), s)[0] for p in (case.true, after))
        if peak := np.abs(true).max():
            smooth = np.all([np.abs(s - at) > NEAR for at in jumps(case.true, name)], axis=0)
            error = np.abs(found - true)[smooth] / peak
            out[name] = np.sqrt(np.mean(error**2)), error.max()
    return out


def jumps(profile: Profile, channel: str) -> list[float]:
    """Normalised positions where a channel's curve jumps."""
    components = getattr(profile.channels, channel).components
    ends = [end for c in components for end in zip(c.interval, (c.y[0], c.y[-1]), strict=True)]
    return [at for at, y in ends if y] + [-1.0]


def planted_table(seeds: int = 20, *names: str) -> None:
    print("RMS and largest error over the visited range, % of the channel's peak; seconds")
    rms = []
    for name in names or sorted(templates()):
        for seed in range(int(seeds)):
            begun = time.time()
            off = recovery(planted(name, seed))
            rms.append(max(e[0] for e in off.values()))
            line = "".join(f"  {c} {100 * e[0]:5.1f} {100 * e[1]:5.1f}" for c, e in off.items())
            print(f"{name:40}{seed:3}{line}  {time.time() - begun:.1f} s", flush=True)
    share = np.mean(np.array(rms) <= 0.05)
    print(f"{len(rms)} profiles; every channel's RMS error within 5 %: {100 * share:.0f} %")


def paper_table(seeds: int = 10) -> None:
    """Loss before and after nine iterations, on the fitted and on held-out releases; seconds."""
    print("seed  fitted: times less, of the noise   held out: times less, of the noise   s")
    for seed in range(int(seeds)):
        begun = time.time()
        found, start, train, held_out = cabinet(seed)
        problem = problem_of(found, start, train)
        theta = problem.fit(9).theta
        spent = time.time() - begun
        fitted = problem.parameters.written(theta, exact=True)
        line = f"{seed:4}"
        for runs in (train, held_out):
            before, after = (missed(found, one, runs) for one in (start, fitted))
            line += f"  {(before / after) ** 2:10.0f} {after / problem.sigma:6.2f}"
        print(f"{line}  {spent:.1f}", flush=True)


def main() -> None:
    what, *rest = sys.argv[1:] or ["paper"]
    {"planted": planted_table, "robust": robust_table, "paper": paper_table}[what](*rest)
