"""One file per command: its docstring is the help line, `command(arguments)` runs it and returns the exit status."""

import json
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from ..errors import BadConfig, cut
from ..pool import Pool, PoolRow, collection
from ..pool.library import Library
from ..pool.library import names as names  # for the commands
from ..pool.names import Misnamed
from ..work.printed import PlainConsole, printable
from ..work.targets import write as write  # for the commands

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
out = PlainConsole(width=None if sys.stdout.isatty() else 160)
err = PlainConsole(stderr=True, soft_wrap=True)

Arguments = Sequence[str]


def say(text: str) -> None:
    """Print one line as it is: no markup, no colours, no control characters."""
    out.print(printable(text))


def warn(text: str, style: str = "red") -> None:
    """Print a line on standard error as it is."""
    err.print(printable(text), style=style)


def remark(text: str) -> None:
    """Say on standard error what is missing though all went well."""
    warn(f"scengen: {text}", "yellow")


def intake(module: str) -> ModuleType:
    """A module of `scengen.intake`, which needs packages of an extra.

    Raises:
        BadConfig: one of them is not installed.
    """
    try:
        return import_module(f"scengen.intake.{module}")
    except ImportError as error:
        raise BadConfig(f"no {error.name} to take in meshes; say pip install 'scengen[mesh]'") from None


def one(pool: str | list[str] | None) -> str:
    """The only pool named, for a command that takes one."""
    if pool is None:
        raise BadConfig("no pool was named; say pool=FOLDER")
    found = several(pool)
    if len(found) > 1:
        raise BadConfig(f"pool = {cut(','.join(found), 400)}; this command takes one pool")
    return found[0]


def several(pool: str | list[str]) -> list[str]:
    """The pools named, one or more; those of a folder of pools, if that is named."""
    if not pool:
        raise BadConfig("pool = ''; name the folder of a pool")
    return collection.folders(pool)


def holder(pool: str | list[str] | None, name: str) -> Pool:
    """The pool that holds the scenario that id= asks for, if several are named, or a folder of pools."""
    found = [Pool.open(folder) for folder in several(pool or "")]
    if len(found) == 1:
        return found[0].check()
    several_pools = Library(found)
    return several_pools.pool(several_pools.find(name)).check()


def chosen(pool: Pool, name: str) -> PoolRow:
    """The scenario that id= asks for; of a name that is wrong about its id, a line says so."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", Misnamed)
        row = pool.row(name)
    for one in told:
        remark(str(one.message))
    return row


def write_json(path: str, result: Any) -> None:
    """Write what a command's json= asks for."""
    write(Path(path), json.dumps(result, indent=1) + "\n")
