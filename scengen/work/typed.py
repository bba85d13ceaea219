"""Dataclasses filled from plain data such as YAML or JSON, with names and types checked."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, Field, fields, is_dataclass
from types import UnionType
from typing import Any, TypeVar, get_args, get_origin

from ..errors import BadConfig, UnknownName, cut

T = TypeVar("T")

_SPELLED = {int: "a whole number", float: "a number", str: "a word", bool: "true or false", Mapping: "a mapping"}


def typed(where: str, cls: type[T], node: Mapping[str, Any], exact: bool = False) -> T:
    """Fill a dataclass from plain data, checking names and types.

    Args:
        where: dotted name of the data, for messages; empty for the whole of it.
        cls: a dataclass, which may hold others.
        exact: for data that a program wrote: every field must be given unless it may be None, no given value may be
            None, and a number is not accepted as a word.

    Raises:
        UnknownName, BadConfig: a key or the type of a value is wrong, or a value is missing.
    """
    known = {f.name: f for f in fields(cls)}  # type: ignore[arg-type]
    for key in node:
        if key not in known:
            raise UnknownName(f"key of {where}" if where else "key", key, known)
    filled = {}
    for name, field in known.items():
        dotted = f"{where}.{name}".strip(".")
        if name in node:
            filled[name] = _value(dotted, field.type, node[name], exact)
        elif not exact:
            filled[name] = _value(dotted, field.type, _default(field), exact)
        elif type(None) in _options(field.type):
            filled[name] = None
        else:
            raise BadConfig(f"{dotted} is missing")
    return cls(**filled)


def _default(field: Field[Any]) -> Any:
    if field.default_factory is not MISSING:
        return field.default_factory()
    return field.default if field.default is not MISSING else None


def _options(kind: Any) -> tuple[Any, ...]:
    """The types of a union, or the type itself."""
    return get_args(kind) if get_origin(kind) is UnionType else (kind,)


def _value(where: str, kind: Any, value: Any, exact: bool) -> Any:
    options = _options(kind)
    if float in options and isinstance(value, int) and not isinstance(value, bool):
        with suppress(OverflowError):  # a number of hundreds of digits, which is refused below
            return float(value)
    if value is None and type(None) in options and not exact:
        return None
    if str in options and isinstance(value, (int, float)) and not isinstance(value, bool) and not exact:
        return str(value)
    for option in options:
        if _fits(option, value):
            return _converted(where, option, value, exact)
    wanted = " or ".join(_spelled(option) for option in options if option is not type(None))
    alone = "; give one of them, and repeat the command for the others" if isinstance(value, list) and value else ""
    raise BadConfig(f"{cut(where)} = {cut(repr(value))}; it must be {wanted}{alone}")


def _fits(option: Any, value: Any) -> bool:
    """Whether a value can become one of a type, as far as its outermost level shows."""
    plain = get_origin(option) or option
    if option is type(None):
        return False
    if is_dataclass(option):
        return isinstance(value, (Mapping, plain))
    if plain is tuple:
        return isinstance(value, (list, tuple))
    if plain is str:
        return isinstance(value, str) and "\0" not in value
    return isinstance(value, plain) and not (isinstance(value, bool) and plain is not bool)


def _converted(where: str, option: Any, value: Any, exact: bool) -> Any:
    """A value that fits a type, with everything in it."""
    plain, inner = get_origin(option) or option, get_args(option)
    if is_dataclass(option):
        return typed(where, option, value, exact) if isinstance(value, Mapping) else value  # type: ignore[arg-type]
    if plain in (list, tuple):
        return plain(_value(f"{where}[{i}]", inner[0], each, exact) for i, each in enumerate(value))
    if plain is Mapping and inner[1] is not Any:
        return {key: _value(f"{where}.{key}", inner[1], each, exact) for key, each in value.items()}
    return value


def _spelled(option: Any) -> str:
    if is_dataclass(option):
        return "a group of settings"
    inner = get_args(option) or (str,)
    return _SPELLED.get(get_origin(option) or option, "a list of words" if inner[0] is str else "a list")
