"""A checkpoint of robomimic as a policy of `scengen evaluate`, in the same process.

    ROBOMIMIC_CHECKPOINT=recipes/rnn/training/20260101120000/models/model_epoch_2000.pth \\
        scengen evaluate policy=robomimic_scengen.checkpoint:policy pool=generated/id action_repeat=1
"""

import hashlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from robomimic.utils.file_utils import policy_from_checkpoint
from robomimic.utils.obs_utils import process_obs

from scengen.envs.gym import Observation, PoolEnv
from scengen.envs.robomimic import names
from scengen.errors import BadConfig
from scengen.evaluate.policies import unobserved

VARIABLE = "ROBOMIMIC_CHECKPOINT"
"""Environment variable with the checkpoint, a file that ends in .pth."""


class Checkpoint:
    """A trained policy with its own normalisation. Weights and settings are its identity."""

    def __init__(self, env: PoolEnv, file: Path):
        """
        Raises:
            BadConfig: there is no such file, or the policy reads what the environment does not give.
        """
        if not file.is_file():
            raise BadConfig(f"{VARIABLE} = {file} is not a file; it names a checkpoint of robomimic, models/*.pth")
        device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
        self._policy, stored = policy_from_checkpoint(device=device, ckpt_path=str(file))
        own, given = names(env.task.embodiment), env.observation_space.spaces
        read = list(stored["shape_metadata"]["all_obs_keys"])
        if missing := [own.get(key, key) for key in read if own.get(key) not in given]:
            raise BadConfig(unobserved("the checkpoint", missing, [*given]))
        self._names = {key: own[key] for key in read}
        self.identity = hashlib.sha256(file.read_bytes()).hexdigest()

    def reset(self, observation: Observation, info: Mapping[str, Any], seed: int) -> None:
        """Start an episode; the policy draws from torch's generator, which is seeded."""
        torch.manual_seed(seed)
        self._policy.start_episode()

    def act(self, observation: Observation) -> NDArray[np.float32]:
        """The next action."""
        seen = {key: process_obs(np.asarray(observation[name]), obs_key=key) for key, name in self._names.items()}
        return np.asarray(self._policy(ob=seen), np.float32)


def policy(env: PoolEnv) -> Checkpoint:
    """The checkpoint that the environment variable names."""
    if VARIABLE not in os.environ:
        raise BadConfig(f"{VARIABLE} is not set; set it to a checkpoint of robomimic, models/*.pth")
    return Checkpoint(env, Path(os.environ[VARIABLE]))
