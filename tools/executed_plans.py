"""Carry out right and wrong plans of every task with moves for its sub-goals, and print what became of them.

    python tools/executed_plans.py [n=10] [wrong=3] [TASK ...]

The plan of conf/facts/<task>.yaml is played in n feasible training scenarios, with and without its optional sub-goals.
Wrong plans are played in the first ones: with a required sub-goal missing, with two neighbours that have an order
exchanged, and with a wrong sub-goal in place of all or in place of the second half. The last kind counts if the wrong
sub-goal was begun, because nothing is wrong where the goal is reached before it. Results are rows of records/plan; a
repeated call plays only what is missing there.
"""

import sys
from collections import defaultdict
from collections.abc import Iterator
from contextlib import suppress
from itertools import count, islice
from typing import Any

from scengen import list_tasks, load_task
from scengen.agents import execution, facts
from scengen.agents.order import Order
from scengen.errors import Infeasible
from scengen.evidence import measuring
from scengen.samplers.split import ID
from scengen.samplers.task import Task
from scengen.scenario import Scenario
from scengen.validate.rebuilt import world_of

RIGHT, OPTIONAL, MISSING, ORDER, WRONG = "right", "with optional ones", "missing", "wrong order", "wrong sub-goal"
SEED = 1
"""Seed of the draws, that of `tools/certified.py` for draws that only the oracle plays."""


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


def feasible(task: Task) -> Iterator[Scenario]:
    """Training scenarios that statics does not refute, as certification draws them."""
    for index in count():
        with suppress(Infeasible):
            yield task.draw(ID, SEED, index).scenario


def main(*arguments: str) -> None:
    """Play what is missing, and print the table."""
    numbers = {"n": 10, "wrong": 3} | {k: int(v) for k, v in (a.split("=") for a in arguments if "=" in a)}
    for name in [a for a in arguments if "=" not in a] or list_tasks():
        task = load_task(name)
        order = facts.load(task).plan
        if not task.nominal.steps():
            print(f"{name}: no steps")
            continue
        counts: dict[str, list[bool]] = defaultdict(list)
        scenarios = list(islice(feasible(task), numbers["n"]))
        for kind, names, many in plans(order, numbers["n"], numbers["wrong"]):
            for index, scenario in enumerate(scenarios[:many]):
                made_with = {"plan": " ".join(names), "is": kind, "scenario": index}
                row = measuring.measured(task, ID, "plan", made_with)
                if row is None:
                    value = played(task, order, names, scenario)
                    row = measuring.keep(task, ID, "plan", 1, value, made_with)
                    if value["success"] != (kind in (RIGHT, OPTIONAL)):
                        print(f"  {name}@{index} {kind}: {' '.join(names)}: {value['reason'] or 'success'}", flush=True)
                if kind != WRONG or row.value["began"] == len(names):  # else the goal was reached before it
                    counts[kind].append(row.value["success"])
        told = ", ".join(f"{kind} {sum(found)}/{len(found)}" for kind, found in counts.items())
        print(f"{name}: reached the goal: {told}", flush=True)


def played(task: Task, order: Order, names: tuple[str, ...], scenario: Scenario) -> dict[str, Any]:
    """What became of a plan in a scenario."""
    found = execution.execute(names, order, scenario, world_of(scenario, task.embodiment), task.horizon)
    assert found
    began = sum(end != execution.NOT_BEGUN for _, end in found.steps)
    return {"success": found.success, "reason": found.reason, "seconds": found.seconds, "began": began}


if __name__ == "__main__":
    main(*sys.argv[1:])
