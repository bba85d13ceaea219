"""Which scenarios an environment plays: those of some pools, of a split, or one of them."""

from collections.abc import Sequence
from pathlib import Path

from ..errors import PoolError
from ..pool import Pool
from ..pool.collection import members
from ..pool.library import Library
from ..validate.identity import check_versions

Folders = str | Path | Sequence[str | Path]
"""Folder of a pool, or several."""


def rows_of(pool: Folders | None, task: str) -> Library:
    """The scenarios of some pools.

    Raises:
        PoolError: a pool is missing, damaged, empty, of another version or task, or there is none.
    """
    folders = [pool] if isinstance(pool, (str, Path)) else list(pool or ())
    if not folders:
        raise PoolError("no pool was named; say pool=FOLDER, or a list of them; scengen generate makes pools")
    return Library([_opened(each, task) for folder in folders for each in _of_task(folder, task)])


def _of_task(folder: str | Path, task: str) -> list[str]:
    """A pool, or of a folder of pools those of the task."""
    found = members(folder)
    if len(found) == 1:
        return found
    if not (own := [each for each in found if Pool.open(each).task == task]):
        raise PoolError(f"{folder} holds no pool of {task}; see scengen show pool={folder}")
    return own


def chosen(rows: Library, scenario: str | None, split: str | None = None) -> Library:
    """The scenarios of a split, and of these the one of that name.

    Args:
        scenario: what `Pool.row` takes: a name, an id, or how one begins.

    Raises:
        UnknownName: there is none.
        BadConfig: several ids begin so.
    """
    if split is not None:
        rows = rows.of_split(split)
    return rows if scenario is None else rows.only(rows.find(scenario))


def _opened(folder: str | Path, task: str) -> Pool:
    """A sound pool of a task."""
    pool = Pool.open(folder).check()
    check_versions(pool.manifest.versions, str(folder))
    tasks, _ = pool.kinds("task")
    if not tasks:
        raise PoolError(f"{folder} holds no scenario; see scengen generate")
    if others := {*tasks} - {task}:
        raise PoolError(f"{folder} holds scenarios of {', '.join(sorted(others))}, not of {task}")
    return pool
