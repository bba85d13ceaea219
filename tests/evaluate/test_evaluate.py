"""Evaluation: who must succeed succeeds, who must fail fails, and a run that was cut short goes on."""

import json

import helpers
import pytest

from scengen import cli
from scengen.evaluate.rollouts import Settings, evaluate, table

REFERENCE = str(helpers.REFERENCE)


def run(folder, policy, **changes):
    said = {"pool": REFERENCE, "seeds": 3, "rollouts": 1, "to": str(folder), **changes}
    return evaluate(Settings(policy=policy, **said), lambda *_: None).episodes


def test_the_oracle_succeeds_and_idleness_fails(tmp_path):
    assert [e["success"] for e in run(tmp_path / "oracle", "oracle")] == [True] * 3
    assert [e["success"] for e in run(tmp_path / "idle", "idle")] == [False] * 3


def test_random_actions_are_the_same_for_the_same_rollout_only(tmp_path):
    first = run(tmp_path / "a", "random", seeds=1, rollouts=2)
    again = run(tmp_path / "b", "random", seeds=1, rollouts=2, workers=2)
    assert first == again


def test_replay_never_plays_a_scenarios_own_witness(tmp_path):
    outcomes = [e["success"] for e in run(tmp_path, "replay", seeds=6)]
    assert outcomes.count(False) >= 1  # its own witness succeeds in every one of them


def test_a_run_cut_short_goes_on_where_it_was(tmp_path):
    whole = run(tmp_path / "whole", "idle")
    run(tmp_path / "cut", "idle", seeds=2)
    log = tmp_path / "cut" / "episodes.jsonl"
    kept = log.read_text()
    log.write_text(kept + kept.splitlines()[-1][:20])  # a kill in the middle of a line
    assert run(tmp_path / "cut", "idle") == whole
    assert log.read_text().startswith(kept) and len(log.read_text().splitlines()) == 1 + 3


def test_the_table_pairs_each_split_with_training(tmp_path):
    def episode(task, split, scenario, success):
        return {
            **{"task": task, "category": "P3", "split": split, "pool": split, "scenario": scenario},
            **{"rollout": 0, "success": success},
        }

    lines = table(
        [episode("a", "id", str(k), True) for k in range(4)]
        + [episode("a", "far", str(k), k < 1) for k in range(4)]
        + [episode("b", "id", str(k), k < 2) for k in range(4)]
    )
    told = {(line.what, line.split): line for line in lines}
    assert told["a", "far"].difference.value == pytest.approx(-0.75)
    assert told["b", "id"].ood is None and told["b", "id"].id.value == 0.5
    assert told["P3", "all"].id.value == 0.75 and told["all", "all"].ood.value == 0.25


def test_a_policy_of_ones_own_is_found_in_the_working_directory(tmp_path, monkeypatch, capsys):
    (tmp_path / "mine.py").write_text(
        "class Up:\n"
        "    def __init__(self, env): self.task = env.task.name\n"
        "    def reset(self, observation, info, seed): assert 'robot0_eef_pos' in observation\n"
        "    def act(self, observation): return [0, 0, 1, 0, 0, 0, -1]\n"
        "class Nan(Up):\n"
        "    def act(self, observation): return [float('nan')] * 7\n"
    )
    monkeypatch.chdir(tmp_path)
    settings = (f"pool={REFERENCE}", "seeds=1", "rollouts=1")
    assert cli.run(("evaluate", "policy=mine:Up", *settings, "to=up")) == 0
    assert json.loads((tmp_path / "up" / "table.json").read_text())["table"][0]["id"]["value"] == 0.0
    assert "domino_single" in (tmp_path / "up" / "table.md").read_text()
    assert cli.run(("evaluate", "policy=mine:Nan", *settings, "to=nan")) == 2
    assert "7 finite numbers" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("argv", "says"),
    [
        (("policy=orakel",), "did you mean 'oracle'"),
        (("policy=nowhere:Policy",), "there is no module 'nowhere'"),
        (("policy=math:sinus",), "math has no function or class named 'sinus'"),
        (("policy=idle", "seeds=7"), "holds 6 scenarios; say seeds=6"),
        (("policy=idle", "rollouts=0"), "rollouts = 0; it must be at least 1"),
        (("policy=idle", "observations=[rgb_cam]"), "no observation named 'rgb_cam'"),
    ],
)
def test_bad_input_is_told_in_one_line(argv, says, tmp_path, capsys):
    status = cli.run(("evaluate", f"pool={REFERENCE}", "seeds=3", f"to={tmp_path / 'out'}", *argv))
    told = capsys.readouterr().err
    assert status == 2 and says in told and told.count("\n") == 1


def test_results_of_other_settings_are_not_mixed(tmp_path, capsys):
    run(tmp_path / "out", "idle", seeds=1)
    argv = ("evaluate", f"pool={REFERENCE}", "policy=random", "seeds=1", f"to={tmp_path / 'out'}")
    assert cli.run(argv) == 2 and "other pools or settings" in capsys.readouterr().err
