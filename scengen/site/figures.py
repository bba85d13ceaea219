"""Measured figures: certification, and the tables of axes, attacks and baselines in the documentation."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ..evidence.ledger import Evidence, latest
from ..samplers.task_files import tasks

PAGES = ("axes", "attacks", "baselines")
"""Pages of docs/ that hold tables whose first column is `task`. They are written from what tools/ measures."""


@dataclass(frozen=True)
class Figures:
    """What was measured about all tasks."""

    certified: Mapping[str, Mapping[str, Evidence]]
    """Results of certification of today's versions, by task and split."""
    tables: Mapping[str, list[dict[str, str]]]
    """Lines of the tables by page; each line holds its cells by title."""

    @classmethod
    def read(cls, docs: Path | None) -> "Figures":
        """The figures of a folder of documentation, or those of certification alone."""
        paths = {page: docs / "docs" / f"{page}.md" for page in PAGES} if docs else {}
        certified = {task: latest("certified", task) for task in tasks()}
        return cls(certified, {page: lines_of(path.read_text()) for page, path in paths.items() if path.is_file()})

    def of(self, page: str, task: str, axis: str = "") -> list[dict[str, str]]:
        """The lines of a page about a task, or about one of its axes, without the cells that name them."""
        lines = [line for line in self.tables.get(page, ()) if line["task"] == task and line.get("axis", "") == axis]
        return [{title: cell for title, cell in line.items() if title not in ("task", "axis")} for line in lines]


def lines_of(markdown: str) -> list[dict[str, str]]:
    """The lines of all tables of a page whose first column is `task`, by their titles. Links are replaced by texts."""
    found, titles = [], list[str]()
    for line in markdown.splitlines():
        cells = [cell.strip() for cell in line.strip().removeprefix("|").removesuffix("|").split("|")]
        if not line.startswith("|"):
            titles = []
        elif not titles:
            titles = cells
        elif titles[0] == "task" and len(cells) == len(titles) and not set(line) <= set("|-: "):
            named = [cells[0].partition("](")[0].removeprefix("["), *cells[1:]]
            found.append(dict(zip(titles, named, strict=True)))
    return found
