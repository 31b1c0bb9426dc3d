"""Whatever the profile, inertia and timestep: finite, and no energy from friction or damping."""

import mujoco
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from joints import DISCRETE, EULER_LIKE, SOLVERS, component, has, load, warnings

INTEGRATORS = (*EULER_LIKE, "RK4", *(["discrete"] if has(DISCRETE) else []))
SECONDS = 10


@st.composite
def channels(draw, force: float, friction: float, damping: float) -> dict[str, str]:
    """Texts of the three channels, up to three components each, of the given sizes."""

    def part(size: float, signed: bool) -> str:
        width = draw(st.sampled_from([0.02, 0.1, 0.3, 1.0]))
        a = draw(st.floats(0, 1 - width))
        count = draw(st.integers(2, 6))
        unit = st.floats(-1 if signed else 0, 1)
        y = size * np.array(draw(st.lists(unit, min_size=count, max_size=count)))
        return component((a, a + width), np.linspace(0, 1, count), y)

    sizes = {"conservative": force, "friction": friction, "damping": damping}
    return {
        name: "; ".join(part(size, name == "conservative") for _ in range(draw(st.integers(0, 3))))
        for name, size in sizes.items()
    }


def powers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda power: 10.0**power)


@st.composite
def cases(draw):
    """A joint and its profile: h^2 F / (inertia range) and h C / inertia from 1e-4 to 1e4."""
    inertia, h, span = draw(powers(-7, 1)), draw(st.floats(1e-3, 1e-2)), draw(powers(-2, 1))
    force = draw(powers(-4, 4)) * inertia * span / h**2
    friction = force * draw(powers(-2, 1))
    damping = draw(powers(-4, 4)) * inertia / h
    return dict(
        **draw(channels(force, friction, damping)),
        inertia=inertia,
        h=h,
        limits=(0.0, span),
        kind=draw(st.sampled_from(["hinge", "slide"])),
        solver=draw(st.sampled_from(SOLVERS)),
        integrator=draw(st.sampled_from(INTEGRATORS)),
        equality=draw(st.booleans()),
        option="",
    ), draw(st.integers(0, 2**32 - 1))


@pytest.mark.long
@settings(
    max_examples=60,
    deadline=None,
    print_blob=True,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
@given(cases())
def test_any_profile_under_random_pushes(case):
    options, seed = case
    model, data = load(**options)
    random = np.random.default_rng(seed)
    h, inertia, (_, span) = options["h"], options["inertia"], options["limits"]
    push = 0.05 * inertia * span / h**2  # moves the joint by a twentieth of its range in a step
    work, turnover = 0.0, 0.0
    for k in range(round(SECONDS / h)):
        if k % 50 == 0:
            data.qfrc_applied[0] = random.normal() * push * random.choice([0, 0.1, 1])
        mujoco.mj_step(model, data)
        if options["integrator"] == "Euler":
            rows = data.efc_type[: data.nefc] != mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT
            step = h * float(data.efc_force[: data.nefc][rows].sum() * data.qvel[0])
            work, turnover = work + step, turnover + abs(step)
            assert work <= 1e-6 * turnover + 1e-12 * inertia * (span / h) ** 2
    assert np.isfinite([data.qpos[0], data.qvel[0], data.qacc[0]]).all()
    assert warnings(data) == 0
