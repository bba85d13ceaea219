"""Processor time of certificates, by task and check: `scengen bench certify=true`."""

import time

from rich.table import Table

from .. import compose
from ..certificate import CHECKS
from ..samplers import task_files
from ..samplers.split import ID
from ..samplers.task import Task
from ..validate.certify import Trial
from ..validate.settings import QUICK

NEGLIGIBLE_COST = 0.05
"""Processor time below which a check is left out of the cost of a certificate [s]."""


def certificates() -> tuple[Table, dict[str, dict[str, float]]]:
    """Processor time of a quick certificate of every task's first training scenario, by check [s]."""
    costs = {name: _certificate(compose.load_task(name)) for name in task_files.tasks()}
    named = [check for check in CHECKS if any(check in cost for cost in costs.values())]
    table = Table("task", *named, "all", title="processor time of a certificate (s)", title_justify="left")
    for name, cost in costs.items():
        cells = (f"{cost[check]:.1f}" if check in cost else "" for check in named)
        table.add_row(name, *cells, f"{sum(cost.values()):.1f}")
    totals = [sum(cost.get(check, 0.0) for cost in costs.values()) for check in named]
    table.add_section()
    table.add_row("all", *(f"{total:.1f}" for total in totals), f"{sum(totals):.1f}")
    return table, costs


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
    return {name: seconds for name, seconds in cost.items() if seconds >= NEGLIGIBLE_COST}
