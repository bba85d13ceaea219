"""Supports of distributions as unions of intervals, and the distance between two of them."""

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Interval:
    """The numbers from low to high; a point if both ends are equal. An open end does not belong to it."""

    low: float
    """Lower end."""
    high: float
    """Upper end."""
    open_low: bool = False
    """Whether the lower end is excluded."""
    open_high: bool = False
    """Whether the upper end is excluded."""

    def __contains__(self, value: float) -> bool:
        above = self.low < value if self.open_low else self.low <= value
        return above and (value < self.high if self.open_high else value <= self.high)

    def shifted(self, by: float) -> "Interval":
        """The interval moved by `by`."""
        return Interval(self.low + by, self.high + by, self.open_low, self.open_high)

    def reflected(self, about: float) -> "Interval":
        """Mirror image about a value."""
        return Interval(2 * about - self.high, 2 * about - self.low, self.open_high, self.open_low)

    def distance(self, other: "Interval") -> float:
        """Distance between two intervals; 0 if they touch or overlap, whether their ends are open or closed."""
        return max(0.0, other.low - self.high, self.low - other.high)

    def meets(self, other: "Interval") -> bool:
        """Whether some value belongs to both."""
        low, high = max(self.low, other.low), min(self.high, other.high)
        return low < high or (low == high and low in self and low in other)

    def nearest(self, value: float) -> float:
        """The value of the closed interval that is nearest to another one."""
        return min(max(value, self.low), self.high)


Support = tuple[Interval, ...]
"""Non-empty union of intervals."""

TOLERANCE = 1e-9
"""Share of the largest end below which a gap is rounding: 0.1 * 3 touches a range that ends at 0.3."""


def distance(a: Support, b: Support, period: float | None = None) -> float:
    """Smallest distance between a value of `a` and a value of `b`, on a circle if there is a period.

    It is symmetric, and 0 if it is no more than rounding (`TOLERANCE`).
    """
    there = min(x.distance(z) for x in a for y in b for z in turned(y, x, period))
    back = min(y.distance(z) for y in b for x in a for z in turned(x, y, period))
    size = max(abs(end) for i in (*a, *b) for end in (i.low, i.high, period or 0.0))
    gap = min(there, back)
    return gap if gap > TOLERANCE * size else 0.0


def meet(a: Support, b: Support, period: float | None = None) -> bool:
    """Whether some value belongs to both.

    Supports that do not meet may still touch: `[0, 1)` and `[1, 2]` share no value, but training comes arbitrarily
    close to one, so the gap is 0.
    """
    return any(x.meets(z) for x in a for y in b for z in turned(y, x, period))


def nearest(support: Support, value: float, period: float | None = None) -> float:
    """The value of the support that is nearest to `value`, shifted by whole periods to where it is nearest."""
    here = Interval(value, value)
    found = (z.nearest(value) for y in support for z in turned(y, here, period))
    return min(found, key=lambda v: abs(v - value))


def wrapped(value: float, low: float, high: float, period: float | None) -> float:
    """The value, shifted by whole periods into the range from `low` to `high`; unchanged without a period."""
    if period:
        while value < low:
            value += period
        while value > high:
            value -= period
    return value


def width(support: Support) -> float:
    """Length from the lowest to the highest value."""
    return max(i.high for i in support) - min(i.low for i in support)


def turned(interval: Interval, towards: Interval, period: float | None) -> list[Interval]:
    """The interval, or with a period all its copies that can be nearest to another interval."""
    if period is None:
        return [interval]
    first = math.floor((towards.low - interval.high) / period)
    last = math.ceil((towards.high - interval.low) / period)
    return [interval.shifted(k * period) for k in range(first, last + 1)]
