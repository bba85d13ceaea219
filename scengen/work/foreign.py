"""Code of users that a setting names as `module:factory`."""

import importlib
import multiprocessing
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import BadConfig, ForeignCode, cut, place_of


def is_factory(name: str) -> bool:
    """Whether a text is spelled `module:factory`."""
    module, colon, factory = name.partition(":")
    return bool(colon and factory.isidentifier() and all(map(str.isidentifier, module.split("."))))


def is_typed(code: Any) -> bool:
    """Whether a function or class was typed into a session, such as a notebook's, instead of read from a file."""
    if getattr(code, "__module__", None) != "__main__":
        return False
    made = [found.co_filename for part in (code, *vars(code).values()) if (found := getattr(part, "__code__", None))]
    written = getattr(sys.modules["__main__"], "__file__", None) is not None
    return not written or any(file != GENERATED and not Path(file).is_file() for file in made)


GENERATED = "<string>"
"""File of functions that a decorator writes, such as `dataclass`."""


def factory_of(setting: str, name: str) -> Callable[..., Any]:
    """The function or class that `module:factory` names; the module is on the path or in the working directory.

    Args:
        setting: name of the setting, for errors.

    Raises:
        BadConfig: there is no such module, or nothing callable of that name in it.
        ForeignCode: the module cannot be imported.
    """
    module, _, factory = name.partition(":")
    if str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))
    try:
        found = getattr(importlib.import_module(module), factory, None)
    except ModuleNotFoundError as error:
        if error.name and module.startswith(error.name):
            meant = f" (did you mean '{module.removesuffix('.py')}:{factory}'?)" if module.endswith(".py") else ""
            what = f"there is no module {module!r} on the path or in this folder{meant}"
            raise BadConfig(f"{setting} = {cut(name)}; {what}") from None
        raise at_fault(setting, name, "its module cannot be imported", error) from error
    except Exception as error:
        raise at_fault(setting, name, "its module cannot be imported", error) from error
    if not callable(found) and module == "__main__" and multiprocessing.parent_process():
        told = "a worker does not see what was typed into a session; give workers=1, or write it into a file"
        raise BadConfig(f"{setting} = {cut(name)}; {told}")
    if not callable(found):
        raise BadConfig(f"{setting} = {cut(name)}; {module} has no function or class named {factory!r}")
    return found


def at_fault(setting: str, name: str, what: str, error: Exception) -> ForeignCode:
    """The error for a fault of a user's code."""
    message = f"{type(error).__name__}: {cut(' '.join(str(error).split()))}"
    where = f", {place}" if (place := place_of(error)) else ""
    owner = setting.rpartition(": ")[2]
    return ForeignCode(f"{setting} = {cut(name)}; {what} ({message}{where}); the fault is the {owner}'s")
