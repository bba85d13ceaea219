"""Perturbations, arms and interactions: what the tables say of them is what was played."""

import json

import numpy as np
import pytest
from helpers import REFERENCE

from scengen import cli
from scengen.evaluate import benign
from scengen.evaluate.arms import seen_by, wrong_instruction
from scengen.evaluate.comparison import Comparison, PolicyResult
from scengen.evaluate.conditions import condition_lines, factors, interactions
from scengen.evaluate.latex import latex
from scengen.evaluate.lines import read_lines
from scengen.evaluate.rollouts import Evaluation
from scengen.evaluate.settings import EvaluateSettings
from scengen.evaluate.statistics import contrast, difference, paired, rate, smallest_visible_drop
from scengen.perturb.language import Words
from scengen.pool import Pool
from scengen.tasks.domino_single import DominoSingle

LISTENER = """
class Listener:
    def __init__(self, env): self.env = env
    def reset(self, observation, info, seed):
        said = self.env.task_description
        self.action = [0, 0, USED * ("red slab" in said), 0, 0, 0, -1]
    def act(self, observation): return self.action
"""


def episode(task="a", split="id", index=0, success=True, perturbation="none", arm="clean", **more):
    about = {"task": task, "category": {"a": "P1", "b": "P1", "c": "P2"}[task], "split": split, "pool": split}
    about |= {"scenario": f"{split}{index}", "rollout": 0, "seed": 0, "index": index, "crashed": "", "lacks": ""}
    said = {"reason": "" if success else "slow", "phase": "", "actions_sha256": f"{split}{index}{arm}{perturbation}"}
    return {**about, **said, "success": success, "perturbation": perturbation, "arm": arm, **more}


def result(episodes, **settings):
    return PolicyResult(EvaluateSettings(policy="mine", **settings), Evaluation(episodes, 0, {}))


def cells(solved, n=10, **about):
    """Episodes of a cell, of which the first ones are solved."""
    return [episode(index=k, success=k < solved, **about) for k in range(n)]


def test_an_interaction_is_what_two_factors_do_beyond_their_sum():
    played = [*cells(20, 20), *cells(18, 20, split="far"), *cells(18, 20, perturbation="noise@1")]
    (found,) = interactions([*played, *cells(2, 20, split="far", perturbation="noise@1")])
    assert (found.one, found.other, found.rates) == ("far", "noise@1", (0.1, 0.9, 0.9, 1.0))
    assert found.difference.value == pytest.approx(-0.7) and found.difference.high < 0 and found.difference.twins == 20
    assert str(found).startswith("a, far and noise@1: worse together than the sum by 70 points [")
    (additive,) = interactions([*played, *cells(16, 20, split="far", perturbation="noise@1")])
    assert additive.difference.value == pytest.approx(0.0) and "no interaction is seen: +0 points [" in str(additive)
    assert not interactions(played), "one of the four cells is missing"
    (axes,) = interactions([*cells(10), *cells(5, split="x"), *cells(5, split="y@2"), *cells(0, split="x+y@2")])
    assert (axes.one, axes.other) == ("x", "y@2") and factors("x+y@2", "noise@1") == {"x", "y@2", "noise@1"}


def test_a_contrast_of_two_sides_is_a_paired_difference_and_of_equal_sides_nothing():
    rng = np.random.default_rng(0)
    a, b = ([[bool(x)] for x in rng.random(20) < p] for p in (0.4, 0.8))
    assert contrast([a, b], (1, -1)) == paired(a, b)
    assert contrast([b, a], (1, -1)).low == pytest.approx(-paired(a, b).high)
    four = contrast([a, a, b, b], (1, -1, -1, 1))
    assert four.value == 0.0 and four.low == pytest.approx(-four.high) and four.high < 0.1, "a side cancels itself"
    with pytest.raises(ValueError, match="20 and 3 scenarios; twins need the same number on all sides"):
        contrast([a, b[:3]], (1, -1))


