"""Measurements of scenarios: certification of fresh draws, and verdicts under other versions of MuJoCo."""

import json
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from ..compose import certify_levels
from ..errors import Infeasible, ScengenError, UnknownName
from ..ood.behaviour import solves
from ..pool import Pool
from ..pool.manifest import MANIFEST
from ..runs.generate import GenerateSettings, generate
from ..samplers.split import ID
from ..samplers.task import Task
from ..scenario import Scenario
from ..work.parallel import Limits
from .measurement import Job, Measurement, Result, Row

OTHER_SEED = 1
"""Seed of the draws that only the oracle plays."""
QUICK = "quick"
"""Level of certification of the published figures."""
TRIES = 3
"""Number of draws that may be spent for each scenario."""


def feasible(task: Task, split: str, indices: Iterable[int]) -> Iterator[Scenario]:
    """Draws of a split that are never certified, without indices that have no feasible scenario."""
    for index in indices:
        with suppress(Infeasible):
            yield task.draw(split, OTHER_SEED, index).scenario


@dataclass(frozen=True)
class Certified(Measurement):
    """Certification of fresh draws.

    A split is drawn from until n scenarios are certified, or `TRIES` n draws are spent. The oracle plays other draws
    without disturbance, and the first witnesses are played in robosuite.

    Figures: `indices`, draws tried; `certified` among them; `cpu`, processor time of each that was [s]; `lost`, what
    became of the others; `draws`, other draws that the oracle was given, and `solved` among them; `replays`, witnesses
    played in robosuite, and `same`, those with the same verdict.
    """

    KIND = "certified"
    OPTIONS: ClassVar[Mapping[str, Any]] = {"n": 20, "draws": 100, "replays": 3, "level": QUICK}

    def jobs(self, task: Task) -> Iterator[Job]:
        if self.options["level"] not in (levels := certify_levels(task)):
            raise UnknownName("level of certification", self.options["level"], levels)
        level = {"level": self.options["level"]} if self.options["level"] != QUICK else {}
        for split in self.chosen(task):
            yield Job(task, (split,), {name: self.options[name] for name in ("n", "draws", "replays")} | level)

    def result(self, job: Job) -> Result:
        task, [split], n = job.task, job.splits, self.options["n"]
        with tempfile.TemporaryDirectory() as folder:
            settings = GenerateSettings(split=split, n=n, limit=TRIES * n, pool=f"{folder}/pool")
            made = generate(task, certify_levels(task)[self.options["level"]], settings, lambda *_: None)
            each = round(made.cpu / made.certified, 1) if made.certified else 0.0
            found = {"indices": made.indices, "certified": made.certified, "cpu": each, "lost": dict(made.reasons)}
            words = f"{made.certified} of {made.indices} certified, {each:.1f} core s each"
            if self.options["replays"] and made.certified:
                found |= self._replayed(made.pool)
                words += f", {found['same']} of {found['replays']} with the same verdict in robosuite"
        if self.options["draws"]:
            solved = [solves(task, scenario) for scenario in feasible(task, split, range(self.options["draws"]))]
            found |= {"draws": len(solved), "solved": sum(solved)}
            words += f", the oracle solves {sum(solved)} of {len(solved)}"
        return Result(job, [Row(split, made.indices, found)], words, made.certified >= n)

    def _replayed(self, pool: Pool) -> dict[str, int]:
        """Number of witnesses that are played in robosuite, and of those with the same verdict."""
        from ..envs.agreement import compare_all  # needs robosuite

        played = compare_all([pool], 1, lambda _: None, self.options["replays"], limits=Limits(300, 4000))
        return {"replays": len(played), "same": sum(one.agrees for one in played)}


@dataclass(frozen=True)
class Drift(Measurement):
    """Verdicts of scenarios under several versions of MuJoCo.

    n scenarios of training are compared, and `AXIS_N` of an axis: the paper's if the task has one, else its first.
    Missing pools are generated. The environments come from the package index.
    """

    KIND = "drift"
    OPTIONS: ClassVar[Mapping[str, Any]] = {"n": 2, "mujoco": ["3.5.0", "4.0.0"]}
    COMMANDS = True
    FOLDER = "generated/drift"
    AXIS_N = 2
    """Number of scenarios of an axis."""
    LEVEL = "recheck"
    """Level of the checks."""

    def all_splits(self, task: Task) -> Sequence[str]:
        axis = next((name for name, axis in task.axes.items() if task.of_paper(axis)), next(iter(task.axes), None))
        return (ID, axis) if axis else (ID,)

    def jobs(self, task: Task) -> Iterator[Job]:
        versions = self.options["mujoco"]
        for split in self.chosen(task):
            n = self.options["n"] if split == ID else self.AXIS_N
            mujoco = [versions] if isinstance(versions, str) else [*versions]
            yield Job(task, (split,), {"mujoco": mujoco, "level": self.LEVEL, "n": n})

    def result(self, job: Job) -> Result:
        task, [split], n = job.task, job.splits, job.made_with["n"]
        pool = self.folder / "-".join([task.name, f"v{task.version}", *([] if split == ID else [split])])
        if not (pool / MANIFEST).is_file():
            self.finish("generate", f"task={task.name}", f"split={split}", f"n={n}", f"pool={pool}")
        with tempfile.TemporaryDirectory() as folder:
            target = Path(folder) / "result.json"
            versions = f"mujoco=[{','.join(job.made_with['mujoco'])}]"
            argv = (f"pool={pool}", versions, f"level={self.LEVEL}", f"n={n}", f"workers={self.workers}")
            self.run("verify", "mujoco", *argv, f"json={target}")
            if not target.is_file():
                raise ScengenError(f"{task.name}/{split} was not compared")
            value = shortened(json.loads(target.read_text()))
        words = "; ".join(f"MuJoCo {version}: {counts}" for version, counts in value["counts"].items())
        return Result(job, [Row(split, len(value["scenarios"]), value)], words)


def shortened(result: dict[str, Any]) -> dict[str, Any]:
    """The scenarios of a result with the checks that contradict the certificate, its counts, and who made the pool."""
    for one in result["scenarios"]:
        del one["pool"]
        for judgement in one["mujoco"].values():
            judgement["checks"] = [check for check in judgement["checks"] if check["flipped"]]
    [counts], [pool] = result["tasks"].values(), result["pools"].values()
    return {"scenarios": result["scenarios"], "counts": counts, "control": pool["versions"]["mujoco"]}
