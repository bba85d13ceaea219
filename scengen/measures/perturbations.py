"""Measurement of perturbations: the proofs of every kind and level on scenarios of each task."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import count, islice
from typing import Any, ClassVar

import numpy as np

from ..errors import UnknownName
from ..look.looks import ROOM
from ..params import parameters
from ..perturb.effects import LANGUAGE
from ..perturb.kinds import LEVELS, Kind, kinds, perceived
from ..perturb.language import Words
from ..samplers.split import ID
from ..samplers.task import Task
from ..validate.rebuilt import rebuild, world_of
from ..validate.rollout import run
from .measurement import Job, Measurement, Result, Row
from .proofs import Proof, Stage, faults_of_draws
from .scenarios import feasible

ORDERED = 0.95
"""Least share of the scenarios in which a level changes more than the level before."""


@dataclass(frozen=True)
class Proofs(Measurement):
    """Proofs of all kinds of perturbation at all levels on the first n training scenarios that the oracle solves.

    A cell, a kind at a level, passes if in each scenario the physics is the same to the bit, each camera and stream
    that it affects differs, each body that clean pictures show stays in sight, and the level before changes less. Of
    the changes of pictures the unit is that of `distance`. With `kinds` only these are proved, and nothing is stored.
    """

    KIND = "perturb"
    OPTIONS: ClassVar[Mapping[str, Any]] = {"n": 1, "kinds": None}

    def all_splits(self, task: Task) -> Sequence[str]:
        return (ID,)

    def jobs(self, task: Task) -> Iterator[Job]:
        if self.chosen(task):
            strengths = {name: list(kind.strengths) for name, kind in self._wanted().items()}
            yield Job(task, (ID,), {"n": self.options["n"], "strengths": strengths, "look": str(ROOM)})

    def _wanted(self) -> Mapping[str, Kind]:
        """The kinds to prove.

        Raises:
            UnknownName: a requested kind changes nothing that is perceived, or does not exist.
        """
        every, chosen = perceived(), self.options.get("kinds")
        names = [*every] if chosen is None else [chosen] if isinstance(chosen, str) else chosen
        for name in names:
            if name not in every:
                raise UnknownName("kind that changes what is perceived", name, every)
        return {name: every[name] for name in names}

    def result(self, job: Job) -> Result:
        task = job.task
        words = Words.of(task.name, task.instruction, self.search)
        secrets = [*task.axes, *kinds(), *(p.name for p in parameters(task.family()) if p.hidden)]
        cells: dict[tuple[str, int], list[Proof]] = {}
        for scenario in islice(feasible(task, ID, count()), self.options["n"]):
            played = run(scenario, world_of(scenario, task.embodiment), scenario.oracle, task.horizon)
            made = scenario, rebuild(scenario), task.embodiment, played.actions, words, secrets
            with closing(Stage(*made)) as stage:
                for kind in (k for k in self._wanted().values() if not k.lacks(words)):
                    for level in range(1, LEVELS + 1):
                        cells.setdefault((kind.name, level), []).append(stage.proof(kind, level))
        faults = {
            f"{name}@{level}": sorted({fault for proof in proofs for fault in proof.faults()})
            for (name, level), proofs in cells.items()
        }
        for name in {name for name, _ in cells}:
            faults[f"{name}@1"] += faults_of_draws(kinds()[name])
        changes = {f"{name}@{level}": _mean(proofs) for (name, level), proofs in cells.items()}
        for name, level in cells:
            if level > 1 and kinds()[name].effect.reads != LANGUAGE:
                pairs = zip(cells[name, level], cells[name, level - 1], strict=True)
                if (ordered := np.mean([_mean([one]) > _mean([other]) for one, other in pairs])) < ORDERED:
                    faults[f"{name}@{level}"].append(f"it changes more than level {level - 1} in {ordered:.0%} only")
        value = {"faults": {cell: told for cell, told in faults.items() if told}, "changes": changes}
        words = f"{len(cells) - len(value['faults'])} of {len(cells)} cells are proved"
        words += "".join(f"\n{cell} is not: {'; '.join(told)}" for cell, told in value["faults"].items())
        rows = [Row(ID, self.options["n"], value)] if self.options.get("kinds") is None else []
        return Result(job, rows, words, not value["faults"])


def _mean(proofs: Sequence[Proof]) -> float:
    """Mean change over scenarios, cameras and streams."""
    return round(float(np.mean([change for proof in proofs for change in proof.changes.values()] or [0.0])), 5)
