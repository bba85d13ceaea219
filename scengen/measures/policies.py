"""Measurements of small policies: trained on a task's demonstrations, and on other sets of demonstrations."""

import json
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..envs.object_state import NAME
from ..envs.observations import proprioception
from ..errors import UnknownName
from ..evidence import ledger
from ..evidence.ledger import Evidence
from ..learn.data import KEPT
from ..learn.models import BC, KNN, MIP
from ..learn.store import read_settings
from ..learn.train import TrainSettings
from ..pool import Pool
from ..pool.manifest import MANIFEST
from ..samplers.split import ID
from ..samplers.task import Task
from ..work.targets import appearing
from .measurement import Job, Measurement, Result, Row

POLICIES = (BC, MIP, KNN)
"""Trained policies."""
AGAIN = (1, 2)
"""Further seeds of trainings of `bc`. One of `mip` takes as long as three of these; nearest neighbours have no seed."""
REPLAY = "replay"
"""Policy that replays the witness of the nearest other training scenario."""
UNTRAINED = ("idle", "random", "oracle")
"""Policies that are played in training alone: a certificate shows their results on an axis."""
SCENARIOS = 20
"""Number of scenarios of each split."""
DEMONSTRATIONS = 200
"""Number of demonstrations of each task, held-out ones included."""
RECORDING = "recording"
"""Name of the folder of the recording of a task."""
Question = Literal["curves", "styles", "curation", "wrench"]
"""What trainings are compared for: numbers of demonstrations, their styles, a curation, or the wrench at the wrist."""
MIXED = "mixed"
"""Set of demonstrations: the recording of default styles."""
NOMINAL = "nominal"
"""Set of demonstrations: the nominal style alone."""
VARIED = "varied"
"""Set of demonstrations: the other styles."""
BLIND = "poses alone"
"""Set of demonstrations: the recording of default styles without the wrench at the wrist."""
FELT = "poses and forces"
"""Set of demonstrations: the recording of default styles with the wrench at the wrist."""
ALL = "all"
"""Set of demonstrations: a recording that is spoiled in part."""
CURATED = "curated"
"""Set of demonstrations: the episodes of that recording that a curation keeps."""
RANDOM = "random"
"""Set of demonstrations: as many episodes of that recording at random."""
SIZES = (25, 50, 100)
"""Numbers of demonstrations of a learning curve, held-out ones included. The whole recording is a baseline."""
SEEDS = {BC: (0, 1, 2), MIP: (0, 1, 2), KNN: (0,)}
"""Seeds of the trainings of a policy; nearest neighbours have none."""
RECORDED: Mapping[Question, tuple[str, ...]] = {"styles": (NOMINAL, VARIED)}
"""Sets of demonstrations that are recorded to answer a question; `MIXED` for the others."""
COMPARED: Mapping[Question, tuple[str, ...]] = {
    "styles": (NOMINAL, VARIED),
    "curation": (ALL, CURATED, RANDOM),
    "wrench": (BLIND, FELT),
}
"""Sets of demonstrations that are compared."""
STYLES = {NOMINAL: "[nominal]", VARIED: "[varied,recover]"}
"""Styles of the demonstrations of a set."""
AXES = 2
"""Number of axes on which the trainings of a task are evaluated, unless some are chosen."""
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
class _OfPolicies(Measurement):
    """A measurement that makes pools and demonstrations of a task, and trains and evaluates policies on them."""

    FOLDER = "generated/baselines"

    def made(self, task: Task) -> Path:
        """Folder of what is made for a version of a task."""
        return self.folder / f"{task.name}-v{task.version}"

    def pools(self, task: Task, splits: Iterable[str]) -> dict[str, Path]:
        """Make the pools of some splits that are missing. Returns them by split."""
        pools = {split: self.made(task) / split for split in splits}
        for split, pool in pools.items():
            if not (pool / MANIFEST).is_file():
                self.finish("generate", f"task={task.name}", f"split={split}", f"n={SCENARIOS}", f"pool={pool}")
        return pools

    def record(self, task: Task, to: Path, demos: str, apart: Iterable[Path], *settings: str) -> None:
        """Make demonstrations of a task, and record them, unless the recording is there.

        Args:
            to: folder of the recording.
            demos: name of the folder of the demonstrations.
            apart: pools of evaluation.
            settings: further settings of `scengen demos`.
        """
        if not to.exists():
            folder, pools = self.made(task) / demos, ",".join(map(str, apart))
            numbers = (f"n={DEMONSTRATIONS}", f"to={folder}", f"apart=[{pools}]")
            self.finish("demos", f"task={task.name}", *numbers, *settings)
            self.finish("record", f"pool={folder}", f"to={to}", "cameras=none")

    def play(self, policy: str, pools: Mapping[str, Path], to: Path) -> dict[str, list[dict[str, Any]]]:
        """Evaluate a policy once on each scenario of some pools. Returns the episodes by split."""
        pooled = ",".join(map(str, pools.values()))
        self.finish("evaluate", f"policy={policy}", f"pool={pooled}", f"seeds={SCENARIOS}", "rollouts=1", f"to={to}")
        every = [json.loads(line) for line in (to / "episodes.jsonl").read_text().splitlines()]
        return {split: [one for one in every if one["pool"] == str(pool)] for split, pool in pools.items()}


