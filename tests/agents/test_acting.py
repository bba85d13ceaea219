"""Stage 3: primitives solve tasks through the filter and the controller, and what cannot be carried out is told."""

import json
import re
from pathlib import Path
from types import SimpleNamespace

import by_hand
import numpy as np
import pytest
from helpers import REFERENCE, certified_here

from scengen import cli
from scengen.agents import runner
from scengen.agents.models import Call, Reply
from scengen.agents.primitives import BadCall, primitive, tools
from scengen.agents.runner import AgentSettings, run
from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig
from scengen.evaluate.lines import read_lines
from scengen.perturb.language import Words

BASE = Path(__file__).parents[1] / "checker" / "base"
"""Stored pools of the checker, with one scenario each."""


def played(folder, monkeypatch, model, seeds=1, mode="poses", pool=REFERENCE, **changes):
    monkeypatch.setattr(runner, "made", lambda name: model)
    settings = AgentSettings(
        model="my:model", pool=str(pool), stage=3, seeds=seeds, pictures=False, mode=mode, to=str(folder), **changes
    )
    return run(settings, lambda *_: None).results


class Scripted:
    """A model that goes through a list of calls and keeps the prompts."""

    def __init__(self, *calls):
        self.calls, self.prompts = list(calls), []

    def reply(self, turns, tools, schema, temperature, seed):
        self.prompts.append(turns[-1].text)
        call = self.calls.pop(0) if self.calls else ("Done", {"reason": "over"})
        return Reply("") if call is None else Reply("", (Call(call[0], json.dumps(call[1])),))


def test_a_list_written_by_hand_from_the_poses_topples_every_chain(tmp_path, monkeypatch):
    found = played(tmp_path, monkeypatch, by_hand.Domino(), seeds=5)
    assert sum(result["grades"]["right"] for result in found) >= 3, [r["grades"]["reason"] for r in found]


def test_the_episodes_that_count_have_lines_that_verify(tmp_path, monkeypatch):
    changes = {"seeds": 2, "explore": 1, "temperatures": [0.0, 1.0]}
    for _ in range(2):  # the lines of a run that is repeated are written again
        played(tmp_path, monkeypatch, Scripted(), **changes)
        folder = tmp_path / "lines" / "domino_single"
        lines = read_lines(folder / "episodes.jsonl")
        assert [line["rollout"] for line in lines] == [0, 1, 0, 1] and all(line["instruction_read"] for line in lines)
        assert {line["reason"] for line in lines} == {"the model says that it is done"}
    assert cli.run(["verify", f"results={folder}", "level=full"]) == 0


@pytest.mark.parametrize(
    ("model", "pool"),
    [
        (by_hand.Block, "mirror_id"),
        (by_hand.Carry, "ycb_id"),
        (by_hand.Chains, "select_id"),
        (by_hand.Lip, "edge_id"),
    ],
)
def test_lists_written_by_hand_solve_tasks_from_the_poses_alone(tmp_path, monkeypatch, model, pool):
    certified_here(BASE / pool)
    (result,) = played(tmp_path, monkeypatch, model(), pool=BASE / pool)
    assert result["grades"]["right"], result["grades"]


def test_refused_calls_are_told_and_after_four_of_them_the_robot_holds(tmp_path, monkeypatch):
    model = Scripted(None, ("Fly", {}), ("Lift", {}), ("Lift", {"dz": "high"}))
    (result,) = played(tmp_path, monkeypatch, model)
    first, *again = model.prompts
    assert "was refused" not in first and len(again) == 4
    told = ("0 tools were called", "there is no tool 'Fly'", "Lift lacks dz", "Hold(ticks=50): finished")
    assert all(fault in prompt for fault, prompt in zip(told, again, strict=True))
    assert result["grades"]["refused"] == 4 and result["grades"]["seconds"] == pytest.approx(0.5)
    assert result["grades"]["reason"] == "the model says that it is done" and not result["grades"]["right"]


def test_the_memory_says_why_a_primitive_stopped_with_neutral_names(tmp_path, monkeypatch):
    model = Scripted(("CloseGripper", {}), ("Descend", {"z": 0.70}))
    played(tmp_path, monkeypatch, model)
    last = model.prompts[-1]
    assert "Descend(z=0.7): the hand stayed" in last and "touching" in last and "CloseGripper(): finished" in last
    assert "tile_" not in last and "slab" not in last.replace("red slab", "")


def test_free_trials_on_training_twins_are_remembered_and_do_not_count(tmp_path, monkeypatch):
    model = Scripted(
        ("CloseGripper", {}), ("Done", {"reason": "1"}), ("Lift", {"dz": 0.05}), ("Done", {"reason": "2"}),
        ("Done", {"reason": "3"}),
    )  # fmt: skip
    results = played(tmp_path, monkeypatch, model, seeds=3, explore=2)
    first, *_ = results
    assert [len(trial["steps"]) for trial in first["grades"]["explored"]] == [2, 2]
    assert first["grades"]["steps"] == ['Done(reason="3")'] and not first["grades"]["right"]
    start, _, second, _, counted, *_ = model.prompts
    assert "free trial 1 of 2" in start and "CloseGripper" not in start.partition("TRIALS")[2].partition("OBSERV")[0]
    assert "free trial 2 of 2" in second and "1. CloseGripper(): finished" in second
    assert "This one counts" in counted and "Lift(dz=0.05)" in counted and "the model says that it is done" in counted
    assert not [result for result in results if result["scenario"] in counted]


