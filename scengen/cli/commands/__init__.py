"""One module per command: its docstring is the help line, `command(arguments)` runs it and returns the exit status."""

import json
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from ...errors import BadConfig, cut
from ...pool import Pool, PoolRow, collection
from ...pool.demonstrations import Demonstrations, is_demonstrations
from ...pool.library import Library
from ...pool.library import names as names  # for the commands
from ...pool.names import Misnamed
from ...work.limits import MAX_SETTINGS
from ...work.printed import PlainConsole, printable, width
from ...work.targets import write as write  # for the commands

OK = 0
"""Exit status: success."""
FAILED = 1
"""Exit status: a check failed, or not all work succeeded."""
DECLINED = 3
"""Exit status: no verdict, because something cannot be judged with what is installed here, or within the limits."""
INTERRUPTED = 130
"""Exit status after Ctrl-C."""

out = PlainConsole(width=width())
err = PlainConsole(stderr=True, soft_wrap=True)

Arguments = Sequence[str]


def say(text: str) -> None:
    """Print a line literally: no markup, colours or control characters."""
    out.print(printable(text), soft_wrap=True)


def counted(number: int, what: str) -> str:
    """A number of things: `1 scene`, `2 scenes`."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def warn(text: str, style: str = "red") -> None:
    """Print a line on standard error literally."""
    err.print(printable(text), style=style, soft_wrap=True)


def remark(text: str) -> None:
    """Print a remark on standard error about a success with restrictions."""
    warn(f"scengen: {text}", "yellow")


def intake(module: str) -> ModuleType:
    """A module of `scengen.intake`, which needs packages of an extra.

    Raises:
        BadConfig: one of them is not installed.
    """
    try:
        return import_module(f"scengen.intake.{module}")
    except ImportError as error:
        raise BadConfig(f"importing meshes needs {error.name}; pip install 'scengen[mesh]'") from None


def one(pool: str | list[str] | None) -> str:
    """The folder of the pool, for a command that accepts one."""
    if pool is None:
        raise BadConfig("no pool was given; give pool=FOLDER")
    found = several(pool)
    if len(found) > 1:
        raise BadConfig(f"pool = {cut(','.join(found), 400)}; this command accepts one pool")
    return found[0]


def several(pool: str | list[str]) -> list[str]:
    """Folders of the pools, one or more. A folder of pools stands for its pools."""
    if not pool:
        raise BadConfig("pool = ''; give the folder of a pool")
    return collection.folders(pool)


def filled(folder: str) -> Pool:
    """The checked pool in a folder, for a command that computes something from its scenarios.

    Raises:
        BadConfig: it holds no scenario.
    """
    pool = Pool.open(folder).check()
    if not len(pool):
        why = f"none of its {pool.manifest.indices} indices was certified"
        raise BadConfig(f"{pool.folder} holds no scenario: {why}; see scengen show pool={pool.folder} for the reasons")
    return pool


def holder(pool: str | list[str] | None, name: str) -> Pool:
    """The pool with the scenario `name`: the only pool given, or the one of several that holds it."""
    found = [Pool.open(folder) for folder in several(pool or "")]
    if len(found) == 1:
        return found[0].check()
    library = Library(found)
    return found[library.source(library.find(name))].check()


def identified(pool: str | list[str], name: str | None, index: int | None) -> str:
    """The name of a scenario that was given, or the id of the one that was drawn at an index.

    Args:
        pool: folders of pools, demonstrations or kept rollouts.

    Raises:
        BadConfig: neither or both were given, the index is none, or not exactly one scenario has it.
    """
    if name is not None and index is not None:
        raise BadConfig(f"id = {cut(name)} and index = {cut(str(index))}; give one of them")
    if index is None:
        if name is None:
            raise BadConfig("no scenario was given; give id=ID or index=N")
        return name
    if not 0 <= index <= (most := MAX_SETTINGS["index"]):
        raise BadConfig(f"index = {cut(str(index))}; it must be {f'at most {most}' if index > 0 else 'at least 0'}")
    found = dict[str, str]()
    for folder in several(pool):
        if is_demonstrations(folder):
            rows = Demonstrations.open(folder).check().attempts()
            found.update({row.id: str(row.name) for row in rows if row.index == index})
        elif (place := (opened := Pool.open(folder).check()).directory.of_index(index)) is not None:
            found[opened.directory.id(place)] = str(opened.name_at(place))
    if len(found) != 1:
        which = f"{len(found)} scenarios have it, {cut(', '.join(found.values()))}" if found else "no scenario has it"
        raise BadConfig(f"index = {index}; {which}; scengen show lists them, and id=ID selects one")
    return next(iter(found))


def chosen(pool: Pool, name: str) -> PoolRow:
    """The scenario `name` of a pool. A remark is printed if the name contradicts the id in it."""
    with misnaming_remarked():
        return pool.row(name)


@contextmanager
def misnaming_remarked() -> Iterator[None]:
    """Print a remark if a name that is looked up contradicts the id in it."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", Misnamed)
        yield
    for one in caught:
        remark(str(one.message))


def write_json(path: str, result: Any) -> None:
    """Write the result of a command to the file that json= names."""
    write(Path(path), json.dumps(result, indent=1) + "\n")


def say_begun(count: int, what: str, folder: Path, fresh: bool) -> None:
    """Say before the work that a run continues or starts over, if an earlier one has finished something.

    Args:
        count: number of things that the earlier run has finished.
        what: the things, such as "scenarios".
    """
    if count:
        fate = "moved aside, and made again" if fresh else "kept; fresh=true starts over"
        say(f"{folder}: {count} {what} of an earlier run are {fate}")
