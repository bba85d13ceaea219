"""Rows of the table of an evaluation as people read it: each rate once, with the number of scenarios and rollouts."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..samplers.split import ID
from .conditions import ConditionLine
from .statistics import Difference, Rate
from .table import TableLine, otherwise, percent

ALL_AXES = "all axes"
"""Split of a row with the mean over several axes."""
COUNTS = ("crashed", "otherwise")
"""Titles of the columns with numbers of episodes that end in another way."""
SPLITS = ("task", "split", "policy", "n", "success", "to training", *COUNTS)
"""Titles of the columns of the table of splits."""
CONDITIONS = ("task", "split", "condition", "policy", "n", "success", "to clean", *COUNTS)
"""Titles of the columns of the table of conditions."""
ALIKE = ("task", "policy", "n")
"""Columns that are left out if all rows hold the same value."""
EMPTY = ("", "0")
"""Values of other columns that are left out if all rows hold one of them."""
SIGNIFICANT = "*"
"""Mark behind the value of a change whose interval excludes 0."""
LEGEND = {
    "success": "n: scenarios x rollouts; in brackets: 95 % intervals",
    "to training": "to training: change from training, twin by twin if there are twins",
    "to clean": "to clean: change from the same split without perturbation and arm",
    SIGNIFICANT: "*: significant, the 95 % interval of this change excludes 0",
    "otherwise": "otherwise: episodes that reached the goal, but lack a means of the task (listed below)",
}
"""Meanings of titles and marks."""


@dataclass(frozen=True)
class Row:
    """A rate of one policy."""

    task: str
    """Name of the task or category, or `all`."""
    split: str
    """Name of the split."""
    condition: str
    """Perturbation or arm; empty for clean episodes."""
    policy: str
    """Name of the policy."""
    rate: Rate
    """Success rate."""
    difference: Difference | None
    """Difference to training, or under a condition to the clean episodes."""
    crashed: int = 0
    """Number of episodes in which the policy crashed. They are in no rate."""
    otherwise: int = 0
    """Number of episodes that reached the goal without all means of their task."""

    def cells(self, digits: int = 0) -> list[str]:
        """The cells of the row, as text.

        Args:
            digits: number of digits after the point.
        """
        words = (self.task, self.split, *([self.condition] if self.condition else []), self.policy)
        return [
            *words,
            count(self.rate),
            percent(self.rate, "", digits),
            change(self.difference, digits),
            str(self.crashed),
            str(self.otherwise),
        ]


def change(difference: Difference | None, digits: int = 0) -> str:
    """A difference in points with its interval, marked if it is significant; empty for None."""
    if difference is None:
        return ""
    value, gap, interval = percent(difference, "+", digits).partition(" ")
    return f"{value}{SIGNIFICANT if difference.is_significant else ''}{gap}{interval}"


def count(rate: Rate) -> str:
    """Number of scenarios and rollouts of a rate: `20 x 5`, or `98 of 20` if the scenarios have different numbers."""
    each, rest = divmod(rate.rollouts, rate.scenarios)
    return f"{rate.scenarios} x {each}" if not rest else f"{rate.rollouts} of {rate.scenarios}"


def rows(
    policy: str,
    lines: Sequence[TableLine],
    conditions: Sequence[ConditionLine],
    clean: Sequence[Mapping[str, Any]],
) -> Iterator[Row]:
    """The rows of one policy: for each task training, its axes, their mean, and conditions; then the means of tasks.

    Args:
        lines: lines of its table.
        clean: its episodes under no condition.
    """
    for what in dict.fromkeys([*(line.what for line in lines), *(one.task for one in conditions)]):
        own = [line for line in lines if line.what == what]
        if own and own[0].id is not None:
            yield Row(what, ID, "", policy, own[0].id, None, *_counts(clean, what, ID))
        for line in own:
            if line.ood is not None:
                split = ALL_AXES if line.split == "all" else line.split
                yield Row(what, split, "", policy, line.ood, line.difference, *_counts(clean, what, split))
        for one in (one for one in conditions if one.task == what):
            yield Row(what, one.split, one.condition, policy, one.rate, one.difference, one.crashed, one.otherwise)


def _counts(episodes: Sequence[Mapping[str, Any]], what: str, split: str) -> tuple[int, int]:
    """Numbers of episodes in which the policy crashed, and of those that reached the goal otherwise."""
    own = [
        e
        for e in episodes
        if what in (e["task"], e["category"], "all")
        and (e["split"] == split or (split == ALL_AXES and e["split"] != ID))
    ]
    return sum(bool(e.get("crashed")) for e in own), sum(map(otherwise, own))


@dataclass(frozen=True)
class ShownTable:
    """A table of rows as people read it, without columns that hold one value alone."""

    head: Sequence[str]
    """Titles of the columns in which rows differ."""
    cells: Sequence[Sequence[str]]
    """Cells of each row."""
    common: Mapping[str, str]
    """Values of the other columns, by title."""

    @classmethod
    def of(cls, rows: Sequence[Row], digits: int = 0) -> "ShownTable":
        """The table of rows that are all about splits, or all about conditions.

        Args:
            digits: number of digits after the point.
        """
        head, cells = CONDITIONS if rows and rows[0].condition else SPLITS, [row.cells(digits) for row in rows]
        values = {name: {row[number] for row in cells} for number, name in enumerate(head)}
        common = {
            name: next(iter(some))
            for name, some in values.items()
            if len(some) == 1 and (name in ALIKE or some <= {*EMPTY})
        }
        kept = [number for number, name in enumerate(head) if name not in common]
        return cls([head[number] for number in kept], [[row[number] for number in kept] for row in cells], common)

    @property
    def legend(self) -> list[str]:
        """Lines that explain its titles and marks."""
        is_marked = any(SIGNIFICANT in cell for row in self.cells for cell in row)  # no name has a star
        return [line for name, line in LEGEND.items() if name in self.head or (name == SIGNIFICANT and is_marked)]
