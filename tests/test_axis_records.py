"""Records of what was measured on the axes, and the pages that are written from them."""

import json

import all_axes
import axis_records
import baselines_page
import predictors
import pytest

from scengen import load_task
from scengen.errors import BadConfig
from scengen.ood.axis_card import FORMAT, read_card
from scengen.ood.baseline import Baseline

TASK = load_task("domino_single")


@pytest.mark.parametrize("tool", [predictors, baselines_page], ids=lambda tool: tool.__name__)
def test_the_pages_about_learners_are_up_to_date(tool):
    assert (axis_records.ROOT / tool.PAGE).read_text() == tool.page(), f"run python tools/{tool.__name__}.py"


def test_each_axis_on_which_card_and_learner_disagree_is_explained():
    told = predictors.page().partition("## Exceptions")[2]
    assert "not looked into" not in told
    listed = {tuple(line.split(" | ")[:2]) for line in told.splitlines() if line.startswith("| ")}
    assert {(f"| {task}", axis) for task, axis in predictors.EXCEPTIONS} == listed - {("| task", "axis")}


def found(name, training, here, of=8):
    return Baseline.of(name, "moved within training", [(i < training, i < here) for i in range(of)])


def test_a_record_counts_until_its_axis_is_changed(tmp_path):
    for axis in ("wide_gaps", "diagonal"):
        axis_records.store(tmp_path, TASK, axis, {"n": 8, "baselines": [found("belief", 8, 2).record]})
    lines = axis_records.lines(tmp_path / "domino_single.jsonl")
    assert [line["axis"] for line in lines] == ["diagonal", "wide_gaps"], "in the order of the task's file"
    wider = {name: f"{spelled} or wider" for name, spelled in lines[1]["shifts"].items()}
    (tmp_path / "domino_single.jsonl").write_text(
        "".join(json.dumps(line) + "\n" for line in (lines[0], {**lines[1], "shifts": wider}))
    )
    assert list(axis_records.read(tmp_path, TASK)) == ["diagonal"]


def test_the_measurement_with_more_twins_counts(tmp_path, monkeypatch):
    for name, of in (("CARDS", 20), ("BELIEFS", 8)):
        monkeypatch.setattr(axis_records, name, tmp_path / name)
        axis_records.store(tmp_path / name, TASK, "diagonal", {"baselines": [found("belief", 5, 2, of).record]})
    assert axis_records.baselines(TASK)["diagonal"]["belief"].twins == 20


def learned(policy, split, solved, seed=0, first=0):
    """The record of a policy that solved the first scenarios of ten."""
    moved = {} if split == "id" else axis_records.shifts(TASK, split)
    outcomes = [[first + i, i < solved] for i in range(10)]
    return {"policy": policy, "seed": seed, "split": split, "shifts": moved, "outcomes": outcomes}


def test_the_learner_is_the_policy_that_works_best_in_training_and_paired_by_twins(tmp_path, monkeypatch):
    def learner(*records):
        (tmp_path / "domino_single.jsonl").write_text("".join(json.dumps(record) + "\n" for record in records))
        return axis_records.learners(TASK)["diagonal"]

    monkeypatch.setattr(axis_records, "LEARNED", tmp_path)
    records = [
        learned(policy, split, solved)
        for policy, *both in (("knn", 5, 0), ("mip", 9, 2), ("bc", 9, 1))
        for split, solved in zip(("id", "diagonal"), both, strict=True)
    ]
    best = learner(*records)
    assert (best.name, best.twins, best.finding) == ("bc", 10, "breaks"), "of equals, the first one"
    apart = learner(learned("bc", "id", 9), learned("bc", "diagonal", 1, first=10))
    assert apart.twins == 0 and apart.excess.value == pytest.approx(0.8)
    assert all_axes._baseline(apart).endswith("unpaired")


def test_a_learner_is_judged_by_all_its_trainings(tmp_path, monkeypatch):
    monkeypatch.setattr(axis_records, "LEARNED", tmp_path)
    records = [learned("bc", split, 9 if split == "id" else solved, seed)
               for seed, solved in enumerate((0, 3, 6)) for split in ("id", "diagonal")]  # fmt: skip
    (tmp_path / "domino_single.jsonl").write_text("".join(json.dumps(record) + "\n" for record in records))
    best = axis_records.learners(TASK)["diagonal"]
    assert (best.twins, best.training.value, best.here.value) == (10, 0.9, pytest.approx(0.3))
    assert best.here.rollouts == 30, "clusters of three"


def test_a_card_of_an_earlier_format_is_told_with_the_remedy(tmp_path):
    path = tmp_path / "card.json"
    path.write_text(json.dumps({"task": "domino_single", "axis": "diagonal", "baselines": []}))
    with pytest.raises(BadConfig, match=r"format 1; .* scengen probe task=domino_single axis=diagonal writes it again"):
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
        assert predictors.cell({"belief": LEARNERS[True]}).endswith("belief predicts: breaks") == bool(best)
        assert predictors.cell({"nearest_belief": LEARNERS[True]}) == "not measured", "not known on enough axes"
    predictors.ranking.cache_clear()


def test_the_interval_of_a_rank_correlation_is_that_of_bonett_and_wright():
    """Correlation 0.5 of 60 axes: atanh(0.5) -+ 1.96 sqrt((1 + 0.125) / 57), transformed back."""
    assert predictors.Score(60, 0.5, None).interval == pytest.approx((0.267, 0.678), abs=1e-3)
