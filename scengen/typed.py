"""Dataclasses filled from plain data such as YAML or JSON, with names and types checked."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any, TypeVar

from .errors import BadConfig, UnknownName, cut

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
    return kind.__args__ if hasattr(kind, "__args__") and not hasattr(kind, "__origin__") else (kind,)


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
        plain = getattr(option, "__origin__", option)
        if is_dataclass(option) and isinstance(value, Mapping):
            return typed(where, option, value, exact)  # type: ignore[arg-type]
        if plain is tuple and isinstance(value, (list, tuple)):
            return tuple(_value(f"{where}[{i}]", option.__args__[0], each, exact) for i, each in enumerate(value))
        if isinstance(value, plain) and not (isinstance(value, bool) and plain is not bool):
            if plain is list:
                return [_value(f"{where}[{i}]", option.__args__[0], each, exact) for i, each in enumerate(value)]
            if plain is Mapping:
                of = option.__args__[1]
                return value if of is Any else {k: _value(f"{where}.{k}", of, v, exact) for k, v in value.items()}
            if plain is not str or "\0" not in value:
                return value
    wanted = " or ".join(_spelled(option) for option in options if option is not type(None))
    raise BadConfig(f"{cut(where)} = {cut(repr(value))}; it must be {wanted}")


def _spelled(option: Any) -> str:
    if is_dataclass(option):
        return "a group of settings"
    plain = getattr(option, "__origin__", option)
    inner = getattr(option, "__args__", None) or (str,)
    return _SPELLED.get(plain, "a list of words" if inner[0] is str else "a list")
