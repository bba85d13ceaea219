"""Text for a terminal: control characters from a pool or a command line are spelled out, never sent."""

import unicodedata
from typing import Any

from rich.console import Console
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


class PlainConsole(Console):
    """A console that prints all text literally, in tables and titles, too: no markup, emoji or control characters."""

    def __init__(self, **settings: Any):
        super().__init__(markup=False, emoji=False, highlight=False, **settings)

    def render_str(self, text: str, **settings: Any) -> Text:
        return super().render_str(printable(text, lines=True), **settings)
