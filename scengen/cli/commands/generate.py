"""draw scenarios, certify them, and store the first n certified ones in a pool"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rich.table import Table

from ...compose import Combination, combinations, each_checked
from ...errors import BadConfig, cut
from ...perturb.perturbation import NONE, Perturbation
from ...pool import Pool, collection
from ...pool.kinds import check_target, marks
from ...pool.manifest import MANIFEST
from ...runs.generate import GenerateSettings, Summary, generate
from ...runs.journal import begun
from ...runs.progress import ProgressBar
from ...samplers.conditions import KINDS, split_under
from ...samplers.designs import SOBOL
from ...samplers.split import Split
from ...samplers.task import Task
from ...validate.settings import CertifySettings
from ...work.targets import try_file
from ..tables import attack_table, funnel_table, in_words, summary_lines
from . import FAILED, OK, Arguments, err, intake, out, say, say_begun, warn, write_json
from .settings import read_task

GENERATED = "generated"
"""Default folder of the pools of a sweep."""


MAX_REASONS = 8
"""Largest number of reasons that an interrupted run prints, as many as the rejection report."""
REASON_LENGTH = 90
"""Length up to which the line of progress repeats a reason [characters], as in the rejection report."""


REMEDIES = {
    "was not seen to its end": "leave to_rest out if something never rests, or a rule ends it; see CONTRIBUTING.md",
}
"""Advice for the author of a task, by words of a rejection reason. Certificates hold reasons without remedies."""


@dataclass(frozen=True)
class Run:
    """One pool to make."""

    task: Task
    certify_settings: CertifySettings
    settings: GenerateSettings

    def __call__(self) -> Summary:
        """Make the pool, and print its summary."""
        task, settings = self.task, self.settings
        if settings.sampler == "sobol" and settings.n < SOBOL:
            what = f"in {settings.n} points of a Sobol set some pairs of parameters correlate by chance"
            warn(f"scengen: {what}, up to 0.95 at 32; give n={SOBOL} or more, or sampler=lhs:{settings.n}")
        settings.check(task)
        folder = settings.folder(task)
        say_begun(count := begun(folder), _draws(folder, count), folder, settings.fresh)
        rejections: Counter[str] = Counter()
        try:
            with ProgressBar(err, f"{task.name}/{settings.split}", settings.n, settings.workers) as progress_bar:

                def progress(
                    certified: int, finished: int, verdicts: Mapping[str, int], reasons: Mapping[str, int]
                ) -> None:
                    rejections.update({reason: n - rejections[reason] for reason, n in reasons.items()})
                    progress_bar.show(min(certified, settings.n), _progress_note(finished, verdicts, rejections))

                summary = generate(task, self.certify_settings, settings, progress)
        except KeyboardInterrupt:
            for reason, n in rejections.most_common(MAX_REASONS):
                warn(f"scengen: {n}x {in_words(reason)}", "yellow")
            raise
        out.print(funnel_table(summary.funnel, summary.reasons))
        if summary.attack is not None:
            out.print(attack_table(summary.attack))
        for line in summary_lines(summary):
            say(line)
        for words, remedy in REMEDIES.items():
            if any(words in reason for reason in summary.reasons):
                say(f"remedy for {words!r}: {remedy}")
        if summary.certified < settings.n:
            more = ", or raise limit=" if summary.certified else ""
            warn(
                f"scengen: only {summary.certified} of {settings.n} could be certified among {summary.indices} "
                f"indices; see the reasons above, and play one with scengen try{more}"
            )
        return summary


def _draws(folder: Path, count: int) -> str:
    """What an earlier run has made. Several workers draw ahead of what the pool of a finished run needs."""
    used = Pool.open(folder).manifest.indices if MANIFEST in marks(folder) else count
    return "draws" if used == count else f"draws ({used} of them in its pool)"


def command(arguments: Arguments) -> int:
    requested = combinations("generate", arguments)
    if not requested[0].swept:
        (run,) = map(_run, requested)
        try_file(run.settings.json)
        summary = run()
        if run.settings.json:
            write_json(run.settings.json, summary.plain())
        return OK if summary.certified == run.settings.n else FAILED
    requested, found = _valid_runs(requested)
    runs = _with_folders(requested, found)
    try_file(runs[0].settings.json)
    say(f"{len(runs)} pools: {', '.join(str(run.settings.pool) for run in runs)}")
    summaries = []
    for run in runs:
        summaries.append(run())
        collection.write_index(summaries[-1].pool.folder.parent, [summaries[-1].pool])
    out.print(_table(requested, runs, summaries))
    for folder in dict.fromkeys(summary.pool.folder.parent for summary in summaries):
        use = f"pool={folder} stands for all pools in it"
        say(f"wrote {folder / collection.INDEX}: {use}, in verify, show, report, evaluate")
    if runs[0].settings.json:
        write_json(runs[0].settings.json, [summary.plain() for summary in summaries])
    short = any(summary.certified < run.settings.n for run, summary in zip(runs, summaries, strict=True))
    return FAILED if short else OK


def _progress_note(finished: int, verdicts: Mapping[str, int], rejections: "Counter[str]") -> str:
    """Numbers of indices by verdict, and the most frequent reason of a rejection with its number."""
    lost = [f"{n} {verdict}" for verdict, n in sorted(verdicts.items()) if verdict != "certified"]
    note = ", ".join([f"{finished} tried", *lost])
    if rejections:
        ((reason, n),) = rejections.most_common(1)
        note += f" ({n}x {cut(in_words(reason), REASON_LENGTH)})"
    return note


def _run(requested: Combination) -> Run:
    settings, task, certify_settings = read_task("generate", requested.overrides, GenerateSettings)
    settings = _under_conditions(settings, task)
    if settings.ycb is not None:
        task = intake("ycb").with_scans(task, settings.split, settings.ycb)
    return Run(task, certify_settings, settings)


def _under_conditions(settings: GenerateSettings, task: Task) -> GenerateSettings:
    """The settings with the conditions of control of `perturb` as parts of the split."""
    asked = Perturbation.parse(settings.perturb)
    if not asked:
        return settings
    conditions = asked.conditions(task.embodiment)
    if conditions is None or len(conditions.parts) < len(asked.parts):
        seen = [name for name, _ in asked.parts if name not in KINDS]
        raise BadConfig(
            f"perturb = {settings.perturb}; {seen[0]} changes what is perceived and no physics, so that certificates "
            "stay as they are: give it to evaluate, record or an environment. generate certifies under "
            f"{', '.join(KINDS)}"
        )
    return replace(settings, split=str(split_under(settings.split, conditions)), perturb=NONE)


def _valid_runs(requested: Sequence[Combination]) -> tuple[list[Combination], list[Run]]:
    """The runs of a sweep, all checked before the first one starts.

    A sweep over multiple tasks may name axes of each. A combination of a task with an axis of another task is left out
    with a warning.

    Raises:
        ScengenError: a combination is not valid; the message names it.
    """
    nothing = "no pool was made"
    runs = {str(one): run for one, run in zip(requested, each_checked(requested, _run, nothing), strict=True)}
    missing = each_checked(requested, lambda one: _missing(runs[str(one)]), nothing)
    foreign = [any(each <= run.task.axes.keys() for run in runs.values()) if each else False for each in missing]
    kept = [one for one, elsewhere in zip(requested, foreign, strict=True) if not elsewhere]
    each_checked(kept, lambda one: runs[str(one)].settings.check(runs[str(one)].task), nothing)
    if len(kept) < len(requested):
        lacking = ", ".join(str(one) for one in requested if one not in kept)
        warn(f"scengen: left out, because the task has no such split: {lacking}", "yellow")
    return kept, [runs[str(one)] for one in kept]


def _missing(run: Run) -> set[str]:
    """The axes of a run's split that its task does not have."""
    parts = [part for part in Split.parse(run.settings.split).parts if not run.task.is_condition(part)]
    return {part.axis for part in parts} - run.task.axes.keys()


