"""The card of every axis of every task, and docs/axes.md with a line for each. `python tools/all_axes.py n=50 [task]`

Cards are stored in generated/axes, and what the page shows of them in records/axis. A repeated call continues. `python
tools/all_axes.py page` only writes the page, from the ledger: these rows, and those of tools/certified.py,
tools/beliefs.py and tools/baselines.py.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
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

PAGE = Path(__file__).parent.parent / "docs" / "axes.md"
HEAD = """# Every split, measured

Written by `make axes` and `make docs`. Figures count for the version of a task that they were measured on. *Not
measured on version N* says that there are none yet for the task as it is. The figures of certification are measured by
`tools/certified.py`:

* **certified**: scenarios certified at level `quick`, of the first draws. The rejected ones are listed at the end.
* **oracle**: other draws that the oracle solves without jitter, and the one-sided 95 % Clopper-Pearson bound of its
  success rate.
* **robosuite**: witnesses with the same verdict in robosuite, of those replayed there.
* **CPU s**: CPU time per certified scenario, rejected draws included, with all cores of the machine busy.

## Training

{training}
## Axes

Each line summarizes one axis card (`scengen axis card`) and what else was tried on the axis; each column states its
sample size. {verdicts}

* **outside**: smallest gap between axis and training over the moved parameters [widths of the training range].
  **physics**: features declared by the family that leave training (sampled, 300 draws).
* **verdict**: what the axis breaks of what was right in training, among what was measured: *motion memory* (replay, any
  replay), *object-centric memory*, *belief*, *learner*; the strongest kind of memory stands for both. *solved by* the
  first kind that solves most of the axis, if it breaks none; or *inconclusive*. The columns after it show, for each
  baseline, how many of its control scenarios within training and how many OOD twins it solves, and the excess with its
  95 % interval. Only twins count that the oracle solves in both arms. `weak`: the baseline solves less than 30 % of its
  control, and is inconclusive.
  * **replay**: the actions that solve the training twin. **object-centric**: its path relative to the bodies that the
    hand goes to, followed by feedback. **any**: one of 16 training solutions, none of them the twin's own. The control
    is the remembered scenario with the axis' own parameters redrawn within training. For **any**, and if training has
    one value only (marked *held out*), it is a training scenario that no memory comes from.
  * **belief**: the oracle of the training twin plays in the OOD twin, with all its feedback, and believes all
    parameters that the axis moves to be as in training. **hidden belief**: it believes only the hidden ones, if the
    axis moves any. The control is that of the replay; a value that is constant in training is believed rightly there.
    **nearest belief**: it sees the moved parameters, and takes each for the nearest value of training, and an unseen
    word for one of training.
  * **learner**: of the policies trained on 200 demonstrations ([baselines](baselines.md)), the one that solves most of
    its 20 training scenarios, over all its trainings. Its excess is paired by twins, or marked *unpaired*. {predicted}
  *solved by motion memory* or *object-centric memory*: only vision can be tested there, if anything. In a task with a
  choice (`domino_select`) the memory of the twin contains the answer: an axis that makes the choice harder to see
  cannot break it. Use `scengen evaluate` to measure whether a policy still chooses correctly.
* **replay ends**, **oracle ends**: the first point of the path at which half of the twins or fewer are solved; 0 is
  the edge of training, 1 the far end of the axis. The 95 % interval in brackets assumes no curve; the point before it
  is a guess. `> x`: not before x; if x is the end of the path, with the number of twins solved there. `< 0`: the replay
  fails as soon as its scene's own value is exchanged for the nearest end of training. Holes shorter than a tenth of the
  axis, and beyond 1 shorter than half their distance from 0, may be missed.
* **energy**: energy distance between the features of the twins [training ranges], its value by chance, and the p value
  of a test that exchanges twins; `equal` if the axis moves no feature.

{axes}
## Rejected draws

{lost}
"""
"""The page, with places for its tables."""
CERTIFIED = ("certified", "oracle", "robosuite")
"""Titles of the figures of certification."""
BASELINES = (*MOTION, *OBJECT_CENTRIC, *BELIEF)
"""Baselines that have a column of their own."""
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
    """Make all cards, or those of some tasks, and write the page."""
    if arguments == ("page",):
        PAGE.write_text(page())
        return
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
    PAGE.write_text(page())
    sys.exit(f"no card of {', '.join(failed)}" if failed else 0)


def page() -> str:
    """The whole page."""
    certified = {task: ledger.latest("certified", task) for task in list_tasks()}
    rows = _axes(certified)
    training = [
        [f"[{task}](tasks/{task}.md)", *_certification(task, found.get(ID)), _cpu(task, found.get(ID))]
        for task, found in certified.items()
    ]
    lost = [
        f"* {task}, {split}: {times} {reason}"
        for task, found in certified.items()
        for split in task_files.splits(task)
        if split in found
        for reason, times in found[split].value.get("lost", {}).items()
    ]
    return HEAD.format(
        training=_table(("task", *CERTIFIED, "CPU s"), training),
        predicted=predictors.sentence(),
        verdicts=_verdicts(rows),
        axes=_table(COLUMNS, rows),
        lost="\n".join(lost),
    )


def _axes(certified: Mapping[str, Mapping[str, Evidence]]) -> list[list[str]]:
    """The cells of each axis, in the order of the task files."""
    rows = []
    for task in map(load_task, list_tasks()):
        cards, found = axis_records.cards(task), axis_records.baselines(task)
        rows += [_row(task, axis, cards.get(axis), found[axis], certified[task.name].get(axis)) for axis in task.axes]
    return rows


def _verdicts(rows: Sequence[Sequence[str]]) -> str:
    """How many axes have each kind of verdict, in words."""
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
        *(task.name, axis, outside, physics, *_certification(task.name, certified), judged, *cells),
        *(_learner(task.name, found), replay_ends, oracle_ends, energy),
    ]


def _learner(task: str, found: Mapping[str, Baseline]) -> str:
    """The cell of the learner that solves most in training; of two, that with the first name in `LEARNERS`."""
    tried = [found[name] for name in LEARNERS if name in found]
    best = max(tried, key=lambda one: one.training.value if one.training else 0.0, default=None)
    return f"{best.name}: {_baseline(best)}" if best else predictors.cell(task, found)


def _certification(task: str, row: Evidence | None) -> list[str]:
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
