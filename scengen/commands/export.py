"""write scenes that open in plain MuJoCo from anywhere"""

from dataclasses import dataclass
from pathlib import Path

from ..config import read, typed
from ..export.mjcf import export
from ..pool import Pool
from ..runs.progress import Bar
from . import OK, Arguments, err, one, out


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen export`; meanings stand in conf/command/export.yaml."""

    pool: str | list[str] = ""
    id: str | None = None
    to: str = ""
    robot: bool = True


def command(arguments: Arguments) -> int:
    settings = typed("", Settings, read("export", arguments).settings)
    pool = Pool.open(one(settings.pool)).check()
    rows = [pool.row(settings.id)] if settings.id else list(pool.rows())
    with Bar(err, f"export to {settings.to}", len(rows)) as bar:
        for count, row in enumerate(rows, 1):
            export(row, Path(settings.to), settings.robot)
            bar.show(count)
    out.print(f"wrote {len(rows)} scenes to {settings.to}", highlight=False)
    return OK
