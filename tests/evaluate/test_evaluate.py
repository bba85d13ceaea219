"""Evaluation: who must succeed succeeds, who must fail fails, and a run that was cut short goes on."""

import importlib
import json
import sys
import tempfile

import helpers
import pytest

from scengen import cli
from scengen.errors import BadConfig
from scengen.evaluate import scenarios
from scengen.evaluate.comparison import PolicyResult
from scengen.evaluate.rollouts import Evaluation, evaluate
from scengen.evaluate.settings import EvaluateSettings
from scengen.evaluate.table import table
from scengen.tasks.domino_single import DominoSingle

REFERENCE = str(helpers.REFERENCE)


def run(folder, policy, **changes):
    said = {"pool": REFERENCE, "seeds": 3, "rollouts": 1, "to": str(folder), **changes}
    return evaluate(EvaluateSettings(policy=policy, **said), lambda *_: None).episodes


@pytest.fixture
def brief(monkeypatch):
    """Episodes are lost after a second: for tests of what is done with them."""
    monkeypatch.setattr(DominoSingle, "failure", lambda self, world: "too late" if world.time > 1.0 else None)


def test_the_oracle_succeeds_and_idleness_fails(tmp_path):
    assert [e["success"] for e in run(tmp_path / "oracle", "oracle")] == [True] * 3
    assert [e["success"] for e in run(tmp_path / "idle", "idle")] == [False] * 3


@pytest.mark.parametrize("action_filter", [None, "teleop"])
def test_the_oracle_is_filtered_once(tmp_path, action_filter):
    assert [e["success"] for e in run(tmp_path, "oracle", seeds=1, action_filter=action_filter)] == [True]


def test_a_goal_has_to_last_as_in_a_certificate(tmp_path, monkeypatch):
    monkeypatch.setattr(DominoSingle, "success", lambda self, world: 0.2 < world.time < 0.7)
    monkeypatch.setattr(DominoSingle, "means", lambda self: {})
    (episode,) = run(tmp_path, "idle", seeds=1)
    assert not episode["success"] and "did not last" in episode["reason"]
    (episode,) = run(tmp_path / "at once", "idle", seeds=1, settle=False)
    assert episode["success"] and episode["seconds"] == pytest.approx(0.2, abs=0.011)


def test_actions_can_be_held(tmp_path, monkeypatch):
    """A goal that is reached between two steps of a policy ends the episode then and there."""
    monkeypatch.setattr(DominoSingle, "success", lambda self, world: world.time > 0.215)
    (episode,) = run(tmp_path, "idle", seeds=1, action_repeat=4, rules="paper")
    assert episode["success"] and episode["seconds"] == pytest.approx(1.22)


def test_random_actions_are_the_same_for_the_same_rollout_only(tmp_path):
    first = run(tmp_path / "a", "random", seeds=1, rollouts=2)
    again = run(tmp_path / "b", "random", seeds=1, rollouts=2, workers=2)
    assert first == again


@pytest.mark.parametrize("policy", ["random", "oracle", "replay"])
def test_slots_change_no_result(policy, tmp_path, monkeypatch):
    """Six episodes of unequal lengths, in batches of four and two."""
    end = lambda self, world: "too late" if world.time > 0.3 + 0.1 * self.count else None  # noqa: E731
    monkeypatch.setattr(DominoSingle, "failure", end)
    alone, together = (run(tmp_path / str(slots), policy, seeds=6, slots=slots) for slots in (1, 4))
    assert alone == together and len({e["seconds"] for e in alone}) > 1


def test_replay_never_plays_a_scenarios_own_witness(tmp_path):
    outcomes = [e["success"] for e in run(tmp_path, "replay", seeds=6)]
    assert outcomes.count(False) >= 1  # its own witness succeeds in every one of them


