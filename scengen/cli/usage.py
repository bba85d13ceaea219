"""Text of `scengen COMMAND --help`: the file of the command, and the settings that it does not list."""

import re
import shutil
import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

import yaml

from ..errors import UnknownName
from ..samplers import task_files

WIDTH = 118
"""Largest length of a line [characters]."""
INDENT = 4
"""Indentation of a comment that stands below its setting [characters]."""


def usage(verb: str, overrides: Sequence[str]) -> str:
    """The help of a command.

    Args:
        overrides: the rest of the command line. If it chooses a task, only the splits of this task are listed.

    Raises:
        ScengenError: the chosen task does not exist.
    """
    text = task_files.command_file(verb).read_text()
    own = [line for line in text.splitlines() if not _for_hydra(line)]
    takes_pool = bool(re.search("^(pool|hits|replay):", text, re.M))
    lines = [*own, *_more(verb, task_files.groups(verb), takes_pool, overrides)]
    room = columns()
    return "".join(f"{part}\n" for line in lines for part in folded(line, room))


def columns() -> int:
    """Width of the terminal, or of COLUMNS, at most `WIDTH` [characters]."""
    return min(shutil.get_terminal_size((WIDTH, 24)).columns, WIDTH)


def folded(line: str, room: int) -> Iterator[str]:
    """A line of a help in lines of at most `room` characters; its comment goes below its setting if it must.

    Words, such as commands, stay whole.
    """
    setting, mark, comment = line.partition("# ")
    if len(line) <= room or not mark:
        yield line
        return
    if len(setting) > room // 2:
        yield setting.rstrip()
        setting = " " * INDENT
    first, next_ = f"{setting}# ", "#" + " " * INDENT if not setting else " " * len(setting) + "# "
    wide = max(room, len(first) + 20)
    yield from textwrap.wrap(
        comment, wide, initial_indent=first, subsequent_indent=next_, break_long_words=False, break_on_hyphens=False
    )


def _for_hydra(line: str) -> bool:
    """Whether only Hydra needs a line in the file of a command."""
    return line.startswith("# @package") or "optional /limits" in line


def _more(verb: str, groups: Sequence[str], takes_pool: bool, overrides: Sequence[str]) -> Iterator[str]:
    """Lines about settings that the file of a command does not list.

    Args:
        takes_pool: whether the command takes pools, hits, or demonstrations to replay.
    """
    search = task_files.search_path(overrides)
    if "task" in groups:
        yield ""
        names = _tasks(overrides, search)
        if len(names) == 1:
            yield from _wrapped(
                f"# splits of task={names[0]}: id (training) and its axes:", task_files.splits(names[0], search)
            )
        else:
            yield from _wrapped("# task=NAME, one of:", names)
            yield f"# splits of a task   scengen tasks task=NAME, or scengen {verb} task=NAME --help"
        if verb == "generate":
            yield "# task=all          all tasks; also a category (task=P3), or a list (task=P3,packing)"
        yield "# task.*           any value in the file of the task, as in task.horizon=20 or task.id.x=[uniform,0,0.1]"
        yield "# +task.axes.NAME='{why: ..., replace: {tile: {friction: [uniform, 0.2, 0.3]}}}'   a new axis"
    if "certify" in groups:
        yield "# certify.*        any setting of certificates; those of certify=quick:"
        numbers = yaml.safe_load((task_files.conf_dir() / "certify" / "quick.yaml").read_text())
        yield from _wrapped("#  ", [f"certify.{key}={value}" for key, value in _flat(numbers)])
    if "task" in groups or takes_pool:
        yield "# hydra.searchpath=FOLDER   folder with task/, certify/ or experiment/ (+experiment=NAME) of your own"
    yield f"# --cfg job prints the composed configuration, --info {'|'.join(task_files.ORIGINS)} its origin"


def _tasks(overrides: Sequence[str], search: Sequence[str]) -> list[str]:
    """The chosen task, or all tasks."""
    chosen = [word.removeprefix("task=") for word in overrides if word.startswith("task=")]
    known = task_files.tasks(search)
    if chosen and chosen[-1] not in known:
        raise UnknownName("task", chosen[-1], known)
    return chosen[-1:] or known


def _flat(node: dict[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted names and values of nested settings."""
    for key, value in node.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def _wrapped(start: str, words: Sequence[str]) -> Iterator[str]:
    """Words in lines of the width of the terminal. The words of further lines are indented."""
    line = start
    for word in words:
        if len(line) + 1 + len(word) > columns():
            yield line
            line = "#" + " " * min(len(start) - 1, INDENT)
        line += f" {word}"
    yield line
