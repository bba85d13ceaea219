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


def opened(folders: Sequence[str]) -> list[Source]:
    """The pools or the demonstrations to record.

    Raises:
        ScengenError: they are damaged, or cannot be recorded together.
    """
    found = [open_source(folder).check() for folder in folders]
    demonstrated = [isinstance(source, Demonstrations) for source in found]
    if any(demonstrated) and not all(demonstrated):
        raise BadConfig("pools and demonstrations have different columns; record them separately")
    return found


def scenes_of(pools: Sequence[Source], task: str) -> Iterator[str]:
    """Texts of the scenes of a task in some pools."""
    holding = [pool for pool in pools if task in pool.kinds("task")[0]]
    return (scene for pool in holding for name, scene in pool.columns("task", "scene_xml") if name == task)


def rows_of(pools: Sequence[Source], count: int, failed: bool = False) -> Iterator[SceneRow]:
    """The first rows of some sources.

    Args:
        failed: whether the failed attempts of demonstrations count, too, if they were kept.
    """
    found = (s.attempts() if failed and isinstance(s, Demonstrations) else s.rows() for s in pools)
    return islice(chain.from_iterable(found), count)


def number_of(source: Source, failed: bool) -> int:
    """Number of the rows of a source, see `rows_of`."""
    kept = source.manifest.failed if failed and isinstance(source, Demonstrations) else None
    return len(source) + (kept.rows if kept else 0)


def origins_of(pools: Sequence[Source], count: int, failed: bool = False) -> Iterator[dict[str, str]]:
    """Design of the draws of each of the first rows; for demonstrations also source, operator and rules."""
    return islice(chain.from_iterable(repeat(_origin(s), number_of(s, failed)) for s in pools), count)


def _origin(source: Source) -> dict[str, str]:
    sampler = source.manifest.config.sampler
    if isinstance(source, Pool):
        return {"sampler": sampler}
    about = source.manifest
    return {"sampler": sampler, "source": about.source, "operator": about.operator or "", "rules": about.config.rules}


def texts_of(source: Source, name: str, failed: bool) -> set[str]:
    """The different texts in a column such as `task`, see `rows_of`."""
    found = {*source.kinds(name)[0]}
    if failed and isinstance(source, Demonstrations):
        found |= {getattr(row, name) for row in source.failures()}
    return found


def robot_of(pools: Sequence[Source], failed: bool = False) -> str:
    """The one embodiment of all scenarios, see `rows_of`."""
    robots = set()
    for pool in pools:
        check_versions(pool.manifest.versions, str(pool.folder))
        robots |= texts_of(pool, "embodiment", failed)
    if not robots:
        raise PoolError(f"{', '.join(str(pool.folder) for pool in pools)}: no scenario to record; see scengen generate")
    if len(robots) > 1:
        raise BadConfig(f"pools for {' and '.join(sorted(robots))}; a data set has one robot: record them separately")
    return robots.pop()
