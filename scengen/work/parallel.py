"""Work in multiple processes with limits on time and memory; results come as they are ready."""

import math
import multiprocessing
import os
import pickle
import signal
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any, NoReturn, Protocol, TypeVar, runtime_checkable

from ..control import native
from ..errors import ScengenError, with_place
from . import machine

A = TypeVar("A")
B = TypeVar("B")

EXIT_TIMEOUT = 1.0
"""Time that an idle worker has to end by itself before it is killed [s]."""


MAX_LATENESS = 0.5
"""Delay after which a look at a worker shows that this process was suspended, or got almost no processor time [s]."""
MIN_SHARE = 0.01
"""Share of a core below which a worker that is not suspended does nothing."""
MIN_LOOK = 0.05
"""Shortest time between two looks at a worker that has passed its limit of wall-clock time [s]."""


class WorkerDied(ScengenError):
    """A worker process ended in the middle of its work."""


@dataclass(frozen=True)
class Limits:
    """Limits on the work on one item."""

    seconds: float
    """Processor time [s], or time in which nothing is done. A suspended process and a busy machine do not count."""
    megabytes: int
    """Memory beyond that of a worker at its start [MB]."""


UNTRUSTED_LIMITS = Limits(300.0, 4000)
"""Limits on showing, exporting or recording one scenario of a pool, which is not trusted. Seconds usually suffice."""


@runtime_checkable
class Executor(Protocol):
    """Workers other than processes of this machine."""

    status: str
    """Number of nodes and workers for a progress bar: `2 nodes, 64 workers`. Empty while no work is done."""

    def each(
        self,
        function: Callable[[A], B],
        items: Iterable[A],
        limits: Limits | None,
        lost: Callable[[A, str], B] | None,
    ) -> Iterator[B]:
        """Like the function `each`."""
        ...


Workers = int | Executor
"""Number of processes on this machine, or an executor."""


def each(
    function: Callable[[A], B],
    items: Iterable[A],
    workers: Workers,
    limits: Limits | None = None,
    lost: Callable[[A, str], B] | None = None,
    fork: bool = True,
) -> Iterator[B]:
    """Apply `function` to every item. One worker without limits is this process.

    Items are taken from the iterable only when a worker is free, so they may depend on the results so far. Workers end
    with this process, even if it is killed, and as soon as the iteration is left early. A worker that dies is replaced,
    and its item is tried once more: a process killed from outside changes no result.

    Args:
        function: can be pickled, like items and results. It is sent once to each worker: it may be large, and what it
            stores between items stays in the process of the worker.
        limits: limits on each item. On Linux workers are then copies of this process, which start in milliseconds (see
            `fork`).
        lost: makes the result of an item that has crashed its worker, or has reached a limit, from the reason.
        fork: whether workers with limits are copies of this process; a process with threads must not be copied.

    Raises:
        WorkerDied: a worker crashed, or reached a limit, and there is no `lost`.
    """
    if isinstance(workers, Executor):
        yield from workers.each(function, items, limits, lost)
        return
    if workers == 1 and limits is None:
        yield from map(function, items)
        return
    method = "fork" if fork and limits is not None and machine.LINUX else "spawn"
    remaining, crew = iter(items), [_Worker(function, limits, method) for _ in range(max(1, workers))]
    try:
        while busy := _busy(crew, remaining):
            for answer in _answers(busy, limits):
                if isinstance(answer, _Lost):
                    yield made_of_lost(answer.item, answer.reason, lost)
                else:
                    yield answer.value
    finally:
        for worker in crew:
            worker.end()


def apart(function: Callable[[A], B], item: A, limits: Limits, what: str) -> B:
    """Apply a function to one item, in a separate process that is ended at a limit.

    Args:
        what: description of the work, for the error: `filming 8ed4a4577fe0`.

    Raises:
        WorkerDied: the process has crashed, or has reached a limit.
    """

    def lost(item: A, reason: str) -> NoReturn:
        raise WorkerDied(f"{what} {reason}; see scengen verify for what is wrong with the pool")

    (result,) = each(function, [item], 1, limits, lost)
    return result


def made_of_lost(item: A, reason: str, lost: Callable[[A, str], B] | None) -> B:
    """The result of an item that no worker has finished.

    Raises:
        WorkerDied: there is no `lost` that makes one.
    """
    if lost is None:
        raise WorkerDied(f"a worker process {reason}; run again to continue, with workers=1 to see why")
    return lost(item, reason)


_END: Any = object()
"""Sentinel that is not an item."""


@dataclass(frozen=True)
class _Result:
    """The result of an item."""

    value: Any


@dataclass(frozen=True)
class _Lost:
    """An item without a result, and why."""

    item: Any
    reason: str


