"""Processor time of certificates, by task and check: `scengen bench certify=true`."""

import time
from collections.abc import Mapping

from rich.table import Table

from .. import compose
from ..certificate import CHECKS
from ..samplers import task_files
from ..samplers.split import ID
from ..samplers.task import Task
from ..validate.certify import Trial
from ..validate.settings import QUICK

SMALL_SHARE = 0.04
"""Share of a certificate's cost below which a check is not named in the table."""


def certificates() -> tuple[Table, dict[str, dict[str, float]]]:
    """Processor time of a quick certificate of every task's first training scenario, by check [s]."""
    costs = {name: _certificate(compose.load_task(name)) for name in task_files.tasks()}
    return cost_table(costs), costs


def cost_table(costs: Mapping[str, Mapping[str, float]]) -> Table:
    """Processor time of certificates [s], times that of the oracle's rollout, and the checks that take most of it.

    Args:
        costs: processor time by task and check [s].
    """
    title = "processor time of a certificate (s), and over that of the oracle's rollout"
    table = Table("task", "all", "times", "checks", title=title, title_justify="left")
    totals = {check: sum(cost.get(check, 0.0) for cost in costs.values()) for check in CHECKS}
    for name, cost in {**costs, "all tasks": totals}.items():
        whole = sum(cost.values())
        most = sorted((check for check in cost if cost[check] >= SMALL_SHARE * whole), key=cost.__getitem__)
        times = f"{whole / cost['solved']:.1f}" if cost.get("solved") else ""
        told = ", ".join(f"{check} {cost[check]:.1f}" for check in reversed(most))
        table.add_row(name, f"{whole:.1f}", times, told, end_section=name == [*costs][-1])
    return table


def _certificate(task: Task) -> dict[str, float]:
    """Processor time of each check of the first training scenario [s]."""
    trial = Trial(task.draw(ID, 0, 0).scenario, task.horizon, QUICK, task.embodiment)
    cost = {}
    for name in CHECKS:
        begin = time.process_time()
        check = trial.check(name)
        cost[name] = time.process_time() - begin
        if check.passed is False:
            break
    return cost
