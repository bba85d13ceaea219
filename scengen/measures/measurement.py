"""A kind of measurement: what it measures of a task, and the loop that measures what the ledger lacks."""

import multiprocessing
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from ..errors import BadConfig, ScengenError, UnknownName
from ..evidence import ledger, measuring
from ..evidence.ledger import Evidence, Kind
from ..samplers.split import ID
from ..samplers.task import Task

Command = Callable[[Sequence[str]], int]
"""Function that runs a command line of scengen and returns its exit status."""


@dataclass(frozen=True)
class Job:
    """One step of a measurement, which gives a row for each of its splits."""

    task: Task
    """Task to measure."""
    splits: tuple[str, ...]
    """Splits to measure."""
    made_with: Mapping[str, Any]
    """Settings of the measurement in the ledger."""

    def __str__(self) -> str:
        of = self.splits[0] if len(self.splits) == 1 else f"{len(self.splits)} splits"
        return f"{self.task.name}/{of}"


@dataclass(frozen=True)
class Row:
    """Figures of one split."""

    split: str
    """Name of the split."""
    n: int
    """Number of draws, twins or rollouts that the figures rest on."""
    value: Mapping[str, Any]
    """Figures, as plain data."""


@dataclass(frozen=True)
class Result:
    """Result of a job."""

    job: Job
    """The job."""
    rows: Sequence[Row] = ()
    """Rows for the ledger; none if the job failed."""
    words: str = ""
    """Line about the result."""
    passed: bool = True
    """Whether the job was measured and its figures are as a sound task has them."""
    made_with: Mapping[str, Any] = field(default_factory=dict)
    """Further settings of the measurement, which are known only after it."""


@dataclass(frozen=True)
class Measurement:
    """A kind of measurement with its settings. Subclasses say what it measures."""

    KIND: ClassVar[Kind]
    """Kind of the rows."""
    OPTIONS: ClassVar[Mapping[str, Any]] = {}
    """Default values of the settings that this kind accepts."""
    COMMANDS: ClassVar[bool] = False
    """Whether a job runs commands, which have workers and show their progress themselves. Jobs then run in turn."""
    FOLDER: ClassVar[str] = ""
    """Default folder of pools, logs and policies that jobs keep."""

    options: Mapping[str, Any]
    """Values of the settings."""
    splits: Sequence[str] = ()
    """Splits to measure; empty for all that this kind measures."""
    workers: int = 1
    """Number of processes."""
    to: str | None = None
    """Folder of what jobs keep; None for `FOLDER`."""
    fresh: bool = False
    """Whether to measure again what was measured."""
    search: Sequence[str] = ()
    """Overrides that add folders of other packages, see `task_files.search_path`."""
    command: Command | None = None
    """Function that runs a command line."""

    @property
    def folder(self) -> Path:
        """Folder of what jobs keep."""
        return Path(self.to or self.FOLDER)

    def all_splits(self, task: Task) -> Sequence[str]:
        """Splits of a task that this kind measures by default."""
        return (ID, *task.axes)

    def chosen(self, task: Task) -> tuple[str, ...]:
        """Splits of a task to measure: the chosen ones that the task has, or all."""
        known = self.all_splits(task)
        return tuple(split for split in dict.fromkeys(self.splits) if split in known) if self.splits else tuple(known)

    def jobs(self, task: Task) -> Iterator[Job]:
        """All jobs of a task."""
        for split in self.chosen(task):
            yield Job(task, (split,), dict(self.options))

    def answers(self, row: Evidence, job: Job) -> bool:
        """Whether a row of the ledger answers a job."""
        return row.made_with == job.made_with

    def done(self, job: Job) -> bool:
        """Whether the ledger has the rows of a job, about the task as it is."""
        rows = [row for row in ledger.read(self.KIND, job.task.name) if self.answers(row, job)]
        return all(
            any(row.split == split and not measuring.stale(job.task, row) for row in rows) for split in job.splits
        )

    def prepare(self, tasks: Sequence[Task]) -> None:
        """Make what several jobs share."""

    def result(self, job: Job) -> Result:
        """Measure."""
        raise NotImplementedError

    def run(self, *words: str) -> int:
        """Run a command of scengen.

        Returns:
            Exit status: 0 success, 1 a check failed, 2 bad input, 3 no verdict.
        """
        assert self.command
        return self.command((*words, *self.search))

    def finish(self, *words: str) -> None:
        """Run a command of scengen that must succeed.

        Raises:
            ScengenError: it did not succeed.
        """
        if self.run(*words):
            raise ScengenError(f"scengen {' '.join(words)} failed")


