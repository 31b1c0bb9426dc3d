"""The force that opens real cabinet doors, measured, against what is proposed from a description.

    python tests/benchmarks real_doors                  the tables of docs/real_doors.md
    python tests/benchmarks real_doors -o doors.png     and their picture

Measured by a robot that hooked the handle and pulled slowly (Jain and Kemp, Autonomous Robots 35,
2013). The data are not part of this repository; they are looked for in ../shared/data.
"""

import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
from assets import SHARED

from joda import compare, generate, refine
from joda.measured.quasi_static import static_force
from joda.measured.reading import read_measured
from joda.measured.run_files import read_run

DATA = SHARED / "data" / "pr2_cabinet_doors"
GRID = np.arange(61.0)
"""Where forces are compared, degrees."""
CELL = 0.5
"""Samples so near a degree are averaged, degrees."""
KEYS = ("", *map(str, range(10)))
FINER = 1

SCENE = """
<mujoco model="kitchen">
  <compiler angle="degree"/>
  <worldbody>
    <body name="cabinet">
      <geom type="box" size=".2 .2 .3" pos="-.2 .2 0"/>
      <body name="cabinet_door">
        <joint name="door" axis="0 0 1" range="0 97"/>
        <geom type="box" size="{half} .01 .3" pos="{half} 0 0" mass="2"/>
      </body>
    </body>
  </worldbody>
  <contact><exclude body1="cabinet" body2="cabinet_door"/></contact>
</mujoco>
"""


@dataclass(frozen=True)
class Door:
    """A door that was measured.

    Attributes:
        runs: names of its measurements.
        width: from the hinge to the handle, m.
        described: what somebody says of it who has opened such doors.
    """

    runs: tuple[str, ...]
    width: float
    described: str


DOORS = {
    "IKEA cabinet": Door(
        ("ikea_cabinet_log", "ikea_cabinet_2"),
        0.30,
        "A cabinet door on self-closing hinges: it closes by itself from about 35 degrees on.",
    ),
    "lab cabinet": Door(
        ("lab_cabinet_log",),
        0.38,
        "A cabinet door with a catch that keeps it shut; past the catch it moves on with hardly "
        "any resistance.",
    ),
}


# --- what was measured
@cache
def measured(name: str) -> np.ndarray:
    """A run's moment on the door over GRID, N·m."""
    run = read_run(DATA / f"{name}.csv")
    angle = np.degrees(run.position)
    near = [np.abs(angle - degree) <= CELL for degree in GRID]
    order = np.argsort(angle, kind="stable")
    between = np.interp(GRID, angle[order], run.force[order])
    pairs = zip(near, between, strict=True)
    return np.array([run.force[here].mean() if here.any() else other for here, other in pairs])


def normalised(force: np.ndarray) -> np.ndarray:
    """In units of its own largest value."""
    return force / force.max()


def door_curve(door: Door) -> np.ndarray:
    """The mean of a door's runs, normalised."""
    return normalised(np.mean([measured(name) for name in door.runs], axis=0))


def rms(misfit: np.ndarray) -> float:
    return float(np.sqrt(np.mean(misfit**2)))


# --- what stands beside it
def spring(curve: np.ndarray) -> np.ndarray:
    """The best return spring: stiffness not negative, its rest anywhere at or before closed.

    A line that nowhere falls and nowhere pushes open.
    """
    from scipy.optimize import nnls

    lines = np.stack([np.ones_like(GRID), GRID], axis=1)
    return lines @ nnls(lines, curve)[0]


def line(curve: np.ndarray) -> np.ndarray:
    """The best straight line of any slope."""
    return np.polyval(np.polyfit(GRID, curve, 1), GRID)


def modelled(scene: Path, curve: Path) -> np.ndarray:
    """The force that slowly opens a scene's door, normalised, as `joda compare` has it."""
    joint = read_measured(scene, "door", [curve])
    return normalised(static_force(joint.profile, joint.context, np.radians(GRID), 1.0))


