"""write scenes as MJCF files that open in plain MuJoCo from any folder"""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from ...export.mjcf import export
from ...pool import Pool, PoolRow
from ...runs.progress import ProgressBar
from ...work.parallel import UNTRUSTED_LIMITS, each
from ...work.targets import try_folder
from . import FAILED, OK, Arguments, chosen, err, holder, one, say, warn
from .settings import read


@dataclass(frozen=True)
class ExportSettings:
    """Settings of `scengen export`; conf/command/export.yaml explains them."""

    pool: str | list[str]
    id: str | None
    to: str
    robot: bool


def command(arguments: Arguments) -> int:
    settings = read("export", arguments, ExportSettings)
    try_folder(settings.to)
    pool = Pool.open(one(settings.pool)).check() if settings.id is None else holder(settings.pool, settings.id)
    rows = pool.rows(witness=False) if settings.id is None else [chosen(pool, settings.id)]
    count, lost = 0, []
    with ProgressBar(err, f"export to {settings.to}", len(pool) if settings.id is None else 1) as progress_bar:
        work = partial(export, folder=Path(settings.to), robot=settings.robot)
        for count, why in enumerate(each(work, rows, 1, UNTRUSTED_LIMITS, _lost), 1):
            lost += [why] if why else []
            progress_bar.show(count)
    for why in lost:
        warn(f"UNKNOWN {why}")
    say(f"wrote {count - len(lost)} scenes to {settings.to}")
    return FAILED if lost else OK


def _lost(row: PoolRow, reason: str) -> str:
    return f"{row.name}: its export {reason}"
