"""Physical parameters: plain dataclass fields that know their unit and bounds.

The bounds are declared once, here, and used four times: by the constructor, by the check of a task file, by the
property tests and by the printed table of parameters.
"""

import dataclasses
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from .errors import BadConfig, OutOfBounds, UnknownName

N = TypeVar("N", int, float)
D = TypeVar("D")
Value = int | float
"""Value of a parameter."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of a scenario family, nested assets included."""

    name: str
    """Dotted path, such as `tile.mass`."""
    nominal: Value
    """Nominal value [unit]."""
    unit: str
    """Unit of the value and the bounds."""
    low: float
    """Lowest value that makes physical sense [unit]."""
    high: float
    """Highest value that makes physical sense [unit]."""
    period: float | None
    """Period [unit]: values that differ by it give the same scene, such as 180 for the yaw of a slab. None if there is
    none."""
    hidden: bool
    """Whether the value must not be readable from the scene's geometry, colours or names."""
    integer: bool
    """Whether the value is a whole number."""
    answer: bool = False
    """Whether the value states an answer that a policy must find, such as the number of the intact lane, rather than
    the physical quantity that it follows from. The cue audit does not count it as a source."""

    def check(self, where: str, value: Any) -> None:
        """Raise unless `value` is a finite number of the right kind within the bounds.

        Args:
            where: name of the value in the error message.
            value: the value to check.
        """
        if isinstance(value, bool) or not isinstance(value, int if self.integer else (int, float)):
            kind = "a whole number" if self.integer else "a number"
            raise BadConfig(f"{where} = {value!r}; it must be {kind} in [{self.low:g}, {self.high:g}] {self.unit}")
        if not (math.isfinite(value) and self.low <= value <= self.high):
            raise OutOfBounds(where, value, self.low, self.high, self.unit)


def param(
    nominal: N,
    unit: str,
    low: N,
    high: N,
    *,
    period: float | None = None,
    hidden: bool = False,
    answer: bool = False,
) -> N:
    """Declare a parameter: its nominal value, its unit and its physical bounds.

    The bounds are physical, not statistical: outside them the scene cannot be built or makes no sense. The
    distributions of likely values are in conf/task/.

    Args:
        nominal: the value if nothing else is said; a whole number declares an integer parameter.
        unit: the unit, such as `m`.
        low: lowest value allowed.
        high: highest value allowed.
        period: see `Parameter.period`.
        hidden: see `Parameter.hidden`.
        answer: see `Parameter.answer`.

    Raises:
        ValueError: the period is not a positive number.
    """
    if period is not None and not (math.isfinite(period) and period > 0):
        raise ValueError(f"period = {period}; it must be a positive number, or None")
    whole = isinstance(nominal, int)
    meta = {"unit": unit, "low": low, "high": high, "period": period, "hidden": hidden, "integer": whole}
    meta["answer"] = answer
    return dataclasses.field(default=nominal, metadata=meta)


def parameters(owner: Any, prefix: str = "") -> Iterator[Parameter]:
    """Yield every parameter of an instance, with the instance's values as the nominal ones."""
    for field in dataclasses.fields(owner):
        value = getattr(owner, field.name)
        if dataclasses.is_dataclass(value):
            yield from parameters(value, f"{prefix}{field.name}.")
        elif "unit" in field.metadata:
            yield Parameter(prefix + field.name, value, **field.metadata)


def values(owner: Any) -> dict[str, Value]:
    """All parameter values by dotted name."""
    return {p.name: p.nominal for p in parameters(owner)}


class Bounded:
    """Base of dataclasses of parameters that are parts of a scenario: each checks its bounds."""

    def __post_init__(self) -> None:
        check_bounds(self)


def check_bounds(owner: Any) -> None:
    """Raise for the first parameter of `owner` outside its bounds. Nested assets check their own."""
    for p in parameters(owner):
        if "." not in p.name:
            p.check(f"{type(owner).__name__}.{p.name}", p.nominal)


def with_values(owner: D, new: Mapping[str, Value]) -> D:
    """Copy `owner` with some parameters replaced, such as `{"count": 6, "tile.mass": 0.03}`."""
    known = values(owner)
    flat: dict[str, Any] = {}
    nested: dict[str, dict[str, Value]] = {}
    for name, value in new.items():
        if name not in known:
            raise UnknownName(f"parameter of {type(owner).__name__}", name, known)
        if isinstance(known[name], float) and type(value) is int:
            value = float(value)  # 45 and 45.0 are one scenario and need one id
        head, _, tail = name.partition(".")
        if tail:
            nested.setdefault(head, {})[tail] = value
        else:
            flat[head] = value
    for head, inner in nested.items():
        flat[head] = with_values(getattr(owner, head), inner)
    return dataclasses.replace(owner, **flat)  # type: ignore[type-var]


def canonical(owner: Any) -> str:
    """The parameter values as JSON with sorted keys, from which ids are computed."""
    return json.dumps(values(owner), sort_keys=True)
