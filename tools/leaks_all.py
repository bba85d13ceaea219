"""Search the observations of all splits for hidden parameters, into records/leak.

    python tools/leaks_all.py [TASK ...]

Each split is searched by `scengen attack tiers=[leaks]`: 200 draws, eight seconds of processor time. Tasks without a
hidden parameter have nothing to tell and are left out. A repeated call continues. `make attacks` runs it and tells the
results on the page of attacks.
"""

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from scengen import cli, list_tasks, load_task
from scengen.evidence import ledger, measuring
from scengen.evidence.ledger import Evidence
from scengen.ood.analysis.leaks import SEARCH
from scengen.samplers.split import ID
from scengen.samplers.task import Task

SEED = 4242
"""Seed of the draws."""
MADE_WITH = {"search": SEARCH, "seed": SEED}
"""Settings of a search in the ledger."""


def main(*names: str) -> None:
    """Search what is missing, and store it after each split."""
    for task in map(load_task, names or list_tasks()):
        for split in (ID, *task.axes) if hides(task) else ():
            if not measuring.measured(task, split, "leak", MADE_WITH):
                found = search(task, split)
                draws = found.pop("draws")
                measuring.keep(task, split, "leak", draws, found, MADE_WITH)
                print(f"{task.name}/{split}: {found}", flush=True)


def hides(task: Task) -> bool:
    """Whether a task has a parameter that no observation is to tell."""
    return any(parameter.hidden for parameter in task.known.values())


def searched(task: str) -> dict[str, Evidence]:
    """The rows of today's search about a task, by split."""
    return ledger.latest("leak", task, **MADE_WITH)


def search(task: Task, split: str) -> dict[str, Any]:
    """What the observations of a split tell."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "leaks.json"
        argv = (
            f"task={task.name}",
            f"split={split}",
            "tiers=[leaks]",
            f"seed={SEED}",
            f"json={target}",
            "workers=1",
        )
        if cli.run(("attack", *argv)):
            sys.exit(f"{task.name}/{split} cannot be searched")
        found = json.loads(target.read_text())["leaks"]
    return {name: found[name] for name in ("draws", "hidden", "found")}


if __name__ == "__main__":
    main(*sys.argv[1:])
