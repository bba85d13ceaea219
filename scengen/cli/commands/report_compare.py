"""measure the distances of pools from training and from each other, and leakage"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ...errors import BadConfig
from ...ood.analysis.contrast import apart
from ...ood.analysis.coverage import evenness
from ...ood.analysis.distance import (
    MAX_ENERGY_SCENARIOS,
    MAX_PAIRS,
    NearDuplicate,
    near_duplicates,
    per_parameter,
)
from ...ood.analysis.redraw import batch_of, redrawn, sampled_indices, task_of
from ...ood.analysis.space import Batch
from ...ood.analysis.tables import SHOWN_PAIRS, pairs_table
from ...pool import Pool
from ...samplers.task import Task
from ...samplers.task_files import search_path
from ...work.limits import at_least
from ...work.targets import try_file
from . import FAILED, OK, Arguments, filled, names, out, say, several, write_json
from .settings import read


@dataclass(frozen=True)
class CompareSettings:
    """Settings of `scengen report compare`; conf/command/report_compare.yaml explains them."""

    pool: str | list[str]
    within: float
    permutations: int
    json: str | None


def command(arguments: Arguments) -> int:
    settings = read("report compare", arguments, CompareSettings)
    try_file(settings.json)
    at_least(settings, permutations=1)
    if not 0 < settings.within <= 1000:
        raise BadConfig(f"within = {settings.within:g}; it must lie above 0 and at most at 1000 training widths")
    pools = [filled(folder) for folder in several(settings.pool)]
    search = search_path(arguments)
    task, names = task_of(pools[0], search), {task_of(pool, search).name for pool in pools}
    if len(names) > 1:
        raise BadConfig(
            f"pool = {','.join(several(settings.pool))}; pools of {', '.join(sorted(names))}; give pools of one task"
        )
    first, *others = ((pool, batch_of(task, pool)) for pool in pools)
    result = [_own_figures(task, *first, settings, search)]
    for other in others:
        result += [_own_figures(task, *other, settings, search), _contrast(task, first, other, settings)]
    if settings.json:
        write_json(settings.json, result)
    return FAILED if any(r["near_duplicates"] for r in result) else OK


def _own_figures(
    task: Task, pool: Pool, batch: Batch, settings: CompareSettings, search: Sequence[str]
) -> dict[str, Any]:
    """Print and return the distance of a pool from training, its evenness, and its near duplicates."""
    distances = per_parameter(task, batch)
    words = "; ".join(
        f"{name} {mean:.2f} on average, {least:.2f} at least" for name, (least, mean) in distances.items()
    )
    say(f"{pool.folder}: {len(batch)} scenarios")
    say(f"  outside training by [training widths]: {words or 'nothing'}")
    even = None
    if len(batch) and not pool.manifest.is_subset:
        certified = [list(p.quantiles.values()) for p in redrawn(pool, search=search) if p.certified]
        if certified[0]:
            even = evenness(np.array(certified))
            of = f", {sampled_indices(pool)}" if sampled_indices(pool) else ""
            say(f"  discrepancy: {even.relative:.2f} times that of as many independent draws{of}")
    pairs = near_duplicates(task, batch, within=settings.within)
    if pairs:
        out.print(pairs_table(pairs, "in the pool", "again", names([pool], _ids(pairs))))
    return {
        "pool": str(pool.folder),
        "outside": {name: {"least": least, "mean": mean} for name, (least, mean) in distances.items()},
        "evenness": asdict(even) if even else None,
        "near_duplicates": [asdict(p) for p in pairs],
    }


Side = tuple[Pool, Batch]


def _contrast(task: Task, one: Side, other: Side, settings: CompareSettings) -> dict[str, Any]:
    """Print and return the energy distance between the first pool and another one, and their near duplicates."""
    (pool, here), (beside, there) = one, other
    found = apart(task, pool, beside, settings.permutations)
    few = f" of the first {MAX_ENERGY_SCENARIOS} scenarios" if max(len(here), len(there)) > MAX_ENERGY_SCENARIOS else ""
    say(f"{pool.folder} to {beside.folder}: {found} [training ranges]{few}")
    pairs = near_duplicates(task, here, there, settings.within)
    if pairs:
        out.print(pairs_table(pairs, str(pool.folder), str(beside.folder), names([pool, beside], _ids(pairs))))
    more = " or more" if len(pairs) == MAX_PAIRS else ""
    say(f"  nearer than {settings.within:g} training widths in every parameter: {len(pairs)} pairs{more}")
    return {
        "pools": [str(pool.folder), str(beside.folder)],
        **asdict(found),
        "near_duplicates": [asdict(p) for p in pairs],
    }


def _ids(pairs: Sequence[NearDuplicate]) -> list[str]:
    """Ids of the scenarios in the printed pairs."""
    return [id_ for pair in pairs[:SHOWN_PAIRS] for id_ in (pair.one, pair.other)]