@pytest.mark.usefixtures("brief")
def test_a_run_cut_short_goes_on_where_it_was(tmp_path):
    whole = run(tmp_path / "whole", "idle")
    run(tmp_path / "cut", "idle", seeds=2)
    log = tmp_path / "cut" / "episodes.jsonl"
    kept = log.read_text()
    log.write_text(kept + kept.splitlines()[-1][:20])  # a kill in the middle of a line
    assert run(tmp_path / "cut", "idle") == whole
    assert log.read_bytes() == (tmp_path / "whole" / "episodes.jsonl").read_bytes()


@pytest.mark.usefixtures("brief")
def test_results_name_the_versions_of_their_tasks_and_versions_are_not_mixed(tmp_path, monkeypatch):
    argv = ["evaluate", "policy=idle", f"pool={REFERENCE}", "seeds=1", "rollouts=1", f"to={tmp_path}"]
    assert cli.run(argv) == 0
    monkeypatch.setattr(DominoSingle, "VERSION", newer := DominoSingle.VERSION + 1)
    assert cli.run(argv) == 2, "episodes of the version before are not continued"
    assert cli.run([*argv, "fresh=true"]) == 0
    identity = json.loads((tmp_path / "run.json").read_text())
    record = json.loads((tmp_path / "episodes.jsonl").read_text())
    assert identity["task_versions"] == {"domino_single": newer} and record["task_version"] == newer
    assert json.loads((tmp_path / "table.json").read_text())["task_versions"] == {"domino_single": newer}
    assert f"Versions of the tasks: domino_single {newer}." in (tmp_path / "table.md").read_text()


def test_the_table_pairs_each_split_with_training(tmp_path):
    def episode(task, split, scenario, success):
        return {
            "task": task,
            "category": "P3",
            "split": split,
            "pool": split,
            "scenario": scenario,
            "rollout": 0,
            "success": success,
            "seed": 0,
            "index": int(scenario),
        }

    lines = table(
        [episode("a", "id", str(k), True) for k in range(4)]
        + [episode("a", "far", str(k), k < 1) for k in range(4)]
        + [episode("b", "id", str(k), k < 2) for k in range(4)]
    )
    told = {(line.what, line.split): line for line in lines}
    assert told["a", "far"].difference.value == pytest.approx(-0.75)
    assert told["b", "id"].ood is None and told["b", "id"].id.value == 0.5
    assert told["a", "far"].difference.twins == 4
    assert told["all", "all"].difference.value == pytest.approx(-0.75), "task b has no other side, and weighs on none"


def test_tasks_with_many_axes_weigh_no_more_than_others():
    """Nothing is harder out of distribution; pooled, the task with nine axes would feign a drop of 13 points."""

    def episodes(task, splits, share):
        for split in splits:
            for index in range(10):
                about = {"task": task, "category": "P3", "split": split, "pool": split, "scenario": f"{split}{index}"}
                yield {**about, "rollout": 0, "success": index < 10 * share, "seed": 0, "index": index}

    hard = episodes("hard", ["id", *map(str, range(9))], 0.2)
    easy = episodes("easy", ["id", *map(str, range(4))], 0.9)
    lines = {(line.what, line.split): line for line in table([*hard, *easy])}
    assert lines["all", "all"].difference.value == 0.0 and lines["all", "all"].id.value == pytest.approx(0.55)
    assert lines["hard", "all"].ood.scenarios == 10, "scenario i of nine axes is one scenario"


def test_sides_without_twins_are_compared_unpaired():
    def episode(split, seed, index):
        about = {"task": "a", "category": "P3", "split": split, "pool": split, "scenario": f"{seed}/{index}"}
        return {**about, "rollout": 0, "success": index < 3, "seed": seed, "index": index}

    (line, *_) = table([episode("id", 0, i) for i in range(6)] + [episode("far", 1, i) for i in range(6)])
    assert line.difference.twins == 0 and line.difference.value == 0.0