@pytest.mark.parametrize(("before", "scenarios"), [(1.0, 10), (0.95, 20), (0.5, 50)])
def test_the_smallest_visible_drop_is_seen_and_the_next_smaller_one_is_not(before, scenarios):
    solved = round(before * scenarios)

    def is_seen(drop):
        sides = [rate([[k < count] for k in range(scenarios)]) for count in (solved - drop, solved)]
        return difference(*sides).high < 0

    least = round(smallest_visible_drop(before, scenarios) * scenarios)
    assert is_seen(least) and not is_seen(least - 1)
    assert smallest_visible_drop(before, 2) is None and smallest_visible_drop(0.0, scenarios) is None


def test_each_rate_is_in_one_row_with_its_number():
    """One task and one category repeat nothing; two tasks of a category have its mean, and two categories all."""
    for tasks, means in (("a", []), ("ab", ["P1"]), ("ac", ["all"]), ("abc", ["P1", "all"])):
        played = [e for task in tasks for e in (*cells(9, task=task), *cells(4, task=task, split="far"))]
        rows = result(played).rows
        assert list(dict.fromkeys(row.task for row in rows)) == [*tasks, *means]
        keys = [(row.task, row.split, row.condition) for row in rows]
        assert len({*keys}) == len(keys) and {row.cells()[3] for row in rows} <= {"10 x 1", "20 x 1", "30 x 1"}
    (shown,) = Comparison([result(cells(9) + cells(4, split="far"))]).tables()
    assert shown.head == ["split", "success", "to training"] and shown.common["task"] == "a"
    assert shown.common["n"] == "10 x 1" and [row[0] for row in shown.cells] == ["id", "far"]
    assert {row.cells()[3] for row in result(cells(9) + cells(4, split="far")).rows} == {"10 x 1"}


@pytest.mark.parametrize(("solved", "star"), [(0, "*"), (8, ""), (10, "")])
def test_a_change_is_marked_exactly_if_its_interval_excludes_0(solved, star):
    """In the tables for people and in LaTeX, with a line that explains the mark."""
    compared = Comparison([result([*cells(10), *cells(solved, split="far"), *cells(solved, perturbation="noise@1")])])
    splits, conditions = compared.tables()
    assert splits.head[-1] == "to training" and conditions.head[-1] == "to clean", "a title for each meaning"
    for shown, row in ((splits, 1), (conditions, 0)):
        assert shown.cells[row][-1].startswith(f"{10 * solved - 100:+d}{star} [")
        assert any("excludes 0" in line for line in shown.legend) == bool(star)
        assert any(line.startswith(f"{shown.head[-1]}: ") for line in shown.legend)
    assert latex(compared.rows, compared.category).count("^{*}") == (3 if star else 0)
    assert compared.results[0].headline.endswith(": significant" if star else ": not significant")


@pytest.mark.parametrize(
    ("n", "before", "says"),
    [
        (10, 9, "10 scenarios are enough to show drops of 50 points or more from 90 %"),
        (6, 2, "6 scenarios are too few to show any drop from 33 %, even to 0; it takes 14 or more"),
        (6, 0, "nothing succeeds in training, so that no drop can show"),
    ],
)
def test_the_output_says_which_drops_its_scenarios_can_show(n, before, says):
    assert f"mine: {says}" in result([*cells(before, n), *cells(0, n, split="far")]).sentences


def test_episodes_that_reach_the_goal_otherwise_have_a_line_that_says_so():
    (shown,) = Comparison([result([*cells(9), episode(index=10, success=False, lacks="a bridge")])]).tables()
    assert shown.head[-1] == "otherwise" and shown.cells[0][-1] == "1"
    assert "otherwise: episodes that reached the goal, but lack a means of the task (listed below)" in shown.legend


def test_conditions_are_compared_with_the_same_clean_episodes():
    blind = cells(2, arm="blind", actions_sha256="black")
    same = [{**e, "arm": "wrong"} for e in cells(9)]
    found = result([*cells(9), *blind, *same])
    lines = {line.condition: line for line in condition_lines(found.evaluation.episodes)}
    assert lines["blind"].difference.value == pytest.approx(-0.7) and lines["blind"].same_actions == 0
    assert lines["wrong"].same_actions == 10 and len(found.lines) == 1, "arms are in no line of the paper's table"
    told = list(found.sentences)
    assert (
        "mine: a, id: the instruction ignored, every action is the same: the instruction of another task 9 of 10, "
        "clean 9 of 10" in told
    )
    assert any(line.startswith("mine: a, id: pictures used, without it -70 [") for line in told)


