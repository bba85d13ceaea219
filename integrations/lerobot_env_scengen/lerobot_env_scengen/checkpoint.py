"""A checkpoint of LeRobot as a policy of `scengen evaluate`, in the same process.

    LEROBOT_CHECKPOINT=outputs/act/checkpoints/last/pretrained_model \\
        scengen evaluate policy=lerobot_env_scengen.checkpoint:policy pool=generated/id action_repeat=4
"""

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.configs import PreTrainedConfig
from lerobot.envs.utils import preprocess_observation
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from lerobot.utils.constants import OBS_ENV_STATE, OBS_IMAGES, OBS_STATE
from numpy.typing import NDArray

from scengen.envs.gym import Observation, PoolEnv
from scengen.envs.lerobot import LeRobotNames
from scengen.envs.object_state import NAME
from scengen.envs.observations import proprioception
from scengen.errors import BadConfig
from scengen.evaluate.policies import unobserved

VARIABLE = "LEROBOT_CHECKPOINT"
"""Environment variable with the folder of the checkpoint: the one that has config.json and model.safetensors."""


class Checkpoint:
    """A trained policy with its own normalisation. Weights and settings are its identity."""

    def __init__(self, env: PoolEnv, folder: Path):
        """
        Raises:
            BadConfig: the folder has no checkpoint, or the policy reads what the environment does not give.
        """
        if not (folder / "config.json").is_file():
            raise BadConfig(
                f"{folder} has no config.json; {VARIABLE} names the folder pretrained_model of a checkpoint"
            )
        config = PreTrainedConfig.from_pretrained(folder)
        config.device = "cuda" if torch.cuda.is_available() else "cpu"
        self._env, self._names = env, LeRobotNames(env)
        given = self._batch({name: space.sample() for name, space in env.observation_space.spaces.items()})
        if missing := sorted(config.input_features.keys() - given.keys()):
            ours = {OBS_ENV_STATE: [NAME], OBS_STATE: [*proprioception(env.task.embodiment)]}
            streams = [name for key in missing for name in ours.get(key, [key.removeprefix(f"{OBS_IMAGES}.")])]
            raise BadConfig(unobserved("the checkpoint", streams, [*env.streams, *env.cameras]))
        self._policy = get_policy_class(config.type).from_pretrained(folder, config=config)
        device = {"device_processor": {"device": config.device}}
        self._before, self._after = make_pre_post_processors(config, str(folder), preprocessor_overrides=device)
        files = sorted(path for path in folder.iterdir() if path.is_file())
        self.identity = [(path.name, hashlib.sha256(path.read_bytes()).hexdigest()) for path in files]

    def reset(self, observation: Observation, info: Mapping[str, Any], seed: int) -> None:
        """Start an episode; the policy draws from torch's generator, which is seeded."""
        torch.manual_seed(seed)
        self._policy.reset()

    def act(self, observation: Observation) -> NDArray[np.float32]:
        """The next action of the policy's current chunk."""
        with torch.inference_mode():
            action = self._policy.select_action(self._before(self._batch(observation)))
            return self._after(action)[0].numpy()

    def _batch(self, observation: Observation) -> dict[str, Any]:
        """An observation as a batch of one, as LeRobot's own evaluation makes it."""
        return {**preprocess_observation(self._names.observation(observation)), "task": [self._env.task_description]}


def policy(env: PoolEnv) -> Checkpoint:
    """The checkpoint that the environment variable names."""
    if VARIABLE not in os.environ:
        raise BadConfig(f"{VARIABLE} is not set; set it to the folder pretrained_model of a checkpoint of LeRobot")
    return Checkpoint(env, Path(os.environ[VARIABLE]))
