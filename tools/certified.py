"""Certify fresh draws of every split of some tasks, and write the results into conf/certified.yaml.

    python tools/certified.py N [split=SPLIT,...] [draws=M] [replays=K] [TASK ...]

Every split, or those that are named, is drawn from until N scenarios are certified at level quick, or three times N
draws are spent. The oracle tries M other draws, undisturbed (100), and K witnesses of every split are played in
robosuite (3). Processor time is that of an otherwise idle machine whose cores are all at work on this. What is not
measured stays as it was. A repeated call continues: splits that were measured with the same numbers, distributions and
code are left out.
"""

import fcntl
import hashlib
import inspect
import sys
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml
from arguments import parted

from scengen import compose, list_tasks, load_task
from scengen.envs.agreement import compare_all
from scengen.errors import Infeasible
from scengen.ood.behaviour import solves
from scengen.runs.generate import GenerateSettings, generate
from scengen.samplers.split import ID
from scengen.samplers.task import Task
from scengen.scenario import Scenario
from scengen.task_files import certified
from scengen.validate.identity import source_sha256
from scengen.work.parallel import Limits

FILE = Path(__file__).parent.parent / "conf" / "certified.yaml"
HEAD = """# Results of certification by task and split. Written by tools/certified.py.
# indices: draws tried; certified among them at level quick; cpu: processor time of each that was [s], with every core
# of the machine at work; lost: what became of the others; draws: other draws that the oracle was given undisturbed, and
# solved among them; replays: witnesses played in robosuite, and same: those with the same verdict; key: hash of the
# numbers asked for, the distributions and the code. Where indices, certified and cpu stand alone they were measured
# under conjugate gradients, on one core of an idle machine.
"""
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
    wanted, draws, replays = (options.get(name) for name in ("split", "draws", "replays"))
    for name in names or list_tasks():
        task = load_task(name)
        for split in wanted.split(",") if wanted else (ID, *task.axes):
            asked = int(n), int(draws or 100), int(replays or 3)
            key = identity(task, split, *asked)
            if certified().get(name, {}).get(split, {}).get("key") == key:
                print(f"{name}/{split} is measured", flush=True)
                continue
            found = measured(task, split, *asked) | {"key": key}
            print(f"{name}/{split}", found, flush=True)
            write(name, split, found)


def identity(task: Task, split: str, n: int, draws: int, replays: int) -> str:
    """Hash of what the results of a split follow from: the numbers of draws, the distributions, the code."""
    family, dists = task.family, {**task.training, **task.shifts(split)}
    told = (n, draws, replays, sorted((name, str(dist)) for name, dist in dists.items()), task.horizon)
    code = (source_sha256(family), inspect.getsource(family.oracle))
    return hashlib.sha256(repr((told, code)).encode()).hexdigest()[:12]


def write(task: str, split: str, found: dict[str, Any]) -> None:
    """Add results to the file, or replace them."""
    with FILE.open("r+") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        every = certified()
        every[task] = {**every.get(task, {}), split: found}
        text = yaml.safe_dump(
            {name: every[name] for name in sorted(every)}, default_flow_style=None, sort_keys=False, width=1000
        )
        file.truncate(0)
        file.write(HEAD + text)


if __name__ == "__main__":
    main(*sys.argv[1:])
