"""find the level of an axis or a perturbation at which a policy breaks, from few rollouts"""

from collections.abc import Callable, Sequence
from dataclasses import replace

from rich.table import Table

from ...compose import chosen_task
from ...demos.rollouts import Keeper
from ...errors import BadConfig, cut
from ...evaluate.comparison import Comparison
from ...evaluate.policies import find_policy
from ...evaluate.rollouts import Evaluation
from ...evaluate.settings import PROFILE, other_version
from ...evaluate.threshold.pools import DrawnPools, LevelPools, given
from ...evaluate.threshold.result import ThresholdResult, rows
from ...evaluate.threshold.search import check, find, with_levels
from ...evaluate.threshold.settings import ThresholdSettings
from ...evaluate.threshold.shift import Shift
from ...pool import Pool
from ...pool.collection import write_index
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from ..tables import plain_table
from . import FAILED, OK, Arguments, err, names, out, remark, say, warn, write
from .settings import read, task_overrides

VERB = "evaluate threshold"
"""Name of the command."""
POOLS = "pools"
"""Folder of the drawn pools, below that of the results."""


def command(arguments: Arguments) -> int:
    if changed := task_overrides(arguments):
        raise BadConfig(
            f"{cut(changed[0])}; a search is about tasks as they are: leave it out, or generate pools with it"
        )
    settings, search = read(VERB, arguments, ThresholdSettings), search_path(arguments)
    settings = replace(settings, task=chosen_task(VERB, arguments) or "")
    every = settings.several()
    for one in every:  # before anything is certified
        one.check()
        find_policy(one.name, client=one.remote)
    shift = Shift.of(settings.task, settings.along, settings.levels, search)
    for one in every:
        check(one, shift)
    pools, found = _pools(settings, shift, search), list[Evaluation]()
    for one in every:
        if difference := other_version(one, search):
            remark(difference)
        with ProgressBar(err, f"threshold {one.name}", 1, one.workers) as progress_bar:
            found.append(_found(one, pools, progress_bar.of, search))
    drawn = {str(pool.folder): pool.sha256 for pool in pools.pools} if pools.is_drawn else {}
    if pools.is_drawn:
        write_index(settings.folder / POOLS, pools.pools)
    results = [
        ThresholdResult(one, replace(evaluation, drawn=drawn), shift)
        for one, evaluation in zip(every, found, strict=True)
    ]
    compared = Comparison(results)
    out.print(_table(results))
    for line in compared.headlines:
        say(line)
    for path, text in compared.files(settings.folder).items():
        write(path, text)
    if PROFILE in settings.format:
        from ...evaluate.threshold.plot import plots  # only here: matplotlib starts slowly

        for path, content in plots(results, settings.folder).items():
            write(path, content)
    incomplete = [_report(result, pools) for result in results]
    lines = [f"wrote {one.folder}: episodes.jsonl, episodes.csv" for one in every] if len(every) > 1 else []
    for told in (
        *lines,
        f"wrote {settings.folder}: table.md, table.json{'' if lines else ', episodes.jsonl, episodes.csv'}",
    ):
        say(told)
    return FAILED if any(incomplete) else OK


def _pools(settings: ThresholdSettings, shift: Shift, search: Sequence[str]) -> LevelPools:
    """The given pools, or fresh ones."""
    if settings.pool is not None:
        return given(shift, settings.folders, search)
    with ProgressBar(err, "certify", 1, settings.workers) as progress_bar:

        def progress(split: str, done: int, total: int) -> None:
            progress_bar.of(done, total, f"certify {split}")

        return DrawnPools(shift, search, [], True, settings.folder / POOLS, settings.seed, settings.workers, progress)


def _found(
    settings: ThresholdSettings, pools: LevelPools, progress: Callable[[int, int], None], search: Sequence[str]
) -> Evaluation:
    """The episodes of one policy, which are kept if that is requested."""
    if not settings.keep:
        return find(settings, pools, progress, search)
    with Keeper(with_levels(settings, pools), {pools.shift.task.name: pools.shift.task}) as keeper:
        found = find(settings, pools, progress, search, keeper)
        keeper.finish()
    return found


def _table(results: Sequence[ThresholdResult]) -> Table:
    """Success at each level."""
    shift, cells = results[0].shift, list(rows(results))
    title = f"{shift.task.name} along {shift.name}: success [%] with 95 % intervals, {results[0].settings.rules} rules"
    return plain_table(title, list(cells[0]), [list(row.values()) for row in cells])


def _report(result: ThresholdResult, pools: LevelPools) -> bool:
    """Print what is to be known about the run of one policy. Returns whether episodes are missing."""
    found = result.evaluation
    called = names((Pool.open(pool.folder) for pool in pools.pools), found.lost)
    for scenario, why in found.lost.items():
        warn(f"UNKNOWN {called[scenario]}: {why}; it is left out")
    crashed = sum(bool(episode["crashed"]) for episode in found.episodes)
    if crashed:
        remark(
            f"{result.settings.name} crashed in {crashed} of {len(found.episodes)} episodes, which count for nothing"
        )
    if found.earlier:
        say(f"{found.earlier} of {len(found.episodes)} episodes are from an earlier run; fresh=true repeats them")
    if found.spent.pictures:
        say(str(found.spent))
    return bool(found.lost or crashed)
