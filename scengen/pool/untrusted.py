"""Rules for data of unknown origin: types, finite numbers and sizes, checked before anything uses a value."""

import json
import math
import re
from collections.abc import Mapping
from typing import Any

from ..certificate import from_json

MAX_TEXT = 100_000
"""Largest number of characters of a text, JSON included, unless another limit is given."""
MAX_HORIZON = 3600.0
"""Longest time limit of a scenario [s]."""
MAX_SETTLING = 10.0
"""Longest time for which a goal must hold [s]."""
MAX_DEPTH = 16
"""Largest number of nested brackets in JSON; a manifest has 7."""
MAX_VERSIONS = 100
"""Largest number of packages whose versions are listed."""
READING_MEMORY = 4_000_000_000
"""Memory that reading a few rows may take in addition to what the process has [bytes]. A column that is declared small
can unpack to any size."""

WORD = re.compile(r"[a-z0-9_]{1,100}")
SHORT_HASH = re.compile(r"[0-9a-f]{16}")
HASH = re.compile(r"[0-9a-f]{64}")


class Malformed(ValueError):
    """A part of a pool is not what the format says."""


def demand(holds: bool, otherwise: str) -> None:
    """Raise `Malformed` with the text `otherwise` unless a rule holds."""
    if not holds:
        raise Malformed(otherwise)


# --- JSON -------------------------------------------------------------------------------------------------------------


def read_json(text: str, largest: int = MAX_TEXT) -> Any:
    """Read JSON that has finite numbers, no key twice, and a limited depth and size.

    Raises:
        Malformed: it is something else.
    """
    if len(text) > largest:
        raise Malformed(f"JSON of {len(text)} characters; at most {largest} are read")
    try:
        found = json.loads(text, parse_constant=_not_finite, object_pairs_hook=_without_repeated_keys)
    except RecursionError:
        raise Malformed("JSON with too many nested brackets") from None
    except ValueError as error:
        raise Malformed(f"not JSON: {error}") from None
    check_plain(found)
    return found


def canonical(name: str, text: str) -> dict[str, Any]:
    """Read canonical JSON of a mapping, as `certificate.as_json` writes it, with finite numbers.

    Raises:
        ValueError: it is something else.
    """
    check_text(name, text)
    try:
        found = from_json(text)
    except RecursionError:
        raise Malformed(f"{name} has too many nested brackets") from None
    check_plain(found)
    return found


def _not_finite(text: str) -> Any:
    raise Malformed(f"the number {text}, which is not finite")


def _without_repeated_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    demand(len(found) == len(pairs), "a key that stands twice")
    return found


# --- rules; each raises `Malformed` unless the value is what its name says --------------------------------------------


def check_plain(value: Any) -> None:
    """Plain data with finite numbers of at most 64 bits and texts of Unicode, no deeper than `MAX_DEPTH`."""
    todo = [(value, 0)]
    while todo:
        inner, depth = todo.pop()
        if depth > MAX_DEPTH:
            raise Malformed(f"data more than {MAX_DEPTH} levels deep")
        if isinstance(inner, float) and not math.isfinite(inner):
            raise Malformed("a number that is not finite")
        if isinstance(inner, int) and abs(inner) >= 2**63:
            raise Malformed("a whole number beyond 64 bits")
        if isinstance(inner, str) and not inner.isascii():
            _check_unicode(inner)
        if isinstance(inner, Mapping):
            todo.extend((v, depth + 1) for v in (*inner, *inner.values()))
        elif isinstance(inner, list):
            todo.extend((v, depth + 1) for v in inner)


def _check_unicode(text: str) -> None:
    """A text that can be written to a file, without half of a pair of surrogates."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise Malformed(f"{text[:60]!a} is not Unicode") from None


def check_mapping(name: str, value: Any) -> Mapping[str, Any]:
    """A mapping, which is returned."""
    demand(isinstance(value, Mapping), f"{name} is not a mapping")
    return value


def check_text(name: str, value: Any, largest: int = MAX_TEXT) -> None:
    """A text of limited length."""
    demand(isinstance(value, str), f"{name} is not a text")
    demand(len(value) <= largest, f"{name} has {len(value)} characters; at most {largest} are read")


def check_match(name: str, value: Any, pattern: re.Pattern[str]) -> None:
    """A text that matches a pattern from beginning to end."""
    demand(isinstance(value, str), f"{name} is not a text")
    demand(pattern.fullmatch(value) is not None, f"{name} {value[:60]!r} does not match {pattern.pattern}")


def check_whole(name: str, value: Any, most: int = 2**63 - 1) -> None:
    """A whole number in [0, most]."""
    demand(isinstance(value, int) and not isinstance(value, bool), f"{name} is not a whole number")
    demand(0 <= value <= most, f"{name} = {value}; it must lie in [0, {most}]")


def check_horizon(value: Any) -> None:
    """A time limit [s]."""
    _check_seconds("the horizon", value, MAX_HORIZON)


def check_settling(value: Any) -> None:
    """A time for which a goal must hold [s]."""
    _check_seconds("the settling time", value, MAX_SETTLING)


def _check_seconds(name: str, value: Any, most: float) -> None:
    plain = isinstance(value, (int, float)) and not isinstance(value, bool)
    demand(plain and math.isfinite(value), f"{name} is not a finite number")
    demand(0 < value <= most, f"{name} = {value:g} s; it must lie in (0, {most:g}] s")


def check_task_version(value: Any) -> None:
    """Version of a task: a whole number from 1 upwards."""
    check_whole("task_version", value)
    demand(value >= 1, f"task_version is {value}; versions of tasks begin with 1")


def check_versions(value: Any) -> None:
    """Versions by package, MuJoCo and robosuite among them."""
    demand(len(check_mapping("versions", value)) <= MAX_VERSIONS, f"more than {MAX_VERSIONS} versions")
    for name, version in value.items():
        check_text("a package of versions", name, 100)
        check_text(f"the version of {name[:40]!r}", version, 100)
    for name in ("mujoco", "robosuite"):
        demand(name in value, f"versions lacks {name}")
