"""The tables and plots of docs/baselines.md, from the ledger."""

import json
from collections import Counter
from collections.abc import Iterable, Sequence
from functools import cache
from itertools import product
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

SHOWN = (*POLICIES, REPLAY)
"""Policies that are played on axes, too."""
COLUMNS = ("task", "split", "policy", "solved", "rate [%]", "why not")


def fills() -> dict[str, str]:
    """The tables and plots of docs/baselines.md."""
    return {
        "summary": _summary(),
        "rates": "![Rates of each policy on each axis of each task](baselines_axes.svg)",
        "plot": "![Learning curves of each task](baselines_curves.svg)",
        "curves": _learning_curves(),
        "styles": _worth(NOMINAL, VARIED),
        "curation": _worth(ALL, RANDOM, CURATED),
        "wrench": _worth(BLIND, FELT),
        "splits": _all_splits(),
    }


def plots() -> dict[str, bytes]:
    """The plots of the page: names of files, and SVG."""
    return {
        "baselines_axes.svg": baseline_plots.axes(_rates()),
        "baselines_curves.svg": baseline_plots.curves(_curves()),
    }


def means(task: str) -> dict[str, tuple[float, float]]:
    """Mean percentages that each policy solves in training and on the axes; nothing if one has not played the task."""
    rates, axes = _rates().get(task, {}), load_task(task).axes
    return {
        name: (float(np.mean(own[ID])), float(np.mean([np.mean(own[axis]) for axis in axes])))
        for name, own in rates.items()
    }


def of_task(task: str) -> str:
    """The table of all splits of a task; nothing if none is measured."""
    lines = _lines(task)
    return _table(COLUMNS[1:], [line.partition(" | ")[2] for line in lines]) if lines else ""


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
    """The table with a line for each task, and one for their mean."""
    lines, every, count = [], [], 0
    for task in _rates():
        own, axes = [*means(task).values()], len(load_task(task).axes)
        lines.append(f"| [{task}](tasks/{task}.md) | {axes} | {' | '.join(map(_arrow, own))} |")
        every.append(own)
        count += axes
    lines.append(f"| **mean** | {count} | {' | '.join(map(_arrow, np.mean(every, axis=0)))} |")
    return _table(("task", "axes", *SHOWN), lines)


def _arrow(rates: Sequence[Any]) -> str:
    return " → ".join(f"{rate:.0f}" for rate in rates)


def _missing() -> list[str]:
    """Tasks that are measured by default, and whose present version was not."""
    return [task for task in TASKS if task not in _measured()]


def _all_splits() -> str:
    """The table with a line for each split and policy."""
    lines = [line for task in _measured() for line in _lines(task)]
    lines += [f"| [{task}](tasks/{task}.md) | {' | '.join([ledger.not_measured(task)] * 5)} |" for task in _missing()]
    return _table(COLUMNS, lines)


def _lines(task: str) -> list[str]:
    """The lines of a task: one for each split and policy."""
    rows = _measured().get(task, [])
    played = (
        _chosen(rows, policy, split) for split, policy in product((ID, *load_task(task).axes), (*SHOWN, *UNTRAINED))
    )
    return [_line(own) for own in played if own]


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
    """The table of the learning curves."""
    lines = []
    for task, known in _trainings(MIXED).items():
        for split, policy in product(_splits(task, known), POLICIES):
            cells = " | ".join(_spread(_learned(task, split, policy, size)) for size in _sizes())
            lines.append(f"| [{task}](tasks/{task}.md) | {split} | {policy} | {cells} |")
    columns = ("task", "split", "policy", *(f"{size} demonstrations" for size in _sizes()))
    return _table(columns, lines)


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


def _worth(*sets: str) -> str:
    """A table that compares the last of some sets with the others."""
    *others, last = sets
    lines = []
    for task, known in _trainings(*sets).items():
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
    return _table(columns, lines)


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
