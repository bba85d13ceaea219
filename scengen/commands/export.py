"""write scenes that open in plain MuJoCo from anywhere"""

from dataclasses import dataclass
from pathlib import Path

from ..config import read
from ..export.mjcf import export
from ..pool import Pool
from ..runs.progress import ProgressBar
from ..targets import try_folder
from . import OK, Arguments, err, one, say


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen export`; meanings stand in conf/command/export.yaml."""

    pool: str | list[str]
    id: str | None
    to: str
    robot: bool


def command(arguments: Arguments) -> int:
    settings = read("export", arguments, Settings)
    try_folder(settings.to)
    pool = Pool.open(one(settings.pool)).check()
    rows = [pool.row(settings.id)] if settings.id else list(pool.rows(witness=False))
    with ProgressBar(err, f"export to {settings.to}", len(rows)) as progress_bar:
        for count, row in enumerate(rows, 1):
            export(row, Path(settings.to), settings.robot)
            progress_bar.show(count)
    say(f"wrote {len(rows)} scenes to {settings.to}")
    return OK
