"""An arm improved from two thirds of its logs, by name, and compared on the others.

Whole runs, all joints at once, open loop from the first measured positions: the median error of
each joint as the model is, after a plain fit (`plain_fit`) and after `joda improve --joint all`.

python tests/benchmarks arm arm.xml LOGS/*.csv -o improved.xml
"""

import argparse
from pathlib import Path
from time import perf_counter

import numpy as np
from plain_fit import Arm, fitted

from joda import improve_all
from joda.measured.scene_replay import Course, course_of, replayed_together
from joda.pictures.style import COLOURS, house_style, write_png
from joda.scenes.model import load_model

SHOWN = 12.0
"""How much of a log is drawn, s."""


def medians(model: Path, logs: list[Path]) -> dict[str, float]:
    """Of each joint, rad or m."""
    runs = replayed_together(load_model(model), logs)
    return {name: float(np.median([run.rmse[name] for run in runs])) for name in runs[0].rmse}


def picture(before: Course, after: Course, output: Path) -> None:
    """Each joint in a log that was held out: measured, and replayed by both models."""
    from matplotlib.figure import Figure

    shown = before.time < SHOWN
    with house_style():
        figure = Figure(figsize=(11, 6), layout="constrained")
        for axes, name in zip(figure.subplots(2, 3).flat, before.measured, strict=False):
            for own, label, colour, style in (
                (before.replayed[name], "model as it was", COLOURS["friction"], "--"),
                (after.replayed[name], "improved", COLOURS["conservative"], "-"),
                (before.measured[name], "measured", "black", ":"),
            ):
                axes.plot(before.time[shown], own[shown], style, color=colour, label=label, lw=1.2)
            axes.set(title=name, xlabel="time (s)", ylabel="position (rad)")
        handles = figure.axes[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=3, frameon=False)
        write_png(figure, output, force=True)


def write_picture(model: Path, improved: Path, held: list[Path], output: Path) -> None:
    """Of the log in which the joint that moves least moves most."""
    models = [load_model(one) for one in (model, improved)]
    courses = [course_of(models[1], log) for log in held]
    moves = [
        min(float(np.std(q[one.time < SHOWN])) for q in one.measured.values()) for one in courses
    ]
    best = int(np.argmax(moves))
    picture(course_of(models[0], held[best]), courses[best], output)


def main() -> None:
    """Improves, fits plainly, and tells."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("model", type=Path)
    parser.add_argument("logs", type=Path, nargs="+")
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--picture", type=Path, help="PNG to write of a log held out")
    parser.add_argument(
        "--plain", type=int, default=14, help="iterations of the plain fit; 0: none"
    )
    args = parser.parse_args()
    logs = sorted(args.logs)
    held = logs[2::3]
    train = [log for log in logs if log not in held]
    begin = perf_counter()
    done = improve_all(args.model, train, args.output, force=True, progress=print)
    seconds = perf_counter() - begin
    before, after = medians(args.model, held), medians(args.output, held)
    if args.picture:
        write_picture(args.model, args.output, held, args.picture)
    plain = dict.fromkeys(before, float("nan"))
    if args.plain:
        arm = Arm(args.model, logs)
        own = [arm.logs[logs.index(log)] for log in train]
        x = fitted(arm, own, args.plain)
        errors = arm.rmse(x, [arm.logs[logs.index(log)] for log in held])
        plain = dict(zip(arm.joints, np.median(errors, axis=0), strict=True))
    print(
        f"\n{len(train)} logs fitted in {seconds:.0f} s, {len(held)} held out; mrad or mm, medians"
    )
    print(
        "| joint | as it is | plain fit | improved | of the plain fit's | what was done |\n|"
        + "---|" * 6
    )
    for name, one in before.items():
        what = "; ".join(
            step.effect or ", ".join(own.parameter for own in step.corrections)
            for step in done[name].steps[1:]
        )
        part = after[name] / plain[name]
        told = " | ".join(f"{1e3 * x:.1f}" for x in (one, plain[name], after[name]))
        print(f"| {name} | {told} | {part:.2f} | {what} |")