def outcomes(episodes: Sequence[Mapping[str, Any]], pool: Path) -> list[list[Any]]:
    """Number of the scenario and success of each episode, by number."""
    number = dict(Pool.open(pool).columns("id", "index"))
    return sorted([number[episode["scenario"]], episode["success"]] for episode in episodes)


@dataclass(frozen=True)
class Baselines(_OfPolicies):
    """Small policies in training and on all axes: trained ones, the nearest witness, and those that do not learn.

    A task takes about half an hour of processor time.
    """

    KIND = "baseline"
    COMMANDS = True

    def jobs(self, task: Task) -> Iterator[Job]:
        splits = self.chosen(task)
        for policy, seed in [*((policy, 0) for policy in POLICIES), *((BC, seed) for seed in AGAIN)]:
            yield Job(task, splits, {"policy": policy, "seed": seed})
        for policy in (REPLAY, *UNTRAINED):
            own = splits if policy == REPLAY else tuple(split for split in splits if split == ID)
            if own:
                yield Job(task, own, {"policy": policy})

    def answers(self, row: Evidence, job: Job) -> bool:
        return row.has(**job.made_with)

    def result(self, job: Job) -> Result:
        task, policy = job.task, job.made_with["policy"]
        pools = self.pools(task, dict.fromkeys((ID, *job.splits)))
        folder, further = self.made(task), {}
        if policy in POLICIES:
            self.record(task, folder / RECORDING, "demos", self.pools(task, self.all_splits(task)).values())
            seed = job.made_with["seed"]
            trained = folder / (f"{policy}-{seed}" if seed else policy)
            data = folder / RECORDING
            self.finish("train", f"policy={policy}", f"seed={seed}", f"data={data}", f"to={trained}")
            further = {name: getattr(read_settings(trained), name) for name in ("demonstrations", "epochs")}
        else:
            trained = folder / policy
        own = {split: pools[split] for split in job.splits}
        played = folder / f"{trained.name}-evaluation-{len(own) - 1}"  # an evaluation is bound to its pools
        rows = []
        for split, episodes in self.play(str(trained) if policy in POLICIES else policy, own, played).items():
            reasons = Counter(episode["reason"] for episode in episodes if not episode["success"])
            solved = sum(episode["success"] for episode in episodes)
            value = {"solved": solved, "reasons": dict(reasons), "outcomes": outcomes(episodes, own[split])}
            rows.append(Row(split, len(episodes), value))
        return Result(job, rows, _solved(policy, rows), made_with=further)


def _solved(name: str, rows: Iterable[Row]) -> str:
    """Number of scenarios that a policy solves on each split, as text."""
    counts = (f"{row.value['solved']} of {row.n} in {row.split}" for row in rows)
    return f"{name} solves {', '.join(counts)}"


