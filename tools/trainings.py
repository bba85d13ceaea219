"""Train small policies on other demonstrations than tools/baselines.py, into records/training.

    python tools/trainings.py curves|styles|curation|wrench [workers=N] [TASK ...]

* `curves`: the first 25, 50 and 100 demonstrations; tools/baselines.py trains on all 200.
* `styles`: 200 nominal demonstrations, and 200 varied and recovering ones.
* `curation`: a recording of which every third episode is spoiled, what `scengen curate` keeps of it, and as many of its
  episodes at random.
* `wrench`: poses alone, and the force and torque at the wrist besides.

Pools, and the recording of default styles, are those of tools/baselines.py, which makes missing ones. Trainings differ
in their seed, and are evaluated in training and on two axes. A repeated call continues. The results are shown in
docs/baselines.md, by `make docs`.
"""

import json
import multiprocessing
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, get_args

import baselines
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from arguments import parted
from baselines import ALL, BLIND, CURATED, FELT, MIXED, NOMINAL, RANDOM, VARIED, Question

from scengen import load_task
from scengen.envs.object_state import NAME
from scengen.envs.observations import proprioception
from scengen.evidence import measuring
from scengen.learn.data import KEPT
from scengen.learn.models import BC, KNN, MIP
from scengen.learn.train import TrainSettings
from scengen.pool import Pool
from scengen.samplers.split import ID
from scengen.samplers.task import Task

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

    task: Task
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
        made = baselines.made_of(self.task) / "trainings"
        return made / f"{name}-{self.policy}-{self.size or 'all'}-{self.seed}"

    @property
    def made_with(self) -> dict[str, Any]:
        """Settings of the training in the ledger: its own, and the number of epochs of all trainings."""
        own = {"data": self.data, "policy": self.policy, "size": self.size, "seed": self.seed}
        return {**own, "epochs": TrainSettings().epochs}

    @property
    def done(self) -> bool:
        """Whether the ledger has the results of the training."""
        splits = (ID, *AXES[self.task.name])
        return all(measuring.measured(self.task, split, "training", self.made_with) for split in splits)


def main(*arguments: str) -> None:
    """Train and evaluate what is missing to answer a question."""
    names, settings = parted(arguments, "workers")
    question = next((one for one in get_args(Question) if one in names[:1]), None)
    if question is None:
        sys.exit(f"give a question: {', '.join(get_args(Question))}")
    chosen, workers = names[1:] or TASKS[question], int(settings.get("workers", 1))
    if unknown := {*chosen} - {*AXES}:
        sys.exit(f"no task named {min(unknown)!r}; known: {', '.join(AXES)}")
    tasks = [load_task(name) for name in chosen]
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as executor:
        list(executor.map(pools, tasks))
        list(executor.map(prepare, *zip(*product(tasks, BASES[question]), strict=True)))
        list(executor.map(partial(derive, question), tasks))
        missing = [one for one in trainings(question, tasks) if not one.done]
        started = {executor.submit(train, one): one for one in missing}
        for number, future in enumerate(as_completed(started), 1):
            one = started[future]
            print(f"{number} of {len(started)}: {one.task.name} {one.folder.name} {future.result()}")


def trainings(question: Question, tasks: Iterable[Task]) -> list[Training]:
    """The trainings that a question takes; all of one seed come before the next one."""
    found = [one for task in tasks for one in _of_task(question, task)]
    return sorted(found, key=lambda one: one.seed)


def _of_task(question: Question, task: Task) -> Iterator[Training]:
    if question == "curves":
        for policy, seeds in SEEDS.items():
            yield from (Training(task, MIXED, policy, size, seed) for size in SIZES for seed in seeds)
    else:
        yield from (Training(task, data, BC, None, seed) for data in COMPARED[question] for seed in SEEDS[BC])


def pools(task: Task) -> dict[str, Path]:
    """Make the pools of a task on which policies are evaluated, if they are missing. Returns them by split."""
    return baselines.make_pools(task, AXES[task.name])


def train(training: Training) -> dict[str, int]:
    """Train and evaluate a policy, and store the rows. Returns the number of solved scenarios by split."""
    task, to = training.task, training.folder
    data = _recordings(task)[training.data]
    settings = [f"policy={training.policy}", f"data={data}", f"seed={training.seed}", f"to={to}"]
    if training.size is not None:
        settings.append(f"demonstrations={training.size}")
    if training.data == FELT:
        settings.append(f"observations=[{','.join((*proprioception(task.embodiment), NAME, 'force_torque'))}]")
    baselines.run("train", *settings)
    evaluated, solved = pools(task), {}
    baselines.play(str(to), [*evaluated.values()], to / "evaluation")
    for split, episodes in baselines.episodes(to / "evaluation", evaluated).items():
        own = [success for _, success in baselines.outcomes(episodes, Pool.open(evaluated[split]))]
        solved[split] = sum(own)
        value = {"solved": solved[split], "outcomes": own}
        measuring.keep(task, split, "training", len(own), value, training.made_with)
    return solved


# --- sets of demonstrations ---------------------------------------------------------------


def _recordings(task: Task) -> dict[str, Path]:
    """Folders of the recordings of a task, by the name of the set."""
    folder = baselines.made_of(task)
    names = (NOMINAL, VARIED, ALL, CURATED, RANDOM)
    own = dict.fromkeys((MIXED, BLIND, FELT), folder / baselines.RECORDING)
    return own | {name: folder / "sets" / name for name in names}


def prepare(task: Task, name: str) -> None:
    """Make the demonstrations of a set, and record them, unless they are there."""
    to = _recordings(task)[name]
    demos = baselines.made_of(task) / ("demos" if name == MIXED else f"demos-{name}")
    styles = (f"styles={STYLES[name]}",) if name in STYLES else ()
    baselines.record(task, to, demos, pools(task).values(), *styles)


def derive(question: Question, task: Task) -> None:
    """Make the spoiled, the curated and the random recording of a task, if they are requested and missing."""
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
