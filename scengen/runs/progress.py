"""Progress of long work: a progress bar on a terminal, a line now and then elsewhere."""

import time
from types import TracebackType

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from ..printed import PlainConsole, printable

EVERY = 15.0
"""Seconds between two lines where there is no terminal."""


class ProgressBar:
    """Shows how far some work has come."""

    def __init__(self, console: PlainConsole, title: str, total: int):
        title = printable(title)
        self.console, self.title, self.total = console, title, total
        self._last, self._said = time.monotonic(), 0
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
        """Say that `done` of a total are done that was not known before."""
        self.total = total
        self._progress.update(self._task, total=total)
        self.show(done, note)

    def show(self, done: int, note: str = "") -> None:
        """Say that `done` of the total are done."""
        self._progress.update(self._task, completed=done, note=note)
        due = time.monotonic() - self._last > EVERY or (done == self.total and self._said != done)
        if due and not self.console.is_terminal:
            self._last, self._said = time.monotonic(), done
            self.console.print(f"{self.title}: {done} of {self.total} {note}".rstrip())
