"""measure the costs that scengen documents, as ratios within one run"""

from dataclasses import dataclass
from typing import Any

from rich.table import Table

from ...bench.certificate_cost import certificates
from ...bench.speed import bench
from ...drift import speed as by_version
from ...drift.environment import environment, versions_of
from ...errors import BadConfig
from ...work.limits import at_least
from ...work.targets import try_file
from . import OK, Arguments, out, remark, say, write_json
from .settings import read


@dataclass(frozen=True)
class BenchSettings:
    """Settings of `scengen bench`; conf/command/bench.yaml explains them."""

    json: str | None
    repeats: int
    certify: bool
    mujoco: str | list[str] | None


def command(arguments: Arguments) -> int:
    settings = read("bench", arguments, BenchSettings)
    at_least(settings, repeats=1)
    try_file(settings.json)
    tables: list[Table]
    result: Any
    noise = ""
    if settings.mujoco is not None:
        if settings.certify:
            raise BadConfig("certify=true measures under the installed MuJoCo alone; leave out mujoco=")
        environments = [environment(version, say) for version in versions_of(settings.mujoco)]
        found = by_version.measured(environments, settings.repeats)
        tables = [by_version.table(found)]
        result = {
            version: {name: each.values for name, each in measures.items()} for version, measures in found.items()
        }
    elif settings.certify:
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