def test_latex_has_a_row_for_each_row_and_no_bare_command():
    compared = Comparison([result(cells(9) + cells(4, split="far_out") + cells(2, perturbation="noise@1"))])
    text = latex(compared.rows, compared.category)
    assert text.count(r"\begin{table}") == text.count(r"\end{table}") == 3 and r"far\_out" in text
    assert text.count(r"$\times$") == len(compared.rows) == 3 and "far_out" not in text.replace(r"far\_out", "")


def test_arms_change_what_is_seen_and_said_and_nothing_else():
    row = Pool.open(REFERENCE).at(0)
    said = {wrong_instruction(row) for row in Pool.open(REFERENCE).rows()}
    assert row.instruction not in said and len(said) > 1 and wrong_instruction(row) == wrong_instruction(row)
    seen = {"rgb_cam": np.full((2, 2, 3), 9, np.uint8), "pose": np.ones(3)}
    assert not seen_by("blind", seen, ["rgb_cam"])["rgb_cam"].any() and seen["rgb_cam"].all()
    assert all(seen_by(arm, seen, ["rgb_cam"])["rgb_cam"].all() for arm in ("clean", "wrong"))


@pytest.mark.parametrize(("used", "told"), [(0, "ignored, every action is the same"), (1, "no use of the instruction")])
def test_a_policy_that_reads_the_instruction_also_gets_a_wrong_one(tmp_path, monkeypatch, capsys, used, told):
    monkeypatch.setattr(DominoSingle, "failure", lambda self, world: "too late" if world.time > 0.3 else None)
    name = f"listener{used}"
    (tmp_path / f"{name}.py").write_text(LISTENER.replace("USED", str(used)))
    monkeypatch.chdir(tmp_path)
    words = ("evaluate", f"policy={name}:Listener", f"pool={REFERENCE}", "seeds=2", "rollouts=1", "to=out")
    assert cli.run([*words, "arms=none"]) == 0 and cli.run(words) == 0
    lines = read_lines(tmp_path / "out" / "episodes.jsonl")
    assert [line["arm"] for line in lines] == ["clean"] * 2 + ["wrong"] * 2
    assert all(line["instruction_read"] for line in lines) and lines[0]["instruction"] != lines[2]["instruction"]
    assert (lines[0]["actions_sha256"] == lines[2]["actions_sha256"]) == (not used)
    assert told in capsys.readouterr().out
    assert cli.run(["verify", "results=out", "level=full"]) == 0
    assert json.loads((tmp_path / "out" / "table.json").read_text())["arms"] == ["wrong"]


def test_an_arm_has_another_wording_and_an_unknown_one_is_refused(tmp_path, capsys):
    words = ("evaluate", "policy=idle", f"pool={REFERENCE}", "seeds=1", "rollouts=1", f"to={tmp_path / 'out'}")
    assert cli.run([*words, "arms=blnd"]) == 2 and "did you mean 'blind'" in capsys.readouterr().err
    assert cli.run([*words, "arms=reworded", "action_repeat=100"]) == 0
    clean, reworded = read_lines(tmp_path / "out" / "episodes.jsonl")
    assert reworded["instruction"] in Words.of("domino_single", clean["instruction"]).wordings["reworded"]


def test_fresh_training_scenarios_are_an_arm_that_is_verified_too(tmp_path, capsys):
    words = ("evaluate", "policy=idle", f"pool={REFERENCE}", "seeds=1", "rollouts=1", f"to={tmp_path}", "arms=benign")
    assert cli.run([*words, "action_repeat=100"]) == 0
    clean, fresh = read_lines(tmp_path / "episodes.jsonl")
    assert (clean["arm"], fresh["arm"], fresh["seed"], fresh["split"]) == ("clean", "benign", benign.SEED, "id")
    assert "fresh training scenarios 0 of 1, clean 0 of 1" in capsys.readouterr().out
    assert cli.run(["verify", f"results={tmp_path}", "level=full"]) == 0