@dataclass(frozen=True)
class Trainings(_OfPolicies):
    """Small policies that are trained on other demonstrations than the baselines.

    * `curves`: the first 25, 50 and 100 demonstrations; a baseline has all 200.
    * `styles`: 200 nominal demonstrations, and 200 varied and recovering ones.
    * `curation`: a recording of which every third episode is spoiled, what `scengen curate` keeps of it, and as many of
      its episodes at random.
    * `wrench`: poses alone, and the force and torque at the wrist besides.

    Pools, and the recording of default styles, are those of the baselines. Policies are evaluated in training and on
    the axes of earlier trainings of the task; on its first two if there are none.
    """

    KIND = "training"
    OPTIONS: ClassVar[Mapping[str, Any]] = {"compare": "curves"}

    @property
    def question(self) -> Question:
        """What trainings are compared for."""
        for known in get_args(Question):
            if known == self.options["compare"]:
                return known
        raise UnknownName("comparison of trainings", self.options["compare"], get_args(Question))

    def chosen(self, task: Task) -> tuple[str, ...]:
        if self.splits:
            return super().chosen(task)
        before = {row.split for row in ledger.newest(self.KIND, task.name)}
        return (ID, *([axis for axis in task.axes if axis in before] or [*task.axes][:AXES]))

    def jobs(self, task: Task) -> Iterator[Job]:
        """The trainings of a question; all of one seed come before the next one."""
        trainings = [self._made_with(*one) for one in self._trainings()]
        for made_with in sorted(trainings, key=lambda one: one["seed"]):
            yield Job(task, self.chosen(task), made_with)

    def _trainings(self) -> Iterator[tuple[str, str, int | None, int]]:
        """Set of demonstrations, policy, number of demonstrations and seed of each training."""
        if self.question == "curves":
            for policy, seeds in SEEDS.items():
                yield from ((MIXED, policy, size, seed) for size in SIZES for seed in seeds)
        else:
            yield from ((data, BC, None, seed) for data in COMPARED[self.question] for seed in SEEDS[BC])

    def _made_with(self, data: str, policy: str, size: int | None, seed: int) -> dict[str, Any]:
        return {"data": data, "policy": policy, "size": size, "seed": seed, "epochs": TrainSettings().epochs}

    def prepare(self, tasks: Sequence[Task]) -> None:
        for task in tasks:
            sets = self._recordings(task)
            pools = self.pools(task, dict.fromkeys((ID, *self.chosen(task)))).values()
            for name in RECORDED.get(self.question, (MIXED,)):
                styles = (f"styles={STYLES[name]}",) if name in STYLES else ()
                self.record(task, sets[name], "demos" if name == MIXED else f"demos-{name}", pools, *styles)
            if self.question == "curation":
                _changed(sets[MIXED], sets[ALL], spoil)
                _changed(sets[ALL], sets[CURATED], self._curate)
                kept = json.loads((sets[CURATED] / KEPT).read_text())
                _changed(sets[ALL], sets[RANDOM], partial(choose, count=len(kept)))

    def _curate(self, recording: Path) -> None:
        """Curate a recording."""
        self.finish("curate", f"data={recording}", "workers=auto")

    def _recordings(self, task: Task) -> dict[str, Path]:
        """Folders of the recordings of a task, by the name of the set."""
        own = dict.fromkeys((MIXED, BLIND, FELT), self.made(task) / RECORDING)
        return own | {name: self.made(task) / "sets" / name for name in (NOMINAL, VARIED, ALL, CURATED, RANDOM)}

    def result(self, job: Job) -> Result:
        task, (data, policy, size, seed) = job.task, (job.made_with[key] for key in ("data", "policy", "size", "seed"))
        to = self.made(task) / "trainings" / f"{data.replace(' ', '_')}-{policy}-{size or 'all'}-{seed}"
        settings = [f"policy={policy}", f"data={self._recordings(task)[data]}", f"seed={seed}", f"to={to}"]
        if size is not None:
            settings.append(f"demonstrations={size}")
        if data == FELT:
            settings.append(f"observations=[{','.join((*proprioception(task.embodiment), NAME, 'force_torque'))}]")
        self.finish("train", *settings)
        pools, rows = self.pools(task, job.splits), []
        for split, episodes in self.play(str(to), pools, to / "evaluation").items():
            own = [success for _, success in outcomes(episodes, pools[split])]
            rows.append(Row(split, len(own), {"solved": sum(own), "outcomes": own}))
        return Result(job, rows, _solved(to.name, rows))


# --- sets of demonstrations ---------------------------------------------------------------


def _changed(source: Path, to: Path, change: Callable[[Path], None]) -> None:
    """Make a changed copy of a recording, unless it is there."""
    if not to.exists():
        with appearing(to, folder=True) as part:
            shutil.copytree(source, part, dirs_exist_ok=True)
            change(part)


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
