"""Docstrings as Sphinx reads them: their Markdown as reStructuredText. Sections such as `Args` are napoleon's."""

import re
from typing import Any

CODE = re.compile(r"(?<!`)`([^`]+)`(?!`)")
"""Code in Markdown."""
SPECIAL = re.compile(r"([*|\\])|(?<=\w)(_)(?!\w)")
"""Characters of plain text that mark something in reStructuredText."""
SKETCHES = re.compile(r"(?<=\n\n)((?: {4,}\S.*(?:\n|$)|\n(?= {4}))+)")
"""Indented blocks after an empty line. Entries of `Args` follow their heading without one."""
SKETCH = re.compile(r" {4,}\S")
"""Beginning of such a block."""
BULLET = re.compile(r"^(\s*)\* ")
LINK = re.compile(r"\[([^\]]+)\]\([^)]+\)")
"""Link of Markdown; it leads to a file of the repository, so that its text alone is kept."""
NAMES = re.compile(r"^(\s+)(\*{1,2}\w+|\w+(?:, \*{0,2}\w+)+): ")
"""Beginning of an entry of `Args`, which napoleon reads."""


VALUES = ("attribute", "data", "property")
"""Kinds of docstrings that napoleon spoils: it takes what stands before a colon for a type."""


def before_napoleon(app: Any, what: str, name: str, of: Any, options: Any, lines: list[str]) -> None:
    """Replace the lines of a docstring. An event of Sphinx."""
    text = rest("\n".join(lines))
    if what in VALUES:
        _spared[name], text = text, ""
    lines[:] = text.split("\n")


def after_napoleon(app: Any, what: str, name: str, of: Any, options: Any, lines: list[str]) -> None:
    """Restore what napoleon was not to see. An event of Sphinx."""
    if what in VALUES:
        lines[:] = _spared.pop(name, "").split("\n")


_spared: dict[str, str] = {}


def rest(text: str) -> str:
    """A docstring as reStructuredText."""
    return "".join(_block(part) if SKETCH.match(part) else _prose(part) for part in SKETCHES.split(text))


def _block(text: str) -> str:
    """An indented block after a paragraph, such as a sketch or code."""
    return f"::\n\n{text}\n"


def _prose(text: str) -> str:
    lines: list[str] = []
    for line in CODE.sub(lambda code: f"``{' '.join(code[1].split())}``", text).split("\n"):
        bullet = BULLET.match(line)
        if bullet and lines and lines[-1].strip() and not BULLET.match(lines[-1]) and not lines[-1].startswith(" "):
            lines.append("")  # Markdown lets a list follow a paragraph
        lines.append(_line(line))
    return "\n".join(lines)


def _line(line: str) -> str:
    """A line whose plain text marks nothing. Blocks of code are indented, as are entries of sections."""
    names = NAMES.match(line)
    start = names[0] if names else (BULLET.match(line) or [""])[0]
    parts = re.split(r"(``[^`]+``)", LINK.sub(r"\1", line[len(start) :]))
    return start + "".join(part if part.startswith("``") else SPECIAL.sub(r"\\\1\2", part) for part in parts)
