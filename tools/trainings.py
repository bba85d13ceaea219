"""Train small policies on other demonstrations than tools/baselines.py, into records/trainings.

    python tools/trainings.py curves|styles|curation|wrench [workers=N] [TASK ...]

* `curves`: the first 25, 50 and 100 demonstrations; tools/baselines.py trains on all 200.
* `styles`: 200 nominal demonstrations, and 200 varied and recovering ones.
* `curation`: a recording of which every third episode is spoiled, what `scengen curate` keeps of it, and as many of its
  episodes at random.
* `wrench`: poses alone, and the force and torque at the wrist besides.

Pools, and the recording of default styles, are those of tools/baselines.py, which makes missing ones. Trainings differ
in their seed, and are evaluated in training and on two axes. A repeated call continues. The results are shown in
docs/baselines.md by `python tools/baselines_page.py`.
"""

import json
import multiprocessing
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, get_args

import axis_records
import baselines
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from arguments import parted
from baselines import ALL, BLIND, CURATED, FELT, MIXED, NOMINAL, RANDOM, VARIED, Question
from filelock import FileLock

from scengen import load_task
from scengen.envs.object_state import NAME
from scengen.envs.observations import proprioception
from scengen.learn.data import KEPT
from scengen.learn.models import BC, KNN, MIP
from scengen.learn.store import FORMAT
from scengen.learn.train import TrainSettings
from scengen.pool import Pool
from scengen.pool.files import sha256
from scengen.samplers.split import ID

AXES = {
    "domino_single": ("diagonal", "stout_starter"),
    "mirror_pick_place": ("small", "far"),
    "linear_intercept": ("fast", "large_ball"),
    "pendulum_grasp": ("plane_45", "off_centre"),
    "edge_slide": ("heavy_strip", "thin"),
    "tool_retrieve": ("mirrored_hook", "long_handle"),
    "pick_place_ycb": ("far_jumps", "unseen_item"),
    "slip_recovery": ("two_slips", "long_window"),
    "balance_medium": ("off_centre", "narrow_ridge"),
    "cube_toss": ("farther", "small_tray"),
    "domino_select": ("diagonal", "longer"),
    "bounce_intercept": ("fast", "dead_walls"),
    "mass_sort": ("reversed", "close_masses"),
}
"""Axes on which the policies of a task are evaluated."""
TASKS: dict[Question, tuple[str, ...]] = {
    "curves": baselines.TASKS,
    "styles": ("tool_retrieve", "edge_slide", "balance_medium"),
    "curation": ("tool_retrieve", "edge_slide", "balance_medium"),
    "wrench": ("mass_sort",),
}
"""Tasks that are measured by default. Styles and curation can only show where not everything is solved anyway."""
SIZES = (25, 50, 100)
"""Numbers of demonstrations of a learning curve, held-out ones included."""
SEEDS = {BC: (0, 1, 2), MIP: (0, 1, 2), KNN: (0,)}
"""Seeds of the trainings of a policy; nearest neighbours have none."""
BASES: dict[Question, tuple[str, ...]] = {
    "curves": (MIXED,),
    "styles": (NOMINAL, VARIED),
    "curation": (MIXED,),
    "wrench": (MIXED,),
}
"""Sets of demonstrations that are recorded."""
COMPARED: dict[Question, tuple[str, ...]] = {
    "styles": (NOMINAL, VARIED),
    "curation": (ALL, CURATED, RANDOM),
    "wrench": (BLIND, FELT),
}
"""Sets of demonstrations that are compared."""
STYLES = {NOMINAL: "[nominal]", VARIED: "[varied,recover]"}
"""Styles of the demonstrations of a set."""
EVERY = 3
"""One episode of so many is spoiled."""
LATE = 5
"""Rows by which the actions of a spoiled episode are late: 0.2 s at 25 Hz."""
FROZEN = 25
"""Rows for which the observations of a spoiled episode stand still: 1 s at 25 Hz."""
ACTIONS = ("action", "control.actions")
"""Columns of a recording with actions."""
SEEN = ("robot0_", "force_torque", "observation.")
"""How the names of columns with observations begin."""


