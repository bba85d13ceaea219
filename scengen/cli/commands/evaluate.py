"""measure the success rate of policies, in and out of distribution, with intervals"""

from collections.abc import Sequence
from dataclasses import replace

from ...compose import load_task
from ...demos.rollouts import Keeper
from ...evaluate.arms import BENIGN
from ...evaluate.benign import benign_pools
from ...evaluate.comparison import MAX_SHOWN, Comparison, PolicyResult
from ...evaluate.edition import Edition, check_pool, chosen_sets, evaluation_pools
from ...evaluate.policies import find_policy
from ...evaluate.rollouts import Evaluation, Progress, evaluate
from ...evaluate.rows import ShownTable
from ...evaluate.scenarios import different_sizes
from ...evaluate.settings import PROFILE, EvaluateSettings, other_version
from ...pool import Pool
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from ..tables import plain_table
from . import FAILED, OK, Arguments, err, names, out, remark, say, warn, write
from .settings import read


def command(arguments: Arguments) -> int:
    settings = read("evaluate", arguments, EvaluateSettings)
    settings.check_pools()
    every = settings.several()
    for one in every:  # before any of them plays for hours
        one.check()
        find_policy(one.name, client=one.remote)
    if settings.edition:
        folders = _edition_pools(settings, settings.edition)
        settings = replace(settings, pool=folders)
        every = settings.several()
    if BENIGN in (settings.chosen_arms or ()):
        settings = replace(settings, benign=_benign_pools(settings, search_path(arguments)))
        every = settings.several()
    if told := different_sizes([*map(Pool.open, settings.folders)], settings):
        remark(told)
    results, search = [], search_path(arguments)
    for one in every:
        if difference := other_version(one, search):
            remark(difference)
        with ProgressBar(err, f"evaluate {one.name}", 1, one.workers) as progress_bar:
            results.append(PolicyResult(one, _evaluated(one, progress_bar.of, search)))
    compared = Comparison(results)
    _show(compared, settings)
    for path, text in compared.files(settings.folder).items():
        write(path, text)
    if PROFILE in settings.format:
        from ...evaluate.profile import plots  # only here: matplotlib starts slowly

        for path, content in plots(compared).items():
            write(path, content)
    incomplete = [_report(result) for result in results]
    if len(results) > 1:
        for result in results:
            say(f"wrote {result.settings.folder}: episodes.jsonl, episodes.csv")
    lines = "" if len(results) > 1 else ", episodes.jsonl, episodes.csv"
    say(f"wrote {settings.folder}: table.md, table.json{lines}")
    return FAILED if any(incomplete) else OK


def _edition_pools(settings: EvaluateSettings, edition: str) -> list[str]:
    """The pools of an edition: the given ones, which must be its sets, or those of the chosen tasks."""
    found = Edition.read(edition)
    if settings.pool is not None:
        keys = [check_pool(found, Pool.open(folder).check()) for folder in settings.folders]
    else:
        keys = chosen_sets(settings.tasks) if settings.tasks else list(found.sets)
    for line in found.other_versions(keys):
        remark(line)
    if settings.pool is not None:
        return settings.folders
    with ProgressBar(err, f"edition {found.name}", found.n, settings.workers) as progress_bar:
        return evaluation_pools(
            found, keys, settings.workers, lambda key, done, total: progress_bar.of(done, total, f"certify {key}")
        )


def _benign_pools(settings: EvaluateSettings, search: Sequence[str]) -> list[str]:
    """The pools of the arm `benign`."""
    with ProgressBar(err, "benign", 1, settings.workers) as progress_bar:
        return benign_pools(
            settings, search, lambda task, done, total: progress_bar.of(done, total, f"certify {task}, fresh draws")
        )


def _evaluated(settings: EvaluateSettings, progress: Progress, search: Sequence[str]) -> Evaluation:
    """Evaluate one policy, and keep its rollouts if that is requested."""

    def announce(line: str) -> None:
        warn(f"evaluate {settings.name}: {line}", "none")  # standard output would break the bar

    if not settings.keep:
        return evaluate(settings, progress, search, announce=announce)
    tasks = {pool.task: load_task(pool.task, search) for pool in map(Pool.open, settings.folders)}
    with Keeper(settings, tasks) as keeper:
        found = evaluate(settings, progress, search, keeper, announce)
        for one in keeper.finish():
            many = sum(one.manifest.outcomes.values())
            say(f"kept {many} rollouts, {one.made} of them successes: {one.demonstrations.folder}")
    return found


def _show(compared: Comparison, settings: EvaluateSettings) -> None:
    """Print the tables and the headlines."""
    explained = list[str]()
    for shown in compared.tables():
        common = [shown.common[name] for name in ("task", "policy") if name in shown.common]
        n = f", n = {shown.common['n']}" if "n" in shown.common else ""
        by = "split and condition" if "condition" in shown.head else "split"
        title = f"{', '.join(['success [%]', *common])} by {by}, {settings.rules} rules{n}"
        table = plain_table(title, *_grouped(shown))
        for column in table.columns[1:]:
            column.no_wrap, column.justify = True, "right"
        if explained:
            say("")
        out.print(table)
        for line in (line for line in shown.legend if line not in explained):
            say(line)
        explained += shown.legend
    for title, (head, rows) in (
        ("goal reached otherwise than by the means of the task", compared.way_table()),
        ("failures", compared.failure_table()),
    ):
        if rows:
            say("")
            out.print(plain_table(title, head, rows[:MAX_SHOWN]))
        if (more := len(rows) - MAX_SHOWN) > 0:
            say(f"{more} more lines are in table.md")
    for line in compared.headlines:
        say(line)


def _grouped(shown: ShownTable) -> tuple[list[str], list[list[str]]]:
    """Titles and cells with task, split and condition in one column, and below them a line for each policy if there are
    several: names of policies and conditions are long, and a terminal may have 80 columns."""
    places = [k for k, name in enumerate(shown.head) if name in ("task", "split", "condition")]
    policy = shown.head.index("policy") if "policy" in shown.head else None
    others = [k for k in range(len(shown.head)) if k not in (*places, policy)]
    found, before = list[list[str]](), ""
    for row in shown.cells:
        where = ", ".join(row[k] for k in places)
        if policy is not None and where != before:
            found.append([where, *("" for _ in others)])
        found.append([where if policy is None else f"  {row[policy]}", *(row[k] for k in others)])
        before = where
    return ["", *(shown.head[k] for k in others)], found


def _report(result: PolicyResult) -> bool:
    """Print what is to be known about the run of one policy. Returns whether episodes are missing."""
    settings, found = result.settings, result.evaluation
    called = names(map(Pool.open, settings.folders), found.lost)
    for scenario, why in found.lost.items():
        warn(f"UNKNOWN {called[scenario]}: {why}; its episodes are left out")
    crashed = [e for e in found.episodes if e.get("crashed")]
    if crashed:
        remark(f"{settings.name} crashed in {len(crashed)} of {len(found.episodes)} episodes, which are in no rate")
    if found.earlier:
        what = "the pools, the settings and the policy are the same; fresh=true repeats them"
        say(f"{found.earlier} of {len(found.episodes)} episodes are from an earlier run: {what}")
    if found.spent.pictures:
        say(str(found.spent))
    return bool(found.lost or crashed)
