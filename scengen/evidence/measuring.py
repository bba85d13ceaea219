"""Measurements of tasks: which of them the ledger lacks, and the rows of their results."""

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any

from ..errors import Infeasible
from ..samplers.split import ID
from ..samplers.task import Task
from ..validate.rebuilt import portable_sha256, rebuild
from . import ledger
from .ledger import Evidence, Kind

DRAWS = 6
"""Number of draws of a split in the hash that identifies its scenarios. Other distributions differ in each."""
SEED = 0
"""Seed of these draws."""


def draws_of(task: Task, split: str) -> str:
    """Hash of the first draws of a split and of their scenes. It is the same on machines with different rounding.

    A row about a task as a whole has the hash of the training split.
    """
    parts = [each for index in range(DRAWS) for each in _draw(task, split or ID, index)]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:12]


def _draw(task: Task, split: str, index: int) -> Iterator[str]:
    """Id and scene of a draw, or that there is none."""
    try:
        scenario = task.draw(split, SEED, index).scenario
    except Infeasible:
        yield "infeasible"
        return
    yield scenario.id
    yield portable_sha256(rebuild(scenario))


def measured(task: Task, split: str, kind: Kind, made_with: Mapping[str, Any]) -> Evidence | None:
    """The row of a measurement with these settings, if today's task has one.

    The row has today's version of the task, and the same first draws. Commands that measure call this first. A repeated
    command then measures only what is missing.
    """
    rows = [row for row in ledger.read(kind, task.name) if row.split == split and row.made_with == made_with]
    return next((row for row in rows if not stale(task, row)), None)


def stale(task: Task, row: Evidence) -> bool:
    """Whether a row is not about the task as it is: about another version, or draws that have changed without one."""
    return row.version != task.version or row.draws != draws_of(task, row.split)


def keep(
    task: Task, split: str, kind: Kind, n: int, value: Mapping[str, Any], made_with: Mapping[str, Any]
) -> Evidence:
    """Write the result of a measurement of today's task into the ledger. Fields as in `Evidence`."""
    row = Evidence(task.name, task.version, split, kind, n, value, made_with, draws_of(task, split))
    ledger.write(row)
    return row
