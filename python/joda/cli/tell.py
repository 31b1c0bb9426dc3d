"""Results as text or JSON on stdout."""

import json
import os
import shlex
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Any

from joda.cli.say import say
from joda.errors import JodaError
from joda.plain import line, plain

if TYPE_CHECKING:
    from joda.cases.gallery import Shown
    from joda.commands.bench import Row
    from joda.commands.demo import Demo
    from joda.commands.doctor import Check
    from joda.commands.each_joint import Compared
    from joda.commands.estimate import Estimate
    from joda.commands.evaluate import Evaluation
    from joda.commands.generate import Generated
    from joda.commands.refine import Refined
    from joda.exporting.nearest import Nearest
    from joda.importing.understood import Understood
    from joda.propose import Usage
    from joda.propose.history import Round
    from joda.template import Template
    from joda.warp.bench import WarpRow


def print_json(value: Any) -> None:
    """The value as indented JSON."""
    say(*json.dumps(value, indent=2, ensure_ascii=False).split("\n"))


def with_text_paths(values: Mapping[str, Any]) -> dict[str, Any]:
    """The same for JSON, which has no paths."""
    return {key: str(v) if isinstance(v, Path) else v for key, v in values.items()}


def generated_as_json(result: "Generated") -> dict[str, Any]:
    """What `joda generate --json` prints of a joint."""
    told: dict[str, Any] = result.history.model_dump(mode="json")
    usage = result.history.usage.model_dump(mode="json")
    return {**told, "usage": usage, "notes": result.notes, "stopped": result.stopped}


def tell_changes(changes: Sequence[str]) -> None:
    """A line per change, or that there is none."""
    for change in changes or ("Nothing changed.",):
        say(change)


def tell_files(folder: Path, names: Iterable[str]) -> None:
    """The files of a folder that are worth naming."""
    say("Files:")
    for name in names:
        say(f"  {folder / name}")


def tell_viewer(scene: Path) -> None:
    """How to look at a scene."""
    command = shlex.join([_python(), "-m", "mujoco.viewer", f"--mjcf={scene}"])
    say(f"See it move: {command}")


def _python() -> str:
    """How one types this Python: "python" where that is the one, as within an environment."""
    found, own = shutil.which("python"), sys.executable
    if found and os.path.dirname(found) == os.path.dirname(own) and os.path.samefile(found, own):
        return "python"
    return own


def tell_round(round: "Round") -> None:
    """What was proposed in a round, and what came of it."""
    summary = round.proposal.joint_summary
    say(f"Round {round.number}, {round.proposer}: {summary.motion_description}")
    say(f"  {round.proposal.whole_motion_descrptn}")
    for effect in round.proposal.effect_proposals:
        where = f"{effect.start_ratio:g} to {effect.end_ratio:g}"
        say(f"  - {effect.effect_name}, s = {where}: {effect.reason}")
    say(*textwrap.indent(round.facts, "  ").split("\n"))
    came, of = len(round.met), len(round.met) + len(round.unmet)
    say(f"  {came} of {of} behaviours came true" + (", but not these:" if round.unmet else "."))
    for sentence in (*round.unmet, *round.notes):
        say(f"  ! {sentence}")


def tell_cost(usage: "Usage") -> None:
    """What was asked of the network; nothing if it was not asked."""
    if usage.requests:
        price = "price unknown" if usage.dollars is None else f"{usage.dollars:.3f} dollars"
        say(
            f"Asked {usage.requests} times: {usage.input_tokens} tokens in "
            f"({usage.cache_read_tokens} from the cache), {usage.output_tokens} out, {price}."
        )


@contextmanager
def telling_cost(folder: Path | None, as_json: bool) -> Iterator[None]:
    """Tells what was asked of the network in a folder where what is done here is broken off."""
    from joda.propose import total
    from joda.propose.asking import ProposalFailed
    from joda.propose.history import History

    try:
        yield
    except ProposalFailed as error:
        if not as_json:
            tell_cost(error.usage)
        raise
    except KeyboardInterrupt:
        if folder and not as_json:
            tell_cost(total(History.read(path).usage for path in folder.rglob("history.json")))
        raise


