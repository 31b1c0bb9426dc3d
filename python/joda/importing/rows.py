"""One clock for all columns of a recording, and the text of a run."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from joda.errors import JodaError
from joda.importing.columns import Pick
from joda.importing.log import Array, Clock, Log, Recording, Track
from joda.importing.scaling import Scaled
from joda.measured.run_files import run_text
from joda.measured.runs import MIN_SAMPLES, Run
from joda.measured.table import LARGEST


@dataclass(frozen=True)
class Rows:
    """A recording in the model's units; all arrays have shape (n,).

    Attributes:
        name: of its run.
        time: s, from 0.
        columns: by target; NaN where a force is not known.
        notes: what was left out, a sentence each.
    """

    name: str
    time: Array
    columns: dict[str, Array]
    notes: tuple[str, ...] = ()


def rows(log: Log, recording: Recording, columns: Sequence[Scaled], interpolate: bool) -> Rows:
    """Brings the columns of a recording to the times of its positions.

    A command holds between samples. What else is at other times is refused, or interpolated.

    Raises:
        JodaError: times do not increase, numbers are missing or too large, or there are too few.
    """
    tracks = {one.pick.target: _track(log, recording, one) for one in columns}
    for track in tracks.values():
        _check_increasing(track.clock)
    first = next(one.pick for one in columns if one.pick.role == "position")
    base = tracks[first.target].clock
    out, begin, end = {}, base.time[0], base.time[-1]
    for one in columns:
        target, track = one.pick.target, tracks[one.pick.target]
        known = np.flatnonzero(np.isfinite(track.values))
        if not len(known):
            raise JodaError(f"{track.clock.at(0)}: {one.pick.signal.name} has no numbers there.")
        if one.pick.role != "force":  # which may be unknown
            begin = max(begin, track.clock.time[known[0]])
        same = track.clock is base or np.array_equal(track.clock.time, base.time)
        if one.pick.role == "ctrl":
            _check_known(one, track, known[0])
            at = np.searchsorted(track.clock.time, base.time, "right") - 1
            values = track.values[np.maximum(at, 0)]
        elif same:
            values = track.values
        elif interpolate:
            _check_known(one, track, known[0])
            end = min(end, track.clock.time[-1])
            values = np.interp(base.time, track.clock.time, track.values)
        else:
            raise JodaError(
                f"{track.clock.place}: {one.pick.signal.name} has times of its own, other than "
                f"{first.signal.name}; take one joint with --joint, or say --interpolate."
            )
        out[target] = one.to_model.scale * values + one.to_model.offset
    inside = (base.time >= begin) & (base.time <= end)
    for one in columns:
        bad = np.flatnonzero(inside & ~np.isfinite(out[one.pick.target]))
        if len(bad) and one.pick.role != "force":
            raise _unknown(one, base, int(bad[0]))
        if np.nanmax(np.abs(out[one.pick.target][inside]), initial=0.0) > LARGEST:
            raise JodaError(
                f"{base.place}: {one.pick.signal.name} has numbers too large to be meant."
            )
    if inside.sum() < MIN_SAMPLES:
        raise JodaError(
            f"{base.place}: {int(inside.sum())} samples in which all columns are known; a run "
            f"needs at least {MIN_SAMPLES}."
        )
    notes = []
    if (cut := int(len(base.time) - inside.sum())) > 0:
        notes.append(
            f"{recording.name}: {cut} samples are left out in which not all columns are known yet."
        )
    time = base.time[inside] - base.time[inside][0]
    kept = {target: values[inside] for target, values in out.items()}
    return Rows(recording.name, time, kept, tuple(notes))


def text(made: Rows, columns: Sequence[Scaled], comment: str, alone: Pick | None) -> str:
    """The CSV of a run; with `alone`, a position of a joint, that joint's only, as `position`."""
    if alone is None:
        head = "".join(f"# {line}\n" for line in comment.splitlines())
        lines = [",".join(["time", *made.columns])]
        lines += [
            ",".join("" if x != x else f"{x:.9g}" for x in row)
            for row in np.column_stack([made.time, *made.columns.values()]).tolist()
        ]
        return head + "\n".join(lines) + "\n"
    own = {one.pick.role: made.columns[one.pick.target] for one in columns}
    run = Run(
        name=made.name,
        time=made.time,
        position=own["position"],
        velocity=own.get("velocity"),
        force=own.get("force", np.zeros(len(made.time))),
        forced="force" in own,
    )
    return run_text(run, comment)


def _track(log: Log, recording: Recording, column: Scaled) -> Track:
    name = column.pick.signal.name
    if name not in recording.tracks:
        raise JodaError(f"{log.path}, {recording.name}: has no '{name}'.")
    track = recording.tracks[name]
    if not len(track.values):
        raise JodaError(f"{track.clock.place}: is empty.")
    return track


def _check_increasing(clock: Clock) -> None:
    """Raises JodaError where times stand still, go back or are no numbers."""
    bad = np.flatnonzero(~(np.isfinite(clock.time) & (np.abs(clock.time) < LARGEST)))
    if len(bad):
        raise JodaError(f"{clock.at(int(bad[0]))}: its time is no number.")
    wrong = np.flatnonzero(np.diff(clock.time) <= 0)
    if not len(wrong):
        return
    k = int(wrong[0])
    before, after = clock.time[k : k + 2]
    told = "is that of the one before" if before == after else "goes back"
    more = f", and in {len(wrong)} places in all" if len(wrong) > 1 else ""
    raise JodaError(
        f"{clock.at(k + 1)}: time does not increase: it {told} ({before:.9g} s, then {after:.9g} s)"
        f"{more}; record it anew, or cut the log there into two."
    )


def _check_known(column: Scaled, track: Track, begin: int) -> None:
    """Raises JodaError where a number is missing after the first."""
    bad = np.flatnonzero(~np.isfinite(track.values[begin:]))
    if len(bad):
        raise _unknown(column, track.clock, int(begin + bad[0]))


def _unknown(column: Scaled, clock: Clock, k: int) -> JodaError:
    return JodaError(
        f"{clock.at(k)}: {column.pick.signal.name} is not a number; leave the part out, or the "
        f"column with --without '{column.pick.signal.name}'."
    )
