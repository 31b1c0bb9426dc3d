"""The recorded answers of a model: all can be used, and the table counts what it should."""

import numpy as np
import pytest
from ablation import MODELS, OBJECTS, RUNS, TESTS, WAYS, loop, main, rows, spread

from joda import context
from joda.propose import Task
from joda.propose.replies import parse, parse_ablation
from joda.template import read_templates


@pytest.mark.parametrize("run", RUNS)
@pytest.mark.parametrize("name", OBJECTS)
def test_every_recorded_answer_can_be_used(name, run):
    task = Task(context(MODELS / f"{name}.xml", OBJECTS[name][0]), read_templates())
    for kind, reader in (("templates", lambda text: parse(text, task, ())), ("raw", None)):
        text = (TESTS / "recorded" / f"{kind}_{run}" / f"{name}.json").read_text("utf-8")
        assert (reader or (lambda text: parse_ablation(text, task)))(text) is not None


@pytest.mark.long
def test_the_table_has_every_object_and_adds_up(capsys):
    table = list(rows())
    assert [(row[0], row[1]) for row in table] == [
        (name, kind) for name in OBJECTS for kind in ("templates", "raw")
    ]
    for _, _, met, of, _, lacking in table:
        assert [of - len(missed) for missed in lacking] == met
    main()
    printed = capsys.readouterr().out
    total = sum(sum(row[2]) for row in table if row[1] == "raw")
    assert f"raw: {total} of {sum(2 * row[3] for row in table if row[1] == 'raw')}" in printed


def test_the_spread_of_two_runs_is_relative_to_the_peak():
    assert spread([np.array([0.0, 2.0]), np.array([0.0, 1.0])]) == pytest.approx(0.5 / np.sqrt(2))


def test_feedback_and_the_sum_bring_what_the_first_proposal_and_the_largest_miss():
    """The dishwasher's door: springs and a catch add up, and must carry its weight."""
    found = loop("dishwasher", "0")
    met = dict(zip(WAYS, found.met, strict=True))
    assert found.gravity and found.rounds == 2
    assert met["with feedback"] == found.of == 5
    assert met["first proposal"] < 5
    assert met["largest, not sum"] < 5


def test_what_comes_true_at_once_takes_one_round():
    found = loop("drawer", "0")
    assert (found.gravity, found.rounds, found.met) == (False, 1, (found.of,) * 3)
