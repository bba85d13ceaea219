"""Play the planners with beliefs of training on the axes, without making cards, into records/belief.

    python tools/beliefs.py n=8 [workers=1] [TASK | TASK/AXIS ...]

Axes of the same version of their task that have a row with as many twins are left out, so that a repeated call
continues; n=20 extends what n=8 has played. `fresh` plays all of them again. A twin takes 5 to 7 rollouts, about a
second of processor time. docs/axes.md shows them.
"""

import sys
from collections.abc import Iterator

from arguments import parted
from axis_records import ROOT

from scengen import list_tasks, load_task
from scengen.errors import ScengenError
from scengen.evidence import ledger, measuring
from scengen.ood.behaviour import Trials
from scengen.ood.belief import measure_belief
from scengen.samplers.task import Task

MADE = ROOT / "generated" / "beliefs"
"""Folder of the outcomes of single twins, by the draws and the version of a task."""
TWINS = 8
"""Default number of twins of an axis."""


def main(*arguments: str) -> None:
    """Play what is missing."""
    names, given = parted([argument for argument in arguments if argument != "fresh"], "n", "workers")
    n, workers = int(given.get("n", TWINS)), int(given.get("workers", 1))
    failed = []
    for task, axis in wanted(names, n, fresh="fresh" in arguments):
        try:
            told = measure(task, axis, n, workers, "fresh" in arguments)
        except ScengenError as error:  # one axis without a feasible twin must not end the run
            failed.append(f"{task.name}/{axis}")
            told = str(error)
        print(f"{task.name}/{axis}: {told}", flush=True)
    sys.exit(f"not measured: {', '.join(failed)}" if failed else 0)


def wanted(names: list[str], n: int, fresh: bool) -> Iterator[tuple[Task, str]]:
    """The axes to play: of the named tasks, the named ones, or all; those without a row of n twins.

    Raises:
        ScengenError: there is no such task or axis.
    """
    for name, _, chosen in (text.partition("/") for text in names or list_tasks()):
        task = load_task(name)
        known = [row for row in ledger.current("belief", name) if row.n >= n and not measuring.stale(task, row)]
        for axis in [task.axis(chosen).name] if chosen else task.axes:
            if fresh or axis not in {row.split for row in known}:
                yield task, axis


def measure(task: Task, axis: str, n: int, workers: int, fresh: bool) -> str:
    """Play the planners on an axis and store the row. Returns the result as text."""
    folder = MADE / f"{task.name}-{axis}" / f"v{task.version}-{measuring.draws_of(task, axis)}"
    if fresh:
        (folder / "beliefs.jsonl").unlink(missing_ok=True)
    found = measure_belief(task, axis, folder, Trials(n, belief_n=n, workers=workers))
    measuring.keep(task, axis, "belief", n, {"baselines": [one.record for one in found]}, {"n": n})
    counts = [f"{r['name']} {r['training']} -> {r['here']} of {r['twins']}" for r in (one.record for one in found)]
    return f"{', '.join(counts)}: {', '.join(one.finding for one in found)}"


if __name__ == "__main__":  # worker processes import this file again
    main(*sys.argv[1:])
