"""Writes the table of costs in docs/cluster.md from the ledger. `make docs`"""

import re
from pathlib import Path

from scengen import list_tasks
from scengen.evidence import ledger
from scengen.samplers.split import ID

PAGE = Path(__file__).parent.parent / "docs" / "cluster.md"
BEGIN, END = "<!-- costs: tools/cluster_page.py -->\n", "<!-- end of costs -->\n"
HOUR, DAY = 3600.0, 86_400.0


def page() -> str:
    """The page with its table up to date."""
    return re.sub(f"{BEGIN}.*{END}", lambda _: f"{BEGIN}{table()}{END}", PAGE.read_text(), flags=re.S)


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


if __name__ == "__main__":
    PAGE.write_text(page())
    print(f"wrote {PAGE}")