@pytest.mark.usefixtures("brief")
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
        (("policy=mine.py:Policy",), "did you mean 'mine:Policy'?"),
        (("policy=mine.py",), "did you mean 'mine:FACTORY'?"),
        (("policy=math:sinus",), "math has no function or class named 'sinus'"),
        (("policy=idle", "seeds=7"), "holds 6 scenarios; pass seeds=6"),
        (("policy=idle", "rollouts=0"), "rollouts = 0; it must be at least 1"),
        (("policy=idle", "action_repeat=0"), "action_repeat = 0; it must be a whole number of control periods"),
        (("policy=oracle", "action_repeat=4"), "action_repeat = 4; policy oracle acts at 100 Hz: leave it out"),
        (("policy=idle", "observations=[rgb_cam]"), "no observation named 'rgb_cam'"),
    ],
)
def test_bad_input_is_told_in_one_line(argv, says, tmp_path, capsys):
    status = cli.run(("evaluate", f"pool={REFERENCE}", "seeds=3", f"to={tmp_path / 'out'}", *argv))
    told = capsys.readouterr().err
    assert status == 2 and says in told and told.count("\n") == 1


@pytest.mark.usefixtures("brief")
def test_results_of_other_settings_are_not_mixed(tmp_path, capsys):
    run(tmp_path / "out", "idle", seeds=1)
    argv = ("evaluate", f"pool={REFERENCE}", "policy=random", "seeds=1", f"to={tmp_path / 'out'}")
    assert cli.run(argv) == 2 and "other pools or settings" in capsys.readouterr().err


MINE = (
    "class Up:\n"
    "    def __init__(self, env): pass\n"
    "    def reset(self, *_): pass\n"
    "    def act(self, _): return [0] * 7\n"
)


@pytest.fixture
def mine(tmp_path, monkeypatch, brief):
    """A policy of one's own in the working directory, and a function that evaluates it."""
    monkeypatch.chdir(tmp_path)
    name = f"mine_{tmp_path.name}".replace("-", "_")

    def go(*more, source=MINE):
        (tmp_path / f"{name}.py").write_text(source)
        sys.modules.pop(name, None)
        importlib.invalidate_caches()
        argv = ("evaluate", f"policy={name}:Up", f"pool={REFERENCE}", "seeds=1", "rollouts=1", "to=out", *more)
        return cli.run(argv)

    return go


def test_episodes_of_another_policy_are_never_taken_for_new_ones(mine, tmp_path, capsys):
    assert mine() == 0 and "earlier run" not in capsys.readouterr().out
    assert mine("rollouts=2") == 0 and "1 of 2 episodes are from an earlier run" in capsys.readouterr().out
    changed = MINE.replace("[0] * 7", "[1] * 7")
    assert mine(source=changed) == 2
    told = capsys.readouterr().err
    assert "(code." in told and "fresh=true" in told and told.count("\n") == 1
    assert mine("version=2") == 2 and "(version)" in capsys.readouterr().err
    old = (tmp_path / "out" / "episodes.jsonl").read_bytes()
    assert mine("fresh=true", source=changed) == 0 and "earlier run" not in capsys.readouterr().out
    assert (tmp_path / "out" / "episodes-1.jsonl").read_bytes() == old
    assert mine("fresh=true", source=changed) == 0 and (tmp_path / "out" / "episodes-2.jsonl").exists()


@pytest.mark.parametrize("told", ["    version = {0!r}\n", "    def identity(self): return {0!r}\n"])
def test_a_policy_that_tells_its_version_is_bound_to_it_and_not_to_its_source(mine, told):
    assert mine(source=MINE + told.format("a")) == 0
    assert mine(source=MINE + told.format("a") + "# a remark\n") == 0
    assert mine(source=MINE + told.format("b")) == 2


