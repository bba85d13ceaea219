"""The card of every axis of every task, and the tables of docs/axes.md. `python tools/all_axes.py n=50 [task]`

Cards are stored in generated/axes, and what the page shows of them in records/axis. A repeated call continues. `make
docs` takes the tables from the ledger: these rows, and those of tools/certified.py, tools/beliefs.py and
tools/baselines.py.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any

import axis_records
import predictors

from scengen import cli, list_tasks, load_task
from scengen.evaluate.statistics import Rate
from scengen.evidence import ledger
from scengen.evidence.ledger import Evidence
from scengen.ood.analysis.distance import Energy
from scengen.ood.baseline import BELIEF, INCONCLUSIVE, LEARNERS, MOTION, OBJECT_CENTRIC, Baseline, verdict
from scengen.ood.behaviour import HELD_OUT
from scengen.ood.belief import moves_hidden
from scengen.samplers import task_files
from scengen.samplers.split import ID
from scengen.samplers.task import Task
from scengen.validate.certify import lower_bound

CERTIFIED = ("certified", "oracle", "robosuite")
"""Titles of the figures of certification."""
BASELINES = (*MOTION, *OBJECT_CENTRIC, *BELIEF)
"""Baselines that have a separate column."""
TITLES = [name.replace("object_centric", "object-centric").replace("_", " ") for name in BASELINES]
"""Titles of their columns."""
COLUMNS = (
    "task",
    "axis",
    "outside",
    "physics",
    *CERTIFIED,
    "verdict",
    *TITLES,
    "learner",
    "replay ends",
    "oracle ends",
    "energy",
)
"""Titles of the table of axes."""
N = "50"
"""Default number of twins of a card."""


def main(*arguments: str) -> None:
    """Make all cards, or those of some tasks."""
    given = dict(argument.split("=", 1) for argument in arguments if "=" in argument)
    settings = [f"{name}={value}" for name, value in ({"n": N, "workers": "2"} | given).items()]
    tasks = [argument for argument in arguments if "=" not in argument]
    failed = []
    for task in map(load_task, tasks or list_tasks()):
        for axis in task.axes:
            if cli.run(("probe", f"task={task.name}", f"axis={axis}", *settings)):
                failed.append(f"{task.name}/{axis}")
            else:
                axis_records.store_card(task, axis, int(given.get("n", N)))
    sys.exit(f"no card of {', '.join(failed)}" if failed else 0)


def fills() -> dict[str, str]:
    """The tables of docs/axes.md."""
    certified = {task: ledger.latest("certified", task) for task in list_tasks()}
    rows = _axes(list_tasks())
    training = [
        [f"[{task}](tasks/{task}.md)", *certification(task, found.get(ID)), _cpu(task, found.get(ID))]
        for task, found in certified.items()
    ]
    rejected = [
        f"* {task}, {split}: {times} {reason}"
        for task, found in certified.items()
        for split in task_files.splits(task)
        if split in found
        for reason, times in found[split].value.get("lost", {}).items()
    ]
    return {
        "training": _table(("task", *CERTIFIED, "CPU s"), training),
        "predicted": predictors.sentence(),
        "verdicts": _verdicts(rows),
        "axes": _table(COLUMNS, [[f"[{row[0]}](tasks/{row[0]}.md#{row[1]})", *row[1:]] for row in rows]),
        "rejected": "\n".join(rejected),
    }


def of_task(task: str) -> dict[str, dict[str, str]]:
    """The cells of the axes of a task by title."""
    return {row[1]: dict(zip(COLUMNS[2:], row[2:], strict=True)) for row in _axes([task])}


def _axes(tasks: Iterable[str]) -> list[list[str]]:
    """The cells of each axis of some tasks, in the order of the task files."""
    return [row for task in tasks for row in _rows(task)]


@cache
def _rows(name: str) -> list[list[str]]:
    """The cells of each axis of a task."""
    task = load_task(name)
    certified, cards, found = ledger.latest("certified", name), axis_records.cards(task), axis_records.baselines(task)
    return [_row(task, axis, cards.get(axis), found[axis], certified.get(axis)) for axis in task.axes]


def _verdicts(rows: Sequence[Sequence[str]]) -> str:
    """How many axes have each kind of verdict, as text."""
    words = [row[COLUMNS.index("verdict")] for row in rows]
    broken, solved, missing = (sum(word.startswith(start) for word in words) for start in ("breaks", "solved", "not "))
    return (
        f"Of {len(words)} axes, {broken} break what was right in training, {solved} are solved by it, "
        f"{words.count(INCONCLUSIVE)} are inconclusive, and {missing} were not measured."
    )


def _row(
    task: Task,
    axis: str,
    card: Mapping[str, Any] | None,
    found: Mapping[str, Baseline],
    certified: Evidence | None,
) -> list[str]:
    """The cells of an axis."""
    none = ledger.not_measured(task.name)
    outside, physics, replay_ends, oracle_ends, energy = [none] * 5
    if card:
        outside = "another value" if card["outside"] is None else f"{card['outside']:.2g}"
        physics = ", ".join(card["leaving"]) or "stays"
        replay_ends, oracle_ends, energy = *card["boundaries"].values(), str(Energy(**card["energy"]))
    cells = [_baseline(found[name]) if name in found else none for name in BASELINES]
    if not moves_hidden(task, axis):
        cells[BASELINES.index("hidden_belief")] = "nothing hidden"
    judged = verdict(found.values()) if found else none
    return [
        *(task.name, axis, outside, physics, *certification(task.name, certified), judged, *cells),
        *(_learner(task.name, found), replay_ends, oracle_ends, energy),
    ]


def _learner(task: str, found: Mapping[str, Baseline]) -> str:
    """The cell of the learner that solves most in training; of two, that with the first name in `LEARNERS`."""
    tried = [found[name] for name in LEARNERS if name in found]
    best = max(tried, key=lambda one: one.training.value if one.training else 0.0, default=None)
    return f"{best.name}: {_baseline(best)}" if best else predictors.cell(task, found)


def certification(task: str, row: Evidence | None) -> list[str]:
    """The figures of certification of a split. Earlier rows have no draws for the oracle, or no replays."""
    if row is None:
        return [ledger.not_measured(task)] * len(CERTIFIED)
    found, oracle, same = row.value, "-", "-"
    if "draws" in found:
        oracle = f"{found['solved']} of {found['draws']} (> {100 * lower_bound(found['solved'], found['draws']):.0f}%)"
    if found.get("replays"):
        same = f"{found['same']} of {found['replays']}"
    return [f"{found['certified']} of {found['indices']}", oracle, same]


def _cpu(task: str, row: Evidence | None) -> str:
    return f"{row.value['cpu']:.1f}" if row else ledger.not_measured(task)


def _table(titles: Sequence[str], rows: Iterable[Iterable[str]]) -> str:
    lines = (titles, ["---"] * len(titles), *rows)
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def _baseline(baseline: Baseline) -> str:
    if not (baseline.training and baseline.here and baseline.excess):
        return baseline.finding
    training, here, lost = baseline.training, baseline.here, baseline.excess
    marks = [
        "weak" if baseline.finding == "too weak" else "",
        f"{_count(training)} → {_count(here)} of {here.rollouts}",
        f"{lost.value:+.2f} [{lost.low:.2f}, {lost.high:.2f}]",
        "held out" if baseline.control == HELD_OUT and not baseline.name.startswith("any") else "",
        "" if lost.twins else "unpaired",
    ]
    return ", ".join(filter(None, marks))


def _count(rate: Rate) -> int:
    """Number of solved episodes: one for each scenario, or one for each of a learner's trainings."""
    return round(rate.value * rate.rollouts)


if __name__ == "__main__":  # worker processes import this file again
    main(*sys.argv[1:])