def _with_folders(requested: Sequence[Combination], runs: Sequence[Run]) -> list[Run]:
    """The runs, each with its own folder: that of pool= if these all differ, or one in it, named by what is swept.

    Raises:
        BadConfig: two runs have the same folder.
        PoolError: the folder of the index is something else, such as a pool.
    """
    named = [Path(run.settings.pool or GENERATED) for run in runs]
    apart = len({*named}) == len(runs) > 1
    folders = [
        path if apart else path / _folder_name(one, run) for path, one, run in zip(named, requested, runs, strict=True)
    ]
    for folder in folders:
        check_target(folder.parent, collection.INDEX, "pool")
    folder, times = Counter(folders).most_common(1)[0]
    if times > 1:
        raise BadConfig(f"{times} of the combinations would be written to {folder}; give each value once")
    return [
        replace(run, settings=replace(run.settings, pool=str(folder)))
        for run, folder in zip(runs, folders, strict=True)
    ]


def _folder_name(requested: Combination, run: Run) -> str:
    """Name of the folder of a combination."""
    others = [f"{key}={value}" for key, value in requested.swept.items() if key not in ("task", "split")]
    return re.sub(r"[^\w.+@=,\[\]-]", "_", "-".join([run.task.name, run.settings.split, *others]))


def _table(requested: Sequence[Combination], runs: Sequence[Run], summaries: Sequence[Summary]) -> Table:
    """A table with a line for each pool of a sweep."""
    names = list(requested[0].swept)
    table = Table(*names, title=f"{len(runs)} pools", title_justify="left")
    for column in ("certified", "indices", "CPU s each", "pool"):
        table.add_column(column, overflow="fold")
    for one, run, summary in zip(requested, runs, summaries, strict=True):
        certified = f"{summary.certified} of {run.settings.n}"
        each = f"{summary.cpu / summary.certified:.1f}" if summary.certified else "-"
        cells = (certified, str(summary.indices), each, str(summary.pool.folder))
        table.add_row(*one.swept.values(), *cells, style="red" if summary.certified < run.settings.n else None)
    return table
