"""What proposers did and what it cost, as text or JSON."""

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from joda.propose import Usage, total
from joda.propose.asking import ProposalFailed
from joda.propose.generation import Generated
from joda.propose.history import History, Round
from joda.terminal.say import say


def generated_as_json(result: Generated) -> dict[str, Any]:
    """What `joda generate --json` prints of a joint."""
    told: dict[str, Any] = result.history.model_dump(mode="json")
    usage = result.history.usage.model_dump(mode="json")
    return {**told, "usage": usage, "notes": result.notes, "stopped": result.stopped}


def say_round(round: Round) -> None:
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


def say_cost(usage: Usage) -> None:
    """What was asked of the network; nothing if it was not asked."""
    if usage.requests:
        price = "price unknown" if usage.dollars is None else f"{usage.dollars:.3f} dollars"
        say(
            f"Asked {usage.requests} times: {usage.input_tokens} tokens in "
            f"({usage.cache_read_tokens} from the cache), {usage.output_tokens} out, {price}."
        )


@contextmanager
def saying_cost(folder: Path | None, as_json: bool) -> Iterator[None]:
    """Tells what was asked of the network in a folder where what is done here is broken off."""
    try:
        yield
    except ProposalFailed as error:
        if not as_json:
            say_cost(error.usage)
        raise
    except KeyboardInterrupt:
        if folder and not as_json:
            say_cost(total(History.read(path).usage for path in folder.rglob("history.json")))
        raise
