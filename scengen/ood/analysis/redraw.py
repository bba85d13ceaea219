"""All draws of the run that made a pool: its manifest and seed are enough to repeat every proposal."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from ... import compose
from ...errors import BadConfig, Infeasible, PoolError
from ...params import Value, values
from ...pool import Pool
from ...samplers.task import Task
from ...scenario import Scenario
from ...validate.verify import survey
from ...validate.verify.stored import task_of_manifest
from .space import Batch

MAX_REDRAWN = 10_000
"""Maximum number of indices that are drawn again: in every design, the first ones are a sample of all. Shares are
accurate to 1 %, and the discrepancy, whose cost grows with the square, takes seconds."""


@dataclass(frozen=True)
class Redrawn:
    """One draw that a run made, drawn again."""

    index: int
    scenario: Scenario
    quantiles: Mapping[str, float]
    """Number of the design for each parameter that varies, in (0, 1)."""
    feasible: bool
    """Whether the draw satisfies the family's own constraints, so that the certifier examined it."""
    certified: bool
    """Whether the pool holds the draw."""


def task_of(pool: Pool, search: Sequence[str] = ()) -> Task:
    """The task as it was when the pool was made: numbers from the manifest, the family from the installed file.

    Args:
        search: overrides that add folders of other packages, see `task_files.search_path`.

    Raises:
        ScengenError: there is no such task, its family is another one, or the family has changed and does not fit.
    """
    return task_of_manifest(pool, compose.load_task(pool.task, search))


def redrawn(
    pool: Pool, progress: Callable[[int, int], None] = lambda done, total: None, search: Sequence[str] = ()
) -> list[Redrawn]:
    """Repeat all draws of the pool's run at its first `MAX_REDRAWN` indices, infeasible ones included.

    Args:
        progress: called with the number of indices done, and their total.
        search: see `task_of`.

    Raises:
        BadConfig: the pool is a chosen subset, which has no proposals.
        PoolError: a scenario differs from that of the pool, there are more draws than the pool counts, or it counts so
            many that no run can have made them.
    """
    if pool.manifest.is_subset:
        raise BadConfig(f"{pool.folder} is a subset of another pool, chosen and not drawn; give the pool it came from")
    if why := survey.too_large(pool.manifest):
        raise PoolError(f"{pool.folder}: {why}")
    task = task_of(pool, search)
    design = task.design(pool.manifest.config.sampler)
    count = min(pool.manifest.indices, MAX_REDRAWN)
    places = np.flatnonzero(pool.directory.indices < count).tolist()
    ids = {int(pool.directory.indices[place]): pool.directory.id(place) for place in places}
    found: list[Redrawn] = []
    uncounted = 0  # tries at a training scenario from which the axis could not start
    for index in range(count):
        if why := survey.too_many(pool.manifest, index, len(found) + uncounted):
            raise PoolError(f"{pool.folder}: {why}")
        try:
            for p in task.proposals(pool.split, pool.manifest.config.seed, index, design):
                certified = index in ids and p.refutation is None
                if certified and ids[index] != p.scenario.id:
                    raise PoolError(
                        f"{pool.folder}: index {index} gives {p.scenario.id}, but the pool holds {ids[index]}; "
                        "the family has changed since, generate the pool again"
                    )
                found.append(Redrawn(index, p.scenario, p.quantiles, p.refutation is None, certified))
        except Infeasible as error:
            uncounted += error.tries  # this index has no training scenario that the axis can move
        progress(index + 1, count)
    return found


def batch_of(task: Task, pool: Pool) -> Batch:
    """The scenarios of a pool by their parameter values.

    Raises:
        ScengenError: the pool holds a scenario twice, or one with parameters that are not the task's or out of bounds.
    """
    if id_ := pool.directory.repeated:
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
    """The first `count` scenarios of a pool."""
    return [task.scenario(params) for (params,) in islice(pool.columns("params"), count)]


def sampled_indices(pool: Pool) -> str:
    """The indices that `redrawn` repeats, as text; empty if it repeats all."""
    indices = pool.manifest.indices
    return f"of the first {MAX_REDRAWN} of {indices} indices" if indices > MAX_REDRAWN else ""
