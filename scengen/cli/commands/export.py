"""write scenes as MJCF files that open in plain MuJoCo from any folder, or as worlds for mujoco_warp and MJX"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

from ...errors import BadConfig, UnknownName
from ...export.batch import NOTE, BatchWorld, of_layout, write_batch
from ...export.mjcf import export
from ...pool import Pool, PoolRow
from ...pool.library import Library
from ...runs.progress import ProgressBar
from ...work.parallel import UNTRUSTED_LIMITS, each
from ...work.targets import clear_unfinished, try_folder
from . import FAILED, OK, Arguments, chosen, counted, err, filled, holder, one, say, several, warn
from .settings import read

A = TypeVar("A")
MJCF = "mjcf"
"""Name of the format of single scenes."""
BATCH = "batch"
"""Name of the format of worlds."""


@dataclass(frozen=True)
class ExportSettings:
    """Settings of `scengen export`; conf/command/export.yaml explains them."""

    pool: str | list[str]
    id: str | None
    to: str
    robot: bool
    format: str
    layout: int | None

    def check(self) -> None:
        """Raise `ScengenError` if a setting has no meaning for the format."""
        if self.format not in (MJCF, BATCH):
            raise UnknownName("format", self.format, (MJCF, BATCH))
        if self.format == BATCH and not self.robot:
            raise BadConfig("robot = false; with format=batch the robot is in the scene, leave robot= out")
        if self.format == MJCF and self.layout is not None:
            raise BadConfig(f"layout = {self.layout}; only format=batch has layouts; leave it out")


def command(arguments: Arguments) -> int:
    settings = read("export", arguments, ExportSettings)
    settings.check()
    return _worlds(settings) if settings.format == BATCH else _scenes(settings)


def _scenes(settings: ExportSettings) -> int:
    """Write every scenario on its own."""
    try_folder(settings.to)
    pool = Pool.open(one(settings.pool)).check() if settings.id is None else holder(settings.pool, settings.id)
    rows = pool.rows(witness=False) if settings.id is None else [chosen(pool, settings.id)]
    work = partial(export, folder=Path(settings.to), robot=settings.robot)
    written, lost = _each(work, rows, len(pool) if settings.id is None else 1, settings.to)
    say(f"wrote {counted(len(written), 'scene')} to {settings.to}")
    return FAILED if lost else OK


def _worlds(settings: ExportSettings) -> int:
    """Write the scenarios of one task and layout together."""
    target = Path(settings.to)
    if not target.name:
        raise BadConfig(f"to = {settings.to}; name a new folder for the worlds")
    clear_unfinished(target)
    try_folder(target)
    if settings.id is None:
        pools = [filled(folder) for folder in several(settings.pool)]
        rows: Sequence[PoolRow] = Library(pools)
    else:
        pools = [holder(settings.pool, settings.id)]
        rows = [chosen(pools[0], settings.id)]
    if len(tasks := sorted({pool.task for pool in pools})) > 1:
        raise BadConfig(f"a batch has one task, and the pools have {', '.join(tasks)}; export them one by one")
    worlds, lost = _each(BatchWorld.of, rows, len(rows), settings.to)
    if not worlds:
        return FAILED
    found = of_layout(worlds, settings.layout)
    what = f"{len(found)} worlds of {len(found[0].fields['body_mass'])} bodies"
    say(f"wrote {what} to {target}" if write_batch(found, target) else f"{target} holds these {what} already")
    say(NOTE)
    return FAILED if lost else OK


@dataclass(frozen=True)
class Lost:
    """The result of a scenario that crashes or exceeds the limits."""

    why: str
    """Name of the scenario and reason."""

    @classmethod
    def of(cls, row: PoolRow, reason: str) -> "Lost":
        """The result of a scenario."""
        return cls(f"{row.name}: its export {reason}")


def _each(work: Callable[[PoolRow], A], rows: Iterable[PoolRow], total: int, to: str) -> tuple[list[A], bool]:
    """Apply some work to scenarios, each within the limits of a scenario.

    Returns:
        The results, and whether some scenarios were left out, which are printed.
    """
    made, lost = list[A](), list[Lost]()
    with ProgressBar(err, f"export to {to}", total) as progress_bar:
        for count, result in enumerate(each(work, rows, 1, UNTRUSTED_LIMITS, Lost.of), 1):
            lost.append(result) if isinstance(result, Lost) else made.append(result)
            progress_bar.show(count)
    for each_lost in lost:
        warn(f"UNKNOWN {each_lost.why}")
    return made, bool(lost)
