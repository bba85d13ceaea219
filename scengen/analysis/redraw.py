"""What a pool was chosen from: its manifest and seed are enough to draw every proposal again."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from .. import config
from ..errors import BadConfig, Infeasible, PoolError
from ..params import Value, values
from ..pool.pool import Pool
from ..samplers.task import Task
from ..scenario import Scenario
from ..validate import survey
from ..validate.stored import task_of_manifest
from .space import Batch

MOST = 10_000
"""Indices at most that are drawn again: in whatever design they were drawn, the first ones are a sample of all. Shares
come out to 1 %, and the discrepancy, whose cost grows with the square, takes seconds."""


@dataclass(frozen=True)
class Redrawn:
    """One draw that a run made, drawn again."""

    index: int
    scenario: Scenario
    quantiles: Mapping[str, float]
    """What the design gave for each parameter that varies, in (0, 1)."""
    feasible: bool
    """Whether the family's own constraints let it through to the certifier."""
    certified: bool


def task_of(pool: Pool, search: Sequence[str] = ()) -> Task:
    """The task as it was when the pool was made: its numbers from the manifest, its family from the installed file.

    Args:
        search: overrides that add folders of other packages, see `task_files.search_path`.

    Raises:
        ScengenError: there is no such task, or the family is another one or has changed so that the task does not fit.
    """
    return task_of_manifest(pool, config.task(pool.task, search))


def redrawn(
    pool: Pool, progress: Callable[[int, int], None] = lambda done, total: None, search: Sequence[str] = ()
) -> list[Redrawn]:
    """Draw again what the pool's run has drawn at its first `MOST` indices, infeasible tries included.

    Args:
        progress: told how many of how many indices are done.
        search: see `task_of`.

    Raises:
        BadConfig: the pool is a chosen subset, for which there are no proposals.
        PoolError: other scenarios come out than the pool holds, or more draws than it counts; or it counts so many
            that no run can have made them.
    """
    if pool.chosen:
        raise BadConfig(f"{pool.folder} is a subset of another pool, chosen and not drawn; give the pool it came from")
    if why := survey.too_large(pool):
        raise PoolError(f"{pool.folder}: {why}")
    task = task_of(pool, search)
    design = task.design(pool.sampler)
    count = min(pool.indices, MOST)
    places = np.flatnonzero(pool.directory.indices < count).tolist()
    ids = {int(pool.directory.indices[place]): pool.directory.id(place) for place in places}
    found: list[Redrawn] = []
    untold = 0  # tries at a training scenario that an axis could not start from
    for index in range(count):
        if why := survey.too_many(pool, index, len(found) + untold):
            raise PoolError(f"{pool.folder}: {why}")
        try:
            for p in task.proposals(pool.split, pool.seed, index, design):
                certified = index in ids and p.refutation is None
                if certified and ids[index] != p.scenario.id:
                    raise PoolError(
                        f"{pool.folder}: index {index} comes out as {p.scenario.id}, but the pool holds {ids[index]}; "
                        "the family has changed since, generate the pool again"
                    )
                found.append(Redrawn(index, p.scenario, p.quantiles, p.refutation is None, certified))
        except Infeasible as error:
            untold += error.tries  # there was no training scenario of this index that the axis could move
        progress(index + 1, count)
    return found


def batch_of(task: Task, pool: Pool) -> Batch:
    """The scenarios of a pool by their parameter values.

    Raises:
        ScengenError: a scenario stands in it twice, or has other parameters than the task or values out of bounds.
    """
    if id_ := pool.directory.twice:
        raise PoolError(f"{pool.folder} holds scenario {id_} twice; see scengen verify")
    rows = (_complete(task, params) for (params,) in pool.columns("params"))
    batch = Batch.read(pool.directory.ids, rows)
    for name, column in batch.values.items():
        for value in (column.min(), column.max()):
            whole = task.known[name].integer and float(value).is_integer()
            task.known[name].check(f"{pool.folder}: {name}", int(value) if whole else float(value))
    return batch


def _complete(task: Task, params: Mapping[str, Value]) -> Mapping[str, Value]:
    return params if params.keys() == task.known.keys() else values(task.scenario(params))


def first_scenarios(task: Task, pool: Pool, count: int) -> list[Scenario]:
    """The first so many scenarios of a pool."""
    return [task.scenario(params) for (params,) in islice(pool.columns("params"), count)]


def told(pool: Pool) -> str:
    """Of how many indices `redrawn` speaks, if not of all."""
    return f"of the first {MOST} of {pool.indices} indices" if pool.indices > MOST else ""
