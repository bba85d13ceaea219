"""Distributions of one parameter. The set is closed: to add one, add a class and a line in `KINDS`."""

import math
from dataclasses import dataclass, field
from typing import Any

from ..errors import BadConfig, nearest
from ..params import Value
from .support import Interval, Support


@dataclass(frozen=True)
class Fixed:
    """A constant."""

    value: Value
    """Its value."""

    def quantile(self, u: float) -> Value:
        """The value below which a share `u` of the draws lies."""
        return self.value

    @property
    def support(self) -> Support:
        """The value as a point."""
        return (Interval(self.value, self.value),)


CLOSED = "[]"
"""Ends of a range of which both belong to it."""
ENDS = (CLOSED, "[)", "(]", "()")
"""Spellings of the ends of a range: a square bracket is closed, a round one open."""


@dataclass(frozen=True)
class Uniform:
    """Real numbers from low to high, equally likely."""

    low: float
    """Lower end."""
    high: float
    """Upper end."""
    ends: str = field(default=CLOSED, kw_only=True)
    """Ends that belong to the range, one of `ENDS`."""

    def __post_init__(self) -> None:
        _check_ends(self.low, self.high, self.ends)

    def quantile(self, u: float) -> float:
        """The value below which a share `u` of the draws lies."""
        return _within(self.low + u * (self.high - self.low), self.support[0])

    @property
    def support(self) -> Support:
        """The range as one interval."""
        return (Interval(self.low, self.high, self.ends[0] == "(", self.ends[1] == ")"),)


@dataclass(frozen=True)
class LogUniform:
    """Positive real numbers from low to high, uniform in their logarithm."""

    low: float
    """Lower end."""
    high: float
    """Upper end."""
    ends: str = field(default=CLOSED, kw_only=True)
    """Ends that belong to the range, one of `ENDS`."""

    def __post_init__(self) -> None:
        _check_ends(self.low, self.high, self.ends)
        if self.low <= 0:
            raise ValueError("both ends must be positive")

    def quantile(self, u: float) -> float:
        """The value below which a share `u` of the draws lies."""
        return _within(self.low * math.exp(u * math.log(self.high / self.low)), self.support[0])

    @property
    def support(self) -> Support:
        """The range as one interval."""
        return (Interval(self.low, self.high, self.ends[0] == "(", self.ends[1] == ")"),)


@dataclass(frozen=True)
class Integer:
    """Whole numbers low, low + 1, ..., high, equally likely."""

    low: int
    """Smallest number."""
    high: int
    """Largest number."""

    def __post_init__(self) -> None:
        _check_ends(self.low, self.high)
        if not (isinstance(self.low, int) and isinstance(self.high, int)):
            raise ValueError("both ends must be whole numbers")

    def quantile(self, u: float) -> int:
        """The value below which a share `u` of the draws lies."""
        return self.low + int(u * (self.high - self.low + 1))

    @property
    def support(self) -> Support:
        """The numbers as points."""
        return tuple(Interval(v, v) for v in range(self.low, self.high + 1))


@dataclass(frozen=True)
class Choice:
    """One of the listed values, equally likely. A value listed twice is twice as likely."""

    options: tuple[Value, ...]
    """Values in the order of the task file."""

    def quantile(self, u: float) -> Value:
        """The option at share `u` of the list, in the order of the list."""
        return self.options[int(u * len(self.options))]

    @property
    def support(self) -> Support:
        """The values as points."""
        return tuple(Interval(v, v) for v in sorted(set(self.options)))


@dataclass(frozen=True)
class Mixture:
    """One of several distributions, equally likely. A distribution listed twice is twice as likely."""

    parts: tuple["Dist", ...]
    """Distributions in the order of the task file."""

    def quantile(self, u: float) -> Value:
        """The value of the part at share `u` of the list, at the remaining share of `u` in that part."""
        place = u * len(self.parts)
        return self.parts[int(place)].quantile(place % 1.0)

    @property
    def support(self) -> Support:
        """The supports of all parts."""
        return tuple(interval for part in self.parts for interval in part.support)


Dist = Fixed | Uniform | LogUniform | Integer | Choice | Mixture
"""Distribution of a parameter."""


KINDS: dict[str, tuple[type[Dist], str]] = {
    "fixed": (Fixed, "value"),
    "uniform": (Uniform, "low, high"),
    "loguniform": (LogUniform, "low, high"),
    "integer": (Integer, "low, high"),
    "choice": (Choice, "value, value, ..."),
    "mixture": (Mixture, "distribution, distribution, ..."),
}
"""Class and arguments of each distribution, by its spelling in a task file."""


def parse(where: str, node: Any) -> Dist:
    """Read `[uniform, 0.1, 0.2]`, or a bare number for a constant, from a task file.

    A third argument of a range, such as `"[)"`, says which of its ends belong to it. By default both do.

    Raises:
        BadConfig: the node is neither a number nor a list that names a distribution and its arguments.
    """
    if _is_number(node):
        return Fixed(node)
    spelled = "; ".join(f"[{k}, {args}]" for k, (_, args) in KINDS.items())
    if not (isinstance(node, list) and node and isinstance(node[0], str)):
        raise BadConfig(f"{where} = {node!r}; it must be a number or one of: {spelled}")
    kind, *args = node
    if kind not in KINDS:
        raise BadConfig(f"{where}: no distribution named {kind!r}{nearest(kind, KINDS)}; known: {spelled}")
    family, expected = KINDS[kind]
    if family is Mixture and args:
        return Mixture(tuple(parse(f"{where}[{i}]", part) for i, part in enumerate(args, 1)))
    real = family in (Uniform, LogUniform)
    ends = args.pop() if real and len(args) == 3 and args[-1] in ENDS else CLOSED
    if not (args and all(map(_is_number, args))):
        raise BadConfig(f"{where} = {node!r}; [{kind}, {expected}] takes finite numbers")
    try:
        if family is Choice:
            return Choice(tuple(args))
        return family(*map(float, args), ends=ends) if real else family(*args)
    except (TypeError, ValueError) as error:
        why = error if isinstance(error, ValueError) else f"got {len(args)} arguments"
        raise BadConfig(f"{where} = {node!r}; expected [{kind}, {expected}]: {why}") from None


def _is_number(x: Any) -> bool:
    """Whether a node is a finite number."""
    return isinstance(x, (int, float)) and not isinstance(x, bool) and math.isfinite(x)


def _check_ends(low: float, high: float, ends: str = CLOSED) -> None:
    """Raise unless the ends of a range are in order."""
    if low > high:
        raise ValueError("the low end lies above the high end")
    if low == high and ends != CLOSED:
        raise ValueError("a range of one value has closed ends")


def _within(value: float, range_: Interval) -> float:
    """The value, or the last number before an open end that rounding has reached."""
    low = math.nextafter(range_.low, math.inf) if range_.open_low else range_.low
    high = math.nextafter(range_.high, -math.inf) if range_.open_high else range_.high
    return min(max(value, low), high)
