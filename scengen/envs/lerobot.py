"""Observations under the names of LeRobot's environments: `LeRobotNames(gymnasium.make("scengen/...", ...))`.

    pixels               a dictionary of the requested cameras        observation.images.<camera>
    agent_pos            the robot's own pose, one vector             observation.state
    environment_state    `object-state`, privileged                   observation.environment_state

The entries and their order are those of a recording (`scengen record`). The right column shows its columns, to which
LeRobot maps these names. Other streams, such as forces and touch, keep their names.
"""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..errors import BadConfig
from .gym import Observation, PoolEnv
from .object_state import NAME
from .observations import proprioception

PIXELS = "pixels"
"""LeRobot's name of the pictures."""
AGENT = "agent_pos"
"""LeRobot's name of the robot's own pose."""
ENVIRONMENT = "environment_state"
"""LeRobot's name of the privileged state."""
ROLLOUT = "lerobot_new_rollout"
"""An option that LeRobot passes to `reset`; it has no effect here."""


class LeRobotNames(gymnasium.ObservationWrapper[dict[str, Any], NDArray[np.float32], Observation]):
    """A scengen environment with LeRobot's names for its observations."""

    def __init__(self, env: gymnasium.Env[Observation, NDArray[np.float32]]):
        """Wrap an environment.

        Raises:
            BadConfig: it is not an environment of scengen.
        """
        super().__init__(env)
        pool_env = env.unwrapped
        if not isinstance(pool_env, PoolEnv):
            raise BadConfig(f"LeRobotNames cannot wrap {type(pool_env).__name__}; it wraps environments of scengen")
        self._pool_env, streams = pool_env, pool_env.streams
        robot = tuple(name for name in proprioception(pool_env.task.embodiment) if name in streams)
        parts = {AGENT: robot, ENVIRONMENT: (NAME,) if NAME in streams else ()}
        self._joined = {name: own for name, own in parts.items() if own}
        self._cameras = tuple(pool_env.cameras)
        self._others = tuple(name for name in streams if name not in (*robot, NAME))
        entries = pool_env.metadata["names"]
        names = {name: tuple(entry for part in own for entry in entries[part]) for name, own in self._joined.items()}
        self.metadata = {**pool_env.metadata, "names": {**names, **{name: entries[name] for name in self._others}}}
        self.observation_space = self._renamed_space()

    @property
    def _max_episode_steps(self) -> int:
        """Number of steps until the time limit. LeRobot reads it under this name."""
        return self._pool_env.steps_in(self._pool_env.horizon)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """See `PoolEnv.reset`."""
        return super().reset(seed=seed, options={k: v for k, v in (options or {}).items() if k != ROLLOUT})

    def observation(self, observation: Observation) -> dict[str, Any]:
        """The observation under LeRobot's names."""
        pixels = {PIXELS: {name: observation[name] for name in self._cameras}} if self._cameras else {}
        joined = {name: np.concatenate([observation[part] for part in own]) for name, own in self._joined.items()}
        return {**pixels, **joined, **{name: observation[name] for name in self._others}}

    def _renamed_space(self) -> spaces.Dict:
        inner: Any = self._pool_env.observation_space
        found: dict[str, spaces.Space[Any]] = {name: inner[name] for name in self._others}
        if self._cameras:
            found[PIXELS] = spaces.Dict({name: inner[name] for name in self._cameras})
        for name, own in self._joined.items():
            low, high = (np.concatenate([getattr(inner[part], end) for part in own]) for end in ("low", "high"))
            found[name] = spaces.Box(low, high, dtype=np.float32)
        return spaces.Dict(found)
