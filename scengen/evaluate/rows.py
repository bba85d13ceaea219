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
HEAD = ("task", "split", "condition", "policy", "n", "success", "change", "crashed", "otherwise")
"""Titles of the columns. Those in which all rows agree are left out, see `shown`."""
DROPPED = {"task": None, "condition": "", "policy": None, "change": "", "crashed": "0", "otherwise": "0"}
"""Columns that are left out if all rows hold this value, or any one value for None."""


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
    change: Difference | None
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
        change = percent(self.change, "+", digits) if self.change else ""
        counts = (str(self.crashed), str(self.otherwise))
        words = (self.task, self.split, self.condition, self.policy)
        return [*words, count(self.rate), percent(self.rate, "", digits), change, *counts]


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


def shown(cells: Sequence[Sequence[str]]) -> tuple[list[str], list[list[str]], Mapping[str, str]]:
    """Columns in which rows differ: their titles, the cells, and what the others hold in all rows."""
    told: dict[str, str] = {}
    for number, name in enumerate(HEAD):
        values = {row[number] for row in cells}
        if name in DROPPED and len(values) == 1 and DROPPED[name] in (None, *values):
            told[name] = next(iter(values))
    kept = [number for number, name in enumerate(HEAD) if name not in told]
    return [HEAD[number] for number in kept], [[row[number] for number in kept] for row in cells], told
