"""choose the scenarios that cover a pool best, and write them as a new pool"""

import shutil
from dataclasses import dataclass, replace
from pathlib import Path

from ...errors import BadConfig
from ...ood.analysis.coverage import farthest_points
from ...ood.analysis.redraw import batch_of, task_of
from ...ood.analysis.space import of_tables
from ...pool.kinds import check_target
from ...pool.writing import write_pool
from ...samplers.task_files import search_path
from ...validate import lock
from ...work.targets import appearing, check_unfinished, try_folder
from . import OK, Arguments, filled, one, say
from .settings import read


@dataclass(frozen=True)
class SubsetSettings:
    """Settings of `scengen subset`; conf/command/subset.yaml explains them."""

    pool: str | list[str]
    n: int
    to: str


def command(arguments: Arguments) -> int:
    settings = read("subset", arguments, SubsetSettings)
    pool, target = filled(one(settings.pool)), Path(settings.to)
    if not target.name:
        raise BadConfig(f"to = {settings.to}; give a folder for the new pool")
    if not 1 <= settings.n <= len(pool):
        raise BadConfig(
            f"n = {settings.n}; it must lie in [1, {len(pool)}], because {pool.folder} has {len(pool)} scenarios"
        )
    check_target(target)
    check_unfinished(target)
    try_folder(target)
    locked = lock.read_lock(pool.folder)
    task = task_of(pool, search_path(arguments))
    batch = batch_of(task, pool)
    points = of_tables(task, batch.values).of(batch.values, len(batch))
    chosen = sorted(farthest_points(points, settings.n).tolist())
    about = replace(
        pool.manifest.without_files(), n=settings.n, subset={"of": pool.sha256, "chosen": "max-min coverage"}
    )
    with appearing(target, folder=True) as part:
        subset = write_pool(part, about, pool.some(chosen))
        told = f"pool sha256: {subset.sha256}"
        if locked is not None:
            shutil.copyfile(pool.folder / lock.LOCK_FILE, part / lock.LOCK_FILE)
    say(f"wrote {settings.n} of {len(pool)} scenarios to {target}")
    say(told)
    return OK
