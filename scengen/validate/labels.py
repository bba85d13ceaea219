"""Columns of a row that follow from its task and its draw: a run writes them, and verification derives them again."""

from typing import Any

from ..installation import versions
from ..params import values
from ..samplers.split import Split
from ..samplers.task import Draw, Task
from ..work.fingerprint import fingerprint
from .identity import source_sha256


def labels_of_task(task: Task, split: Split, seed: int) -> dict[str, Any]:
    """Columns that are the same in all rows of a pool."""
    return {
        "task": task.name,
        "code": task.code,
        "category": task.category,
        "instruction": task.instruction,
        "horizon": task.horizon,
        "embodiment": task.embodiment,
        "split": str(split),
        "axes": split.axes,
        "seed": seed,
    }


def labels_of_draw(draw: Draw) -> dict[str, Any]:
    """Columns that follow from the draw of a row."""
    return {
        "id": draw.scenario.id,
        "index": draw.index,
        "attempt": draw.attempt,
        "id_twin": draw.id_twin,
        "shifted": draw.shifted,
        "params": values(draw.scenario),
    }


def made_with(task: Task) -> dict[str, Any]:
    """Fields of a manifest and of its certificates that say what they were made with."""
    return {
        "task_version": task.version,
        "versions": versions(),
        "fingerprint": fingerprint(),
        "source_sha256": source_sha256(task.family),
    }
