"""Scenarios as points: parameters or features in units of the training range, those with a period on circles."""

import math
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...params import values
from ...samplers.support import width
from ...samplers.task import Task
from ...scenario import Scenario

Points = NDArray[np.float64]
"""Points of shape (n, d): one row per scenario."""


Table = Mapping[str, NDArray[np.float64]]
"""Values of many scenarios by parameter or feature, each of shape (n,)."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Parameter values of many scenarios; a million scenarios take some hundred MB."""

    ids: NDArray[np.str_] | NDArray[np.bytes_]
    """Unique names of the scenarios, shape (n,)."""
    values: Table
    """Values by parameter, each of shape (n,)."""

    def __len__(self) -> int:
        return len(self.ids)

    @classmethod
    def of(cls, scenarios: Mapping[str, Scenario]) -> "Batch":
        """The batch of some scenarios, given by name."""
        return cls.read(np.array(list(scenarios), str), map(values, scenarios.values()))

    @classmethod
    def read(cls, ids: NDArray[np.str_] | NDArray[np.bytes_], rows: Iterable[Mapping[str, float]]) -> "Batch":
        """The batch of scenarios of one family whose parameter values are read one after the other."""
        columns: dict[str, array[float]] = {}
        for row in rows:
            columns = columns or {name: array("d") for name in row}
            for name, column in columns.items():
                column.append(row[name])
        return cls(ids, {name: _column(np.frombuffer(column)) for name, column in columns.items()})

    def name(self, number: int) -> str:
        """The name of a scenario, by its number."""
        name = self.ids[number]
        return name.decode() if isinstance(name, bytes) else str(name)


def _column(column: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same numbers, stored once if all are equal."""
    equal = len(column) > 0 and bool((column == column[0]).all())
    return np.broadcast_to(column[0].copy(), column.shape) if equal else column


def measured(scenario: Scenario) -> dict[str, float]:
    """All parameters and all features of a scenario, in SI units and as declared."""
    return {**values(scenario), **scenario.features()}


def scale(task: Task, name: str) -> float:
    """The width of a parameter's training range, or of its bounds if training has one value only [its unit].

    Differences of the parameter are divided by it.
    """
    known = task.known[name]
    return width(task.training[name].support) or (known.high - known.low) or 1.0


@dataclass(frozen=True)
class Column:
    """One coordinate; two for a parameter with a period, which lies on a circle of that circumference."""

    name: str
    scale: float
    period: float | None = None

    def of(self, values: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """The coordinates of values, each of shape (n,)."""
        if self.period is None:
            return (values / self.scale,)
        radius, angle = self.period / self.scale / math.tau, math.tau * values / self.period
        return radius * np.cos(angle), radius * np.sin(angle)


@dataclass(frozen=True)
class Space:
    """A choice of coordinates."""

    columns: tuple[Column, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(column.name for column in self.columns)

    def of(self, table: Table, count: int) -> Points:
        """The scenarios of a table as points.

        Args:
            count: number of scenarios; without coordinates all of them are one point.
        """
        found = [x for column in self.columns for x in column.of(table[column.name])]
        return np.column_stack(found) if found else np.zeros((count, 0))

    def points(self, scenarios: Iterable[Scenario]) -> Points:
        """The scenarios as points."""
        rows = [measured(scenario) for scenario in scenarios]
        return self.of({name: np.array([row[name] for row in rows], float) for name in self.names}, len(rows))


def of_tables(task: Task, *tables: Table) -> Space:
    """Coordinates of those parameters in which the scenarios of the tables differ, in training widths."""
    found = [table for table in tables if table]
    varied = [n for n in task.known if any((table[n] != found[0][n][0]).any() for table in found)]
    return Space(tuple(Column(n, scale(task, n), task.known[n].period) for n in varied))


def of_parameters(task: Task, scenarios: Sequence[Scenario]) -> Space:
    """Coordinates of those parameters in which the scenarios differ, in training widths."""
    return of_tables(task, Batch.read(np.zeros(len(scenarios), str), map(values, scenarios)).values)


def of_features(task: Task, training: Sequence[Scenario], others: Sequence[Scenario]) -> Space:
    """Coordinates of the family's features in ranges of a training sample; of its parameters if it has no features."""
    every = [dict(scenario.features()) for scenario in training]
    if not any(every):
        return of_parameters(task, [*training, *others])
    ranges = {n: max(f[n] for f in every) - min(f[n] for f in every) for n in every[0]}
    return Space(tuple(Column(n, span or 1.0) for n, span in ranges.items()))


def with_parameters(space: Space, task: Task, names: Sequence[str]) -> Space:
    """Coordinates with those of more parameters, in training widths."""
    more = [name for name in names if name not in space.names]
    return Space((*space.columns, *(Column(name, scale(task, name), task.known[name].period) for name in more)))
