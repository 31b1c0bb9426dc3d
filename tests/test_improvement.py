"""Effects added one after the other, and two that hide each other."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from hidden_cases import read

from joda.diagnosis import improvement, pair_search
from joda.diagnosis.adding import Error, error
from joda.diagnosis.baseline import fit_baseline
from joda.diagnosis.improvement import Step, improved
from joda.diagnosis.pair_search import pairs
from joda.diagnosis.search import rank
from joda.diagnosis.split import parted
from joda.hidden import draw

BOTH = "asymmetric_friction", "constant_damping_hinge"
STAND_IN = "spring_return_to_low_end"
"""Leaves about as little by itself as the first of them."""


@pytest.fixture(scope="module")
def train():
    """Three runs of a joint that hides two effects."""
    return read(draw(492745320, BOTH[0], True, BOTH[1]))[0].changed(runs=[0, 2, 4])


@pytest.mark.long
def test_the_pair_that_explains_most_is_first(train, monkeypatch):
    monkeypatch.setattr(pair_search, "AHEAD", 2)
    told = []
    begun = fit_baseline(train)
    kept = {BOTH[0], STAND_IN}
    ranking = rank(begun, {h.effect for h in begun.hypotheses} - kept)
    found = pairs(train, replace(ranking, candidates=ranking.candidates[::-1]), told.append)
    assert tuple(one.effect for one in found[0]) == BOTH
    assert {pair[0].effect for pair in found} == kept
    assert len(told) == 2
    assert told[0].startswith("what is missing beside ")


class Joint:
    """A diagnosis and its cure that know what hides: each effect added halves the error."""

    def __init__(self, monkeypatch, hidden, refused):
        self.hidden, self.refused, self.there, self.asked = hidden, refused, [], []
        monkeypatch.setattr(improvement, "diagnosed", self.diagnosed)
        monkeypatch.setattr(improvement, "_added", self.added)
        monkeypatch.setattr(improvement, "pairs", lambda *_: [tuple(map(finding, self.hidden))])
        monkeypatch.setattr(improvement, "divided", lambda profile, effect, begin: ("", effect))
        monkeypatch.setattr(improvement, "_with", lambda parts, profile: (profile, None))
        monkeypatch.setattr(improvement, "error", lambda held: Error(1.0, 1.0))
        monkeypatch.setattr(improvement, "better_stops", lambda train, held: None)

    def diagnosed(self, without, calibrate):
        """Unexplained as a whole; of what was taken out that it is that; else adequate."""
        if isinstance(without, str):
            self.asked.append(without)
            return said("missing_effect", without)
        if len(self.there) == 0:
            return said("unexplained", *self.hidden)
        return said("adequate")

    def added(self, parts, profile, finding, most, told):
        if finding.effect in self.refused:
            return None
        self.there.append(finding.effect)
        return Step(finding, profile, Error(*[0.5 ** len(self.there)] * 2))


def finding(effect):
    return SimpleNamespace(effect=effect, probability=0.3)


def said(verdict, *effects):
    effects = [*map(finding, effects)]
    told = SimpleNamespace(
        verdict=verdict, effects=effects, corrections=(), summary="The end.", confounder=None
    )
    unexplained_by = verdict == "unexplained"
    return SimpleNamespace(
        diagnosis=told,
        candidates=effects,
        unexplained_by=unexplained_by,
        corrected=None,
        calibration=None,
    )


@pytest.mark.slow
@pytest.mark.parametrize(("refused", "there"), [((), BOTH), (BOTH[1:], BOTH[:1]), (BOTH, ())])
def test_of_the_best_pair_as_much_is_added_as_lowers_the_error(monkeypatch, train, refused, there):
    joint = Joint(monkeypatch, BOTH, refused)
    steps, why = improved(train, parted(train))
    assert tuple(step.effect for step in steps) == (None, *there)
    assert [step.error.window for step in steps] == [0.5**k for k in range(len(steps))]
    assert joint.asked == (list(there) if len(there) > 1 else [])  # each beside the other
    assert why == "The end."


@pytest.mark.slow
def test_numbers_that_lower_the_error_only_together_are_set_right():
    """A mass 2 % and a friction 22 % off: the mass alone, which most runs show first, lowers
    nothing."""
    case = draw(727895688, None, family="field")
    train, held = read(case)
    steps, _ = improved(train, parted(train))
    assert steps[-1].right
    assert {one.parameter for one in steps[-1].corrections} >= {"mass", "frictionloss"}
    right = steps[-1].right.of(held)
    before = error(held, within=False).whole
    assert error(right, steps[-1].profile, within=False).whole < 0.1 * before
