"""what can be generated: tasks, parameters, splits and their proofs"""

from dataclasses import dataclass

from .. import config
from ..config import read, search_path, tasks, typed
from ..pictures.report import task_tables, tasks_table
from . import OK, Arguments, out


@dataclass(frozen=True)
class Settings:
    """Settings of `scengen tasks`; meanings stand in conf/command/tasks.yaml."""

    name: str | None = None


def command(arguments: Arguments) -> int:
    settings, search = typed("", Settings, read("tasks", arguments).settings), search_path(arguments)
    if settings.name is None:
        out.print(tasks_table([config.task(name, search) for name in tasks(search)]))
        return OK
    for table in task_tables(config.task(settings.name, search)):
        out.print(table)
    return OK
