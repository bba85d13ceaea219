"""choose the scenarios that cover a pool best, and write them as a new pool"""

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ...errors import BadConfig
from ...ood.analysis.coverage import farthest_points
from ...ood.analysis.redraw import batch_of, task_of
from ...ood.analysis.space import of_tables
from ...pool import Pool
from ...pool.kinds import check_target
from ...pool.manifest import MANIFEST, Manifest
from ...pool.writing import write_pool
from ...samplers.task_files import search_path
from ...validate import lock
from ...work.targets import appearing, clear_unfinished, try_folder
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
    check_target(target, MANIFEST)
    clear_unfinished(target)
    try_folder(target)
    task = task_of(pool, search_path(arguments))
    batch = batch_of(task, pool)
    points = of_tables(task, batch.values).of(batch.values, len(batch))
    chosen = sorted(farthest_points(points, settings.n).tolist())
    about = replace(
        pool.manifest.without_files(), n=settings.n, subset={"of": pool.sha256, "chosen": "max-min coverage"}
    )
    if Path(target, MANIFEST).exists():
        return _again(target, pool, about, chosen)
    with appearing(target, folder=True) as part:
        subset = _write(part, pool, about, chosen)
    say(f"wrote {settings.n} of {len(pool)} scenarios to {target}")
    say(f"pool sha256: {subset}")
    return OK


def _write(folder: Path, pool: Pool, about: Manifest, chosen: Sequence[int]) -> str:
    """Write the scenarios at some places of a pool as another one, whose hash is returned."""
    subset = write_pool(folder, about, pool.some(chosen))
    if lock.read_lock(pool.folder) is not None:
        shutil.copyfile(pool.folder / lock.LOCK_FILE, folder / lock.LOCK_FILE)
    return subset.sha256


def _again(target: Path, pool: Pool, about: Manifest, chosen: Sequence[int]) -> int:
    """The end of a command that was repeated, for one that was killed when all was written.

    Raises:
        BadConfig: the target holds another pool.
    """
    with tempfile.TemporaryDirectory() as made:
        same = _write(Path(made), pool, about, chosen) == Pool.open(target).check().sha256
    if not same:
        raise BadConfig(f"{target} is a pool already, and not this subset; choose another to=")
    say(f"{target} holds this subset already")
    return OK
