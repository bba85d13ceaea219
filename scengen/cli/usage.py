"""What `scengen COMMAND --help` says: the settings of a command as its file tells them, and what else may be given."""

import re
from collections.abc import Iterator, Sequence
from typing import Any

import yaml

from .. import task_files
from ..errors import BadConfig

WIDTH = 118
"""Letters of a line."""


def usage(verb: str, overrides: Sequence[str]) -> str:
    """The help of a command.

    Args:
        overrides: what else stands on the command line: of a task that is chosen there, its splits alone are told.

    Raises:
        ScengenError: a task is chosen that does not exist.
    """
    text = (task_files.conf_dir() / "command" / f"{verb}.yaml").read_text()
    own = "".join(line for line in text.splitlines(keepends=True) if not _for_hydra(line))
    plays = bool(re.search("^(pool|hits):", text, re.M))
    return own + "".join(f"{line}\n" for line in _more(verb, task_files.groups(verb), plays, overrides))


def _for_hydra(line: str) -> bool:
    """Whether a line of a command's file says something to nobody but Hydra."""
    return line.startswith("# @package") or "optional /limits" in line


def _more(verb: str, groups: Sequence[str], plays: bool, overrides: Sequence[str]) -> Iterator[str]:
    """What may be given besides the settings that the file of a command lists.

    Args:
        plays: whether the command takes what others have made.
    """
    search = task_files.search_path(overrides)
    if "task" in groups:
        yield ""
        yield "# task=NAME, and its splits: id, which is training, and its axes"
        for name in _tasks(overrides, search):
            yield from _wrapped(f"#   {name:<20}", task_files.splits(name, search))
        if verb == "generate":
            yield "# task=all          pools of all tasks, and an index; also task=P3, a category, or task=P3,packing"
        yield "# task.*           any number of the task's file, as in task.horizon=20 or task.id.x=[uniform,0,0.1]"
        yield "# +task.axes.NAME='{why: ..., replace: {tile: {friction: [uniform, 0.2, 0.3]}}}'   an axis of your own"
    if "certify" in groups:
        yield "# certify.*        any number of a certificate; those of certify=quick:"
        numbers = yaml.safe_load((task_files.conf_dir() / "certify" / "quick.yaml").read_text())
        yield from _wrapped("#  ", [f"certify.{key}={value}" for key, value in _flat(numbers)])
    if groups or plays:
        yield "# hydra.searchpath=[file:///path/to/conf]   where tasks of a package lie that is not installed"
    yield f"# --cfg job prints the composed configuration, --info {'|'.join(task_files.ORIGINS)} where it comes from"


def _tasks(overrides: Sequence[str], search: Sequence[str]) -> list[str]:
    """The task that is chosen, or all there are."""
    chosen = [word.removeprefix("task=") for word in overrides if word.startswith("task=")]
    known = task_files.tasks(search)
    if chosen and chosen[-1] not in known:
        raise BadConfig(f"no task named {chosen[-1]!r}; known: {', '.join(known)}")
    return chosen[-1:] or known


def _flat(node: dict[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted names and values of nested settings."""
    for key, value in node.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def _wrapped(start: str, words: Sequence[str]) -> Iterator[str]:
    """Words in lines of at most `WIDTH` letters; lines after the first are indented like it."""
    line = start
    for word in words:
        if len(line) + 1 + len(word) > WIDTH:
            yield line
            line = "#" + " " * (len(start) - 1)
        line += f" {word}"
    yield line
