"""refine to quasi-static curves: a known profile is found again, and limits are told."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scenes import attached, write

from joda import JodaError, context, read_profiles, refine
from joda.component import Component
from joda.field import evaluate
from joda.measured.quasi_static import static_force
from joda.profile import Channel, Channels, Joint, Profile, Resistance

NOISE = 0.01
GRID = np.linspace(0.02, 0.98, 97)
JOINT = Joint(name="door", type="hinge", range=(0.0, 1.5), unit="rad")
X = (0.0, 0.25, 0.5, 1.0)


def door(pull=2.0, friction=0.4, wide=0.5) -> Profile:
    """A pull that fades, friction that falls."""
    shut = Component(
        label="pull", interval=(0, wide), x=X, y=(-pull, -0.7 * pull, -0.3 * pull, 0.0)
    )
    rub = Component(label="rub", interval=(0, 1), x=(0, 1), y=(friction, 0.5 * friction))
    return Profile(
        joint=JOINT,
        channels=Channels(
            conservative=Channel(components=(shut,)), friction=Resistance(components=(rub,))
        ),
    )


def gauge(folder: Path, name: str, truth: Profile, ways=(1, -1), dwell=1, seed=0) -> Path:
    """What a force gauge would read: opened (1) and closed (-1), with noise.

    Args:
        folder, name: of the file.
        truth: what acts on the joint.
        ways: directions of travel.
        dwell: samples per place in the first fifth of the way.
        seed: of the noise.
    """
    rng, rows = np.random.default_rng(seed), ["position,force"]
    found = context(folder / "in.xml", "door")
    for way in ways:
        place = np.linspace(0.02, 0.98, 121)
        place = np.sort(np.concatenate([place, *[place[:25] + 1e-6 * k for k in range(1, dwell)]]))
        position = 1.5 * place[::way]
        force = static_force(truth, found, position, float(way)) + rng.normal(0, NOISE, len(place))
        rows += [f"{q:.9g},{f:.6g}" for q, f in zip(position, force, strict=True)]
    return write(folder, "\n".join(rows) + "\n", name)


def test_a_profile_is_found_again_from_both_directions(tmp_path):
    attached(tmp_path, profiles=door(pull=1.2, friction=0.7, wide=0.45))
    curves = [gauge(tmp_path, f"{k}.csv", door(), seed=k) for k in range(3)]
    done = refine(tmp_path / "out.xml", "door", curves[:2], tmp_path / "b.xml", check=curves[2:])
    assert done.before > 0.2 > 2 * NOISE > done.after
    assert done.checked[1] < 1.3 * NOISE
    assert done.windows is None and done.noise == pytest.approx(NOISE, rel=0.3)
    (found,) = [read_profiles(done.scene)["door"]]
    for name in ("conservative", "friction"):
        ours, true = (evaluate(getattr(p.channels, name), GRID)[0] for p in (found, door()))
        assert np.abs(ours - true).max() < 0.05
    assert done.unseen == {"conservative": (), "friction": ()}


def test_of_one_direction_the_sum_is_found_and_said_to_be_a_sum(tmp_path):
    attached(tmp_path, profiles=door(pull=1.2, friction=0.7))
    curve = gauge(tmp_path, "c.csv", door(), ways=(1,))
    done = refine(tmp_path / "out.xml", "door", [curve], tmp_path / "b.xml")
    assert done.after < 1.3 * NOISE
    assert any("cannot be told apart; measure the way back too" in note for note in done.notes)


def test_where_the_hand_rests_counts_no_more(tmp_path):
    """A straight line can only follow a part of what it is fitted to."""
    attached(tmp_path, profiles=Profile(joint=JOINT, channels=Channels(friction=flat(0.5))))
    found = []
    for dwell in (1, 20):
        curve = gauge(tmp_path, f"{dwell}.csv", door(), ways=(1,), dwell=dwell)
        target = tmp_path / f"b{dwell}.xml"
        refine(tmp_path / "out.xml", "door", [curve], target)
        profile = read_profiles(target)["door"]
        found.append(evaluate(profile.channels.friction, GRID)[0])
    assert np.abs(found[0] - found[1]).max() < 0.05 * np.abs(found[0]).max()


def flat(value: float) -> Resistance:
    return Resistance(components=(Component(interval=(0, 1), x=(0, 1), y=(value, value)),))


def test_finer_curves_follow_what_coarse_ones_cannot(tmp_path):
    attached(tmp_path, profiles=Profile(joint=JOINT, channels=Channels(friction=flat(0.5))))
    curve = gauge(tmp_path, "c.csv", door(), ways=(1,))
    errors = [
        refine(
            tmp_path / "out.xml", "door", [curve], tmp_path / "b.xml", finer=finer,
            keep_shape=False, force=True,
        ).after
        for finer in (0, 2)
    ]  # fmt: skip
    assert errors[1] < 0.3 * errors[0]
    (component,) = read_profiles(tmp_path / "b.xml")["door"].channels.friction.components
    assert component.x == (0, 0.25, 0.5, 0.75, 1)


@pytest.mark.parametrize(
    ("runs", "fit", "said"),
    [
        (("c.csv", "run.csv"), ("values",), "c.csv: a quasi-static curve among timed runs"),
        (("c.csv",), ("values", "inertia"), "'inertia' is not in quasi-static curves"),
    ],
)
def test_what_curves_cannot_be_used_for(tmp_path, runs, fit, said):
    attached(tmp_path, profiles=door())
    gauge(tmp_path, "c.csv", door())
    write(tmp_path, "time,position\n" + "".join(f"{k},{k / 99}\n" for k in range(60)), "run.csv")
    with pytest.raises(JodaError, match=said):
        refine(
            tmp_path / "out.xml", "door", [tmp_path / r for r in runs], tmp_path / "b.xml", fit=fit
        )
    assert not (tmp_path / "b.xml").exists()


@pytest.mark.slow
def test_the_command_needs_no_jax_and_speaks_of_force(tmp_path):
    attached(tmp_path, profiles=door(pull=1.2))
    gauge(tmp_path, "c.csv", door())
    command = ["joda", "refine", "out.xml", "c.csv", "--joint", "door", "-o", "b.xml"]
    code = f"import sys\nsys.modules['jax'] = None\nsys.argv = {[*command, '--finer', '1']!r}\n"
    code += "from joda.cli import main\nmain()"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "Force error: " in done.stdout and "N·m RMS after" in done.stdout
    assert "windows" not in done.stdout
    for name in ("b.xml", "b.composed.json", "b.png", "b.history.json"):
        assert (tmp_path / name).is_file()
