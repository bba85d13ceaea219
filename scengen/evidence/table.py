"""The table of what was measured of a task, by kind."""

from functools import cache, partial

from rich.table import Table

from ..errors import ScengenError
from ..samplers.task import ID, Task
from .ledger import KINDS, Kind, read
from .measuring import draws_of

EACH_SPLIT: tuple[Kind, ...] = ("certified", "baseline")
"""Kinds that are measured on every split."""
EACH_AXIS: tuple[Kind, ...] = ("axis", "belief")
"""Kinds that are measured on every axis."""


def evidence_table(task: Task) -> Table:
    """One line for each kind of measurement of a task: the splits that were measured on today's version, and what is
    not of it. Kinds without any row are below the table."""
    title = f"evidence about version {task.version}; scengen help measure explains the kinds"
    table = Table("kind", "splits", "n", "not of this version", title=title, title_justify="left")
    draws, never = cache(partial(_draws_of, task)), []
    for kind in KINDS:
        if not (rows := read(kind, task.name)):
            never.append(kind)
            continue
        named = [row for row in rows if row.version == task.version]
        today = [row for row in named if row.draws == draws(row.split)]
        here = {row.split or "whole task" for row in today}
        wanted = [*([ID] if kind in EACH_SPLIT else []), *(task.axes if kind in (*EACH_SPLIT, *EACH_AXIS) else [])]
        missing = [split for split in wanted if split not in here]
        others = sorted({row.version for row in rows} - {task.version})
        lacking = [f"{len(missing)} of {len(wanted)}: {', '.join(missing)}"] if here and missing else []
        lacking += [f"all on version {', '.join(map(str, others))}"] if others and not here else []
        false = sorted({row.split or "whole task" for row in named if row not in today})
        lacking += [f"on other draws: {', '.join(false)}"] if false else []
        table.add_row(kind, _names(task, here), str(sum(row.n for row in today)), "; ".join(lacking))
    if never:
        table.caption, table.caption_justify = f"not measured: {', '.join(never)}", "left"
    return table


def _draws_of(task: Task, split: str) -> str:
    """Hash of the first draws of a split; empty if the task does not have it."""
    try:
        return draws_of(task, split)
    except ScengenError:
        return ""


def _names(task: Task, splits: set[str]) -> str:
    """Names of splits: all axes are `all axes`."""
    axes = [axis for axis in task.axes if axis in splits]
    if len(axes) == len(task.axes):
        axes = [f"all {len(axes)} axes"]
    return ", ".join([*sorted(splits - {*task.axes}), *axes])
