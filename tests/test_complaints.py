"""A complaint changes what it is about, the way it asks for, and nothing else."""

from typing import NamedTuple

import pytest
from test_offline import own, turn

from joda import JodaError
from joda.proposal import EffectProposal, Proposal
from joda.propose import Task, Turn
from joda.propose.offline import Offline
from joda.template import read_templates


class Change(NamedTuple):
    """A joint before and after a complaint."""

    before: Turn
    after: Turn

    @property
    def proposals(self) -> tuple[Proposal, Proposal]:
        return self.before.proposal, self.after.proposal

    @property
    def added(self) -> tuple[EffectProposal, ...]:
        old, new = self.proposals
        return new.effect_proposals[len(old.effect_proposals) :]

    @property
    def factors(self) -> dict[tuple[str, str], float]:
        """(effect, channel) to how many times stronger, of those effects that were there before.

        All else about them must be the same.
        """
        old, new = self.proposals
        out = {}
        for a, b in zip(old.effect_proposals, new.effect_proposals, strict=False):
            assert a.model_copy(update={"refineFactor": b.refineFactor}) == b
            for (channel, was), (_, now) in zip(a.refineFactor, b.refineFactor, strict=True):
                if now != was:
                    out[a.effect_name, channel] = now / was
        return out


def answer(name: str, complaint: str) -> Proposal:
    done = own(name)
    last = turn(done.context, done.last.proposal, complaint=complaint)
    task = Task(done.context, read_templates())
    revised = Offline().propose(task, [*done.turns[:-1], last]).proposal
    assert revised is not None
    return revised


def complain(name: str, complaint: str) -> Change:
    done, revised = own(name), answer(name, complaint)
    assert revised.joint_summary == done.last.proposal.joint_summary
    return Change(done.last, turn(done.context, revised))


MAGNET = "magnetic_return_to_low_end"
FRICTION = "constant_friction_hinge"
DAMPING = "constant_damping_hinge"


def test_a_closing_pull_that_is_too_strong_becomes_weaker_and_all_else_remains():
    change = complain("refrigerator", "The final closing pull is too strong.")
    assert list(change.factors) == [(MAGNET, "conservative")]
    assert change.factors[MAGNET, "conservative"] < 1
    assert change.added == ()
    old, new = change.proposals
    assert new == old.model_copy(update={"effect_proposals": new.effect_proposals})
    before, after = change.before.behaviour, change.after.behaviour
    assert after.opening.force < 0.9 * before.opening.force
    assert after.opening.middle == before.opening.middle
    profiles = change.before.profile.channels, change.after.profile.channels
    assert profiles[0].friction == profiles[1].friction
    assert profiles[0].damping == profiles[1].damping


@pytest.mark.sweep(5)
@pytest.mark.parametrize(
    ("name", "complaint", "effect", "channel", "stronger"),
    [
        ("refrigerator", "the magnet is much too weak", MAGNET, "conservative", True),
        ("refrigerator", "The door is too heavy to move.", FRICTION, "friction", False),
        ("refrigerator", "It slams!", DAMPING, "damping", True),
        ("drawer", "it closes too slowly", DAMPING, "damping", False),
        ("drawer", "more damping please", DAMPING, "damping", True),
        ("cabinet", "It falls open too fast.", DAMPING, "damping", True),
        ("knob", "There is too much friction.", FRICTION, "friction", False),
        ("laptop", "It is too stiff.", FRICTION, "friction", False),
        ("lighter", "The spring is too weak.", "spring_return_to_low_end", "conservative", True),
        ("switch", "It is too hard to flip.", "bistable_mechanism", "conservative", False),
        (
            "microwave",
            "the latch is too weak",
            "spring_loaded_snap_detent_to_low_end",
            "conservative",
            True,
        ),
    ],
)
def test_a_common_complaint_changes_one_channel_of_one_effect(
    name, complaint, effect, channel, stronger
):
    change = complain(name, complaint)
    assert list(change.factors) == [(effect, channel)]
    assert (change.factors[effect, channel] > 1) is stronger
    assert change.added == ()
    assert change.after.behaviour.opening.arrived and change.after.behaviour.closing.arrived


