"""Questions that need a look: every task has one, and who sees nothing gains nothing from what training is like."""

import pytest
from sheets import STATED

from scengen import load_task
from scengen.agents.facts import load
from scengen.agents.priors import Prior, answers, priors, share
from scengen.agents.tables import sight_lines
from scengen.evidence import ledger
from scengen.measures.understanding import most_excess

MOST = 0.6
"""Largest share of training in which the best fixed answer to the best question of a task may be right."""
MEASURED = {name: row.value for name in STATED for row in ledger.latest("prior", name).values()}


@pytest.mark.parametrize("name", STATED)
def test_every_task_asks_something_that_nobody_knows_without_a_look(name):
    measured = MEASURED[name]
    assert min(prior for prior, _ in measured.values()) <= MOST
    visible = {id_ for id_, question in load(load_task(name)).facts.items() if not question.right}
    assert set(measured) <= visible, "run scengen measure kind=prior again"


def test_nobody_gains_by_what_training_is_like():
    excess = [share - prior for of in MEASURED.values() for prior, share in of.values()]
    assert sum(excess) / len(excess) <= 0.0 and max(excess) <= most_excess(300)


@pytest.mark.parametrize("name", ["domino_single", "packing"])
def test_the_best_fixed_answer_is_as_good_on_other_draws_of_training(name):
    task, sheet = load_task(name), load(load_task(name))
    others = answers(task, sheet, 150, seed=0)
    varied = {id_: prior for id_, prior in priors(task, sheet, 150).items() if prior.share < 1.0}
    assert varied, "some answers differ in training"
    for id_, prior in varied.items():
        found = share(prior.answer, others[id_], sheet.facts[id_].within)
        assert found <= prior.share + 0.15, "three standard errors of a difference of two shares of 150"


def result(task, grades, split="id", index=0):
    about = {"task": task, "category": "P1", "split": split, "seed": 0, "index": index}
    return {**about, "stage": 1, "grades": grades}


KNOWN = {
    "a": {"x": Prior(("left",), 0.5), "y": Prior(0.1, 0.7), "z": Prior(("no",), 1.0)},
    "b": {"z": Prior(("no",), 1.0)},
}


def test_nothing_but_priors_is_zero_all_right_is_one_and_what_never_changes_does_not_count():
    right, wrong = {"x": "right", "y": "right", "z": "wrong"}, {"x": "wrong", "y": "wrong", "z": "right"}
    lines, unseen = sight_lines([result("a", right), result("b", {"z": "right"})], KNOWN)
    assert unseen == ["b"] and [line.id.value for line in lines] == [1.0, 1.0, 1.0] and lines[-1].what == "all"
    answers = [
        result("a", {"x": "right" if i < 5 else "wrong", "y": "right" if i < 7 else "wrong"}, index=i)
        for i in range(10)
    ]
    assert sight_lines(answers, KNOWN)[0][0].id.value == pytest.approx(0.0)
    lines, _ = sight_lines([result("a", right), result("a", wrong, split="far")], KNOWN)
    assert lines[0].ood.value == pytest.approx(-0.6 / 0.4), "the answers of training no longer hold"
