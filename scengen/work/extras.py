"""Modules that need the packages of an extra."""

from importlib import import_module
from types import ModuleType

from ..errors import BadConfig


def module_of_extra(name: str, who: str, extra: str) -> ModuleType:
    """Import a module that needs an extra.

    Args:
        who: who needs it, with the verb: "the studio needs".
        extra: name of the extra.

    Raises:
        BadConfig: a package is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise BadConfig(f"{who} {error.name}; pip install 'scengen[{extra}]'") from None
