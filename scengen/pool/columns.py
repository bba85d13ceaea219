"""Kinds of columns: how Parquet stores a field of a row, and what a stored value must be before anything uses it.

The columns themselves are the fields of `scengen.pool.row.PoolRow`.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Any, get_args, get_origin

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ..certificate import StoredCertificate, as_json
from ..sim.embodiment import EMBODIMENTS, action_size
from .untrusted import (
    HASH,
    MAX_HORIZON,
    MAX_TEXT,
    SHORT_HASH,
    canonical,
    check_horizon,
    check_match,
    check_settling,
    check_task_version,
    check_text,
    check_versions,
    check_whole,
    demand,
)

MAX_SCENE = 5_000_000
"""Largest number of characters of a scene; the largest scenes have 60 000."""
MAX_PERIODS = 1_000_000
"""Bound on the length of a witness [control periods]; one hour, the longest horizon, has 360 000."""
MAX_AXES = 100
"""Largest number of axes of a split."""
MAX_CHECKS = 100
"""Largest number of checks of a certificate."""

ACTION_SIZES = frozenset(map(action_size, EMBODIMENTS))
"""Numbers in an action, for every robot."""

ID = re.compile(r"[0-9a-f]{12}")
VERDICTS = ("certified", "refuted", "unknown")
OUTCOMES = ("success", "failure", "timeout", "unstable")

Reader = Callable[[str, Any], Any]
"""Turns the stored value of a column, given after the column's name, into the value of a row's field, or raises
`ValueError`."""


# --- from a stored value to a field -----------------------------------------------------------------------------------


def text(largest: int = MAX_TEXT) -> Reader:
    """A text of limited length."""

    def read(name: str, value: Any) -> Any:
        check_text(name, value, largest)
        return value

    return read


def matching(pattern: re.Pattern[str]) -> Reader:
    """A text that matches a pattern from beginning to end."""

    def read(name: str, value: Any) -> Any:
        check_match(name, value, pattern)
        return value

    return read


def whole(name: str, value: Any) -> Any:
    """A whole number that is not negative."""
    check_whole(name, value)
    return value


def horizon(name: str, value: Any) -> Any:
    """A time limit [s]."""
    check_horizon(value)
    return value


def seconds(name: str, value: Any) -> Any:
    """A time in an episode [s]."""
    demand(isinstance(value, float) and 0 <= value <= 2 * MAX_HORIZON, f"{name} {str(value)[:60]} is not a time")
    return value


def outcome(name: str, value: Any) -> Any:
    """Result of an episode."""
    demand(value in OUTCOMES, f"{name} {str(value)[:60]!r} is not an outcome; known: {', '.join(OUTCOMES)}")
    return value


def axes(name: str, value: Any) -> tuple[str, ...]:
    """Names of axes with their severities."""
    demand(isinstance(value, list) and len(value) <= MAX_AXES, f"{name} is not a list of at most {MAX_AXES} axes")
    for axis in value:
        check_text(name, axis, 200)
    return tuple(value)


def numbers(name: str, value: Any) -> dict[str, Any]:
    """Numbers by name, from canonical JSON."""
    for key, number in (found := canonical(name, value)).items():
        plain = isinstance(number, (int, float)) and not isinstance(number, bool)
        demand(plain, f"{name} has no number for {key[:60]!r}")
    return found


def embodiment(name: str, value: Any) -> Any:
    """Name of a robot."""
    demand(value in EMBODIMENTS, f"{name} {str(value)[:60]!r} is not a robot; known: {', '.join(EMBODIMENTS)}")
    return value


def certificate(name: str, value: Any) -> StoredCertificate:
    """A certificate with all its checks."""
    demand(isinstance(value, dict), f"{name} is not a certificate")
    for what, largest in (("verdict", 100), ("reason", MAX_TEXT), ("settings", 100)):
        if value[what] is not None:
            check_text(f"{name}.{what}", value[what], largest)
    checks = value["checks"] or []
    demand(len(checks) <= MAX_CHECKS, f"{name} has {len(checks)} checks; at most {MAX_CHECKS} are read")
    for check in checks:
        demand(isinstance(check, dict), f"{name} has an empty check")
        for what in ("name", "reason", "settings", "numbers"):
            check_text(f"{what} of a check", check[what])
        for what in ("settings", "numbers"):
            canonical(f"{what} of check {check['name'][:40]}", check[what])
    found = StoredCertificate.of(value)
    demand(found.verdict in VERDICTS, f"{name} has the verdict {found.verdict[:40]!r}; known: {', '.join(VERDICTS)}")
    check_match(f"{name}.fingerprint", found.fingerprint, SHORT_HASH)
    check_match(f"{name}.source_sha256", found.source_sha256, HASH)
    check_task_version(found.task_version)
    if found.final_state:
        check_text(f"{name}.final_state", found.final_state, 100)
    check_versions(found.versions)
    if found.settle is not None:
        check_settling(found.settle)
    return found


def witness(name: str, value: Any) -> np.ndarray:
    """Recorded actions, shape (n, 7 * arms)."""
    found = np.asarray(value, np.float32)
    demand(found.ndim == 2 and found.shape[1] in ACTION_SIZES, f"a {name} of shape {found.shape}")
    demand(len(found) < MAX_PERIODS, f"a {name} of {len(found)} control periods; at most {MAX_PERIODS - 1} are read")
    demand(bool(np.isfinite(found).all()), f"a {name} with numbers that are not finite")
    return found


def check_robot(embodiment: str, witness: np.ndarray) -> None:
    """Raise `Malformed` unless a witness consists of actions of the robot."""
    size = action_size(embodiment)
    message = f"a witness with {witness.shape[1]} numbers in an action; those of {embodiment} have {size}"
    demand(witness.shape[1] == size, message)


# --- from a field to what is stored -----------------------------------------------------------------------------------


def arrow_type(kind: Any, size: int) -> pa.DataType:
    """Arrow type of the values of a field.

    Args:
        kind: type of the field. Mappings are stored as JSON text.
        size: numbers in an action.
    """
    if kind in _ARROW:
        return _ARROW[kind]
    if is_dataclass(kind):
        return pa.struct([(field.name, arrow_type(field.type, size)) for field in fields(kind)])
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Mapping:
        return pa.string()
    if origin is tuple:
        return pa.list_(arrow_type(inner[0], size))
    if origin in (np.ndarray, NDArray):  # the latter from numpy 2.5 on
        return pa.list_(pa.list_(pa.float32(), size))
    if origin is UnionType:
        return arrow_type(inner[0], size)
    raise TypeError(f"{kind} is not a type of a column")


_ARROW: dict[Any, pa.DataType] = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}


def plain_value(value: Any) -> Any:
    """The value of a field as Arrow takes it."""
    if isinstance(value, StoredCertificate):
        return value.plain()
    if isinstance(value, Mapping):
        return as_json(value)
    return list(value) if isinstance(value, tuple) else value
