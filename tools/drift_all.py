"""Every task under several versions of MuJoCo, and docs/drift.md.

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
PAGE = Path("docs/drift.md")
HEAD = """# Verdicts under other versions of MuJoCo

Written by `make drift`: the results of `scengen verify mujoco` on training scenarios of every task and on some of one
axis (the paper's where the task has one). Each version of MuJoCo has an environment of its own, made by venv and pip
and kept in `~/.cache/scengen`. Everything else in it (Python, numpy, numba, scengen itself) is that of the running
environment, so only MuJoCo differs.

* **same bits**: the witness ends in the same bits, and every repeated check agrees with the certificate.
* **same verdict**: every repeated check agrees with the certificate; the witness ends in other bits.
* **flipped**: a check contradicts the certificate: `witness`, the recorded actions no longer reach the goal; `solved`,
  the oracle no longer reaches it either; or a check of the scene (`overlap`, `rest`, `idle`, ...). The flipped checks
  are given in brackets.

The version that made the pools is the control: if its scenarios do not all have the same bits, the machine is another
one. Level `recheck` makes all checks that need no oracle. If the witness fails, the oracle is tried to find out whether
the scenario can still be solved: `witness` without `solved` means that only the recording fails, and the scenario can
be certified under the new version with a new witness. `scengen verify` always reports a pool as `declined` under any
MuJoCo but its own: certificates refer to the version that made them.

"""
LOCK = """
## scengen.lock

`scengen generate` writes `scengen.lock` beside every pool: the versions of the packages that the code of its verdicts
imports, as lines that pip accepts as requirements and as constraints, and in comments Python, platform, processor and
the hash of the code. The file repeats the manifest, which is authoritative and whose hash does not depend on the file.
A file that contradicts the manifest is refuted; a file that lists packages which no verdict uses is reported, and its
use is not recommended. If a version on this machine differs, `scengen verify` says so and how to restore it: `pip
install --no-deps -r POOL/scengen.lock` in an environment with scengen (`--no-deps`, as in `make setup`: robosuite
requires packages that scengen does not use). A run that was begun with other packages is not continued.
"""


def main(n: str, pools: str, versions: str, *tasks: str) -> None:
    """Compare all tasks, or some, and write the page."""
    missing = []
    for task in map(load_task, tasks or list_tasks()):
        for split, count in ((ID, int(n)), (axis_of(task), OOD)):
            if not compared(task, split, count, Path(pools), versions.split(",")):
                missing.append(f"{task.name}/{split}")
        PAGE.write_text(page())
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


def page() -> str:
    """The page on the results of all tasks, by the set of versions."""
    rows = [row for task in list_tasks() for row in ledger.current("drift", task)]
    sets = sorted({tuple(row.made_with["mujoco"]) for row in rows})
    return HEAD + "\n".join(table(names, [row for row in rows if row.has(mujoco=[*names])]) for names in sets) + LOCK


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
        return _row(task, 0, [ledger.not_measured(task)] * len(versions))
    counts = [total([row.value["counts"][version] for row in rows]) for version in versions]
    return _row(task, sum(row.n for row in rows), list(map(cell, counts)))


def _row(task: str, count: int, told: list[str]) -> str:
    return f"| {task} | {count} | {' | '.join(told)} |"


def _bound(told: dict[str, Any]) -> float:
    """One-sided 95 % Clopper-Pearson bound of the share of flipped scenarios, among those with a known outcome."""
    return TierRate("", False, sum(told[name] for name in OUTCOMES if name != UNKNOWN), told[FLIPPED]).bound


if __name__ == "__main__":  # worker processes import this file again
    main(*sys.argv[1:])
