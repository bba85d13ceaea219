"""A trained policy in an environment: it observes, predicts a chunk of goals, and goes to the first few of them."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..envs.gym import Observation, PoolEnv
from ..errors import BadConfig
from . import models
from .data import entry_names
from .goals import action_to
from .store import StoredPolicy


class TrainedPolicy:
    """Plays a `StoredPolicy`. It is deterministic."""

    def __init__(self, stored: StoredPolicy, env: PoolEnv):
        """
        Raises:
            BadConfig: the environment is of another task, or does not observe what the policy needs.
        """
        self.stored, self.settings = stored, stored.settings
        self.version = stored.settings.weights_sha256
        """Version of the policy, to which an evaluation is bound."""
        _check(stored, env)
        self._places = _places(stored, env)

    def reset(self, observation: Observation, info: Mapping[str, Any], seed: int) -> None:
        """Start an episode without earlier observations."""
        self._seen: list[NDArray[np.float32]] = []
        self._planned: list[NDArray[np.float32]] = []

    def act(self, observation: Observation) -> ArrayLike:
        """The action to the next goal of the chunk, shape (7 * arms,); of a new chunk if enough of the last one was
        played."""
        own = self.settings
        seen = np.append(_values(observation, own.streams), np.float32(0.0))[self._places]
        self._seen = [*self._seen, seen][-own.steps :]
        hands = _values(observation, own.pose_streams)
        if not self._planned:
            self._planned, self._origin = list(self._predicted()[: own.played]), hands
        return np.clip(action_to(self._planned.pop(0), self._origin, hands), -1.0, 1.0)

    def _predicted(self) -> NDArray[np.float32]:
        """A chunk of goals from the last observations, shape (chunk, 7 * arms)."""
        arrays = self.stored.arrays
        inputs = self.stored.features.inputs(np.stack(self._seen))[-1:]
        standard = models.predict(self.settings.kind, arrays, inputs)[0]
        return (standard * arrays["output_scale"] + arrays["output_mean"]).reshape(self.settings.chunk, -1)


def _values(observation: Observation, streams: Iterable[str]) -> NDArray[np.float32]:
    """Streams of an observation one after the other."""
    return np.concatenate([np.ravel(observation[name]) for name in streams], dtype=np.float32)


def _check(stored: StoredPolicy, env: PoolEnv) -> None:
    own = stored.settings
    if own.task != env.task.name:
        raise BadConfig(f"the policy was trained for {own.task}, the pool holds {env.task.name}; train one for it")
    missing = [name for name in own.observed if name not in env.streams]
    if missing:
        raise BadConfig(
            f"the policy observes {missing[0]}, the environment does not; pass observations=[...,{missing[0]}]"
        )
    if env.action_repeat != own.action_repeat:
        raise BadConfig(
            f"action_repeat = {env.action_repeat}; the policy acts {own.rate} times per second: {own.action_repeat}"
        )


def _places(stored: StoredPolicy, env: PoolEnv) -> NDArray[np.intp]:
    """Place in the environment's observation of each entry that the policy observes.

    It is one past the end for entries that the environment lacks and the policy does not use: those of bodies of other
    tasks in the recording.

    Raises:
        BadConfig: the policy uses an entry that the environment lacks, or does not know one that it has.
    """
    own, used = stored.settings, stored.features.used
    entries = [
        n for name in own.streams for n in entry_names(name, env.streams[name].entries(name), env.streams[name].shape)
    ]
    places = {name: i for i, name in enumerate(entries)}
    other = [name for name in own.entries if name in used and name not in places]
    other += [name for name in entries if name not in own.entries]
    if other:
        raise BadConfig(
            f"the policy was trained on other entries of its observations ({other[0]}); "
            "record its data and train it again"
        )
    return np.array([places.get(name, len(entries)) for name in own.entries])
