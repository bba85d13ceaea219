"""Scenarios of an evaluation: the first ones of each pool that can be played."""

import itertools
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from ..compose import load_task
from ..errors import BadConfig
from ..pool import Pool
from ..samplers.split import ID
from ..samplers.task_files import about as about_task
from ..validate.playable import unplayable
from ..work.parallel import Workers
from .settings import PAPER, SCENARIOS, EvaluateSettings

Scenarios = Mapping[tuple[str, str], Mapping[str, Any]]
"""What lines say of scenarios, by the pool's folder and the scenario's id."""


def chosen(pools: Sequence[Pool], settings: EvaluateSettings, search: Sequence[str]) -> Scenarios:
    """The first scenarios of each pool, of the chosen splits, the same number of each.

    Raises:
        BadConfig: a pool holds fewer than requested, or none of them has one of the splits.
    """
    count = most_scenarios(pools, settings, search)
    some = [_of_splits(pool, settings, search) for pool in pools]
    return {key: told for own in some for key, told in itertools.islice(own.items(), count)}


def most_scenarios(pools: Sequence[Pool], settings: EvaluateSettings, search: Sequence[str]) -> int:
    """Number of scenarios that are played of each pool.

    Raises:
        BadConfig: a pool holds fewer than requested, or none of them has one of the splits.
    """
    counts = {str(pool.folder): n for pool in pools if (n := len(_of_splits(pool, settings, search)))}
    if not counts:
        named = ", ".join(sorted({split for pool in pools for split in pool.kinds("split")[0]}))
        raise BadConfig(f"splits = {settings.splits}; these pools have none of them, but {named}; pass splits=all")
    count = settings.seeds or min(SCENARIOS, *counts.values())
    for folder, there in counts.items():
        if there < count:
            raise BadConfig(f"seeds = {count}, but {folder} holds {there} scenarios; pass seeds={there}")
    return count


def different_sizes(pools: Sequence[Pool], settings: EvaluateSettings) -> str:
    """A line about pools of which more scenarios could be played if all had as many; empty if there are none."""
    sizes = {str(pool.folder): len(pool) for pool in pools}
    if settings.seeds or len({min(SCENARIOS, size) for size in sizes.values()}) < 2:
        return ""
    told = ", ".join(f"{folder} {size}" for folder, size in sizes.items())
    return f"pools differ in size ({told}): {min(sizes.values())} scenarios of each are played"


def known(pool: Pool, search: Sequence[str]) -> Scenarios:
    """All scenarios of a pool."""
    names = ("task", "category", "split", "seed", "index", "id_twin", "shifted", "scene_sha256")
    rows = [(id_, dict(zip(names, told, strict=True))) for id_, *told in pool.columns("id", *names)]
    versions = {name: load_task(name, search).version for name in {told["task"] for _, told in rows}}
    return {(str(pool.folder), id_): {**told, "task_version": versions[told["task"]]} for id_, told in rows}


def not_playable(pools: Sequence[Pool], some: Scenarios, workers: Workers) -> dict[str, str]:
    """Those of some scenarios that cannot be played within the limits, with the reasons."""
    rows = (
        row
        for pool in pools
        for row in itertools.islice(pool.rows(), _last(pool, some))
        if (str(pool.folder), row.id) in some
    )
    return dict(unplayable(rows, workers))


def _of_splits(pool: Pool, settings: EvaluateSettings, search: Sequence[str]) -> Scenarios:
    """The scenarios of a pool of the chosen splits.

    Raises:
        BadConfig: the pool is empty.
    """
    if not len(pool):
        raise BadConfig(f"{pool.folder} holds no scenario; choose another pool")
    every = known(pool, search)
    return {key: a for key, a in every.items() if _is_wanted(a["task"], a["split"], settings.splits, search)}


def _is_wanted(task: str, split: str, splits: str, search: Sequence[str]) -> bool:
    """Whether a split belongs to a set of splits."""
    return splits != PAPER or split == ID or split in _paper_axes(task, tuple(search))


@cache
def _paper_axes(task: str, search: tuple[str, ...]) -> tuple[str, ...]:
    return about_task(task, search).paper_axes


def _last(pool: Pool, about: Scenarios) -> int:
    """Number of rows of a pool up to the last chosen one."""
    numbers = [n for n, (id_,) in enumerate(pool.columns("id"), 1) if (str(pool.folder), id_) in about]
    return max(numbers, default=0)
