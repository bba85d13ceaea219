"""The tables of docs/perturb.md, from the ledger."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from scipy.stats import binomtest
from tables import NONE, link

from scengen import list_tasks
from scengen.evaluate.statistics import wilson
from scengen.evidence import ledger
from scengen.learn.models import BC
from scengen.measures.figures import table
from scengen.perturb.perturbation import NONE as CLEAN
from scengen.samplers.conditions import KINDS


def fills() -> dict[str, str]:
    """All tables by the names of their marks."""
    return {"control": _control(), "unproved": _unproved(), "disturbed": _disturbed()}


def _unproved() -> str:
    """Cells that are not proved, with the reasons, by task and kind."""
    lines = []
    for task in list_tasks():
        for row in ledger.newest("perturb", task):
            name = f"{link(task)}{ledger.mark(row)}"
            lines += [[name, *cells] for cells in _faults(row.value["faults"])]
    return table(("task", "kind", "levels", "why"), lines)


def _faults(faults: Mapping[str, Sequence[str]]) -> list[list[str]]:
    """Kind, levels and reasons of the cells of a row: of several levels together, each once and without its number."""
    found: dict[str, tuple[set[str], set[str]]] = {}
    for cell, told in faults.items():
        kind, _, level = cell.partition("@")
        levels, reasons = found.setdefault(kind, (set(), set()))
        levels.add(level)
        reasons |= {_reason(each) for each in told}
    return [[f"`{k}`", " ".join(sorted(some)), "; ".join(sorted(why))] for k, (some, why) in found.items()]


def _reason(fault: str) -> str:
    """A fault without its numbers."""
    fault = re.sub(r"it changes more than level \d in \d+% only", "changes no more than the level below", fault)
    return re.sub(r"changes by \S+ only", "changes too little", fault)


def _disturbed() -> str:
    """Scenarios that small policies solve under perturbations of their readings, with the paired difference."""
    rows = [row for task in list_tasks() for row in ledger.newest("disturbed", task) if row.has(policy=BC)]
    asked = list(dict.fromkeys(condition for row in rows for condition in row.value))
    lines = [
        [link(row.task), f"{row.n}{ledger.mark(row)}", *(_solved(row.value, condition) for condition in asked)]
        for row in rows
    ]
    return table(("task", "n", *(f"`{condition}`" if condition != CLEAN else "clean" for condition in asked)), lines)


def _solved(value: Mapping[str, Any], condition: str) -> str:
    """Percent solved with its 95 % interval; a star where the paired difference from the clean run is significant."""
    if condition not in value:
        return NONE
    share, count = value[condition]["solved"], len(value[condition]["outcomes"])
    low, high = wilson(share / count, count)
    return f"{share / count:.0%} [{low:.0%}, {high:.0%}]{'*' if _is_clear(value, condition) else ''}"


def _is_clear(value: Mapping[str, Any], condition: str) -> bool:
    """Whether the paired difference of a condition from the clean run is significant."""
    clean, own = (_outcomes(value, each) for each in (CLEAN, condition))
    worse, better = (sum(clean[k] == is_lost != own[k] for k in own) for is_lost in (True, False))
    return worse + better > 0 and binomtest(worse, worse + better).pvalue < 0.05


def _outcomes(value: Mapping[str, Any], condition: str) -> dict[int, bool]:
    """Success by the number of the scenario."""
    return dict(map(tuple, value[condition]["outcomes"]))


# --- conditions of control --------------------------------------------------------------------


def _control() -> str:
    """Conditions of control that each task bears: for each kind the scenarios certified at levels 1 to 5."""
    lines = []
    for task in list_tasks():
        row = next(iter(ledger.newest("control", task)), None)
        cells = [_borne(row.value[kind]) if row else ledger.not_measured(task) for kind in KINDS]
        lines.append([link(task), f"{row.n}{ledger.mark(row)}" if row else NONE, *cells])
    return table(("task", "scenarios", *(f"`{kind}`" for kind in KINDS)), lines)


def _borne(figures: Mapping[str, Any]) -> str:
    """The cell of a kind: certified scenarios by level, with a star where solutions end in the usual bits."""
    return " ".join(
        f"{count}{'*' if level in figures['without_effect'] else ''}"
        for level, count in enumerate(figures["certified"], 1)
    )
