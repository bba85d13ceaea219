"""list the tasks; for one task, its parameters, bounds, splits, axes and what was measured"""

import re
from dataclasses import asdict, dataclass
from typing import Any

from ... import compose, conformance
from ...errors import UnknownName
from ...evidence import ledger
from ...evidence.table import evidence_table
from ...samplers import task_files
from ...samplers.axis import Axis
from ...samplers.task import Task, leaves
from ...samplers.task_files import about, search_path
from ...work.targets import try_file
from ..tables import axes_table, task_tables, tasks_table
from . import FAILED, OK, Arguments, out, remark, say, write_json
from .settings import read

PAPER = "paper"
"""Value of `axes` for the axes that the paper defines."""


@dataclass(frozen=True)
class TasksSettings:
    """Settings of `scengen tasks`; conf/command/tasks.yaml explains them."""

    axes: str | None
    records: str | None
    json: str | None


def command(arguments: Arguments) -> int:
    category = next(
        (text.removeprefix("task=") for text in arguments if re.fullmatch(r"task=(P[1-9]|M|X)", text)), None
    )
    arguments = [text for text in arguments if text != f"task={category}"]
    settings, name = read("tasks", arguments, TasksSettings), compose.chosen_task("tasks", arguments)
    if settings.axes not in (None, PAPER):
        raise UnknownName("choice of axes", settings.axes, [PAPER])
    search = search_path(arguments)
    try_file(settings.json)
    with ledger.opened(settings.records, search):
        data = _print(settings.axes, name, category, arguments)
    if settings.json:
        write_json(settings.json, data)
    if settings.records is not None and not settings.axes:
        say(f"claimed, and not checked: the figures of {settings.records}; scengen measure fresh=true makes them again")
    return FAILED if isinstance(data, dict) and data["refused"] else OK


def _print(axes: str | None, name: str | None, category: str | None, arguments: Arguments) -> Any:
    """Print the tables of a task, or the list of tasks or of the paper's axes, of one category if it is given.

    Returns:
        The same as plain data.
    """
    search = search_path(arguments)
    listed = [about(each, search) for each in ([name] if name else task_files.tasks(search))]
    if category and category not in (known := {task.category for task in listed}):
        raise UnknownName("category", category, known)
    listed = [task for task in listed if category in (None, task.category)]
    listed.sort(key=lambda task: (task.category[:1] != "P", task.category, task.code))  # the paper's, then ours
    if name is None and not axes:
        certified = {each.name: ledger.latest("certified", each.name) for each in listed}
        out.print(tasks_table(listed, certified))
        return [
            {**asdict(each), "certified": {split: row.value for split, row in certified[each.name].items()}}
            for each in listed
        ]
    # Loading a task takes 0.1 s of processor time: only these branches print its numbers, which loading checks.
    others = [a for a in arguments if not a.startswith(("task=", "axes=", "records=", "json="))]
    tasks = [compose.load_task(each.name, others) for each in listed if name or each.paper_axes]
    if axes:
        of_paper = [(task, axis) for task in tasks for axis in task.axes.values() if task.of_paper(axis)]
        out.print(axes_table(of_paper))
        return [{"task": task.name, **_axis(task, axis)} for task, axis in of_paper]
    for table in (*task_tables(tasks[0]), evidence_table(tasks[0])):
        out.print(table)
    for why in (refused := conformance.at_sight(tasks[0].name, others)):
        remark(f"the rules for tasks refuse this: {why} (scengen.conformance)")
    told = {"horizon": tasks[0].horizon, "version": tasks[0].version, "refused": refused}
    return {**asdict(listed[0]), **told, **_contents(tasks[0])}


def _contents(task: Task) -> dict[str, Any]:
    """Parameters and axes of a task as plain data; distributions as task files spell them."""
    training = dict(leaves(task.node["id"] or {}))
    parameters = [
        {**{key: getattr(p, key) for key in ("name", "unit", "low", "high", "nominal", "hidden")},
         "training": training.get(p.name, p.nominal)}
        for p in task.known.values()
    ]  # fmt: skip
    return {"parameters": parameters, "axes": [_axis(task, axis) for axis in task.axes.values()]}


def _axis(task: Task, axis: Axis) -> dict[str, Any]:
    """An axis as plain data, with its proofs."""
    replaced = dict(leaves(task.node["axes"][axis.name]["replace"]))
    proofs = [{**asdict(proof), "goes_to": replaced[proof.parameter]} for proof in task.proofs[axis.name]]
    return {"axis": axis.name, "why": axis.why, "source": axis.source, "severities": axis.severities, "proofs": proofs}
