"""Writes docs/results.md, the headline figures of all tasks, from the ledger: `python tools/results.py`"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import all_axes
import attack_all
import baselines_page
import numpy as np

from scengen import list_tasks, load_task
from scengen.attack.evidence import TierRate
from scengen.evidence import ledger
from scengen.evidence.ledger import Evidence
from scengen.samplers.split import ID
from scengen.samplers.task import Task

PAGE = Path(__file__).parents[1] / "docs" / "results.md"
HEAD = """# Results

<!-- Written by tools/results.py; `make results` -->

One line for each task, on its version of today. *-* says that this version was not measured. The name of a task leads
to its page in the built documentation (`make docs`), and on GitHub to its picture.

* **ID**, **axes**: scenarios certified at level `quick`, of the draws tried in training and on all axes together.
* **broken**: axes that break what was right in training, of the axes measured ([every split, measured](axes.md)).
* **policy**: percent of the scenarios that the best trained policy solves in training, and after the arrow on average
  over the axes ([baselines](baselines.md)).
* **ways around**: hits of the adversary that bypass the task, of its rollouts, and the one-sided 95 % bound of their
  rate ([attacks](attacks.md)).
* **core s**: processor time of one certified training scenario ([cost of pools](cluster.md#cost)).

"""
COLUMNS = ("task", "code", "version", "ID", "axes", "broken", "policy", "ways around", "core s")
"""Titles of the table."""
NONE = "-"
"""Cell of a figure that was not measured."""


def main() -> None:
    """Write the page."""
    PAGE.write_text(page())
    print(f"wrote {PAGE.name}")


def page() -> str:
    """The page, Markdown."""
    tasks = sorted(map(load_task, list_tasks()), key=lambda task: ("TMX".index(task.code[0]), task.code))
    lines = [COLUMNS, ["---"] * len(COLUMNS), *map(cells, tasks), list(_total(tasks))]
    return HEAD + "".join(f"| {' | '.join(line)} |\n" for line in lines)


def cells(task: Task) -> list[str]:
    """The line of a task."""
    found = ledger.latest("certified", task.name)
    own = found.get(ID)
    return [
        f"[{task.name}](tasks/{task.name}.jpg)",
        task.code,
        str(task.version),
        certified([own] if own else []),
        certified([row for split, row in found.items() if split in task.axes]),
        broken([task]),
        policy(task),
        ways_around([attack] if (attack := attack_all.reports().get(task.name)) else []),
        f"{own.value['cpu']:.1f}" if own else NONE,
    ]


def certified(rows: Sequence[Evidence]) -> str:
    """Scenarios certified of the draws tried."""
    tried = sum(row.value["indices"] for row in rows)
    return f"{sum(row.value['certified'] for row in rows)} of {tried}" if tried else NONE


def broken(tasks: Sequence[Task]) -> str:
    """Axes that break, of the measured ones."""
    verdicts = [cells["verdict"] for task in tasks for cells in all_axes.of_task(task.name).values()]
    measured = [verdict for verdict in verdicts if not verdict.startswith("not ")]
    told = f"{sum(verdict.startswith('breaks') for verdict in measured)} of {len(measured)}"
    return told if len(measured) == len(verdicts) else f"{told} measured of {len(verdicts)}"


def policy(task: Task) -> str:
    """The policy that solves most training scenarios, among those that learn."""
    means = {name: rates for name, rates in baselines_page.means(task.name).items() if name in baselines_page.POLICIES}
    if not means:
        return NONE
    best = max(means, key=lambda name: means[name])
    return f"{best} {means[best][0]:.0f} → {means[best][1]:.0f}"


def ways_around(reports: Sequence[Mapping[str, Any]]) -> str:
    """Hits that bypass a task, of the rollouts."""
    rollouts, hits = sum(one["rollouts"] for one in reports), sum(len(one["hits"]) for one in reports)
    return f"{hits} of {rollouts} (< {TierRate('', False, rollouts, hits).bound:.2%})" if rollouts else NONE


def _total(tasks: Sequence[Task]) -> Iterator[str]:
    """The line of all tasks."""
    found = [ledger.latest("certified", task.name) for task in tasks]
    own = [rows[ID] for rows in found if ID in rows]
    yield from (f"**{len(tasks)} tasks**", "", "")
    yield certified(own)
    yield certified([row for rows, task in zip(found, tasks, strict=True) for s, row in rows.items() if s in task.axes])
    yield broken(tasks)
    yield ""
    yield ways_around([*attack_all.reports().values()])
    yield f"{np.mean([row.value['cpu'] for row in own]):.1f}"


if __name__ == "__main__":
    main()
