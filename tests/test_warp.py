"""joda.warp acts as the plugin does, in every world with numbers of its own.

All in one file and with one shape of scene: mujoco_warp compiles its kernels for it once.
"""

import re
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

wp = pytest.importorskip("warp")
mujoco_warp = pytest.importorskip("mujoco_warp")

import warp_parity  # noqa: E402
from warp_parity import CLOSE, CONFIGURATIONS, RANGES, SPANS, by_plugin, by_warp, prepared  # noqa: E402

import joda.warp  # noqa: E402
from joda.component import Component  # noqa: E402
from joda.effects import EndStopRestitution, LoadDependentFriction, PreslidingFriction  # noqa: E402
from joda.profile import Channel, Channels, Joint, Profile, Resistance  # noqa: E402
from joda.warp.bench import bench  # noqa: E402
from joda.warp.numbers import Number  # noqa: E402

WHOLE = (0.0, 1.0)


def flat(name, friction=0.0, damping=0.0, force=0.0, effects=()) -> Profile:
    """A profile whose channels are the same everywhere."""

    def channel(cls, y):
        return cls(components=(Component(interval=WHOLE, x=WHOLE, y=(y, y)),) if y else ())

    kind, unit = warp_parity.KINDS[name]
    return Profile(
        joint=Joint(name=name, type=kind, range=RANGES[name], unit=unit),
        channels=Channels(
            conservative=channel(Channel, force),
            friction=channel(Resistance, friction),
            damping=channel(Resistance, damping),
        ),
        effects=effects,
    )


def both(**own) -> dict[str, Profile]:
    return {name: flat(name, **own) for name in RANGES}


STEEL = {"arm": flat("arm", friction=0.2, damping=0.05), "drawer": flat("drawer", 2.0, 3.0)}


@pytest.mark.slow
@pytest.mark.parametrize(("integrator", "cone"), CONFIGURATIONS, ids="{}".format)
def test_random_profiles_move_as_with_the_plugin(integrator, cone):
    """Of 300 at least 95 % are that close (docs/warp.md); of these 60, drawn anew, at least 85 %:
    fewer come once in some ten thousand times if 97 % are."""
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    error, _ = warp_parity.errors(warp_parity.draw(30, seed), integrator=integrator, cone=cone)
    assert (error < CLOSE).mean() > 0.85 and np.median(error) < 1e-5, f"seed {seed}: {error}"


@pytest.mark.slow
def test_each_effect_alone_moves_as_with_the_plugin():
    """Each makes a difference, and the same one."""
    rng = np.random.default_rng(0)
    drawn = [e for v in warp_parity.draw(60, 5) for e in v["arm"].effects]
    kinds = {f"{e.effect} {getattr(e, 'side', '')}": e for e in drawn}
    assert len(kinds) == len(warp_parity.NAMES) + 1  # backlash has two sides
    arm = warp_parity.random_profile("arm", rng).model_copy(update={"effects": ()})
    variants = [{**STEEL, "arm": arm.with_effect(effect)} for effect in kinds.values()]
    plain = {**STEEL, "arm": arm}
    # added inertia is in the scene, which has it for all; a stop acts only where it is reached
    pushes = warp_parity.forces() * [2.0, 1.0]
    expected = by_plugin([*variants, plain], pushes)[:, :, 0] / SPANS[0]
    m, d, _ = prepared(variants)
    actual = by_warp(m, d, pushes)[:, :, 0] / SPANS[0]
    error = np.abs(actual - expected[:, :-1])[-1]
    change = np.abs(expected[:, :-1] - expected[:, -1:]).max(0)
    for name, wrong, large in zip(kinds, error, change, strict=True):
        assert wrong < CLOSE, f"{name}: {wrong}"
        assert large > 10 * CLOSE or name.startswith("added_inertia"), f"{name}: {large}"


@pytest.mark.slow
def test_soft_bristles_move_as_with_the_plugin():
    """To and fro beyond their break-away, however soft, all the way."""
    variants = [
        {
            name: flat(
                name,
                friction=friction,
                effects=(PreslidingFriction(stiffness=k * friction, breakaway=breakaway),),
            )
            for name, friction in (("arm", 0.2), ("drawer", 2.0))
        }
        for breakaway in (0.0, 0.6, 1.0)
        for k in (100, 500, 2500)
    ]
    pushes = warp_parity.forces() * [0.7, 0.35]
    expected = by_plugin(variants, pushes, gravity="0 0 0") / SPANS
    m, d, _ = prepared(variants, gravity="0 0 0")
    assert np.abs(by_warp(m, d, pushes) / SPANS - expected).max() < CLOSE
    assert (np.ptp(expected, axis=0) > 0.05).all()


