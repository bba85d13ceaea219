"""What the ledger says of axes, and the pages that are written from it."""

import json

import predictors
import pytest

from scengen import load_task
from scengen.errors import BadConfig
from scengen.evidence import ledger, measuring
from scengen.measures import figures
from scengen.ood.axis_card import FORMAT, read_card
from scengen.ood.baseline import Baseline

TASK = load_task("domino_single")


def test_each_axis_on_which_card_and_learner_disagree_is_explained():
    told = predictors.fills()["exceptions"]
    assert "not looked into" not in told
    listed = {tuple(line.split(" | ")[:2]) for line in told.splitlines() if line.startswith("| ")}
    listed -= {("| task", "axis"), ("| ---", "---")}
    explained = {(f"| {task}", axis) for task, axis in predictors.EXCEPTIONS}
    cards = {(f"| {task}", axis) for task, axis in predictors.EXCEPTIONS if axis in figures.cards(task)}
    assert cards <= listed <= explained, "an explanation may wait for a card"


def found(name, training, here, of=8):
    return Baseline.of(name, "moved within training", [(i < training, i < here) for i in range(of)])


@pytest.fixture
def empty(tmp_path, monkeypatch):
    """A ledger without rows."""
    monkeypatch.setattr(ledger, "folder_of", lambda task: tmp_path)


def test_the_measurement_with_more_twins_counts(empty):
    for kind, of in (("axis", 20), ("belief", 8)):
        value = {"baselines": [found("belief", 5, 2, of).record]}
        measuring.keep(TASK, "diagonal", kind, of, value, {"n": of})
    assert figures.baselines(TASK)["diagonal"]["belief"].twins == 20


def learned(policy, split, solved, seed=0, first=0):
    """Store the row of a policy that solved the first scenarios of ten."""
    outcomes = [[first + i, i < solved] for i in range(10)]
    measuring.keep(TASK, split, "baseline", 10, {"outcomes": outcomes}, {"policy": policy, "seed": seed})


def test_the_learner_is_the_policy_that_works_best_in_training(empty):
    for policy, *both in (("knn", 5, 0), ("mip", 9, 2), ("bc", 9, 1)):
        for split, solved in zip(("id", "diagonal"), both, strict=True):
            learned(policy, split, solved)
    best = figures.learners(TASK)["diagonal"]
    assert (best.name, best.twins, best.finding) == ("bc", 10, "breaks"), "of equals, the first one"


def test_a_learner_that_has_played_no_twins_is_not_paired(empty):
    learned("bc", "id", 9)
    learned("bc", "diagonal", 1, first=10)
    apart = figures.learners(TASK)["diagonal"]
    assert apart.twins == 0 and apart.excess.value == pytest.approx(0.8)
    assert figures.baseline_cell(apart).endswith("unpaired")


def test_a_learner_is_judged_by_all_its_trainings(empty):
    for seed, solved in enumerate((0, 3, 6)):
        learned("bc", "id", 9, seed)
        learned("bc", "diagonal", solved, seed)
    best = figures.learners(TASK)["diagonal"]
    assert (best.twins, best.training.value, best.here.value) == (10, 0.9, pytest.approx(0.3))
    assert best.here.rollouts == 30, "clusters of three"


def test_a_card_of_an_earlier_format_is_told_with_the_remedy(tmp_path):
    path = tmp_path / "card.json"
    path.write_text(json.dumps({"task": "domino_single", "axis": "diagonal", "baselines": []}))
    with pytest.raises(
        BadConfig, match=r"format 1; .* scengen axis card task=domino_single axis=diagonal writes it again"
    ):
        read_card(path)
    path.write_text(json.dumps({"format": FORMAT, "task": "domino_single", "axis": "diagonal"}))
    assert read_card(path)["axis"] == "diagonal"
    for damaged in ("{", "[]", '{"format": 2}'):
        path.write_text(damaged)
        with pytest.raises(BadConfig, match="not the card of an axis"):
            read_card(path)


LEARNERS = {broken: found("bc", 8, 0 if broken else 8) for broken in (True, False)}


def trial(k, broken):
    return predictors.Trial("task", f"axis_{k}", LEARNERS[broken], (), {"belief": k / 100, "replay": 0.5})


def test_the_best_predictor_orders_axes_as_the_learner_does_and_few_axes_decide_nothing(monkeypatch):
    for count, best in ((predictors.MIN_AXES, ["belief"]), (predictors.MIN_AXES - 1, [])):
        monkeypatch.setattr(predictors, "_trials", lambda n=count: [trial(k, k >= n // 2) for k in range(n)])
        predictors.ranking.cache_clear()
        assert predictors.ranking()[:1] == best
        assert predictors.score("belief").auc == 1.0 and predictors.score("belief").correlation > 0.8
        assert predictors.score("replay").correlation is None, "the same everywhere"
        assert ("not decided" in predictors.sentence()) == (not best)
        assert predictors.cell(TASK.name, {"belief": LEARNERS[True]}).endswith("belief predicts: breaks") == bool(best)
        unknown = predictors.cell(TASK.name, {"nearest_belief": LEARNERS[True]})
        assert unknown == f"not measured on version {TASK.version}", "not known on enough axes"
    predictors.ranking.cache_clear()


def test_the_interval_of_a_rank_correlation_is_that_of_bonett_and_wright():
    """Correlation 0.5 of 60 axes: atanh(0.5) -+ 1.96 sqrt((1 + 0.125) / 57), transformed back."""
    assert predictors.Score(60, 0.5, None).interval == pytest.approx((0.267, 0.678), abs=1e-3)
