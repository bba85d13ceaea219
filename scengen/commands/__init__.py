"""One file per command: its docstring is the help line, `command(arguments)` runs it and returns the exit status."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from ..errors import BadConfig

OK, FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
out = Console(width=None if sys.stdout.isatty() else 160)
err = Console(stderr=True, soft_wrap=True)

Arguments = Sequence[str]


def say(text: str) -> None:
    """Print a line as it is: no markup, no colours."""
    out.print(text, highlight=False, markup=False)


def warn(text: str, style: str = "red") -> None:
    """Print a line on standard error as it is."""
    err.print(text, style=style, highlight=False, markup=False)


def remark(text: str) -> None:
    """Say on standard error what is missing though all went well."""
    warn(f"scengen: {text}", "yellow")


def one(pool: str | list[str]) -> str:
    """The only pool named, for a command that takes one."""
    if isinstance(pool, list):
        raise BadConfig(f"pool = {','.join(map(str, pool))}; this command takes one pool")
    return pool


def several(pool: str | list[str]) -> list[str]:
    """The pools named, one or more."""
    return pool if isinstance(pool, list) else [pool]


def write(path: Path, content: str | bytes) -> None:
    """Write a file, its folder made if need be.

    Raises:
        BadConfig: it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    except OSError as error:
        raise BadConfig(f"{path} cannot be written: {error.strerror}") from None


def write_json(path: str, result: Any) -> None:
    """Write what a command's json= asks for."""
    write(Path(path), json.dumps(result, indent=1) + "\n")
