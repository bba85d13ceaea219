"""Measurements of the built-in adversary: attacks on tasks, and hidden parameters in observations."""

import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from ..attack.adversary import TIERS
from ..attack.campaign import GRAMMAR
from ..episode import PAPER, STRICT, check_rules
from ..errors import ScengenError
from ..evidence.ledger import Evidence
from ..ood.analysis.leaks import SEARCH, leaks
from ..samplers.split import ID
from ..samplers.task import Task
from .measurement import Job, Measurement, Result, Row

SEED = 4242
"""Seed of the draws and of everything random."""


@dataclass(frozen=True)
class _Searches(Measurement):
    """A search whose number of scenarios is that of its row."""

    def answers(self, row: Evidence, job: Job) -> bool:
        return row.made_with == job.made_with and row.n >= self.options["n"]


@dataclass(frozen=True)
class Attacks(_Searches):
    """Attacks on n training scenarios of a task with `budget` rollouts, as by `scengen attack`.

    With `rules=paper` a goal counts however it is reached: hits then show what the paper's rules admit. Tasks without
    means are the same under both and are left out.
    """

    KIND = "attack"
    OPTIONS: ClassVar[Mapping[str, Any]] = {"n": 10, "budget": 500, "rules": STRICT}
    COMMANDS = True
    FOLDER = "generated/attack"

    def all_splits(self, task: Task) -> Sequence[str]:
        return (ID,)

    def jobs(self, task: Task) -> Iterator[Job]:
        rules = check_rules(self.options["rules"])
        if self.chosen(task) and (rules == STRICT or task.nominal.means()):
            made_with = {"grammar": GRAMMAR, "rules": rules, "budget": self.options["budget"], "seed": SEED}
            yield Job(task, (ID,), made_with)

    def result(self, job: Job) -> Result:
        task, rules = job.task, self.options["rules"]
        folder = self.folder / ("paper" if rules == PAPER else "") / f"{task.name}-v{task.version}"
        tiers = f"tiers=[{','.join(TIERS)}]"  # without leaks, a kind of its own
        numbers = (f"n={self.options['n']}", f"budget={self.options['budget']}", f"seed={SEED}", f"rules={rules}")
        with tempfile.TemporaryDirectory() as temporary:
            target = Path(temporary) / "report.json"
            argv = (f"task={task.name}", *numbers, tiers, f"workers={self.workers}", f"to={folder}")
            self.run("attack", *argv, f"json={target}")
            if not target.is_file():
                raise ScengenError(f"{task.name} was not attacked")
            report = json.loads(target.read_text())
        value = {name: report[name] for name in ("lost", "not_tried", "priors", "rates", "rollouts")}
        value["hits"] = [hit for hit in report["hits"] if hit["refutes"]]
        value["cpu"] = _cpu(folder / "attack.jsonl")
        refuted = bool(report["lost"]) or (bool(value["hits"]) and rules == STRICT)
        words = f"{report['rollouts']} rollouts, {len(value['hits'])} ways around, {len(report['lost'])} lost"
        return Result(job, [Row(ID, len(report["scenarios"]), value)], words, not refuted)


@dataclass(frozen=True)
class LeakSearches(_Searches):
    """Search of the observations of n draws for hidden parameters. Tasks without a hidden parameter are left out."""

    KIND = "leak"
    OPTIONS: ClassVar[Mapping[str, Any]] = {"n": 200}

    def jobs(self, task: Task) -> Iterator[Job]:
        if any(parameter.hidden for parameter in task.known.values()):
            for split in self.chosen(task):
                yield Job(task, (split,), {"search": SEARCH, "seed": SEED})

    def result(self, job: Job) -> Result:
        [split] = job.splits
        found = asdict(leaks(job.task, split, self.options["n"], SEED))
        value = {name: found[name] for name in ("hidden", "found")}
        words = f"{len(value['hidden'])} hidden parameters, observations reveal {len(value['found'])}"
        return Result(job, [Row(split, found["draws"], value)], words)


def _cpu(log: Path) -> float:
    """Processor time of the rollouts of an attack [s], from its log."""
    return round(sum(json.loads(line).get("cpu", 0.0) for line in log.read_text().splitlines()), 1)
