"""measure the costs that scengen documents, as ratios within one run"""

from dataclasses import dataclass

from rich.table import Table

from ..errors import at_least
from ..evaluate.speed import bench, certificates
from ..work.targets import try_file
from . import OK, Arguments, out, remark, write_json
from .settings import read


@dataclass(frozen=True)
class BenchSettings:
    """Settings of `scengen bench`; conf/command/bench.yaml explains them."""

    json: str | None
    repeats: int
    certify: bool


def command(arguments: Arguments) -> int:
    settings = read("bench", arguments, BenchSettings)
    at_least(settings, repeats=1)
    try_file(settings.json)
    tables: list[Table]
    noise = ""
    if settings.certify:
        table, result = certificates()
        tables = [table]
    else:
        tables, result, noise = bench(settings.repeats)
    for table in tables:
        out.print(table)
    if noise:
        remark(f"the machine was not quiet: {noise}; repeat the command when nothing else runs")
    if settings.json:
        write_json(settings.json, result)
    return OK
