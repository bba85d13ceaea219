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


def each(function: Callable[[A], B], items: Iterable[A], workers: int) -> Iterator[B]:
    """Apply `function` to every item, in this process if there is one worker only.

    Items are taken from the iterable only when a worker is about to be free, so that it may depend on the results
    so far. Workers die with this process, whatever kills it.

    Args:
        function: can be pickled, like items and results. It is sent once to each worker: it may be large, and what it
            keeps between items stays in its process.

    Raises:
        WorkerDied: a worker crashed.
    """
    if workers == 1:
        yield from map(function, items)
        return
    todo, flying = iter(items), set[Future[B]]()
    executor = ProcessPoolExecutor(
        workers, multiprocessing.get_context("spawn"), initializer=_prepare, initargs=(function,)
    )
    try:
        while True:
            while len(flying) <= workers and (item := next(todo, None)) is not None:
                flying.add(executor.submit(_apply, item))
            if not flying:
                return
            for future in wait(flying, return_when=FIRST_COMPLETED).done:
                flying.remove(future)
                yield future.result()
    except BrokenProcessPool:
        raise WorkerDied("a worker process died; run again to continue, with workers=1 to see why") from None
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


_function: Callable[[Any], Any]
"""What this worker process applies to every item that it is sent."""


def _prepare(function: Callable[[Any], Any]) -> None:
    """Leave interrupts to the parent, and die with it."""
    global _function
    _function = function
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    native.silence()
    threading.Thread(target=_die_with_parent, daemon=True).start()


def _apply(item: Any) -> Any:
    return _function(item)


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)