@pytest.mark.slow
def test_motors_and_contacts_load_a_joint_as_with_the_plugin():
    """The arm hits the floor and its stop, the drawer the ball."""
    variants = [
        both(effects=(LoadDependentFriction(coefficient=mu),), damping=0.05) for mu in (0.1, 0.3, 0)
    ]
    pushes = warp_parity.forces() * [3.0, 1.0]
    expected = by_plugin(variants, pushes, motors=True) / SPANS
    m, d, _ = prepared(variants)
    actual = by_warp(m, d, pushes, motors=True) / SPANS
    assert (np.abs(actual - expected)[-1] < CLOSE).all()
    assert (np.abs(expected - expected[:, 2:])[-1, :2] > 100 * CLOSE).all()
    assert (expected[:, :2, 0].min(0) < RANGES["arm"][0] / SPANS[0]).all()


@pytest.mark.slow
def test_a_held_joint_does_not_creep():
    """At 80 % of its friction, for 2 s; MuJoCo's own friction row would creep."""
    m, d, _ = prepared([STEEL], option='><flag gravity="disable"/></option><option')
    pushes = np.tile([0.8 * 0.2, 0.8 * 2.0], (1000, 1))
    moved = by_warp(m, d, pushes)
    assert np.abs(moved[-1] - moved[200]).max() < 1e-7
    assert np.abs(moved[-1] - warp_parity.start()).max() < 1e-5


def test_each_world_has_its_own_strengths():
    """As the plugin moves with profiles that have these numbers."""
    factors = np.array([0.0, 0.5, 1.0, 3.0])
    m, d, fields = prepared([STEEL], nworld=4)
    fields.numbers["friction.strength"].assign(np.tile(factors[:, None], (1, 2)))
    fields.numbers["damping.strength"].assign(np.tile(factors[::-1, None], (1, 2)))
    pushes = warp_parity.forces(0.3)
    variants = [
        {"arm": flat("arm", 0.2 * f, 0.05 * c), "drawer": flat("drawer", 2.0 * f, 3.0 * c)}
        for f, c in zip(factors, factors[::-1], strict=True)
    ]
    expected = by_plugin(variants, pushes)
    actual = by_warp(m, d, pushes)
    assert (np.abs(actual - expected)[-1] < CLOSE * SPANS).all()
    assert (np.ptp(expected[-1], axis=0) > 20 * CLOSE * SPANS).all()  # the worlds do differ


def test_each_world_has_its_own_restitutions():
    """As the plugin throws back with profiles that have them; below 0 a stop is the scene's."""
    ends = (0.0, 0.2, 0.5, 0.85)
    m, d, fields = prepared([STEEL], nworld=5)
    for end in ("low", "high"):
        fields.numbers[f"end_stop_restitution.{end}"].assign(
            np.tile([[-1], *([e] for e in ends)], 2)
        )
    pushes = warp_parity.forces(0.6) * [8.0, 3.0]
    variants = [STEEL] + [
        {name: profile.model_copy(update={"effects": bouncy(e)}) for name, profile in STEEL.items()}
        for e in ends
    ]
    expected = by_plugin(variants, pushes)
    actual = by_warp(m, d, pushes)
    assert (np.abs(actual - expected)[-1] < CLOSE * SPANS).all()
    assert (np.ptp(expected[-1], axis=0) > 20 * CLOSE * SPANS).all()


def bouncy(restitution):
    return tuple(EndStopRestitution(restitution=restitution, end=end) for end in ("low", "high"))


def test_an_effect_needs_no_curve():
    """A profile without channels acts as with the plugin."""
    variants = [
        {name: flat(name, effects=(effect,)) for name in RANGES}
        for effect in (
            PreslidingFriction(stiffness=30.0),
            LoadDependentFriction(coefficient=0.1),
            *bouncy(0.6),
        )
    ]
    pushes = 2 * warp_parity.forces(0.6)
    expected = by_plugin(variants, pushes)
    m, d, _ = prepared(variants)
    assert (np.abs(by_warp(m, d, pushes) - expected)[-1] < CLOSE * SPANS).all()


def test_the_docs_list_every_number():
    page = (Path(__file__).parents[1] / "docs" / "warp.md").read_text()
    assert [one.title for one in Number if f"`{one.title}`" not in page] == []


def put_back(d, qpos) -> None:
    """All worlds where they were, at rest."""
    d.qpos.assign(qpos)
    d.qvel.zero_()
    d.qacc_warmstart.zero_()


def test_a_reset_world_begins_anew_and_no_other_does():
    """By the mask where time goes on, and by itself where it goes back."""
    pushes = warp_parity.forces(0.2)
    m, d, fields = prepared(warp_parity.draw(3, 11))
    start = d.qpos.numpy().copy()
    first = by_warp(m, d, pushes)
    put_back(d, start)
    fields.reset()
    assert np.array_equal(by_warp(m, d, pushes), first)
    put_back(d, start)
    d.time.zero_()
    assert np.array_equal(by_warp(m, d, pushes), first)
    put_back(d, start)
    fields.reset([True, False, False])
    third = by_warp(m, d, pushes)
    assert np.array_equal(third[:, 0], first[:, 0])
    assert not np.array_equal(third[:, 1], first[:, 1])
    assert not np.array_equal(third[:, 2], first[:, 2])