def tell_estimate(estimated: "Estimate | None", as_json: bool) -> None:
    """What a generation will about cost."""
    if as_json:
        print_json(estimated and estimated.model_dump(mode="json"))
        return
    if estimated is None:
        say("Nobody would be asked who costs anything.")
        return
    least, most = estimated.least, estimated.most
    dollars = (
        "price unknown (JODA_VLM_PRICE sets it)"
        if least.dollars is None or most.dollars is None
        else f"{_span(least.dollars, most.dollars, '.2g')} dollars"
    )
    say(
        f"Estimate, joints: {estimated.joints}, with {estimated.proposer}: "
        f"{_span(least.requests, most.requests)} requests, "
        f"{_span(least.input_tokens, most.input_tokens)} tokens in, "
        f"{_span(least.output_tokens, most.output_tokens)} out, {dollars}."
    )


def _span(low: float, high: float, form: str = "d") -> str:
    ends = f"{low:{form}}", f"{high:{form}}"
    return " to ".join(dict.fromkeys(ends))


def tell_all(done: "Mapping[str, Generated | JodaError]", sheet: Path, as_json: bool) -> None:
    """A line per joint, what of all does not come true, and the contact sheet.

    Raises JodaError if some gave nothing.
    """
    from joda.commands.generate_all import PassedOver, remarks
    from joda.propose import total
    from joda.propose.asking import ProposalFailed

    failed = {label: result for label, result in done.items() if isinstance(result, JodaError)}
    mistakes = [one for one in failed.values() if not isinstance(one, PassedOver)]
    lost = (one.usage for one in mistakes if isinstance(one, ProposalFailed))
    made = {label: result for label, result in done.items() if not isinstance(result, JodaError)}
    if as_json:
        print_json(
            {
                label: {"error": str(failed[label])}
                if label in failed
                else generated_as_json(made[label])
                for label in done
            }
        )
    else:
        for label in done:
            if label in failed:
                say(f"{label}: {failed[label]}")
                continue
            result = made[label]
            last = result.history.rounds[-1]
            lacking = " ".join(last.unmet) or "as described"
            say(f"{label}: {last.proposal.joint_summary.motion_description}; {lacking}")
            for note in remarks(result):
                say(f"  {note}")
        tell_cost(total([*(result.history.usage for result in made.values()), *lost]))
        lasts = [result.history.rounds[-1] for result in made.values()]
        came, not_ = (sum(len(getattr(r, what)) for r in lasts) for what in ("met", "unmet"))
        joints = sum(bool(last.unmet) for last in lasts)
        say(f"{came} of {came + not_} behaviours come true; {joints} joints lack one.")
        if over := len(failed) - len(mistakes):
            say(f"{over} {'joint has' if over == 1 else 'joints have'} no range and no profile.")
        say(f"Contact sheet: {sheet}")
    stopped = sum(bool(result.stopped) for result in made.values())
    lacks = [(len(mistakes), "have no profile"), (stopped, "stopped early and go on with --resume")]
    if told := [f"{count} of {len(done)} {what}" for count, what in lacks if count]:
        raise JodaError(f"{', '.join(told)}; see above.")


def evaluation_as_json(result: "Evaluation") -> dict[str, Any]:
    """What `joda evaluate --json` prints."""
    told: dict[str, Any] = result.model_dump(mode="json")
    for row, one in zip(told["joints"], result.joints, strict=True):
        row |= {"met": one.met, "of": len(one.behaviours)}
    usage = result.usage.model_dump(mode="json")
    return {
        **told, "met": result.met, "of": result.of, "usage": usage,
        "seconds": round(result.seconds, 3),
    }  # fmt: skip


