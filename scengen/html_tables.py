"""Short tables in HTML, as notebooks show objects. Every text is escaped: a pool may come from anywhere."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from itertools import islice

from .errors import cut

MAX_ROWS = 20
"""Largest number of rows of a table."""
MAX_CELL_LENGTH = 120
"""Largest length of the text in a cell [characters]."""
ABRIDGED = "font-size: smaller; opacity: 0.7"
"""Style of the line below an abridged table."""


def table(title: str, head: Sequence[str], rows: Iterable[Sequence[object]], total: int = 0) -> str:
    """A table with a title, of the first `MAX_ROWS` rows.

    Args:
        rows: rows of as many values as the head has; no more of them are read than are shown.
        total: number of all rows, which is stated below a longer table.
    """
    shown = list(islice(rows, MAX_ROWS))
    lines = [f"<tr>{_cells('th', head)}</tr>", *(f"<tr>{_cells('td', row)}</tr>" for row in shown)]
    more = f'<p style="{ABRIDGED}">and {total - len(shown)} more</p>' if total > len(shown) else ""
    caption = f'<p style="text-align: left"><b>{escape(cut(title))}</b></p>'
    return f"<div>{caption}<table>{''.join(lines)}</table>{more}</div>"


def spoken(value: object) -> str:
    """A value in a few characters: numbers with four digits, mappings as `name = value`."""
    if isinstance(value, bool) or value is None:
        return {True: "yes", False: "no", None: ""}[value]
    if isinstance(value, float):
        return f"{value:.4g}"
    return ", ".join(f"{k} = {spoken(v)}" for k, v in value.items()) if isinstance(value, Mapping) else str(value)


def _cells(tag: str, values: Sequence[object]) -> str:
    texts = (escape(cut(spoken(value), MAX_CELL_LENGTH)) for value in values)
    return "".join(f'<{tag} style="text-align: left">{text}</{tag}>' for text in texts)
