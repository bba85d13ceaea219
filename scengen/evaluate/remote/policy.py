"""A policy behind a socket: it sends observations under the server's names and plays the chunks of actions it gets."""

from collections import deque
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from ...envs.gym import Observation, PoolEnv
from ...errors import UnknownName, cut
from ...sim.embodiment import hands
from .client import INSTRUCTION, ClientSettings, address_of
from .servers import SERVERS, Server, plain

RATES = ("fps", "control_hz")
"""Names under which a server's description may give the rate of its actions [Hz]."""
MODALITIES = ("video", "state", "language")
"""Kinds of observations of GR00T, the first parts of the names of entries."""
MAX_HISTORY = 100
"""Largest number of past observations that a server may request."""


class RemotePolicy:
    """The policy of one server in one environment. Observations and actions are those of `client`.

    A server chooses its own random numbers: openpi's protocol has no seed, GR00T's own policies ignore it.
    """

    def __init__(self, env: PoolEnv, policy: str, client: ClientSettings):
        """Connect to the server and compare its description with the client's file.

        Args:
            env: environment with the streams of `client` and its `repeat` as `action_repeat`.
            policy: address of the server.

        Raises:
            BadServer: it does not exist, or it expects or sends something else.
        """
        self.env, self.client = env, client
        self.server: Server = SERVERS[address_of(policy).scheme](address_of(policy), client)
        self._embodiment = env.task.embodiment
        self._size = (env.action_space.shape or (0,))[0]
        about = self.server.describe()
        self._past = self._offsets(about)
        self._check_rate(about)
        self._history: deque[Observation] = deque(maxlen=1 - min(map(min, self._past.values()), default=0))
        self._plan: deque[NDArray[np.float32]] = deque()

    def described(self) -> Any:
        """The server's description of itself, as plain data."""
        return plain(self.server.about or {})

    def reset(self, observation: Observation, info: Mapping[str, Any], seed: int) -> None:
        """Start an episode: no actions are left, and the past holds nothing."""
        self._history.clear()
        self._plan.clear()
        self.server.reset(seed)

    def act(self, observation: Observation) -> NDArray[np.float32]:
        """The next action of the chunk; a request for another chunk if `execute` of its actions are played."""
        return self.act_all([self], [observation])[0]

    @staticmethod
    def act_all(policies: "Sequence[RemotePolicy]", observations: Sequence[Observation]) -> list[NDArray[np.float32]]:
        """The next actions of several policies, which send their requests at the same time."""
        for policy, observation in zip(policies, observations, strict=True):
            policy._history.append(observation)
        asking = [policy for policy in policies if not policy._plan]
        if len(asking) > 1:
            with ThreadPoolExecutor(len(asking)) as crew:
                list(crew.map(RemotePolicy._ask, asking))
        elif asking:
            asking[0]._ask()  # not in a thread: Ctrl-C ends it
        return [policy._plan.popleft() for policy in policies]

    def looks(self) -> bool:
        """Whether a request will hold the next observation: that of the next act, or a later one that looks back."""
        wait = len(self._plan)
        offsets = {0, *chain(*self._past.values())}
        return any(-past >= wait and (-past - wait) % self.client.execute == 0 for past in offsets)

    def close(self) -> None:
        """Close the connection."""
        self.server.close()

    def _ask(self) -> None:
        """Request a chunk; `execute` of its actions are played."""
        self._plan.extend(self._chunk(self.server.infer(self._request()))[: self.client.execute])

    def _request(self) -> dict[str, Any]:
        """The observation under the server's names."""
        return {entry: self._entry(entry) for entry in self.client.observation}

    def _entry(self, entry: str) -> Any:
        names = self.client.parts(entry, self._embodiment)
        if names == (INSTRUCTION,):
            return [[self.env.task_description]] if self._past else self.env.task_description
        if not self._past:
            return _joined(self._history[-1], names)
        latest = len(self._history) - 1
        return np.stack([_joined(self._history[max(0, latest + past)], names) for past in self._past[entry]])[None]

    def _chunk(self, reply: Mapping[str, Any]) -> NDArray[np.float32]:
        """The actions of a reply, shape (chunk, size of an action).

        Raises:
            BadServer: they have another shape, are too few, or are not finite.
        """
        parts = []
        for name in self.client.action:
            if name not in reply:
                raise self.server.fault(f"{UnknownName('entry of the reply', name, reply)} (see {self.client.file})")
            part = reply[name]
            if isinstance(part, np.ndarray) and self._past and part.ndim == 3 and len(part) == 1:
                part = part[0]
            if not isinstance(part, np.ndarray) or part.ndim != 2:
                told = f"has the shape {part.shape}" if isinstance(part, np.ndarray) else f"is {cut(repr(part))}"
                expected = "(1, chunk, n)" if self._past else "(chunk, n)"
                raise self.server.fault(f"{name} of a reply {told}; it must be an array of shape {expected}")
            parts.append(part)
        told = ", ".join(f"{name} {part.shape}" for name, part in zip(self.client.action, parts, strict=True))
        if len({len(part) for part in parts}) > 1 or sum(part.shape[1] for part in parts) != self._size:
            arms = len(hands(self._embodiment))
            raise self.server.fault(
                f"the actions have the shapes {told}; {self.env.task.name} takes {self._size} numbers for each of them "
                f"({arms} arm{'s' if arms > 1 else ''}: three of translation, three of rotation, one gripper each)"
            )
        with np.errstate(over="ignore"):  # what is too large for float32 is not finite, see below
            chunk = np.concatenate(parts, axis=1).astype(np.float32)
        if len(chunk) < self.client.execute:
            few = f"a chunk has {len(chunk)} actions; execute = {self.client.execute} (see {self.client.file})"
            raise self.server.fault(few)
        if not np.isfinite(chunk).all():
            row = chunk[np.flatnonzero(~np.isfinite(chunk).all(axis=1))[0]]
            raise self.server.fault(f"an action is not finite: {np.array2string(row, max_line_width=400)}")
        return chunk

    def _offsets(self, about: Mapping[str, Any]) -> dict[str, tuple[int, ...]]:
        """Observations in each entry, as offsets in time from the present one.

        Empty for openpi, which has no axes for a batch and for time.

        Raises:
            BadServer: the server expects other entries than the client's file has.
        """
        if self.server.address.scheme != "zmq":
            return {}
        expected: dict[str, tuple[int, ...]] = {}
        for modality in (*MODALITIES, "action"):
            config = about.get(modality)
            keys = config.get("modality_keys") if isinstance(config, Mapping) else None
            past = config.get("delta_indices") if isinstance(config, Mapping) else None
            if not _words(keys) or not _are_offsets(past, modality == "action"):
                raise self.server.fault(f"its modality configuration of {modality} is {cut(repr(config))}")
            expected |= {f"{modality}.{key}": tuple(past) for key in keys}
        actions = {name.partition(".")[2] for name in expected if name.startswith("action.")}
        entries = {name: past for name, past in expected.items() if not name.startswith("action.")}
        for kind, here, there in (
            ("observations", set(self.client.observation), set(entries)),
            ("actions", set(self.client.action), actions),
        ):
            if here != there:
                differ = f"the server has {', '.join(sorted(there))}; {self.client.file} has {', '.join(sorted(here))}"
                raise self.server.fault(f"other {kind}: {differ}")
        return entries

    def _check_rate(self, about: Mapping[str, Any]) -> None:
        """Raise `BadServer` if the server gives the rate of its actions and it is not that of the client's file."""
        for name in RATES:
            rate = about.get(name)
            if isinstance(rate, (int, float)) and not abs(rate - self.client.rate) < 1e-6:
                raise self.server.fault(f"it acts at {rate:g} Hz; rate = {self.client.rate:g} (see {self.client.file})")


def _joined(observation: Observation, names: tuple[str, ...]) -> NDArray[Any]:
    """The value of one stream or camera as it is, or of several streams in one vector."""
    if len(names) == 1:
        return np.ascontiguousarray(observation[names[0]])
    return np.concatenate([observation[name].ravel() for name in names])


def _words(value: Any) -> TypeGuard[list[str]]:
    return isinstance(value, list) and all(isinstance(each, str) for each in value)


def _are_offsets(value: Any, future: bool) -> TypeGuard[list[int]]:
    """Whether a value is a list of offsets in time: of future actions, or of past observations."""
    low, high = (0, 1000) if future else (-MAX_HISTORY, 0)
    return isinstance(value, list) and bool(value) and all(type(n) is int and low <= n <= high for n in value)
