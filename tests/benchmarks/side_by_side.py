"""Ways to refine a joint, side by side on the paper's case, as a Markdown table.

python tests/benchmarks side_by_side          seed 0
python tests/benchmarks side_by_side 1        another seed

The case is `refine_table.cabinet`: a cabinet door that gravity opens, three measured releases, a
profile that holds too much, and four releases that are held out. All ways get the same runs.

Every row is judged by one function: the door is let go in native MuJoCo from where it truly was
(`TRAIN` and `HELD_OUT`, parts of the range), at rest, and whole runs are compared with the measured
positions. The loss is the mean squared difference over all samples of all releases, rad², as in
the paper; `times less` is the loss before divided by that after; `of noise` is the loss's root in
units of the noise that was added.

Finite differences and mujoco.sysid also fit from the true starts. Ours fits the starts too, as it
does for any runs. The others know only boxes: that a rising part of a curve keeps rising is not
asked of them.
mujoco.sysid with native parameters begins with a bare joint, not with the profile: its loss before
is another one.
"""

import logging
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import redirect_stdout
from dataclasses import dataclass
from functools import partial
from io import StringIO

import mujoco
import numpy as np
from mujoco import sysid
from refine_table import MODELS, NOISE, SECONDS, STEP, cabinet, problem_of, quiet_rig
from scipy.optimize import least_squares

from joda import attach
from joda.estimation.profile_parameters import Parameters
from joda.measured.runs import Run
from joda.profile import Profile
from joda.scenes.context import Context
from joda.scenes.motion import release

Array = np.ndarray
Fitted = tuple[int, mujoco.MjModel]
"""Iterations, and the model that they led to."""

BARE, JOINT = MODELS + "/cabinet.xml", "door"
TRAIN = (0.35, 0.55, 0.8)
HELD_OUT = (0.3, 0.45, 0.7, 0.9)
FAR = 6.0
"""Where a number has no bound but a solver wants one: so many of its prior's deviations away."""
MANY = 200
"""Iterations that let a way converge."""

LINEAR = {
    "damping": (1.0, 0.0, 10.0),
    "frictionloss": (0.5, 0.0, 5.0),
    "stiffness": (1.0, 0.0, 20.0),
    "springref": (0.8, -1.6, 3.2),
    "armature": (0.05, 0.0, 1.0),
}
"""MuJoCo's own parameters of a joint: first value, least, largest."""
CUBIC = LINEAR | {
    "damping": ((1.0, 0.1, 0.1), (0.0, 0.0, 0.0), (10.0, 5.0, 5.0)),
    "stiffness": ((1.0, 0.0, 0.0), (0.0, -10.0, -10.0), (20.0, 10.0, 10.0)),
}
"""The same with polynomials; wider boxes fit more closely and predict held-out runs worse."""


@dataclass(frozen=True)
class Case:
    """The door, the profile to start from, its numbers, and the runs."""

    found: Context
    start: Profile
    train: list[Run]
    held_out: list[Run]
    parameters: Parameters

    def model(self, theta: Array) -> mujoco.MjModel:
        """The door with these numbers in its profile."""
        return quiet_rig(self.found, self.parameters.written(theta, exact=True))

    def position(self, place: float) -> float:
        """Of a part of the range, rad."""
        lo, hi = self.found.joint.range
        return lo + place * (hi - lo)

    def misfits(self, model: mujoco.MjModel, places=TRAIN) -> Array:
        """Predicted minus measured positions of the releases from these places, rad."""
        runs = self.train if places is TRAIN else self.held_out
        motions = [release(model, 0, self.position(place), SECONDS) for place in places]
        pairs = zip(motions, runs, strict=True)
        return np.concatenate([motion.position - run.position for motion, run in pairs])

    def loss(self, model: mujoco.MjModel, places=TRAIN) -> float:
        """The paper's, rad²."""
        return float(np.mean(self.misfits(model, places) ** 2))


def boxes(parameters: Parameters) -> tuple[Array, Array]:
    """The least and largest value of each number: the constraints on one number alone."""
    lo, hi = (parameters.start + sign * FAR * parameters.prior_std for sign in (-1, 1))
    for row, least in zip(parameters.constraints.G, parameters.constraints.h, strict=True):
        one, *others = np.flatnonzero(row)
        if not others and row[one] > 0:
            lo[one] = max(lo[one], least / row[one])
        elif not others:
            hi[one] = min(hi[one], least / row[one])
    return lo, hi


# --- ours, and finite differences
def ours(case: Case, iterations: int) -> Fitted:
    """Windows, their starts fitted too, with the joint in C++."""
    problem = problem_of(case.found, case.start, case.train)
    fit = problem.fit(iterations)
    fitted = problem.parameters.written(fit.theta, exact=True)
    return len(fit.history), quiet_rig(case.found, fitted)


def differences(case: Case, iterations: int) -> Fitted:
    """SciPy's least squares on whole runs, with finite differences of MuJoCo with the plugin."""
    done = least_squares(
        lambda theta: case.misfits(case.model(theta)),
        case.parameters.start,
        bounds=boxes(case.parameters),
        max_nfev=iterations,
    )
    return done.njev, case.model(done.x)


# --- mujoco.sysid
def scene(path: str) -> mujoco.MjSpec:
    """The cabinet with the rig's options."""
    spec = mujoco.MjSpec.from_file(path)
    spec.option.timestep, spec.option.tolerance = STEP, 1e-14
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return spec


