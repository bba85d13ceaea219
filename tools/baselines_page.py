"""Write docs/baselines.md and its plots from the ledger: `python tools/baselines_page.py`"""

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import axis_records
import baseline_plots
import numpy as np
from baselines import (
    ALL,
    BLIND,
    CURATED,
    DEMONSTRATIONS,
    FELT,
    MIXED,
    NOMINAL,
    POLICIES,
    RANDOM,
    REPLAY,
    SCENARIOS,
    TASKS,
    UNTRAINED,
    VARIED,
)

from scengen import list_tasks, load_task
from scengen.evaluate.statistics import paired, rate
from scengen.evidence import ledger
from scengen.evidence.ledger import Evidence
from scengen.learn.models import BC, MIP
from scengen.learn.train import TrainSettings
from scengen.samplers.split import ID

PAGE = Path("docs/baselines.md")
SHOWN = (*POLICIES, REPLAY)
"""Policies that are played on axes, too."""
AXES_PLOT = Path("docs/baselines_axes.svg")
"""Plot of the rates on all axes."""
CURVES_PLOT = Path("docs/baselines_curves.svg")
"""Plot of the learning curves."""
HEAD = f"""# Baselines

Written by `make baselines` and `make curves`: success rates of small policies that `scengen train` trains on
{DEMONSTRATIONS} demonstrations (`scengen demos`, default styles), on {SCENARIOS} certified scenarios of each split.

**What these figures may not be compared with.** The policies read poses and outer sizes of all bodies, and the pose of
the hand. The paper's policies see pictures, which is a harder problem. A low rate on an axis says that this policy does
not transfer, not that none can: the oracle solves every scenario, and doing nothing solves none; otherwise it would not
be certified.

* **bc**, **mip**, **knn**: see [Training](policies.md#training). They are deterministic: each scenario is played once,
  by each of up to three trainings.
* **replay**: the witness of the nearest other training scenario, played without looking: the success of pure memory. On
  an axis, the training scenario with the same values of all other parameters is often the nearest one.

"""
SUMMARY = """## Summary

Percent of the scenarios solved in training, and after the arrow the mean over the axes of the task.

"""
PLOTTED = f"""
![Rates of each policy on each axis of each task]({AXES_PLOT.name})

The percentages of each axis; lines span the three trainings of `bc`.
"""
SPLITS = """
## All splits

Brackets: 95 % Wilson interval over the scenarios. **why not**: the most frequent reasons of failures. In training
alone:

* **idle**, **random**: nothing, and uniformly random actions at 100 Hz. Random actions solve 24 of 200 episodes of
  `domino_single`, whose first tile need only be tipped, and none of 20 to 60 episodes of each of 18 other tasks in
  which they were tried.
* **oracle**: what `scengen` certifies with.

"""
COLUMNS = ("task", "split", "policy", "solved", "rate [%]", "why not")
FAILURES = """
## What fails in training

What failures are (`scengen evaluate keep=[episodes]`, `scengen show film`, and the states that were passed):

* `balance_medium`: the hand lets the rod go 4 to 15 mm beside the middle of the ridge, which is 12 mm wide.
* `tool_retrieve`: the hook passes beside the cube or leaves it behind half way, and the hand creeps on with it.
* `pick_place_ycb`: the hand sinks while it follows the square, until the object touches the table 8 to 12 cm short of
  it and is released or held (`bc` 5 of 7), or the jaw closes beside or above the object.
* `slip_recovery`: the open hand hovers 10 cm above the object, 2 to 4 cm beside it, and does not come down.
* `cube_toss`: misses strike the rim of the tray.
* `bounce_intercept`: the hand waits 2 to 10 cm beside the way of the ball that comes back, leaves the place again, or
  goes to the ball at a wall. The place follows from one to three bounces.
* `domino_select`: the hand tips one chain of five, the right one in 4 to 7 of 20, where chance is 4.
"""
TRIED = """
## What was tried

With 20 training scenarios of each task, of which a difference of 3 is noise. On scenarios apart from those of the
tables:

* 2, 3 and 4 goals before the next prediction: 247, 247 and 223 of 300, by `bc` and `mip` in `slip_recovery` (76, 66 and
  49 of 80), `balance_medium` (55, 69 and 67 of 80), `pendulum_grasp` (70, 71 and 70 of 80) and `pick_place_ycb` (46, 41
  and 37 of 60).

On those of the tables, three trainings of `bc`, and one of `mip`:

* actions instead of goals, 4 before the next prediction: 16, 18, 9, and 9 of `slip_recovery`; 15, 12, 15, and 10 of
  `balance_medium`; 9, 11, 7, and 17 of `pick_place_ycb`; 17, 19, 19, and 20 of `edge_slide`; 15, 16, 19, and 19 of
  `tool_retrieve`; 4, 2, 3, and 5 of `bounce_intercept`. On axes, `bc` solves 2, 3 and 6 of `diagonal` in
  `domino_single` instead of 19, 20 and 19, and `mip` 14 of `far_inset` in `edge_slide` instead of 20: goals are seen
  from the hand, which turns with a scene;
* actions, 2 before the next prediction: 19, 19, 20, and 19 of `slip_recovery`; 11, 7, 8, and 11 of `balance_medium`;
  12, 16, 13, and 16 of `pick_place_ycb`; 7, 9, 17, and 20 of `edge_slide`; 16, 17, 15, and 17 of `tool_retrieve`.

And with actions instead of goals, 4 before the next prediction, one training:

* no sizes in `object-state`: `bc` and `mip` solve 10 and 11 of `pick_place_ycb` instead of 9 and 17, 12 and 5 of
  `slip_recovery` instead of 16 and 9, 17 and 15 of `tool_retrieve` instead of 15 and 19. On axes that move a size they
  help or mislead: `mip` solves 4 of `small` in `mirror_pick_place` instead of 19, 5 of `far_inset` in `edge_slide`
  instead of 14, but 19 of `long_handle` in `tool_retrieve` instead of 5;
* 20 epochs: `bc` solves 1 of `pick_place_ycb`, 2 of `cube_toss`, 12 of `tool_retrieve`, 16 of `linear_intercept`;
* 150 epochs: 7 of `pick_place_ycb` instead of 10 (without sizes, as everything below);
* one perceptron instead of five: 11 to 15 of `tool_retrieve`, 9 to 16 of `edge_slide` in three trainings (20 epochs);
* the mean of overlapping chunks: of five tasks 55 of 100 (the oldest one counts most, as in ACT) and 69 (the newest
  one) instead of 73;
* weight decay 30 000 times as large: smaller errors of held-out demonstrations (0.19 instead of 0.21 variances), and 5
  of `pick_place_ycb` instead of 10, 11 of `slip_recovery` instead of 12;
* one observation without velocities: 2 of `pick_place_ycb`, 13 of `slip_recovery` (20 epochs).
"""
LEARNING_CURVES = """
## Learning curves

Scenarios solved of 20 by policies that were trained on the first demonstrations: the mean of up to three trainings with
different seeds, and in brackets the lowest and the highest of them. `knn` has no seed. Made by
`python tools/trainings.py curves`; empty cells are not measured yet. The last column is that of all splits.

"""
CURVES_SHOWN = f"""
![Learning curves of each task]({CURVES_PLOT.name})

Lines: in training; dashes: the mean of the two axes.

`mirror_pick_place` needs 25 demonstrations, and `domino_single` 50. More than 200 would help where the last 100 still
bring much: 7 and 3 scenarios in `pick_place_ycb` (`bc` and `mip`), 5 and 6 in `slip_recovery`, 6 and 3 in `edge_slide`,
3 and 9 in `pendulum_grasp`, 3 and 6 in `balance_medium`. In `tool_retrieve` they bring nothing, and `domino_select`
stays at chance.
"""
STYLES = """
## What styles are worth

Scenarios solved of 20 by `bc`, trained on 200 nominal demonstrations and on 200 of which three quarters are varied and
a quarter recover: mean of three trainings, lowest and highest. Difference: points of percent with a 95 % interval over
the scenarios, each with its trainings; one that holds 0 is below its noise. Made by
`python tools/trainings.py styles`.

"""
STYLES_SHOWN = """
Variation does not help these policies. Of 7 failures of `long_handle` after varied demonstrations that were looked at,
6 hold the hook and creep on at 2 to 5 mm/s from the 8th to 11th second on. Varied demonstrations pause before a third
of their moves, nominal ones never; 8 episodes of a policy that had learned from those never slowed down like this.

Policies that predicted actions instead of goals, and saw no sizes (20 epochs, three trainings), gained 42 points in
training by variation in `balance_medium` (7 of 20 without it) and 10 in `edge_slide`, within noise, and lost 17 in
`tool_retrieve`. A goal leads back to the path by itself.
"""
CURATION = """
## What curation is worth

`scengen curate` keeps all 200 scripted demonstrations of these tasks, so that there is nothing to compare. Here every
third episode of the recording is spoiled by turns: its actions are late by 0.2 s, or its observations stand still for
a second, or its actions are those of the next episode. **all**: `bc` learns from the recording as it is; **curated**:
from what `scengen curate` keeps; **random**: from as many episodes of it at random. Columns as above. Made by
`python tools/trainings.py curation`.

"""
CURATION_SHOWN = """
A third of such episodes ruins a policy of goals. Those that predicted actions gained less by curation: 45 and 43 points
in training over all and random in `balance_medium`, 17 and 55 in `edge_slide` (20 epochs, three trainings).
"""
WRENCH = """
## What the wrench is worth

The masses of `mass_sort` are hidden: a heavy cube looks like a light one, and is known by the force at the wrist once
it is lifted. Three cubes lie in one of four orders, so that a fixed answer is right in 5 of 20. Scenarios solved of 20
by `bc`, trained on 200 demonstrations, without and with `force_torque` among its observations. Columns as above. Made
by `python tools/trainings.py wrench`.

"""
WRENCH_SHOWN = """
Without forces the policies are at chance or below it: in training they put a cube into a wrong zone in 9, 13 and 11 of
20 scenarios. With them this never happens, but few scenarios are solved, and the gain is within its noise, since the
policies get lost while they weigh: of 17 failures of two trainings that were looked at, the hand stays or creeps where
it has lifted a cube, lifts one again that it has weighed, or, in 3, forgets the one in the middle. The policies have no
memory, and a scene looks the same before and after a weighing. Without the rows at which nothing acts and nothing
changes, 5 % of all, the training that solves 1, 0 and 0 scenarios solves 7, 2 and 5.
"""


