"""Text for a terminal: control characters from a pool or a command line are spelled out, never sent."""

import os
import sys
import textwrap
import unicodedata
from collections.abc import Iterator
from typing import Any

from rich.cells import cell_len
from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

_CONTROL = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}
"""Unicode categories of characters that a terminal acts on, reorders text by, or cannot show."""


def printable(text: str, lines: bool = False) -> str:
    """The text with control characters spelled out, `\\x1b` for escape.

    Args:
        lines: whether to leave line feeds as they are.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        c.encode("unicode_escape").decode() if unicodedata.category(c) in _CONTROL and not (lines and c == "\n") else c
        for c in text
    )


PIPED_WIDTH = 160
"""Width of what is printed into a file or a pipe if COLUMNS does not say another one [characters]."""
MAX_ROW = 6
"""Largest height of a row of a table [lines]; a table with a higher one is printed as blocks."""


def width() -> int | None:
    """Width for a console: that of its terminal (None), or that of COLUMNS or `PIPED_WIDTH` without one."""
    if sys.stdout.isatty():
        return None
    asked = os.environ.get("COLUMNS", "")
    return int(asked) if asked.isdecimal() and 0 < int(asked) < 10_000 else PIPED_WIDTH


class PlainConsole(Console):
    """A console that prints all text literally, in tables and titles, too: no markup, emoji or control characters.

    No word is ever clipped or broken: a table that is too wide for the console is printed as a block for each row.
    """

    def __init__(self, **settings: Any):
        super().__init__(markup=False, emoji=False, highlight=False, **settings)

    def render_str(self, text: str, **settings: Any) -> Text:
        return super().render_str(printable(text, lines=True), **settings)

    def print(self, *objects: Any, **settings: Any) -> None:
        """Print objects as `Console.print` does, and tables so that every word is whole."""
        wide = [each for each in objects if isinstance(each, Table) and not _fitted(each, self.width)]
        for table in wide:
            for line, style in _blocks(table, self.width):
                super().print(printable(line), style=style, soft_wrap=True)
        if len(wide) < len(objects) or not objects:
            super().print(*(each for each in objects if each not in wide), **settings)


def _cells(column: Column) -> list[str]:
    return [str(cell) for cell in column.cells]


def _is_name(column: Column) -> bool:
    """Whether the cells of a column are names, which say what a row is about."""
    return column.no_wrap and column.justify == "left"


def _fitted(table: Table, room: int) -> bool:
    """Set the widths of columns so that each holds its longest word.

    Returns:
        Whether that is possible with rows of at most `MAX_ROW` lines.
    """
    columns = [(str(column.header), *_cells(column)) for column in table.columns]
    whole = [max(cell_len(line) for cell in cells for line in cell.split("\n")) for cells in columns]
    room -= 3 * len(columns) + 1  # a line and two spaces for each column, and the last line
    if sum(whole) <= room:
        return True
    least = [
        most if column.no_wrap else max((cell_len(word) for cell in cells for word in cell.split()), default=0)
        for column, cells, most in zip(table.columns, columns, whole, strict=True)
    ]
    spare, wanted = room - sum(least), sum(whole) - sum(least)
    if spare < 0:
        return False
    widths = [low + spare * (most - low) // wanted for low, most in zip(least, whole, strict=True)]
    for column, cells, wide in zip(table.columns, columns, widths, strict=True):
        if any(len(textwrap.wrap(cell, max(wide, 1))) > MAX_ROW for cell in cells):
            return False
        column.width = wide
    return True


def _blocks(table: Table, room: int) -> Iterator[tuple[str, str]]:
    """The rows of a table as blocks, each line with its style: a head, and the other cells with their headers."""
    columns = [(str(column.header), _cells(column)) for column in table.columns]
    heads = next((k for k, column in enumerate(table.columns) if k and not _is_name(column)), len(columns))
    yield from ((line, "italic") for line in _wrapped(str(table.title or ""), room))
    for k, row in enumerate(table.rows):
        cells = [(header, each[k]) for header, each in columns]
        style = str(row.style or "")
        head = "  ".join(cell for _, cell in cells[:heads] if cell)
        rest = "; ".join(f"{header}: {cell}" if header else cell for header, cell in cells[heads:] if cell)
        if table.show_header:
            yield from ((line, style or "bold") for line in _wrapped(head, room))
        else:
            rest = f"{head}: {rest}"
        yield from ((f"  {line}", style) for line in _wrapped(rest, max(room - 2, 20)))
    yield from ((line, "dim") for line in _wrapped(str(table.caption or ""), room))


def _wrapped(text: str, room: int) -> list[str]:
    return textwrap.wrap(text, room, break_long_words=False, break_on_hyphens=False)