def native(case: Case, ranges: dict) -> Fitted:
    """Its fit of MuJoCo's own parameters to a joint without a profile."""
    parameters = sysid.ParameterDict()
    for name, values in ranges.items():
        parameters.add(sysid.Parameter(name, *values, modifier=partial(write_native, name)))
    return identified(case, scene(BARE), parameters, "mujoco")


def write_native(name: str, spec: mujoco.MjSpec, parameter) -> None:
    """Puts a number, or a polynomial's, into the joint."""
    joint = spec.joint(JOINT)
    if name in ("damping", "stiffness"):
        getattr(joint, name)[: parameter.size] = parameter.value
    else:
        setattr(joint, name, parameter.value.item())


def plugged(case: Case, optimiser: str) -> Fitted:
    """Its fit of our numbers: a modifier writes them into the plugin's configuration."""

    def write(spec: mujoco.MjSpec, parameter) -> None:
        profile = case.parameters.written(parameter.value, exact=True)
        spec.plugins[0].config = profile.attributes()

    with tempfile.TemporaryDirectory() as folder:
        attach(BARE, case.start, folder + "/scene.xml")
        spec = scene(folder + "/scene.xml")
    numbers = (case.parameters.start, *boxes(case.parameters))
    parameters = sysid.ParameterDict()
    parameters.add(sysid.Parameter("profile", *numbers, modifier=write))
    return identified(case, spec, parameters, optimiser)


def identified(case: Case, spec: mujoco.MjSpec, parameters, optimiser: str) -> Fitted:
    """What mujoco.sysid makes of the measured releases, by one of its optimisers."""
    model, series, signal = spec.compile(), sysid.TimeSeries, [JOINT + "_qpos"]
    sequences = sysid.ModelSequences(
        "cabinet",
        spec,
        [f"release {place}" for place in TRAIN],
        [sysid.create_initial_state(model, np.array([case.position(place)])) for place in TRAIN],
        [series(run.time, np.zeros((len(run.time), 0))) for run in case.train],
        [series.from_names(r.time, r.position[:, None], model, signal) for r in case.train],
        allow_missing_sensors=True,
    )
    residuals = sysid.build_residual_fn(models_sequences=[sequences], custom_rollout=each_its_own)
    with redirect_stdout(StringIO()):
        fitted, done = sysid.optimize(parameters, residuals, optimiser, verbose=False)
    # its own optimiser lists the first point too
    count = done.njev if "njev" in done else len(done.extras["objective"]) - 1
    return count, sysid.apply_param_modifiers(fitted, spec)


def each_its_own(models, datas, control_signal, initial_states, **_) -> list:
    """A roll-out with data for each model: where they are shared, so are the plugin's numbers."""
    triples = zip(models, control_signal, initial_states, strict=True)
    return [sysid.sysid_rollout(m, mujoco.MjData(m), c, s)[0] for m, c, s in triples]


# --- the table
HEAD = """\
| way | iterations | s | loss before | after | times less | of noise | held out: less | of noise |
|---|---|---|---|---|---|---|---|---|"""


def row(case: Case, way: str, fit: Callable[[Case], Fitted], first: mujoco.MjModel) -> str:
    """Of the table."""
    begun = time.time()
    iterations, model = fit(case)
    spent = time.time() - begun
    noise = NOISE * np.ptp(case.found.joint.range)
    losses = (f"{case.loss(one):.2e}" for one in (first, model))
    cells = [way, str(iterations), f"{spent:.1f}", *losses]
    for places in (TRAIN, HELD_OUT):
        before, after = case.loss(first, places), case.loss(model, places)
        cells += [f"{before / after:.0f}", f"{np.sqrt(after) / noise:.2f}"]
    return f"| {' | '.join(cells)} |"


WAYS = {
    "ours": partial(ours, iterations=9),
    "ours, to its end": partial(ours, iterations=MANY),
    "finite differences": partial(differences, iterations=9),
    "finite differences, to their end": partial(differences, iterations=MANY),
    "mujoco.sysid, our profile": partial(plugged, optimiser="mujoco"),
    "mujoco.sysid, our profile, its SciPy": partial(plugged, optimiser="scipy"),
}
NATIVE = {
    "mujoco.sysid, MuJoCo's own": partial(native, ranges=LINEAR),
    "mujoco.sysid, MuJoCo's own, polynomials": partial(native, ranges=CUBIC),
}


def table(seed: int) -> None:
    """All ways, on one seed's runs."""
    found, start, train, held_out = cabinet(seed)
    case = Case(found, start, train, held_out, problem_of(found, start, train).parameters)
    profiled, bare = quiet_rig(found, start), scene(BARE).compile()
    print(HEAD)
    for ways, first in ((WAYS, profiled), (NATIVE, bare)):
        for way, fit in ways.items():
            if way.startswith("mujoco.sysid") and not hasattr(sysid, "optimize"):
                print(f"| {way} | not installed (pip install 'mujoco[sysid]') |")
            else:
                print(row(case, way, fit, first), flush=True)


def main() -> None:
    logging.getLogger("absl").setLevel(logging.ERROR)  # mujoco.sysid on positions, not sensors
    table(int(sys.argv[1]) if sys.argv[1:] else 0)