def main() -> None:
    """Write the page and its plots."""
    PAGE.write_text(page())
    AXES_PLOT.write_bytes(baseline_plots.axes(_rates()))
    CURVES_PLOT.write_bytes(baseline_plots.curves(_curves()))


def page() -> str:
    """The whole page, from the ledger."""
    return (
        HEAD
        + _summary()
        + PLOTTED
        + _learning_curves()
        + _worth(STYLES, NOMINAL, VARIED)
        + STYLES_SHOWN
        + _worth(CURATION, ALL, RANDOM, CURATED)
        + CURATION_SHOWN
        + _worth(WRENCH, BLIND, FELT)
        + WRENCH_SHOWN
        + FAILURES
        + TRIED
        + _all_splits()
    )


@cache
def _rates() -> dict[str, baseline_plots.Rates]:
    """Solved scenarios [%] of each training of each policy in training and on all axes, by task.

    Tasks that not all of these policies have played are left out.
    """
    found = dict[str, baseline_plots.Rates]()
    for task, rows in _measured().items():
        splits = (ID, *load_task(task).axes)
        rates = {
            policy: {split: [_percent(one) for one in _chosen(rows, policy, split)] for split in splits}
            for policy in SHOWN
        }
        if all(solved for known in rates.values() for solved in known.values()):
            found[task] = rates
    return found


