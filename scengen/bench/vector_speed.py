"""Costs of the vector environment: against bare physics, one environment, and Gymnasium's environments in processes."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from gymnasium.vector import AsyncVectorEnv, VectorEnv

from ..envs.gym import PoolEnv
from ..envs.observations import PROPRIOCEPTION
from ..envs.vector import PoolVectorEnv
from ..episode import Actions
from ..pool import PoolRow
from ..validate.playable import stored_world
from .timing import SLICE, Measure, Side, alternated, ratio, step_with

SLOTS = 16
"""Number of slots."""
PERIODS = 200
"""Number of control periods of a repetition: two seconds."""


def vector_ratios(folder: str, row: PoolRow, repeats: int) -> dict[str, Measure]:
    """The ratios of `PoolVectorEnv`, by name. Times of threads and processes are those on the clock.

    Args:
        folder: pool with the scenario of `row` alone.
    """
    task, actions = row.task, row.witness[:PERIODS]
    seen: dict[str, Any] = {"observations": PROPRIOCEPTION}
    processes = AsyncVectorEnv(
        [lambda: PoolEnv(task, folder, **seen)] * SLOTS
    )  # before any thread: it copies this process
    one, two = (PoolVectorEnv(task, folder, SLOTS, threads, **seen) for threads in (1, 2))
    every, single = PoolVectorEnv(task, folder, SLOTS, **seen), PoolEnv(task, folder, **seen)
    try:
        apart = alternated([_stepping(one, actions), _bare(row, actions)], repeats)
        rates = [_rates((two, every, processes), single, actions) for _ in range(repeats + 1)][1:]
    finally:
        for envs in (processes, one, two, every):
            envs.close()
    return {
        "vector_to_raw": ratio(apart),
        "vector_two_threads": ratio((two, lone) for two, _, _, lone in rates),
        "vector_to_async": ratio((every, processes) for _, every, processes, _ in rates),
    }


def _rates(several: tuple[VectorEnv, ...], single: PoolEnv, actions: Actions) -> tuple[float, ...]:
    """Steps in a second of some vector environments, and of one environment; they work in turn, a slice each."""
    for envs in (*several, single):
        envs.reset(seed=0)
    spent = [0.0] * (len(several) + 1)
    for start in range(0, len(actions), SLICE):
        part = actions[start : start + SLICE]
        tiled = np.repeat(part[:, None], SLOTS, axis=1)
        for number, envs in enumerate(several):
            spent[number] += _seconds(envs.step, tiled)
        spent[-1] += _seconds(single.step, part)
    counts = [SLOTS * len(actions)] * len(several) + [len(actions)]
    return tuple(count / seconds for count, seconds in zip(counts, spent, strict=True))


def _seconds(step: Callable[..., object], actions: Actions) -> float:
    """Time on the clock of some steps [s]."""
    start = time.perf_counter()
    for action in actions:
        step(action)
    return time.perf_counter() - start


def _stepping(envs: PoolVectorEnv, actions: Actions) -> Side:
    """The steps of a vector environment, yielding after each. Its reset, which comes before, is not counted."""

    def steps() -> Iterator[None]:
        envs.reset(seed=0)
        tiled = np.repeat(actions[:, None], SLOTS, axis=1)
        return _after_each(lambda number: envs.step(tiled[number]), len(actions))

    return steps


def _bare(row: PoolRow, actions: Actions) -> Side:
    """The bare mj_step calls of as many simulations, in turn as the slots take them, through the same states."""
    worlds = [stored_world(row) for _ in range(SLOTS)]
    substeps = worlds[0].loop.substeps
    controls = np.zeros((len(actions) * substeps, worlds[0].model.nu))
    worlds[0].loop.replay(actions, controls)

    def period(number: int) -> None:
        part = controls[number * substeps : (number + 1) * substeps]
        for world in worlds:
            step_with(world.model._address, world.data._address, world.data.ctrl, part)

    def raw() -> Iterator[None]:
        for world in worlds:
            world.reset()
        return _after_each(period, len(actions))

    return raw


def _after_each(step: Callable[[int], object], count: int) -> Iterator[None]:
    for number in range(count):
        step(number)
        yield
