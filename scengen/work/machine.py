"""Readings of processes from the operating system, and the limits that it enforces. Linux has all of it.

Elsewhere a worker's processor time is taken for the time on the clock, its memory has no limit, and it does not end
with a parent that is killed. None of this was tried on macOS or Windows.
"""

import ctypes
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

try:
    import resource
except ImportError:  # Windows
    resource: Any = None

LINUX = sys.platform == "linux"
"""Whether processes can be measured and limited, and be forked instead of spawned."""
QUOTA = Path("/sys/fs/cgroup/cpu.max")
"""File with the processor time of a container: microseconds in a period of microseconds, or `max`."""
_PR_SET_PDEATHSIG = 1
"""Option of prctl: the signal that a process gets when its parent dies (linux/prctl.h)."""


def cores() -> int:
    """Number of cores that this process may use: those that it is bound to, and at most the quota of its container."""
    if not LINUX:
        return os.cpu_count() or 1
    allowed = len(os.sched_getaffinity(0))
    with suppress(OSError, ValueError):  # not in a container, or in one with cgroups of version 1
        quota, period = QUOTA.read_text().split()
        allowed = allowed if quota == "max" else min(allowed, int(quota) // int(period))
    return max(1, allowed)


def processor_time(process: int) -> tuple[float, bool]:
    """Processor time that a process has used [s], and whether it is suspended. Both are 0 if it has ended."""
    if not LINUX:
        return time.monotonic(), False
    try:
        state, *numbers = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0, False
    user, system = int(numbers[10]), int(numbers[11])  # utime and stime in proc(5), which counts from 1
    return (user + system) / os.sysconf("SC_CLK_TCK"), state in "Tt"


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Hold back Ctrl-C and SIGTERM; a process that is started meanwhile holds them back, too."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT, signal.SIGTERM})


def leave_interrupts_to(parent: int) -> None:
    """Let this worker ignore Ctrl-C, which its parent handles, end by SIGTERM, and end when its parent dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    if LINUX:
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def close_all_but(kept: int) -> None:
    """Close the files that a copied process inherits from its parent: locks, the journal, ends of other pipes."""
    for name in os.listdir("/proc/self/fd") if LINUX else ():
        if int(name) > 2 and int(name) != kept:
            with suppress(OSError):
                os.close(int(name))


def free_address_space() -> float:
    """Address space that this process may still take [bytes]: infinite unless it is limited (`ulimit -v`)."""
    if not LINUX:
        return math.inf
    soft, _ = resource.getrlimit(resource.RLIMIT_AS)
    return math.inf if soft == resource.RLIM_INFINITY else soft - _address_space()


def bound_memory(megabytes: int) -> bool:
    """Limit the address space of this process to what it has now and `megabytes` more.

    Returns:
        Whether it has this room. It has less if the command was started under a lower limit (`ulimit -v`).
    """
    if not LINUX:
        return True
    room = free_address_space()
    if wide_enough := room >= megabytes * 1_000_000:
        bound = _address_space() + megabytes * 1_000_000
        resource.setrlimit(resource.RLIMIT_AS, (bound, bound))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    return wide_enough


@contextmanager
def memory_bounded(more: int) -> Iterator[None]:
    """Limit the memory that this process may take in addition to what it has during a `with` statement.

    Threads may be in such statements at the same time. The latest one sets the limit; the last to leave lifts it.

    Args:
        more: the limit [bytes].
    """
    if not LINUX:
        yield
        return
    _BOUNDING.enter(more)
    try:
        yield
    finally:
        _BOUNDING.leave()


class _Bounding:
    """The limit that the threads of this process share, and the limits before it."""

    def __init__(self) -> None:
        self._lock, self._inside = threading.Lock(), 0
        self._before = (0, 0)

    def enter(self, more: int) -> None:
        with self._lock:
            if not self._inside:
                self._before = resource.getrlimit(resource.RLIMIT_AS)
            self._inside += 1
            soft, hard = self._before
            bound = _address_space() + more
            resource.setrlimit(
                resource.RLIMIT_AS, (bound if soft == resource.RLIM_INFINITY else min(soft, bound), hard)
            )

    def leave(self) -> None:
        with self._lock:
            if self._inside:  # a process that started within a statement has left it already
                self._inside -= 1
                if not self._inside:
                    resource.setrlimit(resource.RLIMIT_AS, self._before)

    def leave_all(self) -> None:
        """Lift the limit in a new process, whose only thread is in no such statement but its parent's were."""
        if self._inside:
            resource.setrlimit(resource.RLIMIT_AS, self._before)
        self._lock, self._inside = threading.Lock(), 0


_BOUNDING = _Bounding()
if LINUX:
    os.register_at_fork(after_in_child=_BOUNDING.leave_all)


def _address_space() -> int:
    """Address space of this process [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
