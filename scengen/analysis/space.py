"""Scenarios as points: parameters or features in units of the training range, periods closed to circles."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..params import values
from ..samplers.support import width
from ..samplers.task import Task
from ..scenario import Scenario

Points = NDArray[np.float64]
"""Shape (n, d): one row per scenario."""


def measured(scenario: Scenario) -> dict[str, float]:
    """All parameters and all features of a scenario, in SI units and as declared."""
    return {**values(scenario), **scenario.features()}


def scale(task: Task, name: str) -> float:
    """The unit in which differences of a parameter are measured, in its own unit.

    The width of the training range; where training knows one value only, the width of its bounds.
    """
    known = task.known[name]
    return width(task.training[name].support) or (known.high - known.low) or 1.0


@dataclass(frozen=True)
class Column:
    """One coordinate, or two for a parameter with a period: a place on a circle of that circumference."""

    name: str
    scale: float
    period: float | None = None

    def of(self, value: float) -> tuple[float, ...]:
        if self.period is None:
            return (value / self.scale,)
        radius, angle = self.period / self.scale / math.tau, math.tau * value / self.period
        return radius * math.cos(angle), radius * math.sin(angle)


@dataclass(frozen=True)
class Space:
    """A choice of coordinates."""

    columns: tuple[Column, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(column.name for column in self.columns)

    def point(self, measured: Mapping[str, float]) -> list[float]:
        return [x for column in self.columns for x in column.of(measured[column.name])]

    def points(self, scenarios: Iterable[Scenario]) -> Points:
        """The scenarios as points."""
        rows = [self.point(measured(scenario)) for scenario in scenarios]
        return np.array(rows, float).reshape(len(rows), -1)


def of_parameters(task: Task, scenarios: Sequence[Scenario]) -> Space:
    """Coordinates of those parameters in which the scenarios differ, in training widths."""
    every = [values(scenario) for scenario in scenarios]
    varied = [n for n in task.known if any(v[n] != every[0][n] for v in every)]
    return Space(tuple(Column(n, scale(task, n), task.known[n].period) for n in varied))


def of_features(task: Task, training: Sequence[Scenario], others: Sequence[Scenario]) -> Space:
    """Coordinates of the family's features in ranges of a training sample; of its parameters if it declares none."""
    every = [dict(scenario.features()) for scenario in training]
    if not any(every):
        return of_parameters(task, [*training, *others])
    ranges = {n: max(f[n] for f in every) - min(f[n] for f in every) for n in every[0]}
    return Space(tuple(Column(n, span or 1.0) for n, span in ranges.items()))
