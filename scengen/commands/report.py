"""a page about whole pools: losses, distance from training, certification bias, coverage, leakage"""

from dataclasses import dataclass
from pathlib import Path

from ..analysis.overview import gather, page, plain
from ..config import read, typed
from ..errors import BadConfig
from ..pool import Pool
from . import OK, Arguments, err, out, several, write_json


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen report`; meanings stand in conf/command/report.yaml."""

    pool: str | list[str] = ""
    to: str = "generated/report.html"
    json: str | None = None


def command(arguments: Arguments) -> int:
    settings = typed("", Settings, read("report", arguments).settings)
    if Path(settings.to).suffix != ".html":
        raise BadConfig(f"to = {settings.to}; a report is an .html file")
    pools = [Pool.open(folder).check() for folder in several(settings.pool)]
    overviews, contrasts = gather(pools)
    if remark := page(pools, overviews, contrasts, Path(settings.to)):
        err.print(f"scengen: the report has no pictures: {remark}", highlight=False, markup=False)
    if settings.json:
        write_json(settings.json, plain(overviews, contrasts))
    for found in overviews:
        bent = f", BENT in {', '.join(found.bias.flagged)}" if found.bias and found.bias.flagged else ""
        out.print(f"{found.folder}: {found.scenarios} certified of {found.funnel['proposed']}{bent}", highlight=False)
    leaks = sum(len(c.shared) for c in contrasts)
    out.print(f"{leaks} near duplicates between pools; wrote {settings.to}", highlight=False)
    return OK