@cache
def _measured() -> dict[str, list[Evidence]]:
    """The rows of each task that has some."""
    every = {task: ledger.current("baseline", task) for task in list_tasks()}
    return {task: rows for task, rows in every.items() if rows}


def _chosen(rows: Iterable[Evidence], policy: str, split: str) -> list[Evidence]:
    """The rows of a policy on a split, one for each training, by seed."""
    chosen = [row for row in rows if row.split == split and row.has(policy=policy)]
    return sorted(chosen, key=lambda row: row.made_with.get("seed", 0))


def _percent(row: Evidence) -> float:
    return 100.0 * row.value["solved"] / row.n


def _summary() -> str:
    """The section with a line for each task, and one for their mean."""
    lines, every, count = [], [], 0
    for task, rates in _rates().items():
        axes = load_task(task).axes
        means = [(np.mean(own[ID]), np.mean([np.mean(own[axis]) for axis in axes])) for own in rates.values()]
        lines.append(f"| [{task}](tasks/{task}.md) | {len(axes)} | {' | '.join(map(_arrow, means))} |")
        every.append(means)
        count += len(axes)
    lines.append(f"| **mean** | {count} | {' | '.join(map(_arrow, np.mean(every, axis=0)))} |")
    return SUMMARY + _table(("task", "axes", *SHOWN), lines)


