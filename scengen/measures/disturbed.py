"""Measurement of small policies whose readings are disturbed."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from ..learn.models import BC
from ..perturb.effects import OBJECTS, PROPRIOCEPTION
from ..perturb.kinds import kinds
from ..perturb.perturbation import NONE
from ..samplers.split import ID
from ..samplers.task import Task
from .measurement import Job, Result, Row
from .policies import RECORDING, SCENARIOS, OfPolicies, outcomes

LEVELS = (1, 3, 5)
"""Levels of perturbations that are tried."""


def conditions() -> list[str]:
    """Perturbations of what a policy of poses reads."""
    read = [name for name, kind in kinds().items() if kind.effect.reads in (PROPRIOCEPTION, OBJECTS)]
    return [f"{name}@{level}" for name in read for level in LEVELS]


@dataclass(frozen=True)
class Disturbed(OfPolicies):
    """The baseline `bc` in training under perturbations of the readings, and the clean run on the same scenarios.

    It is trained on 200 demonstrations that are apart from these scenarios.
    """

    KIND = "disturbed"
    COMMANDS = True
    FOLDER = "generated/disturbed"

    def all_splits(self, task: Task) -> Sequence[str]:
        return (ID,)

    def jobs(self, task: Task) -> Iterator[Job]:
        if self.chosen(task):
            yield Job(task, (ID,), {"policy": BC, "conditions": conditions()})

    def result(self, job: Job) -> Result:
        task, asked = job.task, job.made_with["conditions"]
        folder, pool = self.made(task), self.pools(task, (ID,))[ID]
        self.record(task, folder / RECORDING, "demos", (pool,))
        self.finish("train", f"policy={BC}", "seed=0", f"data={folder / RECORDING}", f"to={folder / BC}")
        own = (f"perturb=[{','.join(asked)}]", "arms=none")
        episodes = self.play(str(folder / BC), {ID: pool}, folder / f"{BC}-{self.KIND}", *own)[ID]
        value: dict[str, Any] = {}
        for condition in (NONE, *asked):
            played = outcomes([one for one in episodes if one["perturbation"] == condition], pool)
            value[condition] = {"solved": sum(success for _, success in played), "outcomes": played}
        words = ", ".join(f"{own['solved']} under {condition}" for condition, own in value.items())
        return Result(job, [Row(ID, SCENARIOS, value)], f"{BC} solves, of {SCENARIOS}: {words}")
