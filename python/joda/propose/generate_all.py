"""Generation for every joint of every model below a folder."""

from collections.abc import Callable, Sequence
from pathlib import Path

from joda.errors import JodaError
from joda.files import make_folder, write_text
from joda.propose import Ask, BatchProposer, Proposer
from joda.propose.asking import Effort, ProposalFailed
from joda.propose.generation import ROUNDS, Generated, begin, check_rounds, choose, run
from joda.propose.joints import find_jobs
from joda.propose.offline import Offline
from joda.propose.review import Decide
from joda.propose.review import review as walk
from joda.propose.session import PICTURES, Pictures, Session
from joda.propose.sheet import Entry, sheet
from joda.scenes.model_cache import loading_once

Advance = Callable[[int, int, str], None]
Results = dict[str, Generated | JodaError]

SHEET = "sheet.html"
"""The contact sheet."""

BOTH_ENDS = Pictures(2, (480, 360))
"""Pictures of a joint that nobody looks at but the sheet, which shows them half as large."""


def generate_all(
    models: str | Path,
    output: str | Path,
    *,
    joint: str | None = None,
    proposer: str | Path | Proposer | None = None,
    rounds: int = ROUNDS,
    describe: str = "",
    templates: Sequence[str | Path] = (),
    key: str = "",
    vlm: str | None = None,
    base_url: str | None = None,
    effort: Effort | None = None,
    resume: bool = False,
    force: bool = False,
    review: Decide | None = None,
    progress: Advance = lambda done, total, what: None,
) -> Results:
    """`joda.generate` for all hinges and slides with a range, of all models below a folder.

    Ends with a contact sheet, `sheet.html` in the folder: every joint's pictures, profile,
    behaviours, force at the handle, and how sure the proposer was.

    A `joda.propose.BatchProposer`, as anthropic's with its Message Batches, is asked for a round
    of all joints at once. Interrupted, the same call with `resume` goes on.

    Args:
        models: folder with MJCF and URDF files; those that are only parts of others, and cannot be
            loaded by themselves, are passed over.
        output: folder to fill, with a folder per model and in it one per joint.
        joint: only the joints of this name.
        proposer, rounds, describe, templates, key, vlm, base_url, effort: as for `joda.generate`.
        resume: go on with what the folder holds; what is complete stays.
        force: overwrite what another generation left in the folder, with `resume` profiles that
            were edited by hand.
        review: asked about the joints that are doubtful, the least sure first: given the label and
            what was made, returns a `joda.Decision`, or None for no more. What it has been asked
            before it is not asked again.
        progress: told how many joints are done, of how many, and what is being done.

    Returns:
        "model/joint" to what was made, or to the reason why nothing was, a `PassedOver` of joints
        without a range; "model" to the reason why it cannot be loaded.

    Raises:
        JodaError: no joint is found, the folder holds files already, or the proposer is not to be
            had.
    """
    check_rounds(rounds)
    source, target = Path(models), Path(output)
    _check_target(target, force or resume)
    chosen = choose(proposer, key, vlm, base_url, effort)
    with loading_once(source):
        jobs, left_out = find_jobs(source, target, joint)
        done: Results = {**left_out}
        make_folder(target)
        further = [Path(path) for path in templates]
        sessions: dict[str, Session] = {}
        pictures = BOTH_ENDS if isinstance(chosen, Offline) else PICTURES
        batched = chosen if isinstance(chosen, BatchProposer) else None
        for number, (label, job) in enumerate(jobs.items()):
            progress(number, len(jobs), label)
            try:
                session = begin(
                    *(job.folder, job.model, job.joint, describe, further, key, resume),
                    pictures=pictures,
                )
                sessions[label] = session
                if batched is None:
                    own = choose(proposer, session.history.key, vlm, base_url, effort)
                    run(session, own, rounds, force)
                elif session.pending(rounds) and not force:
                    session.check_unedited()
            except JodaError as error:
                done[label] = error
        if batched is not None:
            _run_many(sessions, batched, rounds, target / "batch.json", done, progress)
        for label, session in sessions.items():
            failed, made = str(done.get(label, "")), session.history
            done[label] = (
                Generated(session.folder, made, tuple(session.notes), failed)
                if made.rounds
                else ProposalFailed(failed, made.usage)
            )
    progress(len(jobs), len(jobs), "drawing the contact sheet")
    write_sheet(target, done)
    progress(len(jobs), len(jobs), "done")
    if review is not None:
        for label, changed in walk(done, review, rounds, proposer, vlm, force):
            done[label] = changed
        write_sheet(target, done)
    return dict(sorted(done.items()))


def remarks(made: Generated) -> tuple[str, ...]:
    """What is to be told of a joint besides its behaviours, a sentence each."""
    if not made.stopped:
        return made.notes
    return (*made.notes, f"Round {len(made.history.rounds) + 1} came to nothing: {made.stopped}")


def write_sheet(folder: Path, done: Results) -> None:
    """Writes the contact sheet of what is in a folder; raises JodaError."""
    entries = [
        Entry(label, failed=str(one))
        if isinstance(one, JodaError)
        else Entry.read(label, one.folder, one.history, remarks(one))
        for label, one in sorted(done.items())
    ]
    write_text(folder / SHEET, sheet(entries, folder, f"Joints of {folder.resolve().name}"))


def _run_many(
    sessions: dict[str, Session],
    proposer: BatchProposer,
    rounds: int,
    store: Path,
    failed: Results,
    progress: Advance,
) -> None:
    """Rounds of all sessions at once, until all are complete or have failed."""
    while True:
        left = {
            label: session
            for label, session in sessions.items()
            if label not in failed and session.pending(rounds)
        }
        if not left:
            return
        closed = len(sessions) - len(left)

        def report(done: int, total: int, closed: int = closed) -> None:
            progress(closed, len(sessions), f"asking {proposer.name}, {done} of {total} answered")

        asks = [Ask(label, session.task, session.turns) for label, session in left.items()]
        for label, answer in proposer.propose_many(asks, store, report):
            progress(closed, len(sessions), f"simulating {label}")
            try:
                left[label].take(answer, proposer.name)
            except JodaError as error:
                failed[label] = error


def _check_target(folder: Path, allowed: bool) -> None:
    if folder.exists() and (not folder.is_dir() or (any(folder.iterdir()) and not allowed)):
        raise JodaError(
            f"{folder}: exists already; choose another folder with -o, add --force or go on with "
            "--resume."
        )