def test_forward_advances_nothing():
    variants = warp_parity.draw(2, 12)
    pushes = warp_parity.forces(0.2)
    m, d, _ = prepared(variants)
    expected = by_warp(m, d, pushes)
    m, d, _ = prepared(variants)
    before = m.callback.passive
    calls = []

    def twice(m, d):
        before(m, d)
        calls.append(m)

    m.callback.passive = twice
    applied = np.zeros((d.nworld, m.nv), np.float32)
    for i, push in enumerate(pushes):
        applied[:, :2] = push
        d.qfrc_applied.assign(applied)
        warmstart = d.qacc_warmstart.numpy().copy()
        mujoco_warp.forward(m, d)
        d.qacc_warmstart.assign(warmstart)
        mujoco_warp.step(m, d)
        assert np.abs(d.qpos.numpy()[:, :2] - expected[i]).max() < 1e-6
    assert len(calls) == 2 * len(pushes)


def test_one_kernel_more_in_a_step(monkeypatch):
    m, d, _ = prepared([STEEL], nworld=2)
    mujoco_warp.step(m, d)
    counted = []
    for name in ("launch", "launch_tiled"):
        real = getattr(wp, name)
        monkeypatch.setattr(
            wp, name, lambda *args, _real=real, **named: (counted.append(1), _real(*args, **named))
        )
    mujoco_warp.step(m, d)
    ours = len(counted)
    m.callback.passive = None
    mujoco_warp.step(m, d)
    assert ours > 10 and ours - (len(counted) - ours) == 1


def test_a_captured_step_is_the_same_step():
    pushes = warp_parity.forces(0.1)
    m, d, fields = prepared([STEEL], nworld=2)
    start = d.qpos.numpy().copy()
    expected = by_warp(m, d, pushes)
    with wp.ScopedCapture() as capture:
        mujoco_warp.step(m, d)
    put_back(d, start)
    fields.reset()
    applied = np.zeros((d.nworld, m.nv), np.float32)
    for push, there in zip(pushes, expected, strict=True):
        applied[:, :2] = push
        d.qfrc_applied.assign(applied)
        wp.capture_launch(capture.graph)
        assert np.array_equal(d.qpos.numpy()[:, :2], there)


def test_a_callback_that_was_there_is_called_too():
    m, d, fields = prepared([STEEL], nworld=2)
    called = []
    m.callback.passive = lambda m, d: called.append(d)
    joda.warp.attach(m, d, fields)
    joda.warp.attach(m, d, fields)  # takes the place of the first, is not behind it
    mujoco_warp.step(m, d)
    assert called == [d]


older = pytest.mark.skipif(
    not metadata.version("mujoco-warp").startswith(("3.17", "4.")), reason="MuJoCo Warp is older"
)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"integrator": "RK4"}, "integrators Euler, implicit and implicitfast, not RK4"),
        pytest.param({"integrator": "discrete"}, "not DISCRETE", marks=older),
        pytest.param(
            {"option": 'noslip_iterations="2"'}, "option/noslip_iterations to 0", marks=older
        ),
        ({"option": '><flag sleep="enable"/></option><option'}, "flag sleep off"),
    ],
)
def test_what_would_not_act_is_refused(options, said):
    with pytest.raises(joda.JodaError, match=said):
        prepared([STEEL], **options)


