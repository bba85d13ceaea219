"""Distributions of one parameter. A closed set: to add one, add a class and a line in `KINDS`."""

import math
from dataclasses import dataclass
from typing import Any

from ..errors import BadConfig, nearest
from ..ood.support import Interval, Support
from ..params import Value


@dataclass(frozen=True)
class Fixed:
    """Always the same value."""

    value: Value

    def quantile(self, u: float) -> Value:
        """The value below which a share `u` of the draws lies."""
        return self.value

    @property
    def support(self) -> Support:
        return (Interval(self.value, self.value),)


@dataclass(frozen=True)
class Uniform:
    """Real numbers in [low, high], equally likely."""

    low: float
    high: float

    def __post_init__(self) -> None:
        _ordered(self.low, self.high)

    def quantile(self, u: float) -> float:
        """The value below which a share `u` of the draws lies."""
        return self.low + u * (self.high - self.low)

    @property
    def support(self) -> Support:
        return (Interval(self.low, self.high),)


@dataclass(frozen=True)
class LogUniform:
    """Positive real numbers in [low, high], every factor equally likely."""

    low: float
    high: float

    def __post_init__(self) -> None:
        _ordered(self.low, self.high)
        if self.low <= 0:
            raise ValueError("both ends must be positive")

    def quantile(self, u: float) -> float:
        """The value below which a share `u` of the draws lies."""
        return min(max(self.low * math.exp(u * math.log(self.high / self.low)), self.low), self.high)

    @property
    def support(self) -> Support:
        return (Interval(self.low, self.high),)


@dataclass(frozen=True)
class Integer:
    """Whole numbers low, low + 1, ..., high, equally likely."""

    low: int
    high: int

    def __post_init__(self) -> None:
        _ordered(self.low, self.high)
        if not (isinstance(self.low, int) and isinstance(self.high, int)):
            raise ValueError("both ends must be whole numbers")

    def quantile(self, u: float) -> int:
        """The value below which a share `u` of the draws lies."""
        return self.low + int(u * (self.high - self.low + 1))

    @property
    def support(self) -> Support:
        return tuple(Interval(v, v) for v in range(self.low, self.high + 1))


@dataclass(frozen=True)
class Choice:
    """One of the listed values, equally likely; a value listed twice is twice as likely."""

    options: tuple[Value, ...]

    def quantile(self, u: float) -> Value:
        """The option at share `u` of the list, in the order of the list."""
        return self.options[int(u * len(self.options))]

    @property
    def support(self) -> Support:
        return tuple(Interval(v, v) for v in sorted(set(self.options)))


Dist = Fixed | Uniform | LogUniform | Integer | Choice


KINDS: dict[str, tuple[type[Dist], str]] = {
    "fixed": (Fixed, "value"),
    "uniform": (Uniform, "low, high"),
    "loguniform": (LogUniform, "low, high"),
    "integer": (Integer, "low, high"),
    "choice": (Choice, "value, value, ..."),
}
"""The spelling of each distribution in a task file, and its arguments."""


def parse(where: str, node: Any) -> Dist:
    """Read `[uniform, 0.1, 0.2]`, or a bare number for a constant, from a task file.

    Raises:
        BadConfig: the node is neither a number nor a list that names a distribution and its arguments.
    """
    if _number(node):
        return Fixed(node)
    spelled = "; ".join(f"[{k}, {args}]" for k, (_, args) in KINDS.items())
    if not (isinstance(node, list) and node and isinstance(node[0], str)):
        raise BadConfig(f"{where} = {node!r}; it must be a number or one of: {spelled}")
    kind, *args = node
    if kind not in KINDS:
        raise BadConfig(f"{where}: no distribution named {kind!r}{nearest(kind, KINDS)}; known: {spelled}")
    family, expected = KINDS[kind]
    if not (args and all(map(_number, args))):
        raise BadConfig(f"{where} = {node!r}; [{kind}, {expected}] takes finite numbers")
    try:
        if family is Choice:
            return Choice(tuple(args))
        return family(*map(float, args)) if family in (Uniform, LogUniform) else family(*args)
    except (TypeError, ValueError) as error:
        why = error if isinstance(error, ValueError) else f"got {len(args)} arguments"
        raise BadConfig(f"{where} = {node!r}; expected [{kind}, {expected}]: {why}") from None


def _number(x: Any) -> bool:
    return isinstance(x, (int, float)) and not isinstance(x, bool) and math.isfinite(x)


def _ordered(low: float, high: float) -> None:
    if low > high:
        raise ValueError("the low end lies above the high end")
