"""Regions of a parameter outside training, into which an axis may lead."""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from ...params import Parameter, Value
from ...samplers.support import Interval, Support
from ...samplers.task import Task

GAP_SHARE = 0.05
"""Share of a region next to training that is left out: an axis needs a gap."""


@dataclass(frozen=True)
class Region:
    """Values of one parameter between two neighbours in its training support, or beyond the outermost.

    Places in it are numbers from 0 to 1: 0 is next to training, 1 is at the bound of the parameter, or next to training
    again. Beyond the outermost value of training, values grow with the square of the place: a bound only says which
    values have a meaning at all, and solvable scenarios often end far before it.
    """

    parameter: Parameter
    edge: float
    """Training value at which the region starts."""
    far: float
    """Value at which the region ends."""
    beyond: bool
    """Whether the region lies beyond the outermost training value, so that no training lies behind its end."""

    @property
    def name(self) -> str:
        """Readable name, from the parameter and the place of its values. An axis gets this name."""
        where = ("high" if self.far > self.edge else "low") if self.beyond else f"from_{self.edge:g}"
        return f"{self.parameter.name}_{where}".replace(".", "_").replace("-", "minus_")

    @cached_property
    def whole(self) -> list[int]:
        """Values of an integer parameter in the region, in order."""
        step = 1 if self.far > self.edge else -1
        last = round(self.far) if self.beyond else round(self.far) - step
        return list(range(round(self.edge) + step, last + step, step))

    def value(self, place: float) -> Value:
        """The parameter's value at a place from 0 to 1."""
        if self.parameter.integer:
            return self.whole[min(int(self._share(place) * len(self.whole)), len(self.whole) - 1)]
        share = GAP_SHARE**2 + (1 - GAP_SHARE**2) * self._share(place) if self.beyond else self._inner(place)
        return self._wrapped(self.edge + share * (self.far - self.edge))

    def _share(self, place: float) -> float:
        return place**2 if self.beyond else place

    def _inner(self, place: float) -> float:
        return GAP_SHARE + (1 - 2 * GAP_SHARE) * place

    def _wrapped(self, value: float) -> float:
        period = self.parameter.period
        if period:
            value -= period * math.ceil((value - self.parameter.high) / period) if value > self.parameter.high else 0.0
        return round(min(max(value, self.parameter.low), self.parameter.high), 12)


def regions(task: Task) -> list[Region]:
    """All regions of all parameters of a task, in the order of its parameters."""
    return [region for name, known in task.known.items() for region in _outside(known, task.training[name].support)]


def _outside(parameter: Parameter, support: Support) -> Iterator[Region]:
    """The regions of one parameter outside its training support."""
    if parameter.integer:
        support = tuple(Interval(round(v), round(v)) for v in sorted(_integers(support)))
    parts = sorted(support, key=lambda i: i.low)
    for one, other in itertools.pairwise(parts):
        yield from _unless_empty(Region(parameter, one.high, other.low, beyond=False))
    first, last = parts[0].low, max(i.high for i in parts)
    if parameter.period:
        yield from _unless_empty(Region(parameter, last, first + parameter.period, beyond=False))
    else:
        yield from _unless_empty(Region(parameter, last, parameter.high, beyond=True))
        yield from _unless_empty(Region(parameter, first, parameter.low, beyond=True))


def _unless_empty(region: Region) -> Iterator[Region]:
    """The region, unless it is empty."""
    if region.whole if region.parameter.integer else abs(region.far - region.edge) > 1e-9:
        yield region


def _integers(support: Support) -> set[int]:
    return {v for i in support for v in range(math.ceil(i.low), math.floor(i.high) + 1)}


def located(region: Region, value: Value) -> bool:
    """Whether a value lies in a region."""
    low, high = sorted((region.edge, region.far))
    period = region.parameter.period
    turns = (0,) if period is None else (-1, 0, 1)
    return any(low < value + k * (period or 0.0) < high or (region.beyond and value == region.far) for k in turns)


def values_at(place: Mapping[Region, float]) -> dict[str, Value]:
    """Parameter values at places in several regions."""
    return {region.parameter.name: region.value(at) for region, at in place.items()}
