"""Which runs are quasi-static curves, as they go one way only and slowly."""

import numpy as np
import pytest
from gauging import FRICTION, SCENE, SPAN

from joda import simulate
from joda.measured.reading import read_measured
from joda.measured.run_files import write_run
from joda.measured.runs import Run

HELD = 1.0
"""Force that the pushing hand has to overcome, N·m; the model has 0.2."""


def pushed(folder, name="run.csv", seconds=10.0, path=lambda u: u, forced=True, inertia=0.1):
    """A measured run in which a hand moves the joint along a path, normalised in time."""
    rng = np.random.default_rng(1)
    t = np.linspace(0, seconds, 1001)
    q = SPAN * (0.02 + 0.95 * path(t / seconds))
    force = HELD + inertia * np.gradient(np.gradient(q, t), t)
    run = Run(name, t, q + rng.normal(0, 1e-4, len(t)), None, force, forced)
    write_run(folder / name, run)
    return folder / name


def read(folder, *files, scene=SCENE):
    (folder / "model.xml").write_text(scene)
    return read_measured(folder / "model.xml", "door", files)


def test_a_slow_push_one_way_is_a_curve(tmp_path):
    measured = read(tmp_path, pushed(tmp_path))
    assert not measured.runs
    assert [one.curve.name for one in measured.curves] == ["run.csv"]
    assert measured.curves[0].direction.min() == 1
    assert measured.notes[0].startswith("run.csv: taken as a quasi-static curve, as it goes one")
    assert (measured.unit, measured.floor) == ("N·m", measured.curves[0].sigma)


def to_and_fro(u):
    return np.where(u < 0.5, 2 * u, 2 - 2 * u)


@pytest.mark.parametrize(
    "kind", [{"path": to_and_fro}, {"forced": False}, {"path": lambda u: 0.05 * u}]
)
def test_another_run_is_none(tmp_path, kind):
    measured = read(tmp_path, pushed(tmp_path, **kind))
    assert len(measured.runs) == 1
    assert not measured.curves


@pytest.mark.parametrize(("seconds", "samples"), [(0.02, 20), (0.15, 20), (0.9, 200)])
def test_nor_is_one_that_takes_a_moment(tmp_path, seconds, samples):
    rows = np.linspace([0, 0.1, 1], [seconds, 1.4, 1], samples)
    table = "\n".join(",".join(map(str, row)) for row in rows)
    (tmp_path / "run.csv").write_text(f"time,position,force\n{table}\n")
    assert len(read(tmp_path, tmp_path / "run.csv").runs) == 1


def test_inertia_may_not_take_much_of_the_force(tmp_path):
    swing = {"path": lambda u: (1 - np.cos(np.pi * u)) / 2}
    assert read(tmp_path, pushed(tmp_path, seconds=5.0, **swing)).curves
    assert read(tmp_path, pushed(tmp_path, seconds=0.8, **swing)).runs


def test_nor_may_the_models_damping(tmp_path):
    heavy = SCENE.replace('damping="0.1"', 'damping="2"')
    assert read(tmp_path, pushed(tmp_path), scene=heavy).runs  # 2 · 0.14 N·m of 1 N·m


def test_runs_of_several_speeds_stay_runs(tmp_path):
    files = [pushed(tmp_path, f"{k}.csv", seconds=10.0 * k) for k in (1, 2)]
    assert len(read(tmp_path, *files).runs) == 2


def test_a_slow_push_stands_beside_a_curve(tmp_path):
    back = tmp_path / "back.csv"
    q = np.linspace(0.95, 0.05, 60) * SPAN
    back.write_text("position,force\n" + "\n".join(f"{x},-1" for x in q) + "\n")
    measured = read(tmp_path, back, pushed(tmp_path))
    assert [one.curve.name for one in measured.curves] == ["back.csv", "run.csv"]


@pytest.mark.slow
def test_nor_a_run_that_the_model_follows(tmp_path):
    """A slow push against the friction that the model has: 1 N·m, damping 0.1 N·m·s/rad."""
    true = SCENE.replace(f'frictionloss="{FRICTION}"', f'frictionloss="{HELD}"')
    (tmp_path / "true.xml").write_text(true)
    done = simulate(tmp_path / "true.xml", "door", open=True, output=tmp_path / "run.csv")
    assert read(tmp_path, done.csv, scene=true).runs
    assert read(tmp_path, done.csv).curves