def tell_evaluation(result: "Evaluation") -> None:
    """The table of `joda evaluate`; below it what was not met."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    heads = "joint", "met", "rounds", "tokens in", "out", "dollars", "seconds"
    table = Table(box=None, pad_edge=False)
    for k, head in enumerate(heads):
        table.add_column(head, justify="right" if k else "left")
    rows = [
        (one.label, one.met, len(one.behaviours), one.rounds, one.usage, one.seconds)
        for one in result.joints
    ]
    rounds = sum(one.rounds for one in result.joints)
    whole = f"{result.proposer}, {len(rows)} joints"
    rows.append((whole, result.met, result.of, rounds, result.usage, result.seconds))
    for label, met, of, count, usage, seconds in rows:
        dollars = "?" if usage.dollars is None else f"{usage.dollars:.3f}"
        tokens = map(str, (usage.input_tokens, usage.output_tokens))
        paid = (*tokens, dollars) if usage.requests else ("-", "-", "-")
        counts = f"{met} of {of}", str(count), *paid, f"{seconds:.1f}"
        table.add_row(Text(line(label)), *counts)
    Console(width=None if sys.stdout.isatty() else 120).print(table)
    for one in result.joints:
        lacking = [one.failed] if one.failed else [t for t in one.behaviours.values() if t]
        for sentence in lacking:
            say(f"{one.label}: {sentence}")


def tell_doors(result: "Demo") -> None:
    """What the demo's two doors did."""
    rows = zip(result.starts, result.plain_ends, result.joda_ends, strict=True)
    for start, without, ours in rows:
        say(
            f"Let go at {degrees(start):.0f} degrees, {result.duration:g} s later: without a "
            f"profile at {degrees(without):.1f}, with it at {abs(degrees(ours)):.1f} degrees."
        )
    forces = zip(
        ("without a profile", "with it"), (result.plain_force, result.joda_force), strict=True
    )
    told = [
        f"{name} it {'pulls' if force > 0 else 'holds back'} with up to {abs(force):.1f} N·m"
        for name, force in forces
    ]
    say(f"Opened slowly by hand: {', '.join(told)}.")


def tell_errors(result: "Refined", unit: str) -> None:
    """How near the simulation came to the measurement, and where that told little.

    Args:
        result: of a refinement.
        unit: of its joint's position, rad or m.
    """
    what = "Position"
    if result.windows is None:
        what, unit = "Force", {"rad": "N·m", "m": "N"}[unit]
    say(
        f"{what} error: {result.before:.3g} → {result.after:.3g} {unit} RMS after "
        f"{result.iterations} iterations; the measurement's noise is {result.noise:.2g} {unit}."
    )
    if result.windows:
        first, last = result.windows
        say(f"The same over windows of 0.4 s: {first:.3g} → {last:.3g} {unit}.")
    if result.checked:
        say(f"On the runs held out: {result.checked[0]:.3g} → {result.checked[1]:.3g} {unit} RMS.")
    for channel, places in result.unseen.items():
        if places:
            where = ", ".join(f"s = {a:.2f} to {b:.2f}" for a, b in places)
            say(f"The data tell little of {channel} at {where}: it is hardly measured there.")


