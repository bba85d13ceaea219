"""Which scenarios an environment plays: those of some pools, of a split, or one of them."""

from collections.abc import Sequence
from pathlib import Path

from ..collection import members
from ..errors import PoolError, UnknownName
from ..names import find
from ..pool import Pool, PoolRow
from ..validate.identity import check_versions

Folders = str | Path | Sequence[str | Path]
"""Folder of a pool, or several."""


def rows_of(pool: Folders | None, task: str) -> list[PoolRow]:
    """The rows of some pools without witnesses.

    Raises:
        PoolError: a pool is missing, damaged, empty, of another version or task, or there is none.
    """
    folders = [pool] if isinstance(pool, (str, Path)) else list(pool or ())
    if not folders:
        raise PoolError("no pool was named; say pool=FOLDER, or a list of them; scengen generate makes pools")
    return [row for folder in folders for each in _of_task(folder, task) for row in _rows(each, task)]


def _of_task(folder: str | Path, task: str) -> list[str]:
    """A pool, or of a folder of pools those of the task."""
    found = members(folder)
    if len(found) == 1:
        return found
    if not (own := [each for each in found if Pool.open(each).task == task]):
        raise PoolError(f"{folder} holds no pool of {task}; see scengen show pool={folder}")
    return own


def chosen(rows: Sequence[PoolRow], scenario: str | None, split: str | None = None) -> list[PoolRow]:
    """The scenarios of a split, and of these the one of that name.

    Args:
        scenario: what `Pool.row` takes: a name, an id, or how one begins.

    Raises:
        UnknownName: there is none.
        BadConfig: several ids begin so.
    """
    if split is not None:
        if split not in (known := {row.split for row in rows}):
            raise UnknownName("split in these pools", split, known)
        rows = [row for row in rows if row.split == split]
    if scenario is None:
        return list(rows)
    found = {row.id: row for row in rows}
    return [found[find(scenario, (row.name for row in found.values()), "these pools").id]]


def _rows(folder: str | Path, task: str) -> list[PoolRow]:
    pool = Pool.open(folder).check()
    check_versions(pool.versions, str(folder))
    rows = list(pool.rows(witness=False))
    if not rows:
        raise PoolError(f"{folder} holds no scenario; see scengen generate")
    if others := {row.task for row in rows} - {task}:
        raise PoolError(f"{folder} holds scenarios of {', '.join(sorted(others))}, not of {task}")
    return rows
