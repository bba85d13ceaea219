"""measure figures of tasks, and keep them in the evidence ledger"""

from dataclasses import dataclass, fields

from ... import compose
from ...errors import BadConfig, UnknownName, cut
from ...evidence import ledger
from ...measures.kinds import MEASUREMENTS
from ...measures.measurement import Result, check_splits, measure, options_of
from ...runs.progress import ProgressBar
from ...samplers.task_files import search_path
from ...work.limits import at_least
from ...work.targets import try_folder
from ..program import run
from . import FAILED, OK, Arguments, err, say, warn
from .settings import read, task_overrides


@dataclass(frozen=True)
class MeasureSettings:
    """Settings of `scengen measure`; conf/command/measure.yaml explains them."""

    kind: str
    splits: str | list[str] | None
    n: int | None
    runs: int | None
    draws: int | None
    replays: int | None
    level: str | None
    budget: int | None
    rules: str | None
    wrong: int | None
    mujoco: str | list[str] | None
    compare: str | None
    kinds: str | list[str] | None
    fresh: bool
    workers: int
    records: str | None
    to: str | None


COMMON = ("kind", "splits", "fresh", "workers", "records", "to")
"""Settings that every kind accepts."""


def command(arguments: Arguments) -> int:
    if changed := task_overrides(arguments):
        raise BadConfig(
            f"{cut(changed[0])}: figures are about a task as its file defines it; leave it out, or change the file"
        )
    settings = read("measure", [word for word in arguments if not word.startswith("task=")], MeasureSettings)
    at_least(settings, workers=1)
    for folder in (settings.records, settings.to):
        try_folder(folder)
    if settings.kind not in MEASUREMENTS:
        raise UnknownName("kind of measurement", settings.kind, MEASUREMENTS)
    search, kind = search_path(arguments), MEASUREMENTS[settings.kind]
    given = {field.name: getattr(settings, field.name) for field in fields(settings) if field.name not in COMMON}
    splits = [settings.splits] if isinstance(settings.splits, str) else settings.splits or ()
    measurement = kind(
        options_of(kind, given), splits, settings.workers, settings.to, settings.fresh, search, command=run
    )
    names = compose.chosen_tasks("measure", arguments)
    tasks = [compose.load_task(name, search) for name in names]
    check_splits(measurement, tasks)
    title = f"measure {settings.kind}"
    with ledger.opened(settings.records, search), ProgressBar(err, title, None, settings.workers) as bar:

        def progress(done: int, total: int, result: Result | None) -> None:
            if result is not None:
                (say if result.passed else warn)(f"{result.job}: {result.words}")
            if not measurement.COMMANDS:
                bar.of(done, total)

        found = measure(measurement, tasks, progress)
    failed = sum(not result.passed for result in found)
    say(f"{len(found) - failed} measured, {failed} failed" if found else "nothing is missing")
    return FAILED if failed else OK
