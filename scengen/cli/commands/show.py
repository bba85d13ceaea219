"""print the contents of a pool or of one scenario, and draw them"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from ...errors import BadConfig
from ...look.looks import look_named
from ...ood.analysis.redraw import task_of
from ...pictures import film, render
from ...pictures.sheet import contact_sheet
from ...pool import Pool
from ...pool.demonstrations import Demonstrations, is_demonstrations
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from ...validate.playable import check_row
from ...work.limits import at_least
from ...work.targets import try_file
from .. import tables
from . import OK, Arguments, chosen, err, holder, identified, out, remark, say, several, write, write_json
from .settings import read

MAX_DETAILED_POOLS = 3
"""Largest number of pools whose scenarios are listed. More pools get one line each."""


NESTED = ("params", "shifted")
"""Columns that shards store as JSON."""


@dataclass(frozen=True)
class ShowSettings:
    """Settings of `scengen show`; conf/command/show.yaml explains them."""

    pool: str | list[str]
    id: str | None
    index: int | None
    to: str | None
    images: int
    films: bool
    look: str
    json: str | None


def command(arguments: Arguments) -> int:
    settings = read("show", arguments, ShowSettings)
    if settings.index is not None:
        settings = replace(settings, id=identified(settings.pool, settings.id, settings.index))
    try_file(settings.json)
    target, look = Path(settings.to) if settings.to else None, look_named(settings.look)
    if settings.id is None:
        at_least(settings, images=0)
        if target and target.suffix != ".html":
            raise BadConfig(
                f"to = {target}; give an .html file for a contact sheet, or id= for a film strip of one scenario"
            )
        try_file(target)
        if any(map(is_demonstrations, folders := several(settings.pool))):
            return _show_runs(settings, folders)
        pools = [Pool.open(folder).check() for folder in folders]
        if len(pools) > MAX_DETAILED_POOLS:
            out.print(tables.pools_table(pools))
        else:
            for pool in pools:
                out.print(tables.pool_table(pool))
                out.print(tables.funnel_table(pool.manifest.funnel, pool.manifest.reasons))
                say(f"pool sha256: {pool.sha256}")
        data: Any = [_plain(pool) for pool in pools]
        if target:
            with ProgressBar(err, "contact sheet", 1) as bar:
                made = [(pool, task_of(pool, search_path(arguments))) for pool in pools]
                if missing := contact_sheet(made, target, settings.images, settings.films, bar.of, look):
                    remark(f"{target} has no pictures: {missing}")
    else:
        if target and target.suffix != ".png":
            raise BadConfig(f"to = {target}; give a .png file for the film strip of a scenario")
        try_file(target)
        pool = holder(settings.pool, settings.id)
        row = chosen(pool, settings.id)
        for table in tables.scenario_tables(row):
            out.print(table)
        nested = {name: json.loads(value) for name, value in row.plain().items() if name in NESTED}
        data = {**row.plain(), **nested}
        if target:
            render.check_pictures()
            scenario = task_of(pool, search_path(arguments)).scenario(row.params)
            take = replace(film.Take.witness(check_row(row), scenario), look=look)
            write(target, render.encode(film.strip(take), "png"))
    if target:
        say(f"wrote {target}")
    if settings.json:
        write_json(settings.json, data)
    return OK


def _show_runs(settings: ShowSettings, folders: Sequence[str]) -> int:
    """Print what demonstrations or rollouts of a policy are, with a line for each run."""
    if settings.to:
        hint = "scengen show film pool=... id=... draws one run"
        raise BadConfig(f"to = {settings.to}; a contact sheet shows pools, and {folders[0]} is demonstrations; {hint}")
    sources = [Demonstrations.open(folder).check() for folder in folders]
    for source in sources:
        say(tables.nature(source))
        out.print(tables.runs_table(source))
    if settings.json:
        plain = [{"folder": str(each.folder), "is": tables.nature(each), **asdict(each.manifest)} for each in sources]
        write_json(settings.json, plain)
    return OK


def _plain(pool: Pool) -> dict[str, Any]:
    """A pool as plain data: its scenarios by name with their parameters, and its rejection report."""
    rows = zip(pool.names(), pool.columns("params"), strict=True)
    scenarios = {str(name): dict(params) for name, (params,) in rows}
    told = {name: getattr(pool.manifest, name) for name in ("n", "indices", "first_draws", "funnel", "reasons")}
    return {"pool": str(pool.folder), "sha256": pool.sha256, "split": pool.split, **told, "scenarios": scenarios}
