"""Progress of long work: a progress bar on a terminal, a line every few seconds elsewhere."""

import time
from types import TracebackType

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from ..work.parallel import Executor, Workers
from ..work.printed import PlainConsole, printable

LINE_INTERVAL = 15.0
"""Time between two lines if there is no terminal [s]."""


class ProgressBar:
    """Shows the progress of some work, its speed, its estimated end, and the number of nodes.

    The total is None if the end is unknown.
    """

    def __init__(self, console: PlainConsole, title: str, total: int | None, workers: Workers = 1):
        title = printable(title)
        self.console, self.title, self.total, self.workers = console, title, total, workers
        self._last, self._reported = time.monotonic(), 0
        self._first: tuple[float, int] | None = None
        """Time of the first call of `show`, and the work done by then, part of it by an earlier run."""
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[note]}", markup=False),
        )
        self._progress = Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=console, transient=True)
        self._task = self._progress.add_task(title, total=total, note="")

    def __enter__(self) -> "ProgressBar":
        if self.console.is_terminal:
            self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.console.is_terminal:
            self._progress.stop()

    def of(self, done: int, total: int, note: str = "") -> None:
        """Show that `done` of a new total are done."""
        self.total = total
        self._progress.update(self._task, total=total)
        self.show(done, note)

    def show(self, done: int, note: str = "") -> None:
        """Show that `done` of the total are done. Several workers may do more than needed."""
        now, done = time.monotonic(), done if self.total is None else min(done, self.total)
        if self._first is None or done < self._first[1]:  # other work has started
            self._first = now, done
        status = self.workers.status if isinstance(self.workers, Executor) else ""
        rate = (done - self._first[1]) / (now - self._first[0]) if now > self._first[0] else 0.0
        message = ", ".join(text for text in (note, status, f"{rate:.2g}/s" if rate else "") if text)
        self._progress.update(self._task, completed=done, note=message)
        due = now - self._last > LINE_INTERVAL or (done == self.total and self._reported != done)
        if due and not self.console.is_terminal:
            self._last, self._reported = now, done
            left = (self.total - done) / rate if rate and self.total else 0.0
            end = time.strftime(", ends %a %H:%M", time.localtime(time.time() + left)) if left else ""
            of = "" if self.total is None else f" of {self.total}"
            self.console.print(f"{self.title}: {done}{of} {message}".rstrip() + end)