def _arrow(means: Sequence[Any]) -> str:
    return " → ".join(f"{mean:.0f}" for mean in means)


def _missing() -> list[str]:
    """Tasks that are measured by default, and whose present version was not."""
    return [task for task in TASKS if task not in _measured()]


def _all_splits() -> str:
    """The section with a line for each split and policy."""
    lines: list[str] = []
    for task, rows in _measured().items():
        for split, policy in product((ID, *load_task(task).axes), (*SHOWN, *UNTRAINED)):
            own = _chosen(rows, policy, split)
            lines += [_line(own)] if own else []
    lines += [f"| [{task}](tasks/{task}.md) | {' | '.join([ledger.not_measured(task)] * 5)} |" for task in _missing()]
    return SPLITS + _table(COLUMNS, lines)


def _table(columns: Sequence[str], lines: Sequence[str]) -> str:
    return "\n".join([f"| {' | '.join(columns)} |", "|---" * len(columns) + "|", *lines]) + "\n"


@cache
def _trainings(*sets: str) -> dict[str, list[Evidence]]:
    """Rows of trainings on some sets of demonstrations, as they are made today, by task."""
    today = {"epochs": TrainSettings().epochs}
    known = {task: ledger.current("training", task) for task in list_tasks()}
    chosen = {
        task: [row for row in own if row.made_with["data"] in sets and row.has(**today)] for task, own in known.items()
    }
    return {task: own for task, own in chosen.items() if own}


def _learning_curves() -> str:
    """The section of the learning curves; nothing if there is no record of any."""
    lines = []
    for task, known in _trainings(MIXED).items():
        for split, policy in product(_splits(task, known), POLICIES):
            cells = " | ".join(_spread(_learned(task, split, policy, size)) for size in _sizes())
            lines.append(f"| [{task}](tasks/{task}.md) | {split} | {policy} | {cells} |")
    columns = ("task", "split", "policy", *(f"{size} demonstrations" for size in _sizes()))
    return LEARNING_CURVES + _table(columns, lines) + CURVES_SHOWN if lines else ""