def test_clicks_that_are_too_weak_become_stronger_to_the_hand():
    change = complain("knob", "The clicks are too weak.")
    assert ("detent_internal", "conservative") in change.factors
    assert {channel for _, channel in change.factors} == {"conservative"}
    assert min(change.factors.values()) > 1
    before, after = change.before.behaviour, change.after.behaviour
    assert after.opening.force > 1.2 * before.opening.force
    assert len(after.settles_at) >= len(before.settles_at)


def test_a_door_that_slams_closes_more_slowly_afterwards():
    change = complain("refrigerator", "it slams")
    before, after = change.before.behaviour.fastest, change.after.behaviour.fastest
    assert after.speed < before.speed and after.seconds > before.seconds


def test_a_middle_that_should_hold_better_holds_better_only_there():
    change = complain("refrigerator", "The middle should hold better.")
    assert change.factors == {}
    (added,) = change.added
    assert added.effect_name == FRICTION
    assert (added.strength.conservative, added.strength.damping) == ("none", "none")
    assert added.start_ratio >= 0.25 and added.end_ratio <= 0.75
    before, after = change.before.behaviour, change.after.behaviour
    assert after.opening.middle > 1.15 * before.opening.middle
    assert after.opening.first == before.opening.first
    assert after.closing.last == pytest.approx(before.closing.last, rel=0.01)


def test_words_of_degree_make_a_larger_or_smaller_change():
    said = ("slightly too weak", "too weak", "much too weak")
    factors = [
        complain("refrigerator", f"the magnet is {words}").factors[MAGNET, "conservative"]
        for words in said
    ]
    assert 1 < factors[0] < factors[1] < factors[2]


def test_two_complaints_in_a_sentence_are_both_answered():
    change = complain("cabinet", "It slams and the magnet is too weak.")
    assert set(change.factors) == {(DAMPING, "damping"), (MAGNET, "conservative")}
    assert min(change.factors.values()) > 1


def test_a_lack_is_a_wish():
    """'It does not close by itself' asks for just that; 'it should not' for the opposite."""
    lacking = complain("refrigerator", "It does not close by itself from anywhere.").after
    assert lacking.unmet == []
    assert lacking.behaviour.after(0.7).goes == "low_end"
    unwanted = complain("refrigerator", "It should not close by itself.").after
    assert unwanted.unmet == []
    assert unwanted.behaviour.after(0.03).goes == "stays"
    assert unwanted.behaviour.fastest is None


def test_another_number_of_positions_replaces_the_old_one():
    change = complain("knob", "It should click into 4 positions.")
    assert change.after.unmet == []
    detents = [e for e in change.after.proposal.effect_proposals if "detent" in e.effect_name]
    assert len(detents) == 2


def test_what_the_joint_does_already_is_told():
    with pytest.raises(JodaError, match="in simulation it stays fully open already"):
        answer("refrigerator", "It does not stay open.")


@pytest.mark.parametrize("text", ["asdf qwer", "I do not like it.", "make it blue"])
def test_what_is_not_understood_is_told_with_examples(text):
    with pytest.raises(JodaError) as error:
        answer("refrigerator", text)
    assert text in str(error.value)
    assert "'the final closing pull is too strong'" in str(error.value)
    assert "'it slams'" in str(error.value)


def test_a_complaint_about_what_is_not_there_is_told():
    with pytest.raises(JodaError, match=r"no conservative effect there; it has: .*friction"):
        answer("laptop", "The detents are too strong.")


def test_the_same_complaint_gets_the_same_bytes():
    first, second = (answer("oven", "it slams").to_json() for _ in range(2))
    assert first == second


def test_the_loop_goes_on_from_a_complaint_until_nothing_lacks():
    """A complaint that costs a wish is made up for where strengths allow it."""
    done = own("oven")
    task = Task(done.context, read_templates())
    last = turn(done.context, done.last.proposal, complaint="the springs are too strong")
    turns = [*done.turns[:-1], last]
    for _ in range(3):
        revised = Offline().propose(task, turns).proposal
        if revised is None:
            break
        turns.append(turn(done.context, revised))
    assert revised is None
    assert turns[-1].unmet == []
