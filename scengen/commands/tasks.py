"""what can be generated: tasks, parameters, splits and their proofs"""

from dataclasses import dataclass

from .. import config
from ..errors import UnknownName
from ..pictures.report import axes_table, task_tables, tasks_table
from ..task_files import certified
from . import OK, Arguments, out

PAPER = "paper"


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen tasks`; meanings stand in conf/command/tasks.yaml."""

    axes: str | None


def command(arguments: Arguments) -> int:
    settings, name = config.read("tasks", arguments, Settings), config.chosen("tasks", arguments)
    others = [a for a in arguments if not a.startswith(("task=", "axes="))]
    if settings.axes not in (None, PAPER):
        raise UnknownName("choice of axes", settings.axes, [PAPER])
    tasks = [config.task(each, others) for each in (config.tasks(others) if name is None else [name])]
    tasks.sort(key=lambda task: (task.category == "M", task.category, task.code))  # as in the paper
    if settings.axes:
        out.print(axes_table([(task, axis) for task in tasks for axis in task.axes.values() if task.of_paper(axis)]))
    elif name is None:
        out.print(tasks_table(tasks, certified()))
    else:
        for table in task_tables(tasks[0]):
            out.print(table)
    return OK
