"""Where a parameter has values that training does not: the regions that an axis may lead to."""

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from ...params import Parameter, Value
from ...samplers.support import Interval, Support
from ...samplers.task import Task

MARGIN = 0.05
"""Share of a region next to training that is left out: an axis needs a gap."""


@dataclass(frozen=True)
class Region:
    """Values of one parameter between two neighbours in its training support, or beyond the outermost.

    Places in it are numbers from 0 to 1: 0 is next to training, 1 at the bound of the parameter, or next to training
    again. Beyond the outermost value of training they go with the square: a bound is what has a meaning at all, and
    what can be solved often ends far before.
    """

    parameter: Parameter
    edge: float
    """The training value that it begins at."""
    far: float
    """Where it ends."""
    beyond: bool
    """Whether nothing of training lies behind its end."""

    @property
    def name(self) -> str:
        """The parameter and where its values lie, to be read by people and to name an axis."""
        where = ("high" if self.far > self.edge else "low") if self.beyond else f"from_{self.edge:g}"
        return f"{self.parameter.name}_{where}".replace(".", "_").replace("-", "minus_")

    @cached_property
    def whole(self) -> list[int]:
        """The values in order, where they are whole numbers."""
        step = 1 if self.far > self.edge else -1
        last = round(self.far) if self.beyond else round(self.far) - step
        return list(range(round(self.edge) + step, last + step, step))

    def value(self, place: float) -> Value:
        """The parameter's value at a place from 0 to 1."""
        if self.parameter.integer:
            return self.whole[min(int(self._share(place) * len(self.whole)), len(self.whole) - 1)]
        share = MARGIN**2 + (1 - MARGIN**2) * self._share(place) if self.beyond else self._inner(place)
        return self._wrapped(self.edge + share * (self.far - self.edge))

    def _share(self, place: float) -> float:
        return place**2 if self.beyond else place

    def _inner(self, place: float) -> float:
        return MARGIN + (1 - 2 * MARGIN) * place

    def _wrapped(self, value: float) -> float:
        period = self.parameter.period
        if period:
            value -= period * math.ceil((value - self.parameter.high) / period) if value > self.parameter.high else 0.0
        return round(min(max(value, self.parameter.low), self.parameter.high), 12)


def regions(task: Task) -> list[Region]:
    """All regions of all parameters of a task, in the order of its parameters."""
    return [region for name, known in task.known.items() for region in _of(known, task.training[name].support)]


def _of(parameter: Parameter, support: Support) -> Iterator[Region]:
    if parameter.integer:
        support = tuple(Interval(round(v), round(v)) for v in sorted(_wholes(support)))
    parts = sorted(support, key=lambda i: i.low)
    for one, other in itertools.pairwise(parts):
        yield from _filled(Region(parameter, one.high, other.low, beyond=False))
    first, last = parts[0].low, max(i.high for i in parts)
    if parameter.period:
        yield from _filled(Region(parameter, last, first + parameter.period, beyond=False))
    else:
        yield from _filled(Region(parameter, last, parameter.high, beyond=True))
        yield from _filled(Region(parameter, first, parameter.low, beyond=True))


def _filled(region: Region) -> Iterator[Region]:
    """The region, if it has any value."""
    if region.whole if region.parameter.integer else abs(region.far - region.edge) > 1e-9:
        yield region


def _wholes(support: Support) -> set[int]:
    return {v for i in support for v in range(math.ceil(i.low), math.floor(i.high) + 1)}


def located(region: Region, value: Value) -> bool:
    """Whether a value lies in a region."""
    low, high = sorted((region.edge, region.far))
    period = region.parameter.period
    turns = (0,) if period is None else (-1, 0, 1)
    return any(low < value + k * (period or 0.0) < high or (region.beyond and value == region.far) for k in turns)


def spelled(place: Mapping[Region, float]) -> dict[str, Value]:
    """The values of the parameters at places in several regions."""
    return {region.parameter.name: region.value(at) for region, at in place.items()}