class _Worker:
    """One process that works on one item at a time."""

    def __init__(self, function: Callable[[Any], Any], limits: Limits | None, method: str):
        self._function, self._limits = function, limits
        self._context: Any = multiprocessing.get_context(method)
        self._process: Any = None
        self._item, self._tries, self.busy = None, 0, False
        self.deadline = float("inf")
        """Time of the next look at the processor time that the item has used [s]."""
        self._cpu_at_start, self._looked, self._used = 0.0, 0.0, 0.0
        """Processor time at the beginning of the item, time of the last look, and processor time then [s]."""
        self.connection: Connection

    def give(self, item: Any) -> None:
        """Start to work on an item."""
        self._item, self._tries, self.busy = item, 0, True
        self._begin()

    def answer(self, ready: bool) -> _Result | _Lost | None:
        """The outcome of its item; None if it needs more time.

        Args:
            ready: whether its connection has an answer or is closed.

        Raises:
            Exception: the exception that the function has raised.
        """
        if ready:
            try:
                kind, value = self.connection.recv()
            except (EOFError, OSError):
                return self._died()
            self.busy = False
            if kind == "result":
                return _Result(value)
            if kind == "lost":
                return _Lost(self._item, value)
            raise value
        if time.monotonic() < self.deadline or self._limits is None or not self._overdue(self._limits.seconds):
            return None
        self._kill()
        self.busy = False
        return _Lost(self._item, f"took longer than {self._limits.seconds:g} s")

    def _overdue(self, seconds: float) -> bool:
        """Whether the item has used its processor time, or has used none since the last look. Otherwise there will be
        another look."""
        now, (used, stopped) = time.monotonic(), self._processor_time()
        if used - self._cpu_at_start >= seconds:
            return True
        suspended = stopped or now > self.deadline + MAX_LATENESS  # the latter: this process was
        if not suspended and used - self._used < MIN_SHARE * (now - self._looked):
            return True
        self._looked, self._used = now, used
        self.deadline = now + max(seconds - (used - self._cpu_at_start), MIN_LOOK)
        return False

    def end(self) -> None:
        """End the process, in the middle of its work if need be."""
        if self._process is None:
            return
        if not self.busy:
            self.connection.close()  # an idle worker reads the end of its orders and ends
            self._process.join(EXIT_TIMEOUT)
        self._kill()

    def _processor_time(self) -> tuple[float, bool]:
        """Processor time that the process has used [s], and whether it is suspended."""
        return machine.processor_time(self._process.pid)

    def _begin(self) -> None:
        if self._process is None:
            self._start()
        with suppress(OSError):  # it has died, which the answer shows
            self.connection.send(self._item)
        self._looked = time.monotonic()
        self._cpu_at_start = self._used = self._processor_time()[0]
        self.deadline = self._looked + (self._limits.seconds if self._limits else float("inf"))

    def _start(self) -> None:
        """Start the process.

        Raises:
            OSError: the machine has no room for a process or its pipe. The worker is as it was before.
        """
        ours, theirs = self._context.Pipe()
        with theirs:
            arguments = (theirs, self._function, self._limits, os.getpid())
            process = self._context.Process(target=_serve, args=arguments, daemon=True)
            if self._context.get_start_method() == "spawn":
                resource_tracker.ensure_running()  # its own start would let the signals through again
            # Ctrl-C and SIGTERM may reach the whole process group before the worker has set its handlers.
            with machine.interrupts_blocked():
                try:
                    process.start()
                except BaseException:
                    ours.close()
                    raise
        self.connection, self._process = ours, process
        if self._limits:  # an item does not pay for the start of a process
            with suppress(EOFError, OSError):
                self.connection.recv_bytes()

    def _died(self) -> _Lost | None:
        self._process.join(EXIT_TIMEOUT)
        code = self._process.exitcode
        self._kill()
        self._tries += 1
        if self._limits is not None and self._tries == 1:
            self._begin()
            return None
        self.busy = False
        how = f"was ended by {signal.Signals(-code).name}" if code is not None and code < 0 else f"ended with {code}"
        if machine.free_address_space() < math.inf:
            how += ", in an address space that is limited from outside (ulimit -v)"
        return _Lost(self._item, f"died: it {how}")

    def _kill(self) -> None:
        self._process.kill()
        self._process.join()
        self.connection.close()
        self._process = None


def _busy(crew: Sequence[_Worker], items: Iterator[Any]) -> list[_Worker]:
    """Give items to idle workers.

    Returns:
        The workers with an item.
    """
    for worker in crew:
        if not worker.busy and (item := next(items, _END)) is not _END:
            worker.give(item)
    return [worker for worker in crew if worker.busy]


def _answers(busy: Sequence[_Worker], limits: Limits | None) -> Iterator[_Result | _Lost]:
    """Wait until a worker answers, dies or reaches its limit of time, and take all answers."""
    timeout = max(0.0, min(worker.deadline for worker in busy) - time.monotonic())
    ready = wait([worker.connection for worker in busy], None if limits is None else timeout)
    for worker in busy:
        if (answer := worker.answer(worker.connection in ready)) is not None:
            yield answer


def _serve(orders: Connection, function: Callable[[Any], Any], limits: Limits | None, parent: int) -> None:
    """Run a worker process: items in, results out, until the parent closes the connection or dies."""
    machine.leave_interrupts_to(parent)
    counted = limits
    if limits is not None:
        machine.close_all_but(orders.fileno())
        if not machine.bound_memory(limits.megabytes):  # then a lack of memory is the machine's, and not the item's
            counted = None
    native.silence()
    if limits is not None:
        orders.send_bytes(_READY)
    while True:
        try:
            item = orders.recv()
        except (EOFError, OSError):
            os._exit(0)
        orders.send_bytes(_reply(function, item, counted))


def _reply(function: Callable[[Any], Any], item: Any, limits: Limits | None) -> bytes:
    try:
        return pickle.dumps(("result", function(item)))
    except MemoryError as error:
        if limits is not None:
            return pickle.dumps(("lost", f"needs more than {limits.megabytes} MB"))
        return portable(error)
    except Exception as error:
        return portable(error)


def portable(error: Exception) -> bytes:
    """A pickled exception; one that cannot be pickled becomes one with the same message that can."""
    placed = with_place(error)
    try:
        pickle.loads(written := pickle.dumps(("error", placed)))
        return written
    except Exception:
        kind = ScengenError if isinstance(error, ScengenError) else RuntimeError
        return pickle.dumps(("error", with_place(kind(str(error)).with_traceback(error.__traceback__))))


_READY = b"ready"
"""First message of a process with limits."""
