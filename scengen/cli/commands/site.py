"""write a web site of tasks: films in three dimensions, axes next to training, figures"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

from ... import compose
from ...errors import BadConfig
from ...evidence import ledger
from ...ood.analysis.redraw import task_of
from ...pool import Pool
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from ...work.extras import module_of_extra
from ...work.targets import try_folder
from . import FAILED, OK, Arguments, counted, err, filled, say, several, warn
from .settings import read


@dataclass(frozen=True)
class SiteSettings:
    """Settings of `scengen site`; conf/command/site.yaml explains them."""

    pool: str | list[str] | None
    to: str
    records: str | None


def command(arguments: Arguments) -> int:
    module = module_of_extra("scengen.site.build", "the site needs", "studio")
    by_task = any(argument.startswith("task=") for argument in arguments)
    settings = read("site", [argument for argument in arguments if not argument.startswith("task=")], SiteSettings)
    if by_task and settings.pool is not None:
        raise BadConfig("give either task=NAME, to certify a scenario of it, or pool=FOLDER, to show those of pools")
    try_folder(settings.to)
    search = search_path(arguments)
    if settings.pool:
        shown = _of_pools(module, settings.pool, search)
    else:
        shown = [module.Shown(compose.load_task(name, search)) for name in compose.chosen_tasks("site", arguments)]
    with ledger.opened(settings.records, search), ProgressBar(err, "site", len(shown)) as bar:
        built = module.build(shown, Path(settings.to), search, lambda done, _, what: bar.show(done, what))
    for name, why in built.failed.items():
        warn(f"scengen: {name} has no page: {why}")
    made = f"{counted(len(built.made), 'task')} made, {len(built.kept)} up to date, {len(built.failed)} failed"
    say(f"wrote {Path(settings.to) / 'index.html'}: {made}")
    return FAILED if built.failed else OK


def _of_pools(module: ModuleType, folders: str | list[str], search: Sequence[str]) -> list[object]:
    """The tasks of some pools, each as it was when the first of its pools was made."""
    pools: dict[str, list[Pool]] = {}
    for pool in map(filled, several(folders)):
        pools.setdefault(pool.task, []).append(pool)
    return [module.Shown(task_of(own[0], search), own) for own in pools.values()]
