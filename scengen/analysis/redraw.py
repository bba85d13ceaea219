"""What a pool was chosen from: its manifest and seed are enough to draw every proposal again."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import BadConfig, Infeasible, PoolError
from ..params import with_values
from ..pool import Pool
from ..samplers.task import Task, load
from ..scenario import Scenario


@dataclass(frozen=True)
class Proposed:
    """One draw that a run made."""

    index: int
    scenario: Scenario
    quantiles: Mapping[str, float]
    """What the design gave for each parameter that varies, in (0, 1)."""
    feasible: bool
    """Whether the family's own constraints let it through to the certifier."""
    certified: bool


def task_of(pool: Pool) -> Task:
    """The task as it was when the pool was made: from the manifest, not from conf/.

    Raises:
        ScengenError: the family has changed so that the task does not fit it any more.
    """
    node = dict(pool.manifest["config"]["task"])
    return load(node.pop("name"), node)


def proposed(pool: Pool, progress: Callable[[int, int], None] = lambda done, total: None) -> list[Proposed]:
    """Draw everything again that the pool's run has drawn, infeasible tries included.

    Args:
        progress: told how many of how many indices are done.

    Raises:
        BadConfig: the pool is a chosen subset, for which there are no proposals.
        PoolError: other scenarios come out than the pool holds.
    """
    if "subset" in pool.manifest:
        raise BadConfig(f"{pool.folder} is a subset of another pool, chosen and not drawn; give the pool it came from")
    task, config, total = task_of(pool), pool.manifest["config"], pool.manifest["indices"]
    design = task.design(_sampler(config))
    ids = {row["index"]: row["id"] for row in pool.rows(["index", "id"])}
    found: list[Proposed] = []
    for index in range(total):
        try:
            for p in task.proposals(config["split"], config["seed"], index, design):
                certified = index in ids and p.refutation is None
                if certified and ids[index] != p.scenario.id:
                    raise PoolError(
                        f"{pool.folder}: index {index} comes out as {p.scenario.id}, but the pool holds {ids[index]}; "
                        "the family has changed since, generate the pool again"
                    )
                found.append(Proposed(index, p.scenario, p.quantiles, p.refutation is None, certified))
        except Infeasible:
            pass  # without a training scenario of this index there was nothing for the axis to move
        progress(index + 1, total)
    return found


def scenarios_of(task: Task, pool: Pool) -> dict[str, Scenario]:
    """The scenarios of a pool by id."""
    start = task.family()
    return {row["id"]: with_values(start, json.loads(row["params"])) for row in pool.rows(["id", "params"])}


def _sampler(config: Mapping[str, Any]) -> str:
    return config.get("sampler", "iid")  # pools made before there was a choice
