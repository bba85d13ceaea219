"""Rules that every task must satisfy, as checks: `from scengen import conformance`.

The names below are imported when they are first used: pytest imports this package in every run, for its plugin.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .rules import Nonconformity, Rule, at_sight, axis_checks, checks, frame_checks, search

__all__ = ["Nonconformity", "Rule", "at_sight", "axis_checks", "checks", "frame_checks", "search"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; public names: {', '.join(__all__)}")
    return getattr(import_module(".rules", __name__), name)
