"""Looking through the joints that a proposer was not sure of, in the terminal."""

from joda.propose.generation import Generated
from joda.propose.review import Decision
from joda.terminal.say import say

HELP = (
    "Enter: it is right; a number: it is that; k KIND: it is one of joda's kinds; any other words: "
    "what it should do; s: later; q: no more."
)


def look_at(label: str, made: Generated) -> Decision | None:
    """Tells what a joint was taken for, and asks; the end of the input is no more."""
    last = made.history.rounds[-1]
    found = last.recognised
    say("", f"{label}: {last.proposal.joint_summary.motion_description} ({last.sure:.0%} sure)")
    for name in made.history.pictures or ():
        say(f"  picture: {made.folder / 'pictures' / name}")
    others = [one.title for one in found.others] if found else []
    if found:
        say(f"  {found.describe()}")
    for sentence in (*last.met, *last.unmet, *last.notes, *made.notes):
        say(f"  {sentence}")
    for number, title in enumerate(others, 1):
        say(f"  {number}: {title}")
    say(f"  {HELP}")
    while True:
        answer = _line()
        if answer is None or answer == "q":
            return None
        if answer in ("", "s"):
            return Decision(later=answer == "s")
        if answer.isdigit():
            if 1 <= int(answer) <= len(others):
                return Decision(kind=others[int(answer) - 1])
            say(f"  There is no {answer}. {HELP}")
            continue
        word, _, rest = answer.partition(" ")
        return Decision(kind=rest.strip()) if word == "k" and rest else Decision(describe=answer)


def _line() -> str | None:
    try:
        return input("> ").strip()
    except EOFError:
        return None
