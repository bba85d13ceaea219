"""Many environments in one process: `gymnasium.make_vec("scengen/domino_single-v2", num_envs=16, pool="generated/id")`.

Every slot has its own simulation. Threads step the slots: the compiled control loop releases Python's lock.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from ..episode import Outcome
from ..errors import BadConfig, UnknownName, cut
from ..pool import PoolRow
from ..work.machine import cores
from .gym import INFOS, RESET_OPTIONS, PoolEnv, clipped
from .observations import Entry, Reading
from .pools import Folders

MODES = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP, AutoresetMode.DISABLED)
"""Modes in which a slot starts its next episode: in the step after the end, at once, or when it is reset."""
MASK = "reset_mask"
"""Reset option that chooses slots, as in Gymnasium's own vector environments."""
MAX_SLOTS = 4096
"""Largest number of slots."""
MAX_TAKEN = 4
"""Largest number of slots that a thread takes at a time."""

Steps = tuple[dict[str, Reading], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]
"""Observations, rewards, terminations, truncations and infos of all slots."""


class PoolVectorEnv(VectorEnv[dict[str, Reading], NDArray[np.float32], NDArray[Any]]):
    """`num_envs` environments as `PoolEnv`, called slots, over the scenarios of one task.

    Observations, rewards and infos have the slots along their first axis and are new arrays in every step. They have
    the bits of single environments, with any number of threads.

    Scenarios are handed out in the order of the pools: `reset(seed=s)` starts number s in the first slot, s + 1 in the
    second, and so on. A slot whose episode ends gets the next one that no slot has had; among several slots the first
    comes first. After the last scenario the first one follows.

    With `AutoresetMode.NEXT_STEP` the step after the end of an episode ignores the slot's action and starts the next
    one. With `AutoresetMode.SAME_STEP` the step that ends an episode returns the first observation of the next one;
    `infos["final_obs"]` and `infos["final_info"]` hold the end of the old one. With `AutoresetMode.DISABLED` a slot
    stays at the end of its episode, and its actions are ignored, until `reset(options={"reset_mask": mask})` starts
    another one.
    """

    _spec: EnvSpec | None = None

    def __init__(
        self,
        task: str,
        pool: Folders | None = None,
        num_envs: int = 1,
        threads: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        **settings: Any,
    ):
        """Open the pools.

        Args:
            task: name of the task.
            pool: folder of a pool, or several folders. Default: the scenarios of the task that come with scengen.
            num_envs: number of slots.
            threads: number of threads that step slots; None for the available cores.
            autoreset_mode: `NEXT_STEP`, `SAME_STEP` or `DISABLED`.
            settings: further arguments of `PoolEnv`, such as `observations` and `action_repeat`.

        Raises:
            ScengenError: a setting is not valid, or a pool as in `PoolEnv`.
        """
        self.num_envs, most = _count("num_envs", num_envs, MAX_SLOTS), cores() if threads is None else threads
        self.threads = min(_count("threads", most, MAX_SLOTS), self.num_envs)
        mode = _mode(autoreset_mode)
        first = PoolEnv(task, pool, **settings)
        shared = {**settings, "scenario": None, "split": None}
        self.envs = [first, *(PoolEnv(task, first._rows, **shared) for _ in range(self.num_envs - 1))]
        """Environments of the slots."""
        self.metadata = {**first.metadata, "autoreset_mode": mode}
        self.render_mode = first.render_mode
        self.single_observation_space, self.single_action_space = first.observation_space, first.action_space
        self.observation_space = batch_space(first.observation_space, self.num_envs)
        self.action_space = batch_space(first.action_space, self.num_envs)
        self._mode = mode
        self._rows, self._next = first._rows, 0
        self._labels = False
        self._terminated, self._truncated = np.zeros((2, self.num_envs), np.bool_)
        self._started = False
        self._infos: dict[str, NDArray[Any]] = {
            **{f"_{name}": np.ones(self.num_envs, np.bool_) for name in INFOS},
            **{name: np.zeros(self.num_envs, np.bool_) for name in ("success", "is_success")},
            **{name: np.full(self.num_envs, "", object) for name in ("reason", "lacks")},
            "time": np.zeros(self.num_envs),
        }
        """The infos of slots whose episodes go on, but for the time, which each step writes."""
        self._readings = {n: np.zeros((self.num_envs, *s.shape)) for n, s in first.streams.items() if s.view is None}
        self._reads = [[(env.streams[name].read, read) for name, read in self._readings.items()] for env in self.envs]
        self._viewed = {name: s.view for name, s in first.streams.items() if s.view is not None}
        self._views = {name: [np.zeros(0)] * self.num_envs for name in self._viewed}
        size = (self.num_envs, first.observed.height, first.observed.width, 3)
        self._draws = np.ones(self.num_envs, np.bool_)
        self._pictures = {name: np.zeros(size, np.uint8) for name in first.cameras}
        self._crew = ThreadPoolExecutor(self.threads - 1) if self.threads > 1 else None

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Reading], dict[str, Any]]:
        """Start an episode in every slot.

        Args:
            seed: number of the first slot's scenario, or the numbers for all slots; None for those that come next.
            options: `scenario` names the scenario of all slots, or of each; `labels` adds to `info` which scenario
                runs, in later episodes too; `reset_mask`, shape (num_envs,), chooses the slots that begin an episode.
                The episodes of the others go on; in the first reset they are over as soon as they start.

        Raises:
            UnknownName: there is no such scenario or option.
            BadConfig: several ids have this prefix, there are not as many names or seeds as slots, or the mask is none.
        """
        if unknown := set(options or {}) - {*RESET_OPTIONS, MASK}:
            raise UnknownName("reset option", unknown.pop(), (*RESET_OPTIONS, MASK))
        mask = self._mask((options or {}).get(MASK))
        self._labels = bool((options or {}).get("labels"))
        first = not self._started
        fresh = np.flatnonzero(mask | first).tolist()
        numbers = self._numbers(seed, (options or {}).get("scenario"), fresh)
        infos = self._begin({slot: self._rows[number] for slot, number in numbers.items()})
        self._terminated, self._truncated = self._terminated & ~mask, (self._truncated | first) & ~mask
        self._started = True
        return self._observed(), self._gathered(infos)

    def step(self, actions: ArrayLike, draw: ArrayLike | None = None) -> Steps:
        """Take a step in every slot.

        Args:
            actions: shape (num_envs, size of an action).
            draw: slots whose pictures are drawn, shape (num_envs,), so that unused pictures take no time. All others
                are black, except those of a new episode. None for all slots.

        Raises:
            ValueError: the actions have another shape, or one is not finite. Nothing is simulated then.
        """
        given = self._checked(actions)
        if not self._started:
            raise BadConfig("no scenario is running; call reset first")
        self._draws[:] = True if draw is None else np.asarray(draw, np.bool_)
        over = self._terminated | self._truncated
        fresh = self._handed_out(over) if self._mode == AutoresetMode.NEXT_STEP else {}
        rewards = np.zeros(self.num_envs)
        stays = over & (self._mode == AutoresetMode.DISABLED)
        terminated, truncated = self._terminated & stays, self._truncated & stays
        infos: dict[int, dict[str, Any]] = {}
        times = self._infos["time"]

        def play(slots: Sequence[int]) -> None:
            outcomes = dict[int, Outcome | None].fromkeys(slots)
            for _ in range(self.envs[0].action_repeat):
                going = [slot for slot in slots if outcomes[slot] is None]
                for slot in going:
                    self.envs[slot]._simulate(given[slot])
                for slot in going:
                    env = self.envs[slot]
                    outcomes[slot] = env._episode.judge()
                    times[slot] = env.world.time
            for slot, outcome in outcomes.items():
                if outcome is not None:
                    rewards[slot], terminated[slot], truncated[slot], infos[slot] = self.envs[slot]._answer(outcome)

        self._each(play, [slot for slot in range(self.num_envs) if slot not in fresh and not stays[slot]])
        if fresh:
            infos |= self._begin(fresh)
        self._terminated, self._truncated = terminated.copy(), truncated.copy()
        seen, final = self._observed(), dict[int, dict[str, Any]]()
        if self._mode == AutoresetMode.SAME_STEP and (over := terminated | truncated).any():
            for slot in np.flatnonzero(over).tolist():
                values = {**infos[slot], **(self.envs[slot]._labels() if self._labels else {})}
                final[slot] = {"final_obs": {name: value[slot] for name, value in seen.items()}, "final_info": values}
            infos |= self._begin(self._handed_out(over))
            seen = self._observed()
        return seen, rewards, terminated, truncated, self._gathered(infos, final)

    def render(self) -> tuple[Reading | None, ...] | None:  # type: ignore[override]
        """A picture of every slot as `PoolEnv.render`, or None without a render mode."""
        return None if self.render_mode is None else tuple(env.render() for env in self.envs)

    @property
    def spec(self) -> EnvSpec | None:  # type: ignore[override]
        """Gymnasium's specification, with the time limit in steps."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:  # type: ignore[override]
        self._spec = spec and self.envs[0].specified(spec)

    def entry(self, name: str) -> Entry:
        """Place of a reading in the observations, see `PoolEnv.entry`."""
        return self.envs[0].entry(name)

    @property
    def legend(self) -> str:
        """Every reading in the observations of a slot, see `PoolEnv.legend`."""
        return self.envs[0].legend

    def close_extras(self, **_: Any) -> None:
        """Stop the threads and free the renderers."""
        if self._crew:
            self._crew.shutdown()
        for env in self.envs:
            env.close()

    def call(self, name: str, *arguments: Any, **named: Any) -> tuple[Any, ...]:
        """An attribute of every slot's environment, or what its method of that name returns."""
        found = (getattr(env, name) for env in self.envs)
        return tuple(each(*arguments, **named) if callable(each) else each for each in found)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of every slot's environment."""
        return tuple(getattr(env, name) for env in self.envs)

    # --- scenarios ------------------------------------------------------------------------

    def _mask(self, given: Any) -> NDArray[np.bool_]:
        """The slots that a reset starts, shape (num_envs,)."""
        if given is None:
            return np.ones(self.num_envs, np.bool_)
        mask = np.asarray(given)
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_ or not mask.any():
            raise BadConfig(f"reset_mask = {cut(repr(given))}; give {self.num_envs} booleans, one of them true")
        return mask

    def _numbers(self, seed: int | Sequence[int | None] | None, named: Any, slots: Sequence[int]) -> dict[int, int]:
        """Numbers of the scenarios with which some slots begin."""
        count = self.num_envs
        if named is not None:
            names = [named] * count if isinstance(named, str) else list(named)
            if len(names) != count:
                raise BadConfig(f"{len(names)} scenarios for {count} slots; give one name, or one for each slot")
            numbers = {slot: self._rows.find(str(names[slot])) for slot in slots}
        else:
            if seed is None or isinstance(seed, (int, np.integer)):
                seeds = [None if seed is None else seed + slot for slot in range(count)]
            else:
                seeds = list(seed)
            if len(seeds) != count:
                raise BadConfig(f"{len(seeds)} seeds for {count} slots; give one number, or one for each slot")
            numbers = {
                slot: self._following() if (own := seeds[slot]) is None else int(own) % len(self._rows)
                for slot in slots
            }
        self._next = (numbers[slots[-1]] + 1) % len(self._rows)
        return numbers

    def _following(self) -> int:
        """Number of the scenario that comes next."""
        number, self._next = self._next, (self._next + 1) % len(self._rows)
        return number

    def _handed_out(self, over: NDArray[np.bool_]) -> dict[int, PoolRow]:
        """The next scenarios for the slots whose episodes are over."""
        return {slot: self._rows[self._following()] for slot in np.flatnonzero(over).tolist()}

    def _begin(self, rows: Mapping[int, PoolRow]) -> dict[int, dict[str, Any]]:
        """Start episodes in some slots, and return their infos."""
        infos: dict[int, dict[str, Any]] = {}

        def load(slots: Sequence[int]) -> None:
            for slot in slots:
                env = self.envs[slot]
                env._load(rows[slot])
                self._draws[slot] = True
                for name, view in self._viewed.items():
                    self._views[name][slot] = view(env.world)
                infos[slot] = {**env._info("", False), **(env._labels() if self._labels else {})}

        self._each(load, list(rows))
        return infos

    # --- work of the threads --------------------------------------------------------------

    def _each(self, work: Callable[[Sequence[int]], None], slots: Sequence[int]) -> None:
        """Do some work for some slots and read their observations, in all threads.

        A thread takes a few slots at a time, and judges and reads them together: the interpreter's code stays in the
        cache, which the simulation of each slot empties. An error is raised when all threads have stopped.
        """
        size = max(1, min(MAX_TAKEN, len(slots) // self.threads))
        queue = iter([slots[start : start + size] for start in range(0, len(slots), size)])  # threads may share it

        def drain() -> None:
            for some in queue:
                work(some)
                for slot in some:
                    self._read(slot)

        others = [self._crew.submit(drain) for _ in range(min(self.threads, len(slots)) - 1)] if self._crew else []
        try:
            drain()
        finally:
            errors = [other.exception() for other in others]
        for error in errors:
            if error is not None:
                raise error

    def _read(self, slot: int) -> None:
        """Read what has to be computed of a slot's observation."""
        env = self.envs[slot]
        world = env.world
        for read, readings in self._reads[slot]:
            readings[slot] = read(world)
        for name, camera in env.observed.cameras.items():
            shown = env._shown(camera)
            self._pictures[name][slot] = env._picture(camera, shown) if self._draws[slot] else 0

    def _observed(self) -> dict[str, Reading]:
        """The observations after the last steps, as new arrays."""
        found = dict[str, Reading]()
        for name, stream in self.envs[0].streams.items():
            values = np.array(self._views[name]) if stream.view else self._readings[name]
            values = stream.convert(values) if stream.convert else values
            if self.envs[0].perturbation:
                values = np.array([e._perceived(name, one) for e, one in zip(self.envs, values, strict=True)])
            found[name] = clipped(values, stream.bound)
        return {**found, **{name: value.copy() for name, value in self._pictures.items()}}

    def _gathered(
        self, infos: Mapping[int, Mapping[str, Any]], final: Mapping[int, Mapping[str, Any]] | None = None
    ) -> dict[str, Any]:
        """The infos of the slots in arrays, as Gymnasium's vector environments give them.

        Args:
            infos: infos of the slots whose episodes have started or ended.
            final: ends of the episodes that others have followed.
        """
        found: dict[str, Any] = {}
        for slot in sorted(final or {}):
            found = self._add_info(found, {**final[slot]}, slot)  # type: ignore[index]
        found |= {name: values.copy() for name, values in self._infos.items()}  # `_add_info` would take far longer
        for slot, info in infos.items():
            for name in INFOS:
                found[name][slot] = info[name]
        for slot in sorted(infos) if self._labels else ():
            labels = {name: value for name, value in infos[slot].items() if name not in INFOS}
            found = self._add_info(found, labels, slot)
        return found

    def _checked(self, actions: ArrayLike) -> NDArray[np.float32]:
        """The actions as an array of the action space's shape."""
        given = np.asarray(actions, np.float32)
        if given.shape != self.action_space.shape:
            raise ValueError(f"actions have the shape {self.action_space.shape}, not {given.shape}")
        if not np.isfinite(given).all():
            slot = int(np.flatnonzero(~np.isfinite(given).all(axis=1))[0])
            raise ValueError(f"actions must be finite; that of slot {slot} is {np.array2string(given[slot])}")
        return given


def _count(name: str, given: Any, most: int) -> int:
    if isinstance(given, bool) or not isinstance(given, (int, np.integer)) or not 1 <= given <= most:
        raise BadConfig(f"{name} = {given!r}; it must be a whole number in [1, {most}]")
    return int(given)


def _mode(given: AutoresetMode | str) -> AutoresetMode:
    for mode in MODES:
        if given in (mode, mode.value, mode.name):
            return mode
    raise UnknownName("autoreset_mode", str(getattr(given, "value", given)), [mode.value for mode in MODES])
