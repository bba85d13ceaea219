"""Work in several processes: a bounded number of items in flight, results as they get ready."""

import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, TypeVar

from .control import native
from .errors import ScengenError

A = TypeVar("A")
B = TypeVar("B")


class WorkerDied(ScengenError):
    """A worker process ended in the middle of its work."""


def each(
    function: Callable[[A], B],
    items: Iterable[A],
    workers: int,
    begin: Callable[..., None] | None = None,
    arguments: tuple[Any, ...] = (),
) -> Iterator[B]:
    """Apply `function` to every item, in this process if there is one worker only.

    Items are taken from the iterable only when a worker is about to be free, so that it may depend on the results
    so far. Workers die with this process, whatever kills it.

    Args:
        function: importable by name, like its arguments and results.
        begin: called once in every process, with `arguments`, before any work.

    Raises:
        WorkerDied: a worker crashed.
    """
    if workers == 1:
        if begin:
            begin(*arguments)
        yield from map(function, items)
        return
    todo, flying = iter(items), dict[Future[B], A]()
    executor = ProcessPoolExecutor(
        workers, multiprocessing.get_context("spawn"), initializer=_prepare, initargs=(begin, arguments)
    )
    try:
        while True:
            while len(flying) <= workers and (item := next(todo, None)) is not None:
                flying[executor.submit(function, item)] = item
            if not flying:
                return
            for future in wait(flying, return_when=FIRST_COMPLETED).done:
                flying.pop(future)
                yield future.result()
    except BrokenProcessPool:
        raise WorkerDied("a worker process died; run again to continue, with workers=1 to see why") from None
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _prepare(begin: Callable[..., None] | None, arguments: tuple[Any, ...]) -> None:
    """Leave interrupts to the parent, and die with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    native.silence()
    threading.Thread(target=_die_with_parent, daemon=True).start()
    if begin:
        begin(*arguments)


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)
