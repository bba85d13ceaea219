"""draw scenarios, certify them, and store the first n certified ones in a pool"""

import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from rich.table import Table

from ..compose import Combination, combinations
from ..errors import BadConfig, ScengenError
from ..pictures.report import attack_table, funnel_table, summary_lines
from ..pool import collection
from ..runs.generate import GenerateSettings, Summary, generate
from ..runs.progress import ProgressBar
from ..samplers.designs import SOBOL
from ..samplers.split import Split
from ..samplers.task import Task
from ..validate.settings import CertifySettings
from . import FAILED, OK, Arguments, err, intake, out, say, warn
from .settings import read_task

T = TypeVar("T")

GENERATED = "generated"
"""Folder of the pools of a sweep that names none."""


@dataclass(frozen=True)
class Run:
    """One pool that is to be made."""

    task: Task
    certify_settings: CertifySettings
    settings: GenerateSettings

    def __call__(self) -> Summary:
        """Make the pool, and tell what came of it."""
        task, settings = self.task, self.settings
        if settings.sampler == "sobol" and settings.n < SOBOL:
            what = f"of {settings.n} points of a Sobol set some pairs of parameters correlate by chance"
            warn(f"scengen: {what}, up to 0.95 at 32; say n={SOBOL} or more, or sampler=lhs:{settings.n}")
        with ProgressBar(err, f"{task.name}/{settings.split}", settings.n, settings.workers) as progress_bar:

            def progress(certified: int, finished: int, verdicts: Mapping[str, int]) -> None:
                lost = ", ".join(f"{n} {v}" for v, n in sorted(verdicts.items()) if v != "certified")
                progress_bar.show(min(certified, settings.n), f"{finished} tried" + (f", {lost}" if lost else ""))

            summary = generate(task, self.certify_settings, settings, progress)
        out.print(funnel_table(summary.funnel, summary.reasons))
        if summary.attack is not None:
            out.print(attack_table(summary.attack))
        for line in summary_lines(summary):
            say(line)
        if summary.certified < settings.n:
            warn(
                f"scengen: only {summary.certified} of {settings.n} could be certified among {summary.indices} "
                "indices; see the reasons above, or raise limit="
            )
        return summary


def command(arguments: Arguments) -> int:
    asked = combinations("generate", arguments)
    if not asked[0].swept:
        (run,) = map(_run, asked)
        return OK if run().certified == run.settings.n else FAILED
    asked, found = _sensible(asked)
    runs = _apart(asked, found)
    say(f"{len(runs)} pools: {', '.join(str(run.settings.pool) for run in runs)}")
    summaries = []
    for run in runs:
        summaries.append(run())
        collection.write_index(summaries[-1].pool.folder.parent, [summaries[-1].pool])
    out.print(_table(asked, runs, summaries))
    folder = summaries[-1].pool.folder.parent
    stands = f"pool={folder} stands for all pools that it names"
    say(f"wrote {folder / collection.INDEX}: {stands}, in verify, show, report, evaluate")
    short = any(summary.certified < run.settings.n for run, summary in zip(runs, summaries, strict=True))
    return FAILED if short else OK


def _run(asked: Combination) -> Run:
    settings, task, certify_settings = read_task("generate", asked.overrides, GenerateSettings)
    if settings.ycb is not None:
        task = intake("ycb").with_scans(task, settings.split, settings.ycb)
    return Run(task, certify_settings, settings)


def _sensible(asked: Sequence[Combination]) -> tuple[list[Combination], list[Run]]:
    """The runs of a sweep, found to make sense before the first begins.

    Where several tasks are named, so may be axes of each: a combination of a task with an axis that another one has is
    left out, and told.

    Raises:
        BadConfig: one makes no sense, and which it is.
    """
    runs = [_checked(one, _run) for one in asked]
    kept, lacking = [], []
    for one, run in zip(asked, runs, strict=True):
        missing = _checked(one, lambda _, run=run: _missing(run))
        if missing and any(missing <= other.task.axes.keys() for other in runs):
            lacking.append(str(one))
        else:
            _checked(one, lambda _, run=run: run.settings.check(run.task))
            kept.append((one, run))
    if lacking:
        warn(f"scengen: left out, since the task has no such split: {', '.join(lacking)}", "yellow")
    return [one for one, _ in kept], [run for _, run in kept]


def _missing(run: Run) -> set[str]:
    """The axes of a run's split that its task does not have."""
    return {part.axis for part in Split.parse(run.settings.split).parts} - run.task.axes.keys()


def _checked(asked: Combination, look: Callable[[Combination], T]) -> T:
    """What is found of a combination.

    Raises:
        BadConfig: it makes no sense, and which it is.
    """
    try:
        return look(asked)
    except ScengenError as error:
        raise BadConfig(f"{asked}: {error}; nothing was made, leave this combination out") from None


def _apart(asked: Sequence[Combination], runs: Sequence[Run]) -> list[Run]:
    """The runs with a folder each, `<task>-<split>` and what else is swept, below the one that pool= names.

    Raises:
        BadConfig: two of them have the same.
    """
    folders = [Path(run.settings.pool or GENERATED, _called(one, run)) for one, run in zip(asked, runs, strict=True)]
    folder, times = Counter(folders).most_common(1)[0]
    if times > 1:
        raise BadConfig(f"{times} of the combinations would be written to {folder}; give each value once")
    return [
        replace(run, settings=replace(run.settings, pool=str(folder)))
        for run, folder in zip(runs, folders, strict=True)
    ]


def _called(asked: Combination, run: Run) -> str:
    """What the folder of a combination is called."""
    others = [f"{key}={value}" for key, value in asked.swept.items() if key not in ("task", "split")]
    return re.sub(r"[^\w.+@=,\[\]-]", "_", "-".join([run.task.name, run.settings.split, *others]))


def _table(asked: Sequence[Combination], runs: Sequence[Run], summaries: Sequence[Summary]) -> Table:
    """A line for every pool of a sweep."""
    names = list(asked[0].swept)
    table = Table(*names, title=f"{len(runs)} pools", title_justify="left")
    for column in ("certified", "indices", "CPU s each", "pool"):
        table.add_column(column, overflow="fold")
    for one, run, summary in zip(asked, runs, summaries, strict=True):
        certified = f"{summary.certified} of {run.settings.n}"
        each = f"{summary.cpu / summary.certified:.1f}" if summary.certified else "-"
        cells = (certified, str(summary.indices), each, str(summary.pool.folder))
        table.add_row(*one.swept.values(), *cells, style="red" if summary.certified < run.settings.n else None)
    return table