@dataclass(frozen=True)
class Training:
    """One training."""

    task: str
    data: str
    """Name of the set of demonstrations."""
    policy: str
    size: int | None
    """Number of demonstrations, the first ones; None: all of the set."""
    seed: int

    @property
    def folder(self) -> Path:
        """Folder of the policy."""
        name = self.data.replace(" ", "_")
        return baselines.MADE / self.task / "trainings" / f"{name}-{self.policy}-{self.size or 'all'}-{self.seed}"


def main(*arguments: str) -> None:
    """Train and evaluate what is missing to answer a question."""
    names, settings = parted(arguments, "workers")
    question = next((one for one in get_args(Question) if one in names[:1]), None)
    if question is None:
        sys.exit(f"give a question: {', '.join(get_args(Question))}")
    tasks, workers = names[1:] or TASKS[question], int(settings.get("workers", 1))
    if unknown := {*tasks} - {*AXES}:
        sys.exit(f"no task named {min(unknown)!r}; known: {', '.join(AXES)}")
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as executor:
        list(executor.map(pools, tasks))
        list(executor.map(prepare, *zip(*product(tasks, BASES[question]), strict=True)))
        list(executor.map(partial(derive, question), tasks))
        done = {identity(record) for task in tasks for record in records(task)}
        missing = [one for one in trainings(question, tasks) if one not in done]
        started = [executor.submit(train, one) for one in missing]
        for number, future in enumerate(as_completed(started), 1):
            record = future.result()
            store(record)
            print(f"{number} of {len(started)}: {record['task']} {identity(record).folder.name} {record['solved']}")


def trainings(question: Question, tasks: Iterable[str]) -> list[Training]:
    """The trainings that a question takes; all of one seed come before the next one."""
    found = [one for task in tasks for one in _of_task(question, task)]
    return sorted(found, key=lambda one: one.seed)


def _of_task(question: Question, task: str) -> Iterator[Training]:
    if question == "curves":
        for policy, seeds in SEEDS.items():
            yield from (Training(task, MIXED, policy, size, seed) for size in SIZES for seed in seeds)
    else:
        yield from (Training(task, data, BC, None, seed) for data in COMPARED[question] for seed in SEEDS[BC])


def records(task: str) -> list[dict[str, Any]]:
    """The records of a task that were made as they would be now."""
    made = _made(task)
    return [one for one in axis_records.lines(_path(task)) if made.items() <= one.items()]


def _made(task: str) -> dict[str, Any]:
    """How trainings of a task are made: their format and number of epochs, and what is drawn in each split.

    Machines with different fingerprints draw the same scenarios, and write pools that differ in the last bits.
    """
    own = load_task(task)
    hashes = {}
    for split in (ID, *AXES[task]):
        dists = {name: str(dist) for name, dist in {**own.training, **own.shifts(split)}.items()}
        hashes[split] = sha256(json.dumps(dists, sort_keys=True))
    return {"format": FORMAT, "epochs": TrainSettings().epochs, "draws_sha256": hashes}


def identity(record: dict[str, Any]) -> Training:
    """The training of a record."""
    return Training(**{name: record[name] for name in Training.__dataclass_fields__})


def store(record: dict[str, Any]) -> None:
    """Add a record to those of its task; those that were made otherwise are dropped."""
    path = _path(record["task"])
    path.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(baselines.MADE / f"{path.stem}.lock"):
        known = [*records(record["task"]), record]
        path.write_text("".join(sorted(json.dumps(one, sort_keys=True) + "\n" for one in known)))


def _path(task: str) -> Path:
    return baselines.TRAININGS / f"{task}.jsonl"


def pools(task: str) -> dict[str, Path]:
    """Make the pools of a task on which policies are evaluated, if they are missing. Returns them by split."""
    return baselines.make_pools(task, AXES[task])


