"""The main job for every joint of every model below a folder."""

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from joda._generate import ROUNDS, Generated, choose, run
from joda.errors import JodaError
from joda.files import make_folder
from joda.model import joint_name, joint_type, load_model
from joda.propose import Proposer
from joda.session import Session

Advance = Callable[[int, int, str], None]


def generate_all(
    models: str | Path,
    output: str | Path,
    *,
    joint: str | None = None,
    proposer: str | Proposer | None = None,
    rounds: int = ROUNDS,
    describe: str = "",
    templates: Sequence[str | Path] = (),
    key: str = "",
    vlm: str | None = None,
    resume: bool = False,
    force: bool = False,
    progress: Advance = lambda done, total, what: None,
) -> dict[str, Generated | JodaError]:
    """`joda.generate` for all hinges and slides with a range, of all models below a folder.

    A proposer with a `propose_many`, as anthropic's with its Message Batches, is asked for a round
    of all joints at once. Interrupted, the same call with `resume` goes on.

    Args:
        models: folder with MJCF and URDF files; those that cannot be loaded by themselves, being
            included by others, are passed over.
        output: folder to fill, with a folder per model and in it one per joint.
        joint: only the joints of this name.
        proposer, rounds, describe, templates, key, vlm: as for `joda.generate`.
        resume: go on with what the folder holds; what is complete stays.
        force: overwrite what another generation left in the folder.
        progress: told how many joints are done, of how many, and what is being done.

    Returns:
        "model/joint" to what was made, or to the reason why nothing was.

    Raises:
        JodaError: no joint is found, or the folder holds files already.
    """
    source, target = Path(models), Path(output)
    if target.exists() and any(target.iterdir()) and not (force or resume):
        raise JodaError(
            f"{target}: exists already; choose another folder with -o, add --force or go on with "
            "--resume."
        )
    chosen = choose(proposer, key, vlm)
    found = [item for item in _joints(source) if joint in (None, item[1])]
    if not found:
        raise JodaError(f"{source}: holds no model with a hinge or slide that has a range.")
    make_folder(target)
    out: dict[str, Generated | JodaError] = {}
    sessions: dict[str, Session] = {}
    further = [Path(path) for path in templates]
    many = hasattr(chosen, "propose_many")
    for number, (path, name) in enumerate(found):
        label = f"{path.relative_to(source).with_suffix('').as_posix()}/{name}"
        folder = target / path.relative_to(source).with_suffix("") / _file_name(name)
        progress(number, len(found), label)
        try:
            if resume and (folder / "history.json").is_file():
                session = Session.resume(folder)
            else:
                session = Session.start(folder, path, name, describe, further, key)
            sessions[label] = session
            if not many:
                run(session, chosen, rounds)
        except JodaError as error:
            out[label] = error
    if many:
        _run_many(sessions, chosen, rounds, target / "batch.json", out, progress)
    for label, session in sessions.items():
        if label not in out:
            out[label] = Generated(session.folder, session.history, tuple(session.notes))
    progress(len(found), len(found), "done")
    return out


def _run_many(
    sessions: dict[str, Session],
    proposer: Proposer,
    rounds: int,
    store: Path,
    failed: dict[str, Generated | JodaError],
    progress: Advance,
) -> None:
    """Rounds of all sessions at once, until all are complete or have failed."""
    while True:
        open_ = {
            label: session
            for label, session in sessions.items()
            if label not in failed
            and not session.history.complete
            and len(session.history.rounds) < rounds
        }
        if not open_:
            return
        closed = len(sessions) - len(open_)

        def told(done: int, total: int, closed: int = closed) -> None:
            progress(closed + done, len(sessions), f"asking {proposer.name}")

        asks = [(label, session.task, session.turns) for label, session in open_.items()]
        for label, answer in proposer.propose_many(asks, store, told).items():  # type: ignore[attr-defined]
            try:
                if isinstance(answer, JodaError):
                    open_[label].fail(answer)
                    raise answer
                open_[label].take(answer, proposer.name)
            except JodaError as error:
                failed[label] = error


def _joints(folder: Path) -> Iterator[tuple[Path, str]]:
    """Models below the folder that load, and their joints that can have a profile."""
    if not folder.is_dir():
        raise JodaError(f"{folder}: no such folder.")
    for path in sorted(folder.rglob("*")):
        if path.suffix.lower() not in (".xml", ".urdf"):
            continue
        try:
            model = load_model(path)
        except JodaError:
            continue
        for k in range(model.njnt):
            lo, hi = model.jnt_range[k]
            if joint_type(model, k) in ("hinge", "slide") and lo < hi:
                yield path, joint_name(model, k)


def _file_name(joint: str) -> str:
    return re.sub(r"[^\w.-]+", "_", joint).strip("_") or "joint"