def test_what_does_not_fit_is_refused():
    m, d, _ = prepared([STEEL], nworld=2)
    model = mujoco.MjModel.from_xml_string(warp_parity.scene(STEEL))
    with pytest.raises(joda.JodaError, match="2 worlds and the fields 3"):
        joda.warp.attach(m, d, joda.warp.put_fields(model, STEEL, 3))
    other = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><joint name='arm' frictionloss='1'/><geom size='1'/></body>"
        "</worldbody></mujoco>"
    )
    fields = joda.warp.put_fields(other, {"arm": STEEL["arm"]}, 2)
    with pytest.raises(joda.JodaError, match="another model"):
        joda.warp.attach(m, d, fields)
    with pytest.raises(joda.JodaError, match="same joints in the same order"):
        joda.warp.put_fields(model, [STEEL, {"arm": STEEL["arm"]}], 2)
    for mask, is_it in (
        ([True] * 3, "mask is of bool and has the shape (3,); give booleans of the shape (2,)"),
        ([0, 1], "mask is of int64 and has the shape (2,); give booleans"),
        (wp.array([1, 0], dtype=int), "mask is of int32 and has the shape (2,); give booleans"),
    ):
        with pytest.raises(joda.JodaError, match=re.escape(is_it)):
            fields.reset(mask)
    elsewhere = SimpleNamespace(nworld=2, qpos=SimpleNamespace(device="cuda:0"))
    fields = joda.warp.put_fields(model, STEEL, 2, device="cpu")
    with pytest.raises(joda.JodaError, match="the data are on cuda:0 and the fields on cpu"):
        joda.warp.attach(m, elsewhere, fields)
    for nworld in (0, 2.5):
        with pytest.raises(joda.JodaError, match=f"nworld is {nworld}; give a whole number, at le"):
            joda.warp.put_fields(model, STEEL, nworld)
    for nothing in ({}, []):
        with pytest.raises(joda.JodaError, match="there is no profile; give that of at least one"):
            joda.warp.put_fields(model, nothing, 4)
    with pytest.raises(joda.JodaError, match="'arm' is a hinge and its profile that of a slide; "):
        joda.warp.put_fields(model, {"arm": STEEL["drawer"]}, 4)
    other.dof_frictionloss[:] = 0
    with pytest.raises(joda.JodaError, match="no friction row"):
        joda.warp.put_fields(other, {"arm": STEEL["arm"]}, 2)
    for effect, said in (
        (joda.effects.AddedInertia(inertia=1.0), "armature 0.002, less than"),
        (joda.effects.Backlash(play=0.01, inertia=0.1), "backlash with an inertia of 0.1"),
        (joda.effects.Backlash(play=0.01, inertia=0.1, side="motor"), "inertia of 0.1; at most"),
    ):
        with pytest.raises(joda.JodaError, match=said):
            joda.warp.put_fields(model, {"arm": STEEL["arm"].with_effect(effect)}, 1)


MINOR = ".".join(mujoco.__version__.split(".")[:2])
PINNED = f"run: pip install 'mujoco-warp=={MINOR}.*' 'mujoco=={mujoco.__version__}'."
"""What leaves MuJoCo where it is."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("import sys; sys.modules['mujoco_warp'] = None", f"no module mujoco_warp); {PINNED}"),
        (
            "import importlib.metadata as told; told.version = lambda name: '3.9.1'",
            "does not take mujoco-warp 3.9.1 beside mujoco 3.9.1; it goes with MuJoCo 3.11, 3.17 "
            "and 4.0, and here is 3.9.1; use another environment for it.",
        ),
        (
            "import importlib.metadata as told; own = told.version; "
            "told.version = lambda name: '3.11.0' if name == 'mujoco-warp' else own(name)",
            f"does not take mujoco-warp 3.11.0 beside mujoco {mujoco.__version__}; {PINNED}",
        ),
        (
            "import mujoco; del mujoco.mjtSolver",
            f"does not go with mujoco {mujoco.__version__} (module 'mujoco' has no attribute "
            f"'mjtSolver'); {PINNED}",
        ),
    ],
)
def test_without_a_fitting_mujoco_warp_one_sentence_says_what_to_install(change, said):
    code = f"{change}\nimport joda\ntry: joda.warp\nexcept joda.JodaError as error: print(error)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said in run.stdout


@pytest.mark.slow
@older  # forgets the plugin's instances behind a <replicate>
def test_the_example_of_the_docs(tmp_path):
    root = Path(__file__).parents[1]
    (code,) = re.findall(r"```python\n(.*?)```", (root / "docs/warp.md").read_text(), re.DOTALL)
    code = code.replace("WORLDS = 1000", "WORLDS = 16")
    code = code.replace('"models/knob.xml"', repr(str(root / "models/knob.xml")))
    code += "assert np.unique(d.qpos.numpy()).size == 16\n"
    run = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert run.stdout.endswith("(16, 1)\n")


@pytest.mark.parametrize(
    ("option", "worlds", "said"),
    [
        ('solver="PGS"', 1, "(worlds: 1): mjSOL_PGS is unsupported."),
        ('><flag override="enable"/></option><option', 1, "mjENBL_OVERRIDE is unsupported."),
        ("", 10**9, "MuJoCo Warp refuses the scene (worlds: 1000000000): "),
    ],
)
def test_the_bench_says_what_mujoco_warp_refuses(option, worlds, said, tmp_path):
    path = tmp_path / "scene.xml"
    path.write_text(warp_parity.scene(STEEL, option=option))
    with pytest.raises(joda.JodaError, match=re.escape(said)):
        bench(path, worlds=[worlds])


def test_the_bench_counts_steps_and_kernels():
    (row,) = bench(worlds=[2])
    assert min(row.per_second) > 0 and row.native_ratio > 0 < row.plain_ratio
    ours, native, plain = row.launches
    assert ours - native == 1 and native == plain