def test_free_trials_without_enough_training_scenarios_are_one_line(tmp_path, monkeypatch):
    with pytest.raises(BadConfig, match="explore = 3 needs as many other training scenarios of domino_single, and the"):
        played(tmp_path, monkeypatch, Scripted(), seeds=3, explore=3)
    with pytest.raises(BadConfig, match="belong to stage=3"):
        AgentSettings(model="facts", stage=2, explore=1).check()


def test_the_first_trial_is_in_the_twin_of_the_same_index(monkeypatch):
    def work(split, index, seed=0):
        row = SimpleNamespace(task="t", split=split, index=index, seed=seed, id=f"{split}{seed}{index}")
        return SimpleNamespace(task=SimpleNamespace(name="t"), row=row)

    todo = [work("id", k, seed) for k in range(4) for seed in (1, 0)]
    settings = AgentSettings(stage=3, explore=4)
    assert runner.twins(settings, todo, work("far", 2)) == ["id02", "id03", "id00", "id01"]
    assert runner.twins(settings, todo, work("id", 2)) == ["id03", "id00", "id01", "id12"]


def test_poses_are_told_only_in_their_modes(tmp_path, monkeypatch):
    prompts = {}
    for mode in ("see", "poses"):
        model = Scripted()
        played(tmp_path / mode, monkeypatch, model, mode=mode)
        (prompts[mode],) = model.prompts
    assert by_hand.poses(prompts["see"]) == {}
    things = by_hand.poses(prompts["poses"])
    position, _, size = things["red slab"]
    assert position[2] == pytest.approx(0.8, abs=0.002) and size[2] == pytest.approx(0.12, abs=0.001)


@pytest.mark.parametrize(
    ("name", "arguments", "says"),
    [
        ("MoveEEF", {"pos": [0.0, 0.0]}, "expected 3 finite numbers"),
        ("MoveEEF", {"pos": [9.0, 0.0, 1.0]}, "from the shoulder"),
        ("MoveEEF", {"pos": [-0.3, 0.0, 0.45]}, "at least 0.50 m"),
        ("MoveEEF", {"pos": [0.0, 0.0, 1.0], "quat": [0, 0, 0, 0]}, "length 0"),
        ("MoveEEF", {"pos": [0.0, 0.0, float("nan")]}, "finite"),
        ("AtomicAction", {"action": [2.0] * 7, "ticks": 5}, r"in \[-1, 1\]"),
        ("Hold", {"ticks": 0}, "from 1 to 1000"),
        ("Hold", {"ticks": True}, "whole number"),
        ("Lift", {"dz": 0.1, "speed": 3}, "no argument 'speed'"),
        ("Lift", [], "not a JSON object"),
    ],
)
def test_a_call_out_of_bounds_is_one_line(name, arguments, says):
    arm = SimpleNamespace(hand=np.array([0.0, 0.0, 1.0]), number=0)
    arm.world = SimpleNamespace(arms=[arm])
    with pytest.raises(BadCall, match=says):
        primitive(Call(name, json.dumps(arguments)), arm.world)


def test_all_eight_primitives_are_tools_and_two_arms_are_named():
    names = [tool.name for tool in tools(1)]
    paper = ["MoveEEF", "Lift", "Descend", "OpenGripper", "CloseGripper", "AtomicAction", "Hold", "Done"]
    assert names == paper
    assert "arm" in tools(2)[0].schema["required"] and "arm" not in tools(1)[0].schema["properties"]


def test_the_gripper_keeps_its_last_command():
    env = PoolEnv("domino_single", str(REFERENCE), action_filter="teleop")
    env.reset(seed=0)
    for name, given in (("CloseGripper", {}), ("Lift", {"dz": 0.05})):
        for action in primitive(Call(name, json.dumps(given)), env.world).plan():
            env.step(action)
    assert env.world.arm.grip == 1.0 and env.world.arm.gap < 0.005
    env.close()


def test_a_perturbed_robot_feels_and_remembers_with_the_same_error(tmp_path, monkeypatch):
    scripts = [("CloseGripper", {}), ("CloseGripper", {})]
    clean, biased = Scripted(*scripts), Scripted(*scripts)
    played(tmp_path / "clean", monkeypatch, clean)
    (result,) = played(tmp_path / "biased", monkeypatch, biased, perturb="proprioception_bias@5+terse@2")

    def read(prompt):
        felt, told = (
            [float(each) for each in re.search(pattern, prompt)[1].replace(",", " ").split()]
            for pattern in (r"robot0_eef_pos \[([^]]*)\]", r"hand at \(([^)]*)\)")
        )
        return np.array([felt, told])

    without, with_bias = read(clean.prompts[1]), read(biased.prompts[1])
    bias = result["about"]["perturb"]["proprioception_bias"]["bias"]
    assert np.abs(np.abs(with_bias - without) - bias).max() < 2e-3 < bias
    assert np.abs(with_bias[0] - with_bias[1]).max() < 2e-3 and np.abs(without[0] - without[1]).max() < 2e-3
    text = Words.of("domino_single", "").wordings["terse"][1]
    assert text in biased.prompts[0] and text not in clean.prompts[0]
    assert result["perturbation"] == "proprioception_bias@5+terse@2"
