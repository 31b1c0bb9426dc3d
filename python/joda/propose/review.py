"""What a user decides on joints that the proposer was not sure of."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from joda.errors import JodaError
from joda.propose import Proposer
from joda.propose.generation import Generated, choose, run
from joda.propose.session import Session

UNSURE = 0.8
"""Joints less sure than this are to be looked at, and those with something unmet."""


@dataclass(frozen=True)
class Decision:
    """What the user says of a joint; neither: it is good as it is.

    Attributes:
        kind: title of the archetype that it is.
        describe: what it should do, in words.
        later: it is to be asked about again.
    """

    kind: str = ""
    describe: str = ""
    later: bool = False


Decide = Callable[[str, Generated], Decision | None]
"""Given the label of a joint and what was made, says what to do; None: no more for now. Called
again, where a decision came to nothing, with the reason among the notes."""


def unsure(done: Mapping[str, Generated | JodaError]) -> list[str]:
    """The labels of joints that nobody has looked at and that should be, the least sure first."""
    made = {label: one for label, one in done.items() if isinstance(one, Generated)}
    return sorted(
        (
            label
            for label, one in made.items()
            if not one.history.reviewed
            and (one.history.rounds[-1].sure < UNSURE or one.history.rounds[-1].unmet)
        ),
        key=lambda label: (made[label].history.rounds[-1].sure, label),
    )


def review(
    done: Mapping[str, Generated | JodaError],
    decide: Decide,
    rounds: int,
    proposer: str | Path | Proposer | None = None,
    vlm: str | None = None,
    force: bool = False,
) -> Iterator[tuple[str, Generated]]:
    """Asks about one joint after the other, and does what is decided.

    Each decision is kept at once: interrupted, the same goes on with the next.

    Args:
        done: by label.
        decide: is asked.
        rounds, proposer, vlm: as for `joda.generate`; a kind is made by rules.
        force: although composed.json was edited by hand.

    Yields:
        the label of a joint that was decided on, and what it has become.
    """
    for label in unsure(done):
        made = done[label]
        assert isinstance(made, Generated)
        while (decision := decide(label, made)) is not None:
            if decision.later:
                break
            try:
                yield label, _done(made, decision, rounds, proposer, vlm, force)
                break
            except JodaError as error:
                made = Generated(made.folder, made.history, (str(error),))
        if decision is None:
            return


def _done(
    made: Generated,
    decision: Decision,
    rounds: int,
    proposer: str | Path | Proposer | None,
    vlm: str | None,
    force: bool,
) -> Generated:
    """What becomes of a joint; raises JodaError if nothing does, and it is as before."""
    old = Session.resume(made.folder)
    if decision == Decision():
        old.review()
        return Generated(made.folder, old.history, tuple(old.notes))
    if not force:
        old.check_unedited()
    session = old.again(decision.describe or old.history.description, decision.kind)
    who = "offline" if decision.kind else proposer
    try:
        run(session, choose(who, session.history.key, vlm), rounds, force=True)
    except JodaError:
        Session(made.folder, old.history)  # as it was
        raise
    return Generated(made.folder, session.history, tuple(session.notes))