def train(training: Training) -> dict[str, Any]:
    """Train and evaluate a policy. Returns the record."""
    data = _recordings(training.task)[training.data]
    to = training.folder
    settings = [f"policy={training.policy}", f"data={data}", f"seed={training.seed}", f"to={to}"]
    if training.size is not None:
        settings.append(f"demonstrations={training.size}")
    if training.data == FELT:
        robot = load_task(training.task).embodiment
        settings.append(f"observations=[{','.join((*proprioception(robot), NAME, 'force_torque'))}]")
    baselines.run("train", *settings)
    evaluated = pools(training.task)
    baselines.play(str(to), [*evaluated.values()], to / "evaluation")
    outcomes = {
        split: [success for _, success in baselines.outcomes(episodes, Pool.open(evaluated[split]))]
        for split, episodes in baselines.episodes(to / "evaluation", evaluated).items()
    }
    solved = {split: sum(own) for split, own in outcomes.items()}
    played = {"pools_sha256": {split: Pool.open(pool).sha256 for split, pool in evaluated.items()}}
    return {**asdict(training), "solved": solved, "outcomes": outcomes, **played, **_made(training.task)}


# --- sets of demonstrations ---------------------------------------------------------------


def _recordings(task: str) -> dict[str, Path]:
    """Folders of the recordings of a task, by the name of the set."""
    folder = baselines.MADE / task
    names = (NOMINAL, VARIED, ALL, CURATED, RANDOM)
    own = dict.fromkeys((MIXED, BLIND, FELT), folder / baselines.RECORDING)
    return own | {name: folder / "sets" / name for name in names}


def prepare(task: str, name: str) -> None:
    """Make the demonstrations of a set, and record them, unless they are there."""
    to = _recordings(task)[name]
    demos = baselines.MADE / task / ("demos" if name == MIXED else f"demos-{name}")
    styles = (f"styles={STYLES[name]}",) if name in STYLES else ()
    baselines.record(task, to, demos, pools(task).values(), *styles)


def derive(question: Question, task: str) -> None:
    """Make the spoiled, the curated and the random recording of a task, if they are asked for and missing."""
    if question == "curation":
        sets = _recordings(task)
        _make(sets[ALL], sets[MIXED], spoil)
        _make(sets[CURATED], sets[ALL], curate)
        kept = json.loads((sets[CURATED] / KEPT).read_text())
        _make(sets[RANDOM], sets[ALL], partial(choose, count=len(kept)))


def _make(to: Path, source: Path, change: Callable[[Path], None]) -> None:
    """Make a changed copy of a recording, unless it is there."""
    if not to.exists():
        unfinished = to.with_suffix(".unfinished")
        shutil.rmtree(unfinished, ignore_errors=True)
        shutil.copytree(source, unfinished)
        change(unfinished)
        unfinished.rename(to)


def curate(recording: Path) -> None:
    """Curate a recording."""
    baselines.run("curate", f"data={recording}", "workers=auto")


def choose(recording: Path, count: int) -> None:
    """Keep some episodes of a recording at random, as a curation would."""
    total = json.loads((recording / "meta" / "info.json").read_text())["total_episodes"]
    kept = sorted(np.random.default_rng(0).permutation(total)[:count].tolist())
    (recording / KEPT).parent.mkdir()
    (recording / KEPT).write_text(json.dumps(kept))


def spoil(recording: Path) -> None:
    """Spoil every third episode of a recording by the faults of careless ones, in turn.

    Actions are late by 0.2 s, or observations stand still for a second, or the actions are those of the next episode.
    """
    for file in sorted((recording / "data").glob("*/*.parquet")):
        table = pq.read_table(file)
        numbers = table["episode_index"].to_numpy()
        seen, acted = np.arange(len(numbers)), np.arange(len(numbers))
        for turn, number in enumerate(np.unique(numbers)[:-1:EVERY]):
            rows = np.flatnonzero(numbers == number)
            if turn % 3 == 0:
                acted[rows] = np.maximum(rows - LATE, rows[0])
            elif turn % 3 == 1:
                third = len(rows) // 3
                seen[rows[third : third + FROZEN]] = rows[third]
            else:
                others = np.flatnonzero(numbers > number)
                acted[rows] = np.resize(others, len(rows))
        for i, name in enumerate(table.column_names):
            rows = acted if name in ACTIONS else seen if name.startswith(SEEN) else None
            if rows is not None:
                table = table.set_column(i, table.schema.field(i), table[name].take(pa.array(rows)))
        with pq.ParquetWriter(file, table.schema) as writer:
            for number in np.unique(numbers):
                writer.write_table(table.filter(pa.array(numbers == number)))


if __name__ == "__main__":
    main(*sys.argv[1:])
