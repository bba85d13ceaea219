"""write a page about pools: losses, distance from training, bias, coverage, leakage"""

from dataclasses import dataclass
from pathlib import Path

from ...errors import BadConfig
from ...ood.analysis.overview import gather, page, plain
from ...pool import Pool
from ...samplers.task_files import search_path
from ...work.targets import try_file
from . import OK, Arguments, remark, say, several, write_json
from .settings import read


@dataclass(frozen=True)
class ReportSettings:
    """Settings of `scengen report`; conf/command/report.yaml explains them."""

    pool: str | list[str]
    to: str
    json: str | None


def command(arguments: Arguments) -> int:
    settings = read("report", arguments, ReportSettings)
    if Path(settings.to).suffix != ".html":
        raise BadConfig(f"to = {settings.to}; give an .html file")
    try_file(settings.to)
    try_file(settings.json)
    pools = [Pool.open(folder).check() for folder in several(settings.pool)]
    search = search_path(arguments)
    overviews, contrasts = gather(pools, search)
    if missing := page(pools, overviews, contrasts, Path(settings.to), search):
        remark(f"the report has no pictures: {missing}")
    if settings.json:
        write_json(settings.json, plain(overviews, contrasts))
    for found in overviews:
        biased = f", selection bias in {', '.join(found.bias.flagged)}" if found.bias and found.bias.flagged else ""
        say(f"{found.folder}: {found.scenarios} certified of {found.funnel['proposed']}{biased}")
    leaks = sum(len(c.shared) for c in contrasts)
    say(f"{leaks} near duplicates between pools; wrote {settings.to}")
    return OK