def options_of(kind: type[Measurement], given: Mapping[str, Any]) -> dict[str, Any]:
    """Values of the settings of a kind.

    Args:
        given: values by name; None for the default.

    Raises:
        BadConfig: the kind does not accept one of the settings, or a number is too small.
    """
    found = {name: value for name, value in given.items() if value is not None}
    if unknown := sorted(found.keys() - kind.OPTIONS.keys()):
        accepted = ", ".join(("splits", *kind.OPTIONS))
        raise BadConfig(f"kind={kind.KIND} has no setting {unknown[0]}; it accepts {accepted}")
    for name, value in found.items():
        if isinstance(value, int) and value < (least := 1 if name == "n" else 0):
            raise BadConfig(f"{name} = {value}; it must be at least {least}")
    return {**kind.OPTIONS, **found}


def check_splits(measurement: Measurement, tasks: Sequence[Task]) -> None:
    """Check that some task has each of the chosen splits.

    Raises:
        UnknownName: none has.
    """
    known = [split for task in tasks for split in measurement.all_splits(task)]
    for split in measurement.splits:
        if split not in known:
            raise UnknownName(f"split for kind={measurement.KIND}", split, list(dict.fromkeys(known)))


def measure(
    measurement: Measurement,
    tasks: Sequence[Task],
    progress: Callable[[int, int, Result | None], None] = lambda done, total, result: None,
) -> list[Result]:
    """Measure what the ledger lacks, and store it after each job.

    Args:
        measurement: the kind, with its settings.
        tasks: tasks to measure.
        progress: called with the number of finished jobs, of all jobs, and the last result.

    Returns:
        The results of the jobs that ran.
    """
    jobs = [job for task in tasks for job in measurement.jobs(task) if measurement.fresh or not measurement.done(job)]
    found: list[Result] = []
    if jobs:
        progress(0, len(jobs), None)
        measurement.prepare(list({job.task.name: job.task for job in jobs}.values()))
    for number, result in enumerate(_results(measurement, jobs), 1):
        for row in result.rows:
            made_with = {**result.job.made_with, **result.made_with}
            measuring.keep(result.job.task, row.split, measurement.KIND, row.n, row.value, made_with)
        found.append(result)
        progress(number, len(jobs), result)
    return found


def _results(measurement: Measurement, jobs: Sequence[Job]) -> Iterator[Result]:
    """The results of jobs as they finish."""
    if measurement.COMMANDS or measurement.workers == 1 or len(jobs) < 2:
        yield from (_result(measurement, job) for job in jobs)
        return
    # Unlike the workers of `work.parallel`, these processes may have children: certification has them for its limits.
    executor = ProcessPoolExecutor(measurement.workers, multiprocessing.get_context("spawn"))
    try:
        started = [executor.submit(_result, measurement, job) for job in jobs]
        yield from (future.result() for future in as_completed(started))
    finally:
        executor.shutdown(wait=False, cancel_futures=True)  # an interrupted command does not wait for jobs


def _result(measurement: Measurement, job: Job) -> Result:
    """Run a job. An error fails the job alone: one axis without a feasible twin must not end the run."""
    try:
        return measurement.result(job)
    except ScengenError as error:
        return Result(job, words=str(error), passed=False)