def tell_joints(found: "Compared") -> None:
    """Errors of all joints of logs of several, a row each, and what is said of each."""
    rows: list[tuple[str, ...]] = []
    rows.append(("joint", "whole runs", "windows of 0.4 s", "noise", "all joints at once"))
    for name, one in found.joints.items():
        errors = one.rmse, one.rmse_window, one.noise_floor, found.rmse(name)
        rows.append((name, *("" if x is None else f"{x:.3g} {one.unit}" for x in errors)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        say("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip())
    if not found.together:
        say("Not replayed all at once: a command of an actuator on them, or a force, is not known.")
    notes = dict.fromkeys(note for one in found.joints.values() for note in one.notes)
    for note in notes:
        say(note)


def tell_ratios(rows: "Iterable[Row]") -> None:
    """The table of `joda bench`."""
    from rich.console import Console
    from rich.table import Table

    table = Table("comparison", "ratio", "required", "µs per step", box=None, pad_edge=False)
    for row in rows:
        ours, other = row.microseconds
        table.add_row(
            row.what, f"{row.ratio:.3f} ± {row.spread:.3f}", row.bar, f"{ours:.2f} / {other:.2f}"
        )
    Console(width=None if sys.stdout.isatty() else 110).print(table)


def tell_worlds(rows: "Sequence[WarpRow]") -> None:
    """The table of `joda bench --warp`."""
    from rich.console import Console
    from rich.table import Table

    heads = ("worlds", "steps/s with profiles", "native", "none", "÷ native", "÷ none", "kernels")
    table = Table(*heads, box=None, pad_edge=False)
    for row in rows:
        speeds = (f"{speed:,.0f}" for speed in row.per_second)
        ratios = (f"{row.native_ratio:.2f}", f"{row.plain_ratio:.2f}")
        table.add_row(str(row.worlds), *speeds, *ratios, " / ".join(map(str, row.launches)))
    Console(width=None if sys.stdout.isatty() else 110).print(table)
    say(f"device {rows[0].device}; ÷: time with profiles over that of the other scene")


def tell_nearest(joints: "Iterable[Nearest]") -> None:
    """The table of `joda export`."""
    from rich.console import Console
    from rich.table import Table

    table = Table("joint", "what", "error: rms", "largest", "of", box=None, pad_edge=False)
    for joint in joints:
        for error in joint.errors:
            least = 1e-9 * error.size  # rounding
            sizes = (
                f"{size:.3g}" if size > least else "0"
                for size in (error.rms, error.largest, error.size)
            )
            table.add_row(joint.joint, f"{error.what}, {error.unit}", *sizes)
    Console(width=None if sys.stdout.isatty() else 110).print(table)


def tell_cases(shown: "Iterable[Shown]") -> None:
    """The table of `joda experiments`."""
    from rich.console import Console
    from rich.table import Table

    ways = {"joda": "profile", "constant": "constant", "spring": "spring"}
    ways |= {"usual": "constant, usual solver"}
    table = Table("case", "number", *ways.values(), "separated", box=None, pad_edge=False)
    for one in shown:
        number = f"{one.case.meaning} ({one.unit}; {one.case.better} is better)"
        spans = (one.span(way) for way in ways)
        table.add_row(one.case.name, number, *spans, "yes" if one.separated else "NO")
    Console(width=None if sys.stdout.isatty() else 130).print(table)


def tell_checks(checks: "Iterable[Check]") -> None:
    """A line per check, below it what to do, and a sentence about all."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    marks = {"ok": ("ok", "green"), "missing": ("missing", "yellow"), "broken": ("broken", "red")}
    table = Table.grid(padding=(0, 2))
    checks = list(checks)
    for check in checks:
        style = "bold red" if check.fatal else marks[check.state][1]
        told = Text(plain(check.found))
        if check.remedy:
            told.append(f"\n→ {plain(check.remedy)}", "bold" if check.fatal else "dim")
        table.add_row(Text(check.state, style), Text(check.what), told)
    console = Console(width=None if sys.stdout.isatty() else 160)
    console.print(table)
    fatal = [check.what for check in checks if check.fatal]
    say(f"Not working: {', '.join(fatal)}." if fatal else "All that joda needs works.")


def tell_templates(found: "Iterable[Template]") -> None:
    """A paragraph per template, no wider than the terminal."""
    say(*"\n\n".join(map(_paragraph, found)).split("\n"))


def _paragraph(template: "Template") -> str:
    present = ", ".join(name for name, curve in template.channels if curve)
    texts = (
        template.description,
        f"Placement: {template.placement}",
        f"Channels: {present or 'none'}",
    )
    width = min(shutil.get_terminal_size((100, 24)).columns, 100)
    wrap = textwrap.TextWrapper(width, initial_indent="  ", subsequent_indent="  ")
    return "\n".join((template.name, *map(wrap.fill, texts)))


def tell_understood(columns: "Iterable[Understood]") -> None:
    """The table of `joda import`."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    heads = ("column", "becomes", "unit", "known by", "range", "model's", "sign", "zero", "delay")
    table = Table(*heads, box=None, pad_edge=False)
    for one in columns:
        texts = (
            one.column, one.target, one.unit, one.why, _ends(one.range), _ends(one.model_range),
            one.sign or "-", _zero(one), _delay(one),
        )  # fmt: skip
        table.add_row(*(Text(plain(text)) for text in texts))
    Console(width=None if sys.stdout.isatty() else 160).print(table)


def _ends(span: tuple[float, float] | None) -> str:
    return "-" if span is None else f"{span[0]:.3g} to {span[1]:.3g}"


def _zero(one: "Understood") -> str:
    """Whether the zero can be the model's; of a command how far its joint is from it."""
    if one.offset is not None:
        return f"off by {one.offset:.2g}"
    if one.model_range is None:
        return "-"
    return f"{100 * one.outside:.2g} % outside" if one.outside else "inside"


def _delay(one: "Understood") -> str:
    if one.delay is None or one.delay_resolution is None:
        return "-"
    return f"{1e3 * one.delay:.0f} ms (samples: {1e3 * one.delay_resolution:.3g})"