@pytest.mark.parametrize(
    ("source", "says"),
    [
        ("raise RuntimeError('no GPU')\n", "its module cannot be imported (RuntimeError: no GPU, "),
        ("import nowhere_at_all\nUp = 1\n", "its module cannot be imported (ModuleNotFoundError"),
        ("def Up(env): return None\n", "its factory returned NoneType, which has no method reset and no act"),
        ("def Up(): return 1\n", "does not accept it; write `def make_policy(env)`"),
        ("class Up: pass\n", "or `def __init__(self, env)`"),
        ("def Up(env): return 1 / 0\n", "its factory fails (ZeroDivisionError"),
        (MINE.replace("return [0] * 7", "raise ValueError('odd')"), "its act on scenario"),
        (MINE.replace("[0] * 7", "'up'"), "its act on scenario"),
        (MINE.replace("[0] * 7", "[0] * 6"), "7 finite numbers"),
    ],
)
def test_a_fault_of_a_policy_is_called_one(mine, capsys, monkeypatch, tmp_path, source, says):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    assert mine(source=source) == 2
    [told] = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("evaluate ")]
    assert says in told and "unforeseen" not in told
    traces = list(tmp_path.glob("scengen-*.txt"))
    assert len(traces) == ("the fault is the policy's" in told) and all(str(t) in told for t in traces)


