"""Every task under several versions of MuJoCo, for docs/drift.md.

    python tools/drift_all.py 2 POOLS 3.5.0,4.0.0 [task ...]

N training scenarios of each task are compared, and two of an axis: the paper's where the task has one, else its first.
Their pools are POOLS/<task>-v<version> and POOLS/<task>-v<version>-<axis>; missing ones are generated. Results are rows
of records/drift, one for each pool and set of versions. A pool that has been compared is left out: the command can be
interrupted and repeated.
"""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from scengen import cli, list_tasks, load_task
from scengen.attack.evidence import TierRate
from scengen.drift.matrix import FLIPPED, OUTCOMES, UNKNOWN, cell, flips, total
from scengen.evidence import ledger, measuring
from scengen.evidence.ledger import Evidence
from scengen.pool.manifest import MANIFEST
from scengen.samplers.split import ID
from scengen.samplers.task import Task

OOD = 2
"""Number of scenarios of an axis."""
LEVEL = "recheck"
"""Level of the checks."""


def main(n: str, pools: str, versions: str, *tasks: str) -> None:
    """Compare all tasks, or some, and store the results."""
    missing = []
    for task in map(load_task, tasks or list_tasks()):
        for split, count in ((ID, int(n)), (axis_of(task), OOD)):
            if not compared(task, split, count, Path(pools), versions.split(",")):
                missing.append(f"{task.name}/{split}")
    sys.exit(f"not compared: {', '.join(missing)}" if missing else 0)


def axis_of(task: Task) -> str:
    """The axis of a task that is compared."""
    return next((name for name, axis in task.axes.items() if task.of_paper(axis)), next(iter(task.axes)))


def compared(task: Task, split: str, n: int, pools: Path, versions: Sequence[str]) -> bool:
    """Compare scenarios of a split, and store the part of the result that the page needs, unless it is there.

    Returns:
        Whether there is a result.
    """
    made_with = {"mujoco": list(versions), "level": LEVEL, "n": n}
    if measuring.measured(task, split, "drift", made_with):
        return True
    pool = pools / "-".join([task.name, f"v{task.version}", *([] if split == ID else [split])])
    if not (pool / MANIFEST).is_file():
        cli.run(("generate", f"task={task.name}", f"split={split}", f"n={n}", f"pool={pool}"))
    with TemporaryDirectory() as folder:
        found = Path(folder, "drift.json")
        cli.run(("drift", f"pool={pool}", f"mujoco=[{','.join(versions)}]", f"level={LEVEL}", f"json={found}"))
        if found.is_file():
            value = shortened(json.loads(found.read_text()))
            measuring.keep(task, split, "drift", len(value["scenarios"]), value, made_with)
        return found.is_file()


def shortened(result: dict[str, Any]) -> dict[str, Any]:
    """The scenarios of a result with the checks that contradict the certificate, its counts, and who made the pool."""
    for one in result["scenarios"]:
        del one["pool"]
        for judgement in one["mujoco"].values():
            judgement["checks"] = [check for check in judgement["checks"] if check["flipped"]]
    [counts], [pool] = result["tasks"].values(), result["pools"].values()
    return {"scenarios": result["scenarios"], "counts": counts, "control": pool["versions"]["mujoco"]}


def fills() -> dict[str, str]:
    """The results of all tasks, by the set of versions."""
    rows = [row for task in list_tasks() for row in ledger.current("drift", task)]
    sets = sorted({tuple(row.made_with["mujoco"]) for row in rows})
    return {"drift": "\n".join(table(names, [row for row in rows if row.has(mujoco=[*names])]) for names in sets)}


def table(versions: Sequence[str], rows: Sequence[Evidence]) -> str:
    """The section on the results of some tasks under the same versions."""
    every = {version: total([row.value["counts"][version] for row in rows]) for version in versions}
    count = sum(row.n for row in rows)
    lines = [
        f"## MuJoCo {', '.join(versions)}\n",
        f"{count} scenarios of {len({row.task for row in rows})} tasks; `same bits / same verdict / flipped`:\n",
        f"| task | scenarios | {' | '.join(f'MuJoCo {version}' for version in versions)} |",
        "|---|---|" + "---|" * len(versions),
        *(_line(task, versions, [row for row in rows if row.task == task]) for task in list_tasks()),
        _row("**all**", count, [cell(every[version]) for version in versions]),
        _row("flipped, 95 % bound", count, [f"< {_bound(every[version]):.1%}" for version in versions]),
    ]
    if any(each[FLIPPED] for each in every.values()):
        lines += [
            "\n### What flipped, with its margins\n",
            "If a witness no longer reaches the goal, its actions are played under both versions: the fifth column has",
            "the first times at which a body is 0.1, 1 and 10 mm elsewhere, and what it touches then. The last has",
            "the margins of the certificate: successful jittered runs of the oracle, the time at which the witness",
            "reached the goal, and other numerics under which the witness failed.\n",
            "| MuJoCo | scenario | check | now | how it parts | the certificate |",
            "|---|---|---|---|---|---|",
            *(f"| {' | '.join(each)} |" for row in rows for each in flips(row.value)),
        ]
    return "\n".join(lines) + "\n"


def _line(task: str, versions: Sequence[str], rows: Sequence[Evidence]) -> str:
    """The row of a task: the sum of its pools."""
    if not rows:
        return _row(f"[{task}](tasks/{task}.md)", 0, [ledger.not_measured(task)] * len(versions))
    counts = [total([row.value["counts"][version] for row in rows]) for version in versions]
    return _row(f"[{task}](tasks/{task}.md)", sum(row.n for row in rows), list(map(cell, counts)))


def _row(task: str, count: int, told: list[str]) -> str:
    return f"| {task} | {count} | {' | '.join(told)} |"


def _bound(told: dict[str, Any]) -> float:
    """One-sided 95 % Clopper-Pearson bound of the share of flipped scenarios, among those with a known outcome."""
    return TierRate("", False, sum(told[name] for name in OUTCOMES if name != UNKNOWN), told[FLIPPED]).bound


if __name__ == "__main__":  # worker processes import this file again
    main(*sys.argv[1:])
