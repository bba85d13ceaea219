"""Observations under the names that LeRobot's environments use: `LeRobotNames(gymnasium.make("scengen/...", ...))`.

    pixels               a dictionary of the cameras asked for        observation.images.<camera>
    agent_pos            the robot's own pose, one vector             observation.state
    environment_state    `object-state`, privileged                   observation.environment_state

The entries and their order are those of a recording (`scengen record`), whose columns stand on the right: what LeRobot
makes of these names. Other streams, such as forces and touch, keep their names.
"""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..control.loop import Loop
from ..errors import BadConfig
from .gym import Observation, PoolEnv
from .object_state import NAME
from .observations import proprioception

PIXELS, AGENT, ENVIRONMENT = "pixels", "agent_pos", "environment_state"
"""LeRobot's names."""
ROLLOUT = "lerobot_new_rollout"
"""An option with which LeRobot resets environments; it means nothing here."""


class LeRobotNames(gymnasium.ObservationWrapper[dict[str, Any], NDArray[np.float32], Observation]):
    """A scengen environment with LeRobot's names for the observations that it was asked for."""

    def __init__(self, env: gymnasium.Env[Observation, NDArray[np.float32]]):
        """Wrap an environment.

        Raises:
            BadConfig: it is not one of scengen's.
        """
        super().__init__(env)
        pool_env = env.unwrapped
        if not isinstance(pool_env, PoolEnv):
            raise BadConfig(f"LeRobotNames cannot wrap {type(pool_env).__name__}; it is for environments of scengen")
        self._pool_env, streams = pool_env, pool_env.streams
        robot = tuple(name for name in proprioception(pool_env.task.embodiment) if name in streams)
        parts = {AGENT: robot, ENVIRONMENT: (NAME,) if NAME in streams else ()}
        self._joined = {name: own for name, own in parts.items() if own}
        self._cameras = tuple(pool_env.cameras)
        self._others = tuple(name for name in streams if name not in (*robot, NAME))
        told = pool_env.metadata["names"]
        names = {name: tuple(entry for part in own for entry in told[part]) for name, own in self._joined.items()}
        self.metadata = {**pool_env.metadata, "names": {**names, **{name: told[name] for name in self._others}}}
        self.observation_space = self._space()

    @property
    def _max_episode_steps(self) -> int:
        """Steps until the time limit: LeRobot asks for them under this name."""
        return int(np.ceil(self._pool_env.horizon / (Loop.PERIOD * self._pool_env.action_repeat) - 1e-9))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """See `PoolEnv.reset`."""
        return super().reset(seed=seed, options={k: v for k, v in (options or {}).items() if k != ROLLOUT})

    def observation(self, observation: Observation) -> dict[str, Any]:
        """The same under LeRobot's names."""
        pixels = {PIXELS: {name: observation[name] for name in self._cameras}} if self._cameras else {}
        joined = {name: np.concatenate([observation[part] for part in own]) for name, own in self._joined.items()}
        return {**pixels, **joined, **{name: observation[name] for name in self._others}}

    def _space(self) -> spaces.Dict:
        inner: Any = self._pool_env.observation_space
        found: dict[str, spaces.Space[Any]] = {name: inner[name] for name in self._others}
        if self._cameras:
            found[PIXELS] = spaces.Dict({name: inner[name] for name in self._cameras})
        for name, own in self._joined.items():
            low, high = (np.concatenate([getattr(inner[part], end) for part in own]) for end in ("low", "high"))
            found[name] = spaces.Box(low, high, dtype=np.float32)
        return spaces.Dict(found)