def _curves() -> dict[str, dict[str, list[baseline_plots.Point]]]:
    """The points of the learning curves of each policy, by task."""
    found = dict[str, dict[str, list[baseline_plots.Point]]]()
    for task, known in _trainings(MIXED).items():
        found[task] = {policy: [] for policy in POLICIES}
        for policy, size in product(POLICIES, _sizes()):
            solved = [_learned(task, split, policy, size) for split in _splits(task, known)]
            if all(solved):
                here, *axes = (100.0 * np.mean(own) / SCENARIOS for own in solved)
                found[task][policy].append((size, float(here), float(np.mean(axes))))
    return found


def _sizes() -> list[int]:
    """Numbers of demonstrations of the learning curves."""
    return [*sorted({row.made_with["size"] for known in _trainings(MIXED).values() for row in known}), DEMONSTRATIONS]


def _learned(task: str, split: str, policy: str, size: int) -> list[int]:
    """Solved scenarios of each training on so many demonstrations."""
    if size == DEMONSTRATIONS:
        return [one.value["solved"] for one in _chosen(_measured().get(task, []), policy, split)]
    rows = _chosen(_trainings(MIXED)[task], policy, split)
    return [row.value["solved"] for row in rows if row.has(size=size)]


def _splits(task: str, rows: Iterable[Evidence]) -> list[str]:
    """The splits on which all trainings were evaluated, training first, in the order of the task's file."""
    tried = dict[str, set[str]]()
    for row in rows:
        tried.setdefault(json.dumps(row.made_with, sort_keys=True), set()).add(row.split)
    return [split for split in (ID, *load_task(task).axes) if all(split in known for known in tried.values())]


def _worth(head: str, *sets: str) -> str:
    """A section that compares the last of some sets with the others; nothing if there is no row."""
    *others, last = sets
    lines = []
    trained = _trainings(*sets)
    for task, known in trained.items():
        own = {name: [row for row in known if row.has(data=name)] for name in sets}
        if not all(own.values()):
            continue
        for split in _splits(task, known):
            here = {name: _chosen(own[name], BC, split) for name in sets}
            cells = [_spread([row.value["solved"] for row in here[name]]) for name in sets]
            outcomes = {name: [*zip(*(row.value["outcomes"] for row in here[name]), strict=True)] for name in sets}
            for name in others:
                gain = paired(outcomes[last], outcomes[name])
                cells.append(f"{100 * gain.value:+.1f} [{100 * gain.low:.1f}, {100 * gain.high:.1f}]")
            lines.append(f"| [{task}](tasks/{task}.md) | {split} | {' | '.join(cells)} |")
    columns = ("task", "split", *sets, *(f"{last} - {name}" for name in others))
    return head + _table(columns, lines) if trained else ""


def _spread(solved: list[int]) -> str:
    """The mean of some counts, and the lowest and the highest of them; nothing if there is none."""
    if len(solved) < 2:
        return "".join(map(str, solved))
    return f"{sum(solved) / len(solved):.3g} [{min(solved)}, {max(solved)}]"


def _line(rows: list[Evidence]) -> str:
    """The row of a policy on a split, over all its trainings."""
    first = rows[0]
    interval = rate([*axis_records.outcomes(rows).values()])
    reasons = sum((Counter(row.value["reasons"]) for row in rows), Counter[str]())
    why = "; ".join(f"{number} x {reason}" for reason, number in reasons.most_common(2))
    shown = f"{100 * interval.value:.0f} [{100 * interval.low:.0f}, {100 * interval.high:.0f}]"
    solved = ", ".join(str(row.value["solved"]) for row in rows)
    policy, epochs = first.made_with["policy"], first.made_with.get("epochs")
    if policy in (BC, MIP) and epochs != TrainSettings().epochs:
        policy += f", {epochs} epochs"
    task = f"[{first.task}](tasks/{first.task}.md)"
    return f"| {task} | {first.split} | {policy} | {solved} of {first.n} | {shown} | {why} |"


if __name__ == "__main__":
    main()
