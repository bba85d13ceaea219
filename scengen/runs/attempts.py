"""Attempts of a run in the order of their numbers, in parallel, until enough of them have succeeded."""

import itertools
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from ..errors import Infeasible, PoolError
from ..pool.manifest import PROCESS, without_numbers
from ..work.parallel import Limits, Workers, each
from ..work.targets import refused
from .journal import Journal, Record

MAX_LOST = 100
"""Number of attempts in a row that crash or reach a limit, at which a run ends: fewer than one in a hundred attempts of
a sound family does."""

Progress = Callable[[int, int, Mapping[str, int], Mapping[str, int]], None]
"""Called with the numbers of successes and of finished attempts, and the numbers of attempts by verdict and of
rejected ones by "check: reason"."""


class Attempt(Protocol):
    """Makes the attempt of a number."""

    def __call__(self, index: int) -> Record: ...

    def lost_record(self, index: int, reason: str) -> Record:
        """The record of an attempt that has crashed its process, or has reached a limit."""
        ...


@dataclass(frozen=True)
class Wanted:
    """Target of a run, and the limit of its attempts."""

    verdict: str
    """Verdict of a success."""
    n: int
    """Number of successes."""
    limit: int
    """Largest number of attempts."""
    workers: Workers
    limits: Limits
    """Limits of one attempt."""


def extend(
    attempt: Attempt,
    wanted: Wanted,
    records: dict[int, Record],
    journal: Journal,
    progress: Progress,
    follow: Callable[[Mapping[int, Record]], None] = lambda records: None,
) -> None:
    """Add records in the order of their numbers until there are enough successes, or the limit is reached.

    Args:
        records: records of an earlier run, to which those of this one are added.
        follow: called after each record.

    Raises:
        PoolError: many attempts in a row have no verdict, or something cannot be written.
    """
    missing = (i for i in range(wanted.limit) if i not in records)
    verdicts = Counter(r.verdict for r in records.values())
    reasons = Counter(rejection(r) for r in records.values() if r.check)
    lost_in_a_row = 0

    def needed(index: int) -> bool:
        """Whether an attempt can still be among the first n successes."""
        if verdicts[wanted.verdict] < wanted.n:
            return True
        return sum(r.verdict == wanted.verdict for i, r in records.items() if i < index) < wanted.n

    with reported_write_errors(journal.folder):
        follow(records)
    items = itertools.takewhile(needed, missing)
    for record in each(attempt, items, wanted.workers, wanted.limits, attempt.lost_record):
        journal.add(record)
        records[record.index] = record.light()
        with reported_write_errors(journal.folder):
            follow(records)
        verdicts[record.verdict] += 1
        if record.check:
            reasons[rejection(record)] += 1
        lost_in_a_row = lost_in_a_row + 1 if record.check == PROCESS else 0
        if lost_in_a_row == MAX_LOST:
            why = f"{MAX_LOST} scenarios in a row have no verdict, the last because it {record.reason}"
            raise PoolError(f"{why}; raise limit_seconds= and limit_mb=, or debug one with workers=1")
        progress(verdicts[wanted.verdict], len(records), verdicts, reasons)


def infeasible(index: int, verdict: str, error: Infeasible) -> Record:
    """The record of an attempt that has no feasible scenario, with the most frequent reason."""
    why = max(error.reasons, key=error.reasons.__getitem__)
    return Record(index, verdict, "feasible", why, error.tries, dict(error.reasons), None, 0.0)


def first_of(records: Mapping[int, Record], verdict: str, n: int) -> list[int]:
    """Numbers of the first n attempts with a verdict."""
    return [i for i in sorted(records) if records[i].verdict == verdict][:n]


def rejection(record: Record) -> str:
    """Check and reason of a rejected attempt, the same for rejections of the same kind."""
    return without_numbers(f"{record.check}: {record.reason}")


@contextmanager
def reported_write_errors(folder: Path) -> Iterator[None]:
    """Report a folder that cannot be written.

    Raises:
        PoolError: one line with the remedy.
    """
    try:
        yield
    except OSError as error:
        why = f"{refused(folder, error)}; finished work is kept, repeat the command to continue"
        raise PoolError(why) from None