# --- the commands
class Bench:
    """A folder in which doors are made, generated and refined."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def curve(self, name: str) -> Path:
        """A run as a quasi-static curve up to 60 degrees, as if measured with a force gauge."""
        path = self.folder / f"{name}.csv"
        run = read_run(DATA / path.name)
        rows = zip(run.position, run.force, strict=True)
        kept = [f"{q:.8g},{f:.8g}" for q, f in rows if q <= np.radians(GRID[-1] + CELL)]
        path.write_text("\n".join(["position,force", *kept]) + "\n")
        return path

    def generated(self, door: Door, key: str = "", described: str = "") -> Path:
        """The scene with what the rules propose from the description; never shown the data."""
        model = self.folder / "door.xml"
        model.write_text(SCENE.format(half=door.width / 2))
        made = generate(
            model, "door", self.folder / "made", proposer="offline", key=key, force=True,
            describe=described or door.described,
        )  # fmt: skip
        assert not made.history.rounds[-1].unmet
        return made.folder / "scene.xml"

    def refined(self, scene: Path, *names: str) -> Path:
        """A scene refined to runs."""
        target = self.folder / f"refined_{'_'.join(names)}.xml"
        curves = [self.curve(name) for name in names]
        refine(scene, "door", curves, target, finer=FINER, force=True)
        return target

    def newton_metres(self, scene: Path, door: Door) -> float:
        """RMS error of the moment itself over a door's runs, as `joda compare` prints it, N·m."""
        found = compare(scene, "door", [self.curve(name) for name in door.runs])
        return rms(np.array([curve.rmse_force for curve in found.curves]))


def main() -> None:
    bench = Bench(Path(mkdtemp()))
    print("normalised RMS error, 0 to 60 degrees; in brackets the span over eleven keys")
    print(f"{'':14}{'return spring':>15}{'any line':>10}{'generated':>24}{'refined':>9}"
          f"{'N·m: generated':>16}{'refined':>9}")  # fmt: skip
    shown = {}
    for name, door in DOORS.items():
        curve, file = door_curve(door), bench.curve(door.runs[0])
        errors = [rms(modelled(bench.generated(door, key), file) - curve) for key in KEYS]
        scene = bench.generated(door)
        refined = bench.refined(scene, *door.runs)
        ours, bent = modelled(scene, file), modelled(refined, file)
        shown[name] = (door, ours, bent)
        span = f"{errors[0]:.3f} ({min(errors):.3f} to {max(errors):.3f})"
        print(
            f"{name:14}{rms(spring(curve) - curve):15.3f}{rms(line(curve) - curve):10.3f}{span:>24}"
            f"{rms(bent - curve):9.3f}{bench.newton_metres(scene, door):16.2f}"
            f"{bench.newton_metres(refined, door):9.2f}"
        )
    ikea(bench)
    if "-o" in sys.argv:
        draw(shown, Path(sys.argv[sys.argv.index("-o") + 1]))


def ikea(bench: Bench) -> None:
    """What two runs on one door add."""
    door = DOORS["IKEA cabinet"]
    file, (one, other) = bench.curve(door.runs[0]), door.runs
    first, second = (normalised(measured(name)) for name in door.runs)
    apart = rms(first - second)
    print(f"\nIKEA: its two runs are {apart:.3f} apart, so no profile is nearer than "
          f"{apart / 2:.3f} to both")  # fmt: skip
    shifts = np.arange(0, 5.01, 0.1)
    moved = [rms((np.interp(GRID + by, GRID, first) - second)[:55]) for by in shifts]
    print(f"with the first one's zero {shifts[np.argmin(moved)]:.1f} degrees later: "
          f"{min(moved):.3f} apart")  # fmt: skip
    for fitted, judged in ((one, other), (other, one)):
        scene = bench.refined(bench.generated(door), fitted)
        found = modelled(scene, file)
        errors = [rms(found - normalised(measured(name))) for name in (fitted, judged)]
        print(f"refined to {fitted}: {errors[0]:.3f} there, {errors[1]:.3f} on {judged}")
    for degrees in (30, 40):
        said = door.described.replace("35", str(degrees))
        error = rms(modelled(bench.generated(door, described=said), file) - door_curve(door))
        print(f"described as closing from {degrees} degrees on: {error:.3f}")


def draw(shown: dict, path: Path) -> None:
    """Measured, spring, generated and refined force over the angle, a panel per door."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4), dpi=110, layout="constrained")
    panels = figure.subplots(1, len(shown), sharey=True)
    for axes, (name, (door, ours, bent)) in zip(panels, shown.items(), strict=True):
        for run in door.runs:
            axes.plot(GRID, normalised(measured(run)), ".", color="#999999", ms=4, label="a run")
        curve = door_curve(door)
        axes.plot(GRID, curve, color="black", lw=1.4, label="measured")
        axes.plot(GRID, spring(curve), ":", color="#777777", label="best return spring")
        axes.plot(GRID, ours, color="#d1495b", lw=2, label="generated from a description")
        axes.plot(GRID, bent, "--", color="#2e6f95", lw=1.8, label="refined")
        axes.set_title(name, loc="left", fontsize=10)
        axes.set_xlabel("angle from closed (degrees)")
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("opening force, normalised")
    handles, labels = panels[0].get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    panels[-1].legend(named.values(), named, frameon=False, fontsize=8)
    figure.savefig(path)
