"""Measurements of sub-goals and questions: plans that are carried out, and answers that need no look."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count, islice
from typing import Any, ClassVar

from ..agents import execution, facts
from ..agents.order import Order
from ..agents.priors import answers, priors, share
from ..errors import BadConfig
from ..evidence.ledger import Evidence
from ..samplers.split import ID
from ..samplers.task import Task
from ..samplers.task_files import facts_file
from ..validate.rebuilt import world_of
from .measurement import Job, Measurement, Result, Row
from .scenarios import feasible

RIGHT = "right"
"""Kind of plan: the required sub-goals in a right order."""
OPTIONAL = "with optional ones"
"""Kind of plan: all sub-goals in a right order."""
MISSING = "missing"
"""Kind of plan: a required sub-goal is left out."""
ORDER = "wrong order"
"""Kind of plan: two neighbours that have an order are exchanged."""
WRONG = "wrong sub-goal"
"""Kind of plan: a wrong sub-goal ends it."""


@dataclass(frozen=True)
class Plans(Measurement):
    """Right and wrong plans of a task, carried out with moves for its sub-goals.

    The plan of facts/<task>.yaml is played in n feasible training scenarios, with and without its optional sub-goals.
    Wrong plans are played in the first `wrong` ones: with a required sub-goal missing, with two neighbours that have an
    order exchanged, and with a wrong sub-goal in place of all or in place of the second half. The last kind counts if
    the wrong sub-goal was started, because nothing is wrong if the goal is reached first. Tasks without moves for
    sub-goals are left out.
    """

    KIND = "plan"
    OPTIONS: ClassVar[Mapping[str, Any]] = {"n": 10, "wrong": 3}

    def all_splits(self, task: Task) -> Sequence[str]:
        return (ID,)

    def jobs(self, task: Task) -> Iterator[Job]:
        if not self.chosen(task) or not task.nominal.steps():
            return
        for kind, names, many in plans(facts.load(task, self.search).plan, self.options["n"], self.options["wrong"]):
            for index in range(many):
                yield Job(task, (ID,), {"plan": " ".join(names), "is": kind, "scenario": index})

    def result(self, job: Job) -> Result:
        task, names, kind = job.task, tuple(str(job.made_with["plan"]).split()), job.made_with["is"]
        index = job.made_with["scenario"]
        scenario = next(islice(feasible(task, ID, count()), index, None))
        order, world = facts.load(task, self.search).plan, world_of(scenario, task.embodiment)
        found = execution.execute(names, order, scenario, world, task.horizon)
        assert found
        began = sum(end != execution.NOT_BEGUN for _, end in found.steps)
        value = {"success": found.success, "reason": found.reason, "seconds": found.seconds, "began": began}
        return Result(job, [Row(ID, 1, value)], f"{kind}: {' '.join(names)}: {found.reason or 'success'}")


def plans(order: Order, n: int, wrong: int) -> Iterator[tuple[str, tuple[str, ...], int]]:
    """Kind of each plan, its sub-goals, and the number of scenarios in which it is played."""
    right = order.required
    yield RIGHT, right, n
    if len(right) < len(order.subgoals):
        yield OPTIONAL, tuple(order.subgoals), n
    for k, left_out in enumerate(right):
        yield MISSING, (*right[:k], *right[k + 1 :]), wrong
        if k and (right[k - 1], left_out) in order.before:
            yield ORDER, (*right[: k - 1], left_out, right[k - 1], *right[k + 1 :]), wrong
    for k in (0, len(right) // 2):
        for name in order.wrong:
            yield WRONG, (*right[:k], name), min(wrong, 1)


@dataclass(frozen=True)
class Priors(Measurement):
    """How often the best fixed answers of n training draws are right in n other ones.

    A model that sees nothing cannot do better. Each question whose answers differ in training is measured: its share of
    right answers in the draws that the answer is from, and in the others. Tasks without questions are left out.
    """

    KIND = "prior"
    OPTIONS: ClassVar[Mapping[str, Any]] = {"n": 300}
    SYSTEMATIC = 0.05
    """Largest excess of a share over that of the draws that the answer is from, beyond three standard errors."""

    def all_splits(self, task: Task) -> Sequence[str]:
        return (ID,)

    def answers(self, row: Evidence, job: Job) -> bool:
        return row.n >= self.options["n"]

    def jobs(self, task: Task) -> Iterator[Job]:
        return super().jobs(task) if facts_file(task.name, self.search) else iter(())

    def result(self, job: Job) -> Result:
        task, n = job.task, self.options["n"]
        sheet = facts.load(task, self.search)
        others = answers(task, sheet, n, seed=0)
        value = {
            id_: [round(prior.share, 3), round(share(prior.answer, others[id_], sheet.facts[id_].within), 3)]
            for id_, prior in priors(task, sheet, n).items()
            if prior.share < 1.0
        }
        if not value:
            raise BadConfig(f"{task.name} asks nothing whose answer differs in training")
        excess = max(here - prior for prior, here in value.values())
        return Result(job, [Row(ID, n, value)], f"{value}", excess <= most_excess(n))


def most_excess(n: int) -> float:
    """Largest excess of a share of n answers: five points, and three standard errors of a difference of two shares."""
    return Priors.SYSTEMATIC + 3.0 * (0.5 / n) ** 0.5
