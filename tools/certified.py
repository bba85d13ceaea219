"""Certify fresh draws of every split of some tasks, and write the results into records/certified.

    python tools/certified.py N [split=SPLIT,...] [draws=M] [replays=K] [TASK ...]

Every split, or those that are named, is drawn from until N scenarios are certified at level quick, or three times N
draws are spent. The oracle tries M other draws, undisturbed (100), and K witnesses of every split are played in
robosuite (3). Processor time is that of an otherwise idle machine whose cores are all at work on this. A repeated call
continues: splits of the same version of the task that were measured with the same numbers are left out.

Figures: `indices`, draws tried; `certified` among them; `cpu`, processor time of each that was [s]; `lost`, what became
of the others; `draws`, other draws that the oracle was given, and `solved` among them; `replays`, witnesses played in
robosuite, and `same`, those with the same verdict.
"""

import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

from arguments import parted

from scengen import compose, list_tasks, load_task
from scengen.envs.agreement import compare_all
from scengen.errors import Infeasible
from scengen.evidence import measuring
from scengen.ood.behaviour import solves
from scengen.runs.generate import GenerateSettings, generate
from scengen.samplers.split import ID
from scengen.samplers.task import Task
from scengen.scenario import Scenario
from scengen.work.parallel import Limits

OTHER_SEED = 1
"""Seed of the draws that only the oracle plays."""


def measured(task: Task, split: str, n: int, draws: int, replays: int) -> dict[str, Any]:
    """Results of the draws of a split."""
    with tempfile.TemporaryDirectory() as folder:
        settings = GenerateSettings(split=split, n=n, limit=3 * n, pool=f"{folder}/pool")
        made = generate(task, compose.certify_levels(task)["quick"], settings, lambda *_: None)
        each = round(made.cpu / made.certified, 1) if made.certified else 0.0
        found = {"indices": made.indices, "certified": made.certified, "cpu": each, "lost": dict(made.reasons)}
        if replays and made.certified:
            played = compare_all([made.pool], 1, lambda _: None, replays, limits=Limits(300, 4000))
            found |= {"replays": len(played), "same": sum(one.agrees for one in played)}
    if draws:
        solved = [solves(task, scenario) for scenario in feasible(task, split, draws)]
        found |= {"draws": len(solved), "solved": sum(solved)}
    return found


def feasible(task: Task, split: str, draws: int) -> Iterator[Scenario]:
    """Draws that were not certified. Fewer than requested if some indices have no feasible scenario."""
    for index in range(draws):
        with suppress(Infeasible):
            yield task.draw(split, OTHER_SEED, index).scenario


def main(n: str, *others: str) -> None:
    """Measure the splits, and write after each one, so that several processes may share the tasks."""
    names, options = parted(others, "split", "draws", "replays")
    made_with = {"n": int(n), "draws": int(options.get("draws", 100)), "replays": int(options.get("replays", 3))}
    for task in map(load_task, names or list_tasks()):
        for split in options["split"].split(",") if "split" in options else (ID, *task.axes):
            if measuring.measured(task, split, "certified", made_with):
                print(f"{task.name}/{split} is measured", flush=True)
                continue
            found = measured(task, split, **made_with)
            print(f"{task.name}/{split}", found, flush=True)
            measuring.keep(task, split, "certified", found["indices"], found, made_with)


if __name__ == "__main__":
    main(*sys.argv[1:])
