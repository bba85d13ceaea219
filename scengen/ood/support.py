"""Supports of distributions as unions of closed intervals, and how far apart two of them are."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Interval:
    """The closed interval [low, high]; a point when both ends agree.

    Half-open ranges are treated by their closure: a range that merely touches the training range shares
    a limit with it, and a learner has seen values arbitrarily close to that limit.
    """

    low: float
    high: float

    def shifted(self, by: float) -> "Interval":
        return Interval(self.low + by, self.high + by)

    def distance(self, other: "Interval") -> float:
        """Free space between two intervals; 0 when they touch or overlap."""
        return max(0.0, other.low - self.high, self.low - other.high)


Support = tuple[Interval, ...]
"""A non-empty union of intervals."""


def distance(a: Support, b: Support, period: float | None = None) -> float:
    """Smallest distance between a value of `a` and a value of `b`, on a circle if there is a period."""
    return min(_apart(x, y, period) for x in a for y in b)


def width(support: Support) -> float:
    """Length from the lowest to the highest value."""
    return max(i.high for i in support) - min(i.low for i in support)


def _apart(a: Interval, b: Interval, period: float | None) -> float:
    if period is None:
        return a.distance(b)
    turns = math.floor((a.low - b.high) / period)
    around = math.ceil((a.high - b.low) / period)
    return min(a.distance(b.shifted(k * period)) for k in range(turns, around + 1))
