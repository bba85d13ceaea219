"""LeRobot's names stand for the same readings, in the order in which recordings have them."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from helpers import REFERENCE, pictures_are_possible

from scengen.envs.gym import PoolEnv
from scengen.envs.lerobot import ROLLOUT, LeRobotNames
from scengen.envs.observations import proprioception
from scengen.errors import BadConfig

OWN = proprioception("panda_jaw")


def made(observations, **arguments):
    return PoolEnv("domino_single", REFERENCE, observations, **arguments)


def test_the_same_readings_have_lerobots_names():
    plain, env = (
        made([*OWN, "object-state", "force_torque"]),
        LeRobotNames(made([*OWN, "object-state", "force_torque"])),
    )
    check_env(env, skip_render_check=True)
    (seen, _), (named, _) = plain.reset(seed=1), env.reset(seed=1)
    assert set(named) == {"agent_pos", "environment_state", "force_torque"}
    assert (named["agent_pos"] == np.concatenate([seen[name] for name in OWN])).all()
    assert (named["environment_state"] == seen["object-state"]).all()
    names = env.metadata["names"]
    assert [len(names[name]) for name in ("agent_pos", "environment_state")] == [23, 224]
    assert names["agent_pos"][:4] == (*plain.metadata["names"]["robot0_eef_pos"], "robot0_eef_quat.x")


def test_what_was_not_asked_for_is_not_there():
    env = LeRobotNames(made(["object-state"]))
    assert set(env.reset()[0]) == set(env.observation_space) == {"environment_state"}


def test_lerobots_evaluation_finds_what_it_asks_an_environment_for():
    """A vector of environments; `call` for the time limit and the task; success under `is_success`."""
    envs = gymnasium.make_vec(
        "scengen.envs.gym:scengen/domino_single-v2",
        num_envs=2,
        vectorization_mode="sync",
        wrappers=[LeRobotNames],
        pool=REFERENCE,
        action_repeat=4,
    )
    seen, _ = envs.reset(seed=[0, 1], options={ROLLOUT: True})
    assert seen["agent_pos"].shape == (2, 23)
    assert envs.call("_max_episode_steps") == (300, 300)
    assert all("domino" in text for text in envs.call("task_description"))
    *_, info = envs.step(np.zeros((2, 7), np.float32))
    assert not info["is_success"].any() and envs.metadata["render_fps"] == 25
    envs.close()


@pytest.mark.skipif(not pictures_are_possible(), reason="no OpenGL on this machine")
def test_pictures_are_a_dictionary_of_cameras():
    env = LeRobotNames(made(["rgb_ego_cam", "rgb_gripper_cam"], width=32, height=32))
    seen, _ = env.reset(seed=0)
    assert set(seen) == {"pixels"} and set(seen["pixels"]) == {"rgb_ego_cam", "rgb_gripper_cam"}
    assert seen in env.observation_space
    env.close()


def test_other_environments_are_refused():
    with pytest.raises(BadConfig, match="cannot wrap CartPoleEnv; it wraps environments of scengen"):
        LeRobotNames(gymnasium.make("CartPole-v1"))
