"""Every task under other versions of MuJoCo, and docs/drift.md. `python tools/drift_all.py 10 POOLS [task ...]`

Pools lie in POOLS/<task>; one that is missing is generated there. Results stand in records/drift; tasks that were never
compared have no line.
"""

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from scengen import cli, list_tasks
from scengen.attack.evidence import TierRate
from scengen.drift.matrix import FLIPPED, OUTCOMES, UNKNOWN, cell, flips, total
from scengen.pool.manifest import MANIFEST

VERSIONS = ("3.3.7", "3.4.0", "3.5.0")
LEVEL = "recheck"
FOLDER = Path("records/drift")
PAGE = Path("docs/drift.md")
HEAD = """# Verdicts under other versions of MuJoCo

Written by `make drift`: what `scengen drift` came to on training scenarios of every task. Each version of MuJoCo has
an environment of its own, made by venv and pip and kept in `~/.cache/scengen`; everything else in it, Python, numpy,
numba, robosuite's files, scengen itself, is that of the running environment. Only MuJoCo differs.

* **same bits**: the witness ends in the same bits, and every check that was made again says what the certificate
  says.
* **same verdict**: every check says the same; the witness ends in other bits.
* **flipped**: a check says otherwise: `witness`, the recorded actions no longer reach the goal; `solved`, the oracle
  does not either; or a check of the scene (`overlap`, `rest`, `idle`, ...). Which, is told in brackets.

The version that made the pools is the control: all its scenarios have the same bits, or the machine is another one.
Level `recheck`: all checks that need no oracle; where the witness fails the oracle is asked whether the scenario can
still be solved, so that `witness` without `solved` means that the recording alone does not survive. Such a scenario
is certified again under the new version, with a witness of its own. A pool is `declined` by `scengen verify` under
any MuJoCo but its own, whatever stands here: certificates speak of the version that made them.

"""
LOCK = """
## scengen.lock

Beside every pool `scengen generate` writes `scengen.lock`: the versions of the packages that the code of its verdicts
imports, as lines that pip takes as requirements and as constraints, and in comments Python, platform, processor and
the hash of the code. It repeats the manifest, which counts and whose hash does not depend on it: a file that
contradicts the manifest is refuted, one that names other packages than a verdict touches is told of and not
recommended. Where a version here is another one, `scengen verify` says so, with the way back: `pip install --no-deps
-r POOL/scengen.lock` in an environment with scengen (`--no-deps`, as in `make setup`: robosuite asks for packages
that nothing here uses). A run that is continued with other packages than it was begun with is refused.
"""


def main(n: str, pools: str, *tasks: str) -> None:
    """Compare all tasks, or some, and write their lines."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    missing = [task for task in tasks or list_tasks() if not compared(task, n, Path(pools, task))]
    told = [json.loads(path.read_text()) for task in list_tasks() if (path := FOLDER / f"{task}.json").is_file()]
    PAGE.write_text(page(told))
    sys.exit(f"not compared: {', '.join(missing)}" if missing else 0)


def compared(task: str, n: str, pool: Path) -> bool:
    """Compare one task, and keep what the page needs; whether that came to an end."""
    if not (pool / MANIFEST).is_file():
        cli.run(("generate", f"task={task}", f"n={n}", f"pool={pool}"))
    with TemporaryDirectory() as folder:
        found = Path(folder, "drift.json")
        cli.run(
            ("drift", f"pool={pool}", f"mujoco=[{','.join(VERSIONS)}]", f"level={LEVEL}", f"n={n}", f"json={found}")
        )
        if found.is_file():
            told = json.dumps(shortened(json.loads(found.read_text())), indent=1, sort_keys=True)
            (FOLDER / f"{task}.json").write_text(f"{told}\n")
        return found.is_file()


def shortened(result: dict[str, Any]) -> dict[str, Any]:
    """A result without the checks that say what the certificate says, and without the place of the pool."""
    for one in result["scenarios"]:
        del one["pool"]
        for judgement in one["mujoco"].values():
            judgement["checks"] = [check for check in judgement["checks"] if check["flipped"]]
    return {**result, "pools": list(result["pools"].values())}


def page(told: list[dict[str, Any]]) -> str:
    """The page on the results of some tasks."""
    rows = [(task, row, len(one["scenarios"])) for one in told for task, row in one["tasks"].items()]
    every = {version: total([row[version] for _, row, _ in rows]) for version in VERSIONS}
    count = sum(n for *_, n in rows)
    lines = [
        f"{count} scenarios of {len(rows)} tasks; `same bits / same verdict / flipped`:\n",
        f"| task | scenarios | {' | '.join(f'MuJoCo {version}' for version in VERSIONS)} |",
        "|---|---|" + "---|" * len(VERSIONS),
        *(_row(task, n, [cell(row[version]) for version in VERSIONS]) for task, row, n in rows),
        _row("**all**", count, [cell(every[version]) for version in VERSIONS]),
        _row("flipped, 95 % bound", count, [f"< {_bound(every[version]):.1%}" for version in VERSIONS]),
    ]
    if any(each[FLIPPED] for each in every.values()):
        lines += [
            "\n## What flipped, with its margins\n",
            "The last column is the certificate's: how many jittered runs of the oracle succeeded, when the witness",
            "reached the goal, and whether it had survived other numerics under MuJoCo's own version.\n",
            "| MuJoCo | scenario | check | now | the certificate |",
            "|---|---|---|---|---|",
            *(f"| {' | '.join(each)} |" for one in told for each in flips(one)),
        ]
    return HEAD + "\n".join(lines) + "\n" + LOCK


def _row(task: str, count: int, told: list[str]) -> str:
    return f"| {task} | {count} | {' | '.join(told)} |"


def _bound(told: dict[str, Any]) -> float:
    """One-sided 95 % Clopper-Pearson bound of the share that flips, among those of which something can be said."""
    return TierRate("", False, sum(told[name] for name in OUTCOMES if name != UNKNOWN), told[FLIPPED]).bound


if __name__ == "__main__":  # worker processes import this file again
    main(*sys.argv[1:])
