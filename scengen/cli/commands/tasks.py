"""list the tasks; for one task, its parameters, bounds, splits, axes and what was measured"""

from dataclasses import dataclass

from ... import compose, conformance
from ...errors import UnknownName
from ...evidence import ledger
from ...evidence.table import evidence_table
from ...samplers import task_files
from ...samplers.task_files import about, search_path
from ..tables import axes_table, task_tables, tasks_table
from . import OK, Arguments, out, remark, say
from .settings import read

PAPER = "paper"
"""Value of `axes` for the axes that the paper defines."""


@dataclass(frozen=True)
class TasksSettings:
    """Settings of `scengen tasks`; conf/command/tasks.yaml explains them."""

    axes: str | None
    records: str | None


def command(arguments: Arguments) -> int:
    settings, name = read("tasks", arguments, TasksSettings), compose.chosen_task("tasks", arguments)
    if settings.axes not in (None, PAPER):
        raise UnknownName("choice of axes", settings.axes, [PAPER])
    search = search_path(arguments)
    with ledger.opened(settings.records, search):
        _print(settings.axes, name, arguments)
    if settings.records is not None and not settings.axes:
        say(f"claimed, and not checked: the figures of {settings.records}; scengen measure fresh=true makes them again")
    return OK


def _print(axes: str | None, name: str | None, arguments: Arguments) -> None:
    """Print the tables of a task, or the list of tasks or of the paper's axes."""
    search = search_path(arguments)
    listed = [about(each, search) for each in ([name] if name else task_files.tasks(search))]
    listed.sort(key=lambda task: (task.category[:1] != "P", task.category, task.code))  # the paper's, then ours
    if name is None and not axes:
        out.print(tasks_table(listed, {each.name: ledger.latest("certified", each.name) for each in listed}))
        return
    # Loading a task takes 0.1 s of processor time: only these branches print its numbers, which loading checks.
    others = [a for a in arguments if not a.startswith(("task=", "axes=", "records="))]
    tasks = [compose.load_task(each.name, others) for each in listed if name or each.paper_axes]
    if axes:
        out.print(axes_table([(task, axis) for task in tasks for axis in task.axes.values() if task.of_paper(axis)]))
    else:
        for table in (*task_tables(tasks[0]), evidence_table(tasks[0])):
            out.print(table)
        for refused in conformance.at_sight(tasks[0].name, others):
            remark(f"the rules for tasks refuse this: {refused} (scengen.conformance)")
