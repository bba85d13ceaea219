"""Search the observations of all splits for hidden parameters, into records/leaks.

    python tools/leaks_all.py [TASK ...]

Each split is searched by `scengen attack tiers=[leaks]`: 200 draws, eight seconds of processor time. Tasks without a
hidden parameter have nothing to tell and are left out. A record counts as long as the code of its family and of the
observations is the same, so that a repeated call continues. `make attacks` runs it and tells the results in
docs/attacks.md.
"""

import hashlib
import inspect
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from scengen import cli, list_tasks, load_task
from scengen.analysis import leaks
from scengen.envs import object_state, observations
from scengen.samplers.split import ID
from scengen.samplers.task import Task
from scengen.sim import boxes
from scengen.validate.identity import source_sha256

RECORDS = Path("records/leaks")
"""Folder of the results, one file for each task: what was found, by split."""
SEED = 4242
"""Seed of the draws."""


def main(*names: str) -> None:
    """Search what is missing, and store it after each split."""
    RECORDS.mkdir(parents=True, exist_ok=True)
    for name in names or list_tasks():
        task = load_task(name)
        if not hides(task):
            continue
        known = searched(task)
        for split in (ID, *task.axes):
            if split not in known:
                known[split] = search(task, split)
                told = {"code_sha256": code_sha256(task), "splits": known}
                (RECORDS / f"{name}.json").write_text(json.dumps(told, indent=1) + "\n")
                print(f"{name}/{split}: {known[split]}", flush=True)


def hides(task: Task) -> bool:
    """Whether a task has a parameter that no observation is to tell."""
    return any(parameter.hidden for parameter in task.known.values())


def searched(task: Task) -> dict[str, Any]:
    """The results that still count, by split."""
    told = stored(task)
    return told["splits"] if told.get("code_sha256") == code_sha256(task) else {}


def stored(task: Task) -> dict[str, Any]:
    """The record of a task; empty if there is none."""
    path = RECORDS / f"{task.name}.json"
    return json.loads(path.read_text()) if path.is_file() else {}


def code_sha256(task: Task) -> str:
    """Hash of the code that the results of a task follow from."""
    read = map(inspect.getsource, (leaks, object_state, observations, boxes))
    return hashlib.sha256("\n".join([source_sha256(task.family), *read]).encode()).hexdigest()


def search(task: Task, split: str) -> dict[str, Any]:
    """What the observations of a split tell."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "leaks.json"
        argv = (f"task={task.name}", f"split={split}", "tiers=[leaks]", f"seed={SEED}", f"json={target}", "workers=1")
        if cli.run(("attack", *argv)):
            sys.exit(f"{task.name}/{split} cannot be searched")
        found = json.loads(target.read_text())["leaks"]
    return {name: found[name] for name in ("draws", "hidden", "found")}


if __name__ == "__main__":
    main(*sys.argv[1:])
