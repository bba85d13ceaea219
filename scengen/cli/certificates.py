"""Certificates as tables of a terminal."""

from rich.table import Table

from ..pool import PoolRow
from ..validate.words import lines


def certificate_table(row: PoolRow) -> Table:
    """A line for each check, and one for each shortcut and each ablation."""
    title = f"certificate: {row.certificate.verdict} ({row.certificate.settings})"
    table = Table(title=title, title_justify="left")
    table.add_column("check", no_wrap=True)
    table.add_column("passed")
    table.add_column("found")
    for line in lines(row.certificate.checks):
        table.add_row(*line)
    return table
