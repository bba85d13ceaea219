"""Code of users: what a setting names as `module:factory`, and whose code an error comes from."""

import importlib
import sys
import sysconfig
import traceback
from collections.abc import Callable
from functools import cache
from importlib import metadata
from pathlib import Path
from types import FrameType
from typing import Any

from ..errors import BadConfig, ForeignCode, cut


def is_factory(name: str) -> bool:
    """Whether a text is spelled `module:factory`."""
    module, colon, factory = name.partition(":")
    return bool(colon and factory.isidentifier() and all(map(str.isidentifier, module.split("."))))


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
            what = f"there is no module {module!r} on the path or in this folder"
            raise BadConfig(f"{setting} = {cut(name)}; {what}") from None
        raise at_fault(setting, name, "its module cannot be imported", error) from error
    except Exception as error:
        raise at_fault(setting, name, "its module cannot be imported", error) from error
    if not callable(found):
        raise BadConfig(f"{setting} = {cut(name)}; {module} has no function or class named {factory!r}")
    return found


def at_fault(setting: str, name: str, what: str, error: Exception) -> ForeignCode:
    """The error for a fault of a user's code."""
    message = f"{type(error).__name__}: {cut(' '.join(str(error).split()))}"
    where = f", {place}" if (place := place_of(error)) else ""
    return ForeignCode(f"{setting} = {cut(name)}; {what} ({message}{where}); the fault is the {setting}'s")


PLACE = "_scengen_place"
"""Attribute of an error that holds `place_of` in the process where it was raised: tracebacks stay there."""


def with_place(error: Exception) -> Exception:
    """An error that can be sent to another process without losing the place from which it comes."""
    setattr(error, PLACE, place_of(error))
    return error


def place_of(error: BaseException) -> str:
    """The last place in code that is not scengen's through which an error came, such as `task.py, line 3, in success`.

    Returns:
        The place; empty if only scengen, its dependencies and Python were involved.
    """
    if (place := getattr(error, PLACE, None)) is not None:
        return place
    if isinstance(error, SyntaxError) and error.filename and _is_foreign(error.filename, ""):
        return f"{_shown(error.filename)}, line {error.lineno}"
    for frame, line in reversed(list(traceback.walk_tb(error.__traceback__))):
        if _is_foreign(frame.f_code.co_filename, _package(frame)):
            return f"{_shown(frame.f_code.co_filename)}, line {line}, in {frame.f_code.co_name}"
    return ""


def _package(frame: FrameType) -> str:
    return str(frame.f_globals.get("__name__", "")).partition(".")[0]


@cache
def _is_foreign(file: str, package: str) -> bool:
    """Whether a file is neither scengen's nor that of Python or of an installed package that does not build on it."""
    path, installed = Path(file), sysconfig.get_paths()
    if not path.is_file() or path.is_relative_to(Path(__file__).parents[1]):
        return False
    if path.is_relative_to(installed["purelib"]) or path.is_relative_to(installed["platlib"]):
        return _builds_on_scengen(package)
    return not (path.is_relative_to(installed["stdlib"]) or path.is_relative_to(installed["platstdlib"]))


def _builds_on_scengen(package: str) -> bool:
    """Whether the distribution of a package requires scengen, as one with tasks does."""
    names = metadata.packages_distributions().get(package, [])
    required = [line for name in names for line in metadata.requires(name) or []]
    return any(line.split(";")[0].strip().startswith("scengen") for line in required)


def _shown(file: str) -> str:
    """A file relative to the working directory if it is in it."""
    path = Path(file)
    return str(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)