def test_several_policies_stand_in_one_table(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    argv = ("evaluate", "policy=[idle,oracle]", f"pool={REFERENCE}", "seeds=2", "rollouts=1", "to=out")
    assert cli.run(argv) == 0
    told = json.loads((tmp_path / "out" / "table.json").read_text())["policies"]
    assert [(each["policy"], each["table"][-1]["id"]["value"]) for each in told] == [("idle", 0.0), ("oracle", 1.0)]
    lines = (tmp_path / "out" / "table.md").read_text().splitlines()
    assert lines[0].endswith("task domino_single, n 2 x 1")
    assert "| id | idle | 0.0 [" in lines[4] and "| id | oracle | 100.0 [" in lines[5]
    (failure,) = told[0]["failures"]
    assert failure["episodes"] == 2 and failure["phase"] == "before contact" and "not reached" in failure["reason"]
    assert told[1]["failures"] == []
    assert (tmp_path / "out" / "idle" / "episodes.jsonl").exists()
    capsys.readouterr()
    assert cli.run(argv) == 0 and capsys.readouterr().out.count("2 of 2 episodes are from an earlier run") == 2


def test_a_comparison_lets_a_policy_keep_its_own_rate():
    every = EvaluateSettings(policy=["replay", "mine:Up", "ws://host:1"], action_repeat=4, observations=["a"]).several()
    assert [(one.action_repeat, one.observations) for one in every] == [(1, ["a"]), (4, ["a"]), (1, None)]
    assert [one.folder.name for one in every] == ["replay", "mine.Up", "ws.host.1"]
    with pytest.raises(BadConfig, match="name different policies"):
        EvaluateSettings(policy=["idle", "idle"]).several()


CRASHING = (
    "class Up:\n"
    "    episodes = 0\n"
    "    def __init__(self, env): pass\n"
    "    def reset(self, *_):\n"
    "        Up.episodes += 1\n"
    "        self.bad = Up.episodes == 2\n"
    "    def act(self, _):\n"
    "        if self.bad: raise RuntimeError('no GPU')\n"
    "        return [0] * 7\n"
)


TOGETHER = (
    "class Up:\n"
    "    calls = []\n"
    "    def __init__(self, env): self.env = env\n"
    "    def reset(self, *_): self.steps = 0\n"
    "    def act(self, seen): raise RuntimeError('alone')\n"
    "    @staticmethod\n"
    "    def act_all(policies, seen):\n"
    "        Up.calls.append(len(policies))\n"
    "        for policy, one in zip(policies, seen):\n"
    "            assert (one['robot0_eef_pos'] == policy.env._observe()['robot0_eef_pos']).all()\n"
    "        return [[0] * 7] * len(policies)\n"
)


def test_a_policy_can_act_for_all_slots_in_one_call(mine, tmp_path, capsys):
    assert mine("seeds=5", "slots=2", source=TOGETHER) == 0
    (calls,) = (module.Up.calls for name, module in sys.modules.items() if name.startswith("mine_test_a_policy_can"))
    assert set(calls) == {1, 2} and len((tmp_path / "out" / "episodes.jsonl").read_text().splitlines()) == 5
    wrong = TOGETHER.replace("* len(policies)", "")
    assert mine("seeds=5", "slots=2", "fresh=true", source=wrong) == 2
    assert "its act_all returns 1 actions for 2 policies" in capsys.readouterr().err
    assert mine("slots=0") == 2 and "slots = 0; it must lie in [1, 4096]" in capsys.readouterr().err


def test_a_crash_in_one_slot_leaves_the_others_alone(mine, tmp_path, capsys):
    source = CRASHING.replace("== 2", "== 5")
    assert mine("seeds=6", "slots=3", source=source) == 1
    assert "crashed in 1 of 6 episodes" in capsys.readouterr().err


DYING = (
    "import os\n"
    "class Up:\n"
    "    def __init__(self, env): self.env = env\n"
    "    def reset(self, *_): self.bad = self.env.row.index == 2\n"
    "    def act(self, _):\n"
    "        if self.bad: os._exit(3)\n"
    "        return [0] * 7\n"
)


@pytest.mark.slow
def test_a_process_that_dies_takes_one_episode_of_its_batch(mine, tmp_path, capsys):
    assert mine("seeds=4", "slots=3", "workers=2", "action_repeat=20", source=DYING) == 1
    assert "crashed in 1 of 4 episodes" in capsys.readouterr().err
    records = [json.loads(line) for line in (tmp_path / "out" / "episodes.jsonl").read_text().splitlines()]
    assert len(records) == 4 and [one["crashed"] for one in records if one["crashed"]] == [
        "the process died: it ended with 3"
    ]


def test_a_crash_of_a_policy_is_counted_beside_the_rate(mine, tmp_path, capsys):
    assert mine("seeds=3", source=CRASHING) == 1
    assert "crashed in 1 of 3 episodes, which are in no rate" in capsys.readouterr().err
    told = json.loads((tmp_path / "out" / "table.json").read_text())
    line = told["table"][-1]
    assert line["crashed"] == 1 and line["id"]["scenarios"] == 2
    assert any("RuntimeError: no GPU" in failure["reason"] for failure in told["failures"])
    assert "| crashed |" in (tmp_path / "out" / "table.md").read_text()


def test_the_papers_splits_are_training_and_the_papers_conditions(monkeypatch, tmp_path):
    paper = {"domino_single": "diagonal"}
    for split, wanted in (("id", True), ("diagonal", True), ("wide_gaps", False)):
        assert scenarios._is_wanted("domino_single", split, "paper", ()) is wanted
        assert scenarios._is_wanted("domino_single", split, "all", ())
    assert scenarios._paper_axes("domino_single", ()) == (paper["domino_single"],)
    monkeypatch.setattr(scenarios, "_is_wanted", lambda *_: False)
    with pytest.raises(BadConfig, match="these pools have none of them, but id; pass splits=all"):
        run(tmp_path, "idle", splits="paper")


def test_the_headline_compares_the_same_episodes():
    def episode(split, index, success):
        about = {"task": "a", "category": "P3", "split": split, "pool": split, "scenario": f"{split}{index}"}
        about |= {"perturbation": "none", "arm": "clean", "crashed": ""}
        return {**about, "rollout": 0, "success": success, "seed": 0, "index": index, "reason": "slow", "phase": ""}

    episodes = [episode("id", k, True) for k in range(4)] + [episode("far", k, k < 1) for k in range(4)]
    result = PolicyResult(EvaluateSettings(policy="mine"), Evaluation(episodes, 0, {}))
    assert result.headline.startswith("mine: -75.0 points [")
    assert result.headline.endswith("against the same episodes without the axis (4 twins): not significant")
    alone = PolicyResult(EvaluateSettings(policy="mine"), Evaluation(episodes[:4], 0, {}))
    assert alone.headline == ""
