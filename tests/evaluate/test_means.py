"""Solved, but how: a success that lacks a mean of its task says so in environments, copies, records and tables."""

import copy
import json

import numpy as np
import pytest
from helpers import REFERENCE

from scengen import cli
from scengen.compose import load_task
from scengen.envs.gym import PoolEnv
from scengen.envs.vector import PoolVectorEnv
from scengen.episode import Episode
from scengen.means import once, throughout, when
from scengen.params import values, with_values
from scengen.pool import Pool
from scengen.sim.world import World
from scengen.tasks.domino_single import DominoSingle
from scengen.validate.rollout import replay, run

STRUCK = "each tile struck the next"
POLICY = """
class LastTile:
    def __init__(self, env): self.env = env
    def reset(self, observation, info, seed):
        world, scenario = self.env.world, self.env.task.scenario(self.env.row.params)
        self.plan = scenario.topple(world, scenario.count - 1 if self.env.row.index else 0)
    def act(self, observation): return next(self.plan, self.env.world.idle)
"""


@pytest.fixture(scope="module")
def row():
    return Pool.open(REFERENCE).at(0)


def scenario_of(row, family=None):
    return with_values(family or DominoSingle(), values(load_task("domino_single").scenario(row.params)))


def last_tile(scenario, world):
    return lambda world: scenario.topple(world, scenario.count - 1)


def test_a_witness_is_by_the_means_and_a_way_around_is_not(row):
    scenario, world = scenario_of(row), World.load(row.scene_xml)
    assert replay(scenario, world, row.witness, row.horizon).lacks == ""
    found = run(scenario, world, last_tile(scenario, world), row.horizon, rules="paper")
    strictly = run(scenario, world, last_tile(scenario, world), row.horizon)
    assert (strictly.outcome, strictly.reason, strictly.lacks) == ("failure", found.reason, found.lacks)
    assert found.reason == f"the goal was reached otherwise, it lacks: {found.lacks}"
    assert found.solved and STRUCK in found.lacks and "the robot touched the first tile alone" in found.lacks
    assert replay(scenario, world, row.witness, row.horizon).lacks == "", "a used world forgets"


class Counting(DominoSingle):
    """Means of each kind by the clock."""

    def success(self, world):
        return world.time > 0.3

    def means(self):
        return {
            "late": once(lambda world: world.time > 0.2),
            "never": once(lambda world: False),
            "on time": when(lambda world: world.time > 0.1, lambda world: world.time < 0.12),
            "too late": when(lambda world: world.time > 0.15, lambda world: world.time < 0.12),
            "always": throughout(lambda world: world.time < 1.0),
            "broken": throughout(lambda world: not 0.1 < world.time < 0.12),
            "after": once(lambda world: world.time < 0.23, after="late"),
            "after nothing": throughout(lambda world: True, after="never"),
        }


def test_each_kind_of_mean_is_judged_as_it_says(row):
    world = World.load(row.scene_xml)
    episode = Episode(scenario_of(row, Counting()), world)
    for _ in range(15):
        episode.step(world.idle.astype(np.float32))
    state, other = world.state(), copy.copy(world)
    for ahead in (world, other, world):
        if ahead.time > 0.3:
            ahead.restore(state)
        going = Episode(scenario_of(row, Counting()), ahead)
        while going.step(ahead.idle.astype(np.float32)) is None:
            pass
        assert going.outcome == "failure" and going.reason.endswith(f"it lacks: {going.lacks}")
        assert going.lacks == "never; too late; broken; after nothing"


def test_environments_say_what_a_success_lacks(row):
    env = PoolEnv("domino_single", REFERENCE, action_filter="teleop", rules="paper")
    _, info = env.reset(options={"scenario": row.id})
    assert info["lacks"] == ""
    envs = PoolVectorEnv("domino_single", REFERENCE, 1, action_filter="teleop", rules="paper")
    envs.reset(options={"scenario": row.id})
    plan, over = scenario_of(row).topple(env.world, scenario_of(row).count - 1), False
    while not over:
        action = next(plan, env.world.idle)
        _, _, over, _, info = env.step(action)
        *_, infos = envs.step(action[None])
    assert info["success"] and STRUCK in info["lacks"] and infos["lacks"][0] == info["lacks"]


def test_evaluate_counts_successes_by_the_means(tmp_path, monkeypatch, capsys):
    (tmp_path / "lasttile.py").write_text(POLICY)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    said = ("policy=lasttile:LastTile", f"pool={REFERENCE}", "seeds=3", "rollouts=1", "rules=paper", "to=out")
    assert cli.run(("evaluate", *said, "action_filter=teleop")) == 0
    shown = capsys.readouterr().out
    assert "lasttile:LastTile: the goal was reached in 3 of 3 episodes, in 1 by the means" in shown
    (way, *_) = json.loads((tmp_path / "out" / "table.json").read_text())["otherwise"]
    assert STRUCK in way["lacks"] and way["episodes"] == 2
    assert "| lacks |" in (tmp_path / "out" / "table.md").read_text()
