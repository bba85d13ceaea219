"""Copies and pickles of worlds and environments are independent of the original, or are refused in one line."""

import copy
import gc
import pickle

import gymnasium
import numpy as np
import pytest
from helpers import REFERENCE, env_class

import scengen.envs.gym  # noqa: F401  (registers the tasks)
from scengen.envs.lerobot import LeRobotNames
from scengen.pool import Pool
from scengen.sim.world import World

PUSH = np.full(7, 0.3, np.float32)


@pytest.fixture
def env():
    made = gymnasium.make("scengen/domino_single-v2", pool=str(REFERENCE), action_filter="teleop")
    made.reset(seed=1)
    for _ in range(20):
        made.step(np.full(7, 0.2))
    yield made
    made.close()


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
def test_an_environment_and_its_copy_go_their_own_ways_with_the_same_bits(env, copied):
    twin = copied(env)
    assert twin.unwrapped.world.digest == env.unwrapped.world.digest and twin.unwrapped.row.id == env.unwrapped.row.id
    for _ in range(10):
        seen, *_ = twin.step(PUSH)
    assert env.unwrapped.world.time == pytest.approx(0.2) and twin.unwrapped.world.time == pytest.approx(0.3)
    for _ in range(10):
        own, *_ = env.step(PUSH)
    assert env.unwrapped.world.digest == twin.unwrapped.world.digest
    assert all(np.array_equal(own[name], seen[name]) for name in own)


def test_a_copy_outlives_its_original(env):
    twin = copy.deepcopy(env)
    env.unwrapped._world = None
    gc.collect()
    junk = [np.random.default_rng(0).random(200_000) for _ in range(20)]
    for _ in range(50):
        twin.step(PUSH)
    assert len(junk) == 20 and twin.unwrapped.world.time == pytest.approx(0.7)


def test_an_environment_that_was_never_reset_is_copied_too():
    made = copy.deepcopy(gymnasium.make("scengen/domino_single-v2", pool=str(REFERENCE)))
    assert made.reset(seed=2, options={"labels": True})[1]["scenario"] == Pool.open(REFERENCE).at(2).id


def test_shallow_copies_of_a_world_have_their_own_simulation():
    world = World.load(Pool.open(REFERENCE).at(0).scene_xml)
    other = copy.copy(world)
    other.step(PUSH)
    assert world.time == 0.0 and other.time == pytest.approx(0.01)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
def test_a_copy_under_lerobots_names_reads_its_own_environment(env, copied):
    named = LeRobotNames(env)
    twin = copied(named)
    seen, *_ = twin.step(PUSH)
    assert env.unwrapped.world.time == pytest.approx(0.2) and twin.unwrapped.world.time == pytest.approx(0.21)
    assert twin._max_episode_steps == named._max_episode_steps and twin._pool_env is twin.unwrapped
    assert np.array_equal(seen["agent_pos"], named.step(PUSH)[0]["agent_pos"])


def test_copies_of_vectors_of_environments_step_alone():
    envs = gymnasium.make_vec("scengen/domino_single-v2", num_envs=2, vectorization_mode="sync", pool=str(REFERENCE))
    envs.reset(seed=[0, 1])
    twins = copy.deepcopy(envs)
    twins.step(np.tile(PUSH, (2, 1)))
    assert [env.unwrapped.world.time for env in envs.envs] == [0.0, 0.0]
    assert [env.unwrapped.world.time for env in twins.envs] == pytest.approx([0.01, 0.01])


def test_robosuites_environment_refuses_copies_in_one_line():
    env = env_class("domino_single")(pool=REFERENCE, use_camera_obs=False, has_offscreen_renderer=False)
    for copied in (copy.copy, copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match="make another environment"):
            copied(env)


def test_what_holds_addresses_alone_refuses_in_one_line():
    world = World.load(Pool.open(REFERENCE).at(0).scene_xml)
    for held in (world.loop, world.arm):
        for copied in (copy.copy, copy.deepcopy, pickle.dumps):
            with pytest.raises(TypeError, match="copy the World"):
                copied(held)
