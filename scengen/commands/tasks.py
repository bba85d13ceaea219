"""what can be generated: tasks, parameters, splits and their proofs"""

from .. import config
from ..pictures.report import task_tables, tasks_table
from . import OK, Arguments, out


def command(arguments: Arguments) -> int:
    name, others = config.chosen("tasks", arguments), [a for a in arguments if not a.startswith("task=")]
    if name is None:
        out.print(tasks_table([config.task(each, others) for each in config.tasks(others)]))
        return OK
    for table in task_tables(config.task(name, others)):
        out.print(table)
    return OK
