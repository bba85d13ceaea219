"""The scenarios that an environment plays: those of some pools, of a split, or one of them."""

from collections.abc import Sequence
from pathlib import Path

from ..errors import PoolError
from ..pool import Pool
from ..pool.collection import members
from ..pool.library import Library
from ..validate.identity import check_versions

Folders = str | Path | Sequence[str | Path]
"""Folder of a pool, or several folders."""


def rows_of(pool: Folders | Library | None, task: str) -> Library:
    """The scenarios of some pools; those of a library, which has been checked, as they are.

    Raises:
        PoolError: no pool is given, or one is missing, damaged, empty, or of another version or task.
    """
    if isinstance(pool, Library):
        return pool
    folders = [pool] if isinstance(pool, (str, Path)) else list(pool or ())
    if not folders:
        raise PoolError("no pool was given; give pool=FOLDER or a list of folders; scengen generate makes pools")
    return Library([_open_checked(each, task) for folder in folders for each in _pools_of_task(folder, task)])


def _pools_of_task(folder: str | Path, task: str) -> list[str]:
    """The pool in a folder, or, in a folder of pools, those of the task."""
    found = members(folder)
    if len(found) == 1:
        return found
    if not (own := [each for each in found if Pool.open(each).task == task]):
        raise PoolError(f"{folder} holds no pool of {task}; see scengen show pool={folder}")
    return own


def chosen(rows: Library, scenario: str | None, split: str | None = None) -> Library:
    """The scenarios of a split, or one of them.

    Args:
        scenario: name, id, or unique prefix of an id, as in `Pool.row`. Default: all scenarios.
        split: name of the split. Default: all splits.

    Raises:
        UnknownName: there is no such scenario or split.
        BadConfig: several ids have this prefix.
    """
    if split is not None:
        rows = rows.of_split(split)
    return rows if scenario is None else rows.only(rows.find(scenario))


def _open_checked(folder: str | Path, task: str) -> Pool:
    """An undamaged pool of a task."""
    pool = Pool.open(folder).check()
    check_versions(pool.manifest.versions, str(folder))
    tasks, _ = pool.kinds("task")
    if not tasks:
        raise PoolError(f"{folder} holds no scenario; fill it with scengen generate")
    if others := {*tasks} - {task}:
        raise PoolError(f"{folder} holds scenarios of {', '.join(sorted(others))}, not of {task}")
    return pool
