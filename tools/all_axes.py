"""The card of every axis of every task, and docs/axes.md with a line for each. `python tools/all_axes.py n=50 [task]`

Cards are stored in generated/axes, and what the page shows of them in records/axes. A repeated call continues. `python
tools/all_axes.py page` only writes the page: from these records, those of tools/beliefs.py and of tools/baselines.py,
and from conf/certified.yaml.
"""

import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import axis_records
import predictors

from scengen import cli, list_tasks, load_task, task_files
from scengen.analysis.distance import Energy
from scengen.ood.baseline import BELIEF, INCONCLUSIVE, LEARNERS, MOTION, OBJECT_CENTRIC, Baseline, verdict
from scengen.ood.behaviour import HELD_OUT
from scengen.ood.belief import moves_hidden
from scengen.samplers.task import Task
from scengen.statistics import Rate
from scengen.validate.certify import lower_bound

PAGE = Path(__file__).parent.parent / "docs" / "axes.md"
HEAD = """# Every split, measured

Written by `make axes` and `make docs`. The figures of certification are those of conf/certified.yaml, which
`tools/certified.py` measures:

* **certified**: scenarios certified at level `quick`, of the first draws. The rejected ones are listed at the end.
* **oracle**: other draws that the oracle solves without jitter, and the one-sided 95 % Clopper-Pearson bound of its
  success rate.
* **robosuite**: witnesses with the same verdict in robosuite, of those replayed there.
* **CPU s**: CPU time per certified scenario, rejected draws included, with all cores of the machine busy.

## Training

{training}
## Axes

Each line summarizes one axis card (`scengen probe`) and what else was tried on the axis; each column states its sample
size. {verdicts}

* **outside**: smallest gap between axis and training over the moved parameters [widths of the training range].
  **physics**: features declared by the family that leave training (sampled, 300 draws).
* **verdict**: what the axis breaks of what was right in training: *motion memory* (replay, any replay),
  *object-centric memory*, *belief*, *learner*; the strongest kind of memory stands for both. *solved by* the first kind
  that solves most of the axis, if it breaks none; or *inconclusive*. The columns after it show, for each baseline, how
  many of its control scenarios within training and how many OOD twins it solves, and the excess with its 95 % interval.
  Only twins count that the oracle solves in both arms. `weak`: the baseline solves less than 30 % of its control, and
  is inconclusive. *not measured* says that nobody has tried it yet, *no card* the same of a whole card.
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
NO_CARD = "no card"
"""Cell of an axis without a card."""
NOT_MEASURED = "not measured"
"""Cell of a figure that was not measured."""


def main(*arguments: str) -> None:
    """Make all cards, or those of some tasks, and write the page."""
    if arguments == ("page",):
        PAGE.write_text(page())
        return
    settings = [argument for argument in arguments if "=" in argument]
    tasks = [argument for argument in arguments if "=" not in argument]
    failed = []
    for task in tasks or list_tasks():
        for axis in load_task(task).axes:
            if cli.run(("probe", f"task={task}", f"axis={axis}", "workers=2", *settings)):
                failed.append(f"{task}/{axis}")
            else:
                axis_records.store_card(load_task(task), axis)
    PAGE.write_text(page())
    sys.exit(f"no card of {', '.join(failed)}" if failed else 0)


def page() -> str:
    """The whole page."""
    told = task_files.certified()
    rows = _axes(told)
    training = [
        [f"[{task}](tasks/{task}.md)", *_certification(found), f"{found['cpu']:.1f}" if found else NOT_MEASURED]
        for task in list_tasks()
        for found in [told.get(task, {}).get(task_files.ID, {})]
    ]
    lost = [
        f"* {task}, {split}: {times} {reason}"
        for task in list_tasks()
        for split, found in told.get(task, {}).items()
        for reason, times in found.get("lost", {}).items()
    ]
    return HEAD.format(
        training=_table(("task", *CERTIFIED, "CPU s"), training),
        predicted=predictors.sentence(),
        verdicts=_verdicts(rows),
        axes=_table(COLUMNS, rows),
        lost="\n".join(lost),
    )


def _axes(told: Mapping[str, Mapping[str, Any]]) -> list[list[str]]:
    """The cells of each axis, in the order of the task files."""
    rows = []
    for task in map(load_task, list_tasks()):
        cards, found = axis_records.read(axis_records.CARDS, task), axis_records.baselines(task)
        for axis in task.axes:
            rows.append(_row(task, axis, cards.get(axis), found[axis], told.get(task.name, {}).get(axis, {})))
    return rows


def _verdicts(rows: Sequence[Sequence[str]]) -> str:
    """How many axes have each kind of verdict, in words."""
    words = [row[COLUMNS.index("verdict")] for row in rows]
    broken, solved = (sum(word.startswith(start) for word in words) for start in ("breaks", "solved"))
    return (
        f"Of {len(words)} axes, {broken} break what was right in training, {solved} are solved by it, "
        f"{words.count(INCONCLUSIVE)} are inconclusive, and {words.count(NOT_MEASURED)} were not measured."
    )


def _row(
    task: Task,
    axis: str,
    card: Mapping[str, Any] | None,
    found: Mapping[str, Baseline],
    certified: Mapping[str, Any],
) -> list[str]:
    """The cells of an axis."""
    outside, physics, replay_ends, oracle_ends, energy = [NO_CARD] * 5
    if card:
        outside = "another value" if card["outside"] is None else f"{card['outside']:.2g}"
        physics = ", ".join(card["leaving"]) or "stays"
        replay_ends, oracle_ends, energy = *card["boundaries"].values(), str(Energy(**card["energy"]))
    missing = {name: NO_CARD for name in (*MOTION, *OBJECT_CENTRIC) if not card}
    if not moves_hidden(task, axis):
        missing["hidden_belief"] = "nothing hidden"
    cells = [_baseline(found[name]) if name in found else NOT_MEASURED for name in BASELINES]
    cells = [missing.get(name, cell) for name, cell in zip(BASELINES, cells, strict=True)]
    judged = verdict(found.values()) if found else NOT_MEASURED
    learner = _learner(found)
    return [
        *(task.name, axis, outside, physics, *_certification(certified), judged, *cells, learner),
        *(replay_ends, oracle_ends, energy),
    ]


def _learner(found: Mapping[str, Baseline]) -> str:
    """The cell of the learner that solves most in training; of two, that with the first name in `LEARNERS`."""
    tried = [found[name] for name in LEARNERS if name in found]
    best = max(tried, key=lambda one: one.training.value if one.training else 0.0, default=None)
    return f"{best.name}: {_baseline(best)}" if best else predictors.cell(found)


def _certification(found: Mapping[str, Any]) -> list[str]:
    """The figures of certification of a split."""
    if "draws" not in found:
        return [NOT_MEASURED] * len(CERTIFIED)
    oracle = f"{found['solved']} of {found['draws']} (> {100 * lower_bound(found['solved'], found['draws']):.0f}%)"
    same = f"{found['same']} of {found['replays']}" if found.get("replays") else "-"
    return [f"{found['certified']} of {found['indices']}", oracle, same]


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
