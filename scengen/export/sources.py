"""Sources of recordings: pools, whose witnesses are played, and demonstrations."""

from collections.abc import Iterator, Sequence
from itertools import chain, islice, repeat

from ..errors import BadConfig, PoolError
from ..pool import Pool
from ..pool.demonstrations import Demonstrations, is_demonstrations
from ..pool.row import SceneRow
from ..validate.identity import check_versions

LEROBOT = "lerobot"
"""Value of `format` for a LeRobot data set."""
ROBOMIMIC = "robomimic"
"""Value of `format` for robomimic's file."""
Source = Pool | Demonstrations
"""Rows with actions to record."""


def open_source(folder: str) -> Source:
    """The pool or the demonstrations in a folder.

    Raises:
        PoolError: it holds neither.
    """
    return Demonstrations.open(folder) if is_demonstrations(folder) else Pool.open(folder)


def opened(folders: Sequence[str], format: str) -> list[Source]:
    """The pools or the demonstrations to record.

    Raises:
        ScengenError: they are damaged, or cannot be recorded together or in this format.
    """
    found = [open_source(folder).check() for folder in folders]
    demonstrated = [isinstance(source, Demonstrations) for source in found]
    if any(demonstrated) and not all(demonstrated):
        raise BadConfig("pools and demonstrations have different columns; record them separately")
    if any(demonstrated) and format == ROBOMIMIC:
        raise BadConfig(f"format = {format}; its environment plays pools alone: record demonstrations as {LEROBOT}")
    return found


def scenes_of(pools: Sequence[Source], task: str) -> Iterator[str]:
    """Texts of the scenes of a task in some pools."""
    holding = [pool for pool in pools if task in pool.kinds("task")[0]]
    return (scene for pool in holding for name, scene in pool.columns("task", "scene_xml") if name == task)


def rows_of(pools: Sequence[Source], count: int) -> Iterator[SceneRow]:
    """The first rows of some sources."""
    return islice(chain.from_iterable(map(_rows_of, pools)), count)


def _rows_of(source: Source) -> Iterator[SceneRow]:
    yield from source.rows()


def origins_of(pools: Sequence[Source], count: int) -> Iterator[dict[str, str]]:
    """Source and operator of each of the first rows, for demonstrations; nothing for pools."""
    return islice(chain.from_iterable(repeat(_origin(source), len(source)) for source in pools), count)


def _origin(source: Source) -> dict[str, str]:
    if isinstance(source, Pool):
        return {}
    return {"source": source.manifest.source, "operator": source.manifest.operator or ""}


def robot_of(pools: Sequence[Source]) -> str:
    """The one embodiment of all scenarios."""
    robots = set()
    for pool in pools:
        check_versions(pool.manifest.versions, str(pool.folder))
        robots |= {*pool.kinds("embodiment")[0]}
    if not robots:
        raise PoolError(f"{', '.join(str(pool.folder) for pool in pools)}: no scenario to record; see scengen generate")
    if len(robots) > 1:
        raise BadConfig(f"pools for {' and '.join(sorted(robots))}; a data set has one robot: record them separately")
    return robots.pop()
