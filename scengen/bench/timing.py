"""Times of sides that work in turn, and what is promised of their ratios."""

import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from ..control import native

SLICE = 10
"""Number of control periods in a slice: 2 to 20 ms of work, below the time that an operating system gives a process."""


@dataclass(frozen=True)
class Promise:
    """A promised limit of a measure."""

    limit: float
    side: str
    """Side of the limit: `at most` or `at least`."""
    what: str
    """Description of the measure."""

    def holds(self, value: float) -> bool:
        """Whether a measured value satisfies the limit."""
        return value <= self.limit if self.side == "at most" else value >= self.limit


@dataclass(frozen=True)
class Measure:
    """Values of a measure in the repetitions of a run."""

    values: tuple[float, ...]
    """One value for each repetition."""

    @property
    def median(self) -> float:
        """Median of the values."""
        return statistics.median(self.values)

    @property
    def spread(self) -> float:
        """Largest minus smallest value."""
        return max(self.values) - min(self.values)


Side = Callable[[], Iterator[None]]
"""Starts one side of a comparison, which yields after each slice of its work."""


def alternated(
    sides: Sequence[Side], repeats: int, clock: Callable[[], float] = time.thread_time
) -> list[tuple[float, ...]]:
    """Processor time of each side in each repetition [s]. The sides work in turn, a slice each.

    A first repetition, which compiles code and fills caches, does not count.

    Args:
        clock: processor time of this thread, or `time.process_time` that of all threads, which OpenGL needs.
    """
    found = []
    for _ in range(repeats + 1):
        spent, running = [0.0] * len(sides), [side() for side in sides]
        going = list(range(len(sides)))
        while going:
            for number in list(going):
                start = clock()
                if next(running[number], _END) is _END:
                    going.remove(number)
                spent[number] += clock() - start
        found.append(tuple(spent))
    return found[1:]


_END = object()
"""Sentinel that no side yields."""


def ratio(pairs: Iterable[tuple[float, ...]]) -> Measure:
    """The measure of the ratios of two times, one for each repetition."""
    return Measure(tuple(above / below for above, below in pairs))


@njit(nogil=True, cache=True)
def step_with(model: int, data: int, ctrl: NDArray[np.float64], controls: NDArray[np.float64]) -> None:
    """Bare mj_step calls with recorded controls, without Python in between."""
    for row in controls:
        ctrl[:] = row
        native.step(model, data)
