"""A checkpoint of LeRobot is played by `scengen evaluate` in the same process. Needs lerobot, which the stack
`mujoco4-python3.12-lerobot` of tools/stacks.py has."""

import json
import sys
from pathlib import Path

import pytest
from helpers import REFERENCE

from scengen import cli
from scengen.envs.gym import PoolEnv
from scengen.errors import BadConfig

pytest.importorskip("lerobot")
ROOT = Path(__file__).parents[2]
POLICY = "lerobot_env_scengen.checkpoint:policy"
STREAMS = "object-state"


@pytest.fixture(scope="module")
def checkpoint(tmp_path_factory):
    """An ACT of small size after 20 batches on the witnesses of the reference pool."""
    from lerobot.scripts.lerobot_train import main

    folder = tmp_path_factory.mktemp("lerobot")
    assert cli.run(["record", f"pool={REFERENCE}", f"to={folder / 'data'}", "cameras=none"]) == 0
    small = {"dim_model": 64, "dim_feedforward": 128, "n_heads": 4, "chunk_size": 20, "n_action_steps": 20}
    settings = {
        "dataset.repo_id": "local/domino_single",
        "dataset.root": folder / "data",
        "output_dir": folder / "act",
        "policy.type": "act",
        "policy.device": "cpu",
        "policy.push_to_hub": "false",
        "wandb.enable": "false",
        "steps": 20,
        "batch_size": 2,
        "save_freq": 20,
        "num_workers": 0,
        **{f"policy.{name}": value for name, value in small.items()},
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["lerobot-train", *(f"--{name}={value}" for name, value in settings.items())])
        main()
    return folder / "act" / "checkpoints" / "last" / "pretrained_model"


@pytest.fixture(autouse=True)
def package(monkeypatch):
    """The integration, as if it were installed."""
    monkeypatch.syspath_prepend(str(ROOT / "integrations" / "lerobot_env_scengen"))


def streams():
    """The streams of the recording: the robot's own pose and the privileged state."""
    from scengen.envs.observations import proprioception

    return [*proprioception("panda_jaw"), STREAMS]


def test_it_plays_whole_episodes_and_the_same_ones_again(checkpoint, monkeypatch, tmp_path):
    monkeypatch.setenv("LEROBOT_CHECKPOINT", str(checkpoint))
    episodes = []
    for name in ("one", "again"):
        given = [f"policy={POLICY}", f"pool={REFERENCE}", "rollouts=1", "seeds=2", "action_repeat=4", "arms=none"]
        assert cli.run(["evaluate", *given, f"observations=[{','.join(streams())}]", f"to={tmp_path / name}"]) == 0
        lines = (tmp_path / name / "episodes.jsonl").read_text().splitlines()
        episodes.append([{k: v for k, v in json.loads(line).items() if "cpu" not in k} for line in lines])
    assert len(episodes[0]) == 2 and episodes[0] == episodes[1]
    assert all(one["seconds"] > 1.0 for one in episodes[0])


def test_its_actions_are_those_of_lerobots_own_rollout(checkpoint, monkeypatch):
    import numpy as np
    import torch
    from lerobot.configs import PreTrainedConfig
    from lerobot.envs.utils import preprocess_observation
    from lerobot.policies.factory import get_policy_class, make_pre_post_processors
    from lerobot_env_scengen.checkpoint import policy

    from scengen.envs.lerobot import LeRobotNames

    monkeypatch.setenv("LEROBOT_CHECKPOINT", str(checkpoint))
    env = PoolEnv("domino_single", pool=[str(REFERENCE)], observations=streams(), action_repeat=4)
    named = LeRobotNames(env)
    config = PreTrainedConfig.from_pretrained(checkpoint)
    theirs = get_policy_class(config.type).from_pretrained(checkpoint)
    before, after = make_pre_post_processors(config, str(checkpoint))
    ours = policy(env)
    observation, info = env.reset(seed=1000)
    ours.reset(observation, info, 0)
    theirs.reset()
    for _ in range(25):
        batch = preprocess_observation({name: value[None] for name, value in named.observation(observation).items()})
        with torch.inference_mode():
            expected = after(theirs.select_action(before({**batch, "task": [env.task_description]})))[0].numpy()
        action = ours.act(observation)
        np.testing.assert_array_equal(action, expected)
        observation = env.step(np.clip(action, -1.0, 1.0))[0]
    assert np.isfinite(action).all() and action.shape == env.action_space.shape


def test_what_it_needs_is_asked_for_in_one_line(checkpoint, monkeypatch, tmp_path):
    from lerobot_env_scengen.checkpoint import policy

    env = PoolEnv("domino_single", pool=[str(REFERENCE)])
    monkeypatch.delenv("LEROBOT_CHECKPOINT", raising=False)
    with pytest.raises(BadConfig, match="LEROBOT_CHECKPOINT is not set; set it to"):
        policy(env)
    monkeypatch.setenv("LEROBOT_CHECKPOINT", str(tmp_path))
    with pytest.raises(BadConfig, match=r"has no config\.json"):
        policy(env)
    monkeypatch.setenv("LEROBOT_CHECKPOINT", str(checkpoint))
    with pytest.raises(
        BadConfig,
        match=r"reads object-state, which is not observed; pass observations=\[robot0_eef_pos,.*,object-state\]",
    ):
        policy(env)
