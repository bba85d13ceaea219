"""The scenarios that an environment plays: those of some pools, of a split, or one of them.

A small certified pool of every task comes with scengen; it is played if no pool is given.
"""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from ..errors import PoolError
from ..pool import Pool, PoolRow
from ..pool.collection import members
from ..pool.demonstrations import Demonstrations, is_demonstrations
from ..pool.library import Library
from ..pool.rows import AnyRow
from ..samplers.task import Task
from ..samplers.task_files import ID, shipped, version
from ..samplers.task_files import tasks as known_tasks
from ..validate.identity import check_versions

Folders = str | Path | Sequence[str | Path]
"""Folder of a pool, or several folders."""
AnyRows = TypeVar("AnyRows", Pool, Demonstrations)


def rows_of(pool: Folders | Library[PoolRow] | None, task: str) -> Library[PoolRow]:
    """The scenarios of some pools; those of a library, which has been checked, as they are.

    Args:
        pool: None for the pool of the task that comes with scengen.

    Raises:
        PoolError: there is no pool, or one is missing, damaged, empty, or of another version or task.
    """
    if isinstance(pool, Library):
        return pool
    folders = [reference_pool(task)] if pool is None else [pool] if isinstance(pool, (str, Path)) else list(pool)
    if not folders:
        raise PoolError("no pool was given; give pool=FOLDER or a list of folders; scengen generate makes pools")
    return Library([_checked(Pool.open(each), task) for folder in folders for each in _pools_of_task(folder, task)])


def reference_pool(task: str) -> Path:
    """Folder of the certified training scenarios of a task that come with scengen.

    Raises:
        PoolError: the task is one of another package.
    """
    folder = shipped("generated") / "reference" / f"{task}-{ID}"
    if not folder.is_dir():
        remedy = f"give pool=FOLDER, which scengen generate task={task} pool=FOLDER makes"
        raise PoolError(f"no pool was given, and none of {task} comes with scengen; {remedy}")
    return folder


def scenes_drawn_otherwise(rows: Library[Any], task: Task) -> Iterator[str]:
    """Scenes of the pools that were not drawn from the distributions of a task: their bodies may be others."""
    for pool in rows.pools:
        if pool.manifest.config.split.partition("@")[0] not in (ID, *task.axes) or _drawn(pool) != _spaces(task.node):
            yield from (scene for (scene,) in pool.columns("scene_xml"))


def _drawn(pool: Any) -> list[Any]:
    return _spaces(pool.manifest.config.task)


def _spaces(node: Mapping[str, Any]) -> list[Any]:
    """The distributions of a task's file: those of training and of all axes."""
    axes = node.get("axes") or {}
    return [node.get("id"), {name: axis.get("replace") for name, axis in axes.items()}]


def located(pool: Folders | Library[PoolRow] | None) -> Folders | Library[PoolRow] | None:
    """Folders by their absolute paths, which hold in every process and working folder."""
    if isinstance(pool, (str, Path)):
        return Path(pool).absolute()
    return pool if pool is None or isinstance(pool, Library) else [Path(each).absolute() for each in pool]


def scenes_of(pool: Folders, task: str) -> Library[Any]:
    """The scenarios of some pools or demonstrations, for environments that need no certificate.

    Raises:
        PoolError: as `rows_of`.
    """
    folders = [pool] if isinstance(pool, (str, Path)) else list(pool)
    demonstrated = [folder for folder in folders if is_demonstrations(folder)]
    if not demonstrated:
        return rows_of(pool, task)
    if len(demonstrated) < len(folders):
        raise PoolError("pools and demonstrations were given together; give one kind")
    return Library([_checked(Demonstrations.open(folder), task) for folder in folders])


def _pools_of_task(folder: str | Path, task: str) -> list[str]:
    """The pool in a folder, or, in a folder of pools, those of the task."""
    found = members(folder)
    if len(found) == 1:
        return found
    if not (own := [each for each in found if Pool.open(each).task == task]):
        raise PoolError(f"{folder} holds no pool of {task}; see scengen show pool={folder}")
    return own


def chosen(rows: Library[AnyRow], scenario: str | None, split: str | None = None) -> Library[AnyRow]:
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


def _checked(pool: AnyRows, task: str) -> AnyRows:
    """Undamaged rows of a task.

    Raises:
        PoolError: they are damaged, empty, or of another version or task.
    """
    check_versions(pool.check().manifest.versions, str(pool.folder))
    tasks, _ = pool.kinds("task")
    if not tasks:
        raise PoolError(f"{pool.folder} holds no scenario; fill it with scengen generate")
    if others := {*tasks} - {task}:
        raise PoolError(f"{pool.folder} holds scenarios of {', '.join(sorted(others))}, not of {task}")
    if difference := of_another_version(pool):
        warnings.warn(difference, stacklevel=2)
    return pool


def of_another_version(pool: Pool | Demonstrations) -> str:
    """A line about a pool whose task has another version here; empty if it has the same one."""
    here = version(pool.task) if pool.task in known_tasks() else pool.manifest.task_version
    made = pool.manifest.task_version
    if made == here:
        return ""
    message = f"{pool.folder} was made on version {made} of {pool.task}; installed: {here}"
    return f"{message}; its scenes are played under the installed rules, see scengen verify"
