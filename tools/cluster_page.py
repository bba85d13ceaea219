"""The table of costs in docs/cluster.md, from the ledger."""

from scengen import list_tasks
from scengen.evidence import ledger
from scengen.samplers.split import ID

HOUR, DAY = 3600.0, 86_400.0


def fills() -> dict[str, str]:
    """The table of docs/cluster.md."""
    return {"costs": table()}


def table() -> str:
    """Costs of pools of the training split, by task, as Markdown."""
    rows = {task: ledger.latest("certified", task).get(ID) for task in list_tasks()}
    each = {task: row.value["cpu"] for task, row in rows.items() if row}
    lines = [
        "| task | one [core s] | 10 thousand [core hours] | 1 million [core days] | 10 million [core days] |",
        "|---|---|---|---|---|",
        *(_line(f"[{task}](tasks/{task}.md)", cpu) for task, cpu in sorted(each.items(), key=lambda x: x[1])),
        *(
            f"| [{task}](tasks/{task}.md) | {ledger.not_measured(task)} | - | - | - |"
            for task in rows
            if task not in each
        ),
        *([_line("mean over measured tasks", sum(each.values()) / len(each))] if each else []),
    ]
    return "".join(f"{line}\n" for line in lines)


def _line(what: str, cpu: float) -> str:
    costs = (1e4 * cpu / HOUR, 1e6 * cpu / DAY, 1e7 * cpu / DAY)
    return f"| {what} | {cpu:.1f} | {' | '.join(f'{cost:.0f}' for cost in costs)} |"
