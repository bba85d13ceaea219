"""Every task under several versions of MuJoCo, and docs/drift.md.

    python tools/drift_all.py 2 POOLS 3.5.0,4.0.0 [task ...]

N training scenarios of each task are compared, and two of an axis: the paper's where the task has one, else its first.
Their pools are POOLS/<task> and POOLS/<task>-<axis>; missing ones are generated. Results are stored in records/drift,
in one folder for each set of versions. A task whose pools have been compared is left out: the command can be
interrupted and repeated. Tasks that were never compared have no line.
"""

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from scengen import cli, list_tasks, load_task
from scengen.attack.evidence import TierRate
from scengen.drift.matrix import FLIPPED, OUTCOMES, UNKNOWN, cell, flips, total
from scengen.pool import Pool
from scengen.pool.manifest import MANIFEST
from scengen.samplers.split import ID

OOD = 2
"""Number of scenarios of an axis."""
LEVEL = "recheck"
"""Level of the checks."""
FOLDER = Path("records/drift")
"""Folder of the results: a folder for each set of versions, `3.5.0+4.0.0`, with a file for each task."""
PAGE = Path("docs/drift.md")
HEAD = """# Verdicts under other versions of MuJoCo

Written by `make drift`: the results of `scengen drift` on training scenarios of every task and on some of one axis (the
paper's where the task has one). Each version of MuJoCo has an environment of its own, made by venv and pip and kept in
`~/.cache/scengen`. Everything else in it (Python, numpy, numba, scengen itself) is that of the running environment, so
only MuJoCo differs.

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
    folder = FOLDER / versions.replace(",", "+")
    folder.mkdir(parents=True, exist_ok=True)
    missing = []
    for task in tasks or list_tasks():
        if not compared(task, int(n), Path(pools), versions, folder / f"{task}.json"):
            missing.append(task)
        PAGE.write_text(page(stored()))
    sys.exit(f"not compared: {', '.join(missing)}" if missing else 0)


def stored() -> dict[str, list[dict[str, Any]]]:
    """All stored results, by the set of versions."""
    return {
        folder.name: [json.loads(path.read_text()) for path in sorted(folder.glob("*.json"))]
        for folder in sorted(FOLDER.iterdir())
    }


def axis_of(task: str) -> str:
    """The axis of a task that is compared."""
    loaded = load_task(task)
    return next((name for name, axis in loaded.axes.items() if loaded.of_paper(axis)), next(iter(loaded.axes)))


def compared(task: str, n: int, pools: Path, versions: str, record: Path) -> bool:
    """Compare one task, and store the part of the result that the page needs, unless it is there.

    Returns:
        Whether there is a result.
    """
    axis = axis_of(task)
    wanted = {pools / task: (ID, n), pools / f"{task}-{axis}": (axis, OOD)}
    for pool, (split, count) in wanted.items():
        if not (pool / MANIFEST).is_file():
            cli.run(("generate", f"task={task}", f"split={split}", f"n={count}", f"pool={pool}"))
        if not (pool / MANIFEST).is_file():
            return False
    known = json.loads(record.read_text()) if record.is_file() else {"pools": []}
    if {Pool.open(pool).sha256 for pool in wanted} == {one["sha256"] for one in known["pools"]}:
        return True
    with TemporaryDirectory() as folder:
        found = Path(folder, "drift.json")
        both = ",".join(map(str, wanted))
        cli.run(("drift", f"pool=[{both}]", f"mujoco=[{versions}]", f"level={LEVEL}", f"json={found}"))
        if found.is_file():
            told = json.dumps(shortened(json.loads(found.read_text())), indent=1, sort_keys=True)
            record.write_text(f"{told}\n")
        return found.is_file()


def shortened(result: dict[str, Any]) -> dict[str, Any]:
    """A result without the checks that agree with the certificate, and without the folder of the pool."""
    for one in result["scenarios"]:
        del one["pool"]
        for judgement in one["mujoco"].values():
            judgement["checks"] = [check for check in judgement["checks"] if check["flipped"]]
    return {**result, "pools": list(result["pools"].values())}


def page(told: dict[str, list[dict[str, Any]]]) -> str:
    """The page on the results of some tasks, by the set of versions."""
    return HEAD + "\n".join(table(results) for results in told.values() if results) + LOCK


def table(told: list[dict[str, Any]]) -> str:
    """The section on the results of some tasks under the same versions."""
    rows = [(task, row, len(one["scenarios"])) for one in told for task, row in one["tasks"].items()]
    versions = list(told[0]["mujoco"])
    every = {version: total([row[version] for _, row, _ in rows]) for version in versions}
    count = sum(n for *_, n in rows)
    lines = [
        f"## MuJoCo {', '.join(versions)}\n",
        f"{count} scenarios of {len(rows)} tasks; `same bits / same verdict / flipped`:\n",
        f"| task | scenarios | {' | '.join(f'MuJoCo {version}' for version in versions)} |",
        "|---|---|" + "---|" * len(versions),
        *(_row(task, n, [cell(row[version]) for version in versions]) for task, row, n in rows),
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
            *(f"| {' | '.join(each)} |" for one in told for each in flips(one)),
        ]
    return "\n".join(lines) + "\n"


def _row(task: str, count: int, told: list[str]) -> str:
    return f"| {task} | {count} | {' | '.join(told)} |"


def _bound(told: dict[str, Any]) -> float:
    """One-sided 95 % Clopper-Pearson bound of the share of flipped scenarios, among those with a known outcome."""
    return TierRate("", False, sum(told[name] for name in OUTCOMES if name != UNKNOWN), told[FLIPPED]).bound


if __name__ == "__main__":  # worker processes import this file again
    main(*sys.argv[1:])
