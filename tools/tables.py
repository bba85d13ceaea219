"""Generated tables of docs/: those of the pages of attacks, axes, costs, drift, kept cheats and decisions."""

import ast
import importlib
import inspect
import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import baselines_page
import numpy as np
import predictors
from failures import failures

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "attack"))

import mutation_score
import recall
from hand import Hand
from test_hands import HANDS

from scengen import list_tasks, load_task
from scengen.attack.campaign import GRAMMAR
from scengen.attack.evidence import TierRate
from scengen.drift.matrix import FLIPPED, OUTCOMES, UNKNOWN, cell, flips, total
from scengen.episode import PAPER, STRICT
from scengen.evidence import ledger
from scengen.evidence.ledger import Evidence
from scengen.measures import figures
from scengen.measures.figures import table
from scengen.measures.policies import POLICIES
from scengen.ood.analysis.leaks import SEARCH
from scengen.ood.baseline import INCONCLUSIVE
from scengen.samplers.split import ID
from scengen.samplers.task import Task

CHEATS = ("task", "idea", "cheat", "solved", "without the mend", "the adversary finds")
"""Titles of the table of kept cheats."""
CLAUSES = (
    "task",
    "left out",
    "exploited by a written cheat",
    "found by the adversary",
    "random",
    "varied runs flagged",
)
"""Titles of the table of clauses."""
COSTS = ("task", "one [core s]", "10 thousand [core hours]", "1 million [core days]", "10 million [core days]")
"""Titles of the table of costs."""
AGREEMENT = ("task", "witnesses", "goal reached", "same verdict", "ends within 1 cm", "largest distance, median [mm]")
"""Titles of the table of witnesses in mujoco_warp."""
WARP = Path(__file__).parents[1] / "records" / "warp"
"""Folder of the results of `make warp`."""
HOUR, DAY = 3600.0, 86_400.0


def link(task: str, part: str = "") -> str:
    """A link to the page of a task."""
    return f"[{task}](tasks/{task}.md{part})"


# --- docs/attacks.md --------------------------------------------------------------------------


def attacks() -> dict[str, str]:
    """The tables of docs/attacks.md."""
    found = reports()
    hours = sum(report["cpu"] for report in found.values()) / 3600
    told = f"The rollouts of {len(found)} tasks took {hours:.1f} hours of one core."
    for missing in sorted({*list_tasks()} - {*found}):
        told += f" `{missing}`: {ledger.not_measured(missing)}."
    return {"attacks": f"{told}\n\n{_attacked(found)}", "leaks": _leaks(), "paper": _attacked(reports(PAPER))}


def reports(rules: str = STRICT) -> dict[str, Mapping[str, Any]]:
    """The report on each task that was attacked."""
    return {task: report for task in list_tasks() if (report := figures.attack(task, rules))}


def _attacked(found: Mapping[str, Mapping[str, Any]]) -> str:
    return table(("task", *figures.ATTACK), ([link(task), *figures.attack_cells(one)] for task, one in found.items()))


def _leaks() -> str:
    """What the observations of all splits tell."""
    splits = {
        (task, split): row
        for task in list_tasks()
        for split, row in ledger.latest("leak", task, search=SEARCH).items()
        if row.value["hidden"]
    }
    count = sum(len(row.value["hidden"]) for row in splits.values())
    told = [(*name, leak) for name, row in splits.items() for leak in row.value["found"]]
    tasks = len({task for task, _ in splits})
    text = f"Searched: {count} varying hidden parameters in {len(splits)} splits of {tasks} tasks. Told: {len(told)}.\n"
    for task, split, leak in told:
        text += f"\n* {task}, {split}: `{leak['stream']}` tells {leak['parameter']}, {leak['explained']:.0%} explained"
    return text + ("\n" if told else "")


# --- docs/axes.md -----------------------------------------------------------------------------


def axes() -> dict[str, str]:
    """The tables of docs/axes.md."""
    certified = {task: figures.certified(task) for task in list_tasks()}
    cells = {task: of_axes(task) for task in list_tasks()}
    training = (
        [link(task), *figures.certification(task, found.get(ID)), _cpu(task, found.get(ID))]
        for task, found in certified.items()
    )
    rejected = (
        f"* {task}, {split}: {times} {reason}"
        for task, found in certified.items()
        for split in (ID, *load_task(task).axes)
        if split in found
        for reason, times in found[split].value.get("lost", {}).items()
    )
    rows = (
        [link(task, f"#{axis}"), axis, *own.values()] for task, found in cells.items() for axis, own in found.items()
    )
    return {
        "training": table(("task", *figures.CERTIFIED, "CPU s"), training),
        "predicted": predictors.sentence(),
        "verdicts": _verdicts([own["verdict"] for found in cells.values() for own in found.values()]),
        "axes": table(("task", "axis", *figures.AXIS), rows),
        "rejected": "\n".join(rejected),
    }


@cache
def of_axes(name: str) -> dict[str, dict[str, str]]:
    """The figures of the axes of a task, with what is predicted of a learner where none was tried."""
    task = load_task(name)
    cells, found = figures.axes(task), figures.baselines(task)
    for axis, own in cells.items():
        if not figures.learner_cell(found[axis]):
            own["learner"] = predictors.cell(name, found[axis])
    return cells


def _verdicts(words: Sequence[str]) -> str:
    """How many axes have each kind of verdict, in words."""
    broken, solved, missing = (sum(word.startswith(start) for word in words) for start in ("breaks", "solved", "not "))
    return (
        f"Of {len(words)} axes, {broken} break what was right in training, {solved} are solved by it, "
        f"{words.count(INCONCLUSIVE)} are inconclusive, and {missing} were not measured."
    )


def _cpu(task: str, row: Evidence | None) -> str:
    return f"{row.value['cpu']:.1f}{ledger.mark(row)}" if row else ledger.not_measured(task)


# --- docs/cluster.md --------------------------------------------------------------------------


def cluster() -> dict[str, str]:
    """The table of docs/cluster.md: costs of pools of the training split."""
    rows = {task: figures.certified(task).get(ID) for task in list_tasks()}
    found = sorted((row.value["cpu"], task, ledger.mark(row)) for task, row in rows.items() if row)
    lines = [_cost(f"{link(task)}{mark}", cpu) for cpu, task, mark in found]
    lines += [[link(task), ledger.not_measured(task), "-", "-", "-"] for task, row in rows.items() if not row]
    lines += [_cost("mean over measured tasks", sum(cpu for cpu, *_ in found) / len(found))] if found else []
    return {"costs": table(COSTS, lines)}


def _cost(what: str, cpu: float) -> list[str]:
    costs = (1e4 * cpu / HOUR, 1e6 * cpu / DAY, 1e7 * cpu / DAY)
    return [what, f"{cpu:.1f}", *(f"{cost:.0f}" for cost in costs)]


# --- docs/drift.md ----------------------------------------------------------------------------


def drift() -> dict[str, str]:
    """The results of all tasks, by the set of versions."""
    rows = [row for task in list_tasks() for row in ledger.newest("drift", task)]
    sets = sorted({tuple(row.made_with["mujoco"]) for row in rows})
    return {"drift": "\n".join(_drifted(names, [row for row in rows if row.has(mujoco=[*names])]) for names in sets)}


def warp() -> dict[str, str]:
    """Witnesses in mujoco_warp: how often goal and end agree with C MuJoCo."""
    lines = []
    for path in sorted(WARP.glob("*.json")):
        found = json.loads(path.read_text())
        if found["version"] == load_task(found["task"]).version:
            cells = (str(found[name]) for name in ("n", "goals", "verdicts", "near"))
            lines.append([link(found["task"]), *cells, f"{1000 * found['median']:g}"])
    return {"warp": table(AGREEMENT, lines)}


def _drifted(versions: Sequence[str], rows: Sequence[Evidence]) -> str:
    """The section on the results of some tasks under the same versions."""
    every = {version: total([row.value["counts"][version] for row in rows]) for version in versions}
    count, tasks = sum(row.n for row in rows), len({row.task for row in rows})
    lines = [_compared(task, versions, [row for row in rows if row.task == task]) for task in list_tasks()]
    lines.append(["**all**", str(count), *(cell(every[version]) for version in versions)])
    lines.append(["flipped, 95 % bound", str(count), *(f"< {_bound(every[version]):.1%}" for version in versions)])
    text = f"## MuJoCo {', '.join(versions)}\n\n{count} scenarios of {tasks} tasks; "
    text += "`same bits / same verdict / flipped`:\n\n"
    text += table(("task", "scenarios", *(f"MuJoCo {version}" for version in versions)), lines)
    if any(each[FLIPPED] for each in every.values()):
        titles = ("MuJoCo", "scenario", "check", "now", "how it parts", "the certificate")
        text += FLIPS + table(titles, (each for row in rows for each in flips(row.value)))
    return text


FLIPS = """
### What flipped, with its margins

If a witness no longer reaches the goal, its actions are played under both versions: the fifth column has
the first times at which a body is 0.1, 1 and 10 mm elsewhere, and what it touches then. The last has
the margins of the certificate: successful jittered runs of the oracle, the time at which the witness
reached the goal, and other numerics under which the witness failed.

"""
"""Text above the table of scenarios that flipped."""


def _compared(task: str, versions: Sequence[str], rows: Sequence[Evidence]) -> list[str]:
    """The row of a task: the sum of its pools."""
    if not rows:
        return [link(task), "0", *[ledger.not_measured(task)] * len(versions)]
    counts = [total([row.value["counts"][version] for row in rows]) for version in versions]
    return [link(task), f"{sum(row.n for row in rows)}{ledger.mark(rows[0])}", *map(cell, counts)]


def _bound(told: Mapping[str, Any]) -> float:
    """One-sided 95 % Clopper-Pearson bound of the share of flipped scenarios, among those with a known outcome."""
    return TierRate("", False, sum(told[name] for name in OUTCOMES if name != UNKNOWN), told[FLIPPED]).bound


# --- docs/kept_cheats.md ----------------------------------------------------------------------


def kept_cheats() -> dict[str, str]:
    """The tables of docs/kept_cheats.md."""
    return {"cheats": table(CHEATS, cheats()), "clauses": table(CLAUSES, clauses())}


def cheats() -> Iterator[list[str]]:
    """The rows of the table of cheats."""
    last = ""
    for (task, cheat), hand in HANDS.items():
        number, _, idea = str(importlib.import_module(f"hands.{task}").__doc__).partition(":")
        name, idea = (f"{number} {link(task)}", " ".join(idea.split())) if task != last else ("", "")
        rows = [row for row in ledger.newest("cheat", task) if row.has(cheat=cheat, draws=recall.DRAWS)]
        parts = ("closed", "open") if rows else ()
        counts = [f"{rows[0].value[part]} of {recall.DRAWS}{ledger.mark(rows[0])}" for part in parts]
        plan = cheat.removesuffix("_raw").replace("_", " ") + (", raw" if hand.raw else "")
        yield [name, idea, plan, *(counts or [ledger.not_measured(task)] * 2), found_by(task, hand)]
        last = task


def found_by(task: str, hand: Hand) -> str:
    """The tiers that find a way without a cheat's mend. Cheats with the same mend share them."""
    mended = {cheat for (name, cheat), other in HANDS.items() if name == task and other.unmended == hand.unmended}
    rows = [row for row in ledger.newest("recall", task) if row.has(grammar=GRAMMAR)]
    found = next((row.value["found"] for row in rows if row.made_with["cheat"] in mended), None)
    return ledger.not_measured(task) if found is None else found.partition(":")[0] or "nothing"


def clauses() -> Iterator[list[str]]:
    """The rows of the table of clauses, and their sums."""
    found = mutation_score.stored()
    for name in ("all", *sorted({row.task for row in found})):
        of = [row for row in found if name in ("all", row.task)]
        mutants, varied = (
            [row.value for row in of if bool(row.made_with["mutant"]) is which] for which in (True, False)
        )
        exploited = [one for one in mutants if one["cheats"]]
        counts = [sum(bool(one[what]) for one in exploited) for what in ("found", "random")]
        runs, flagged = (sum(one[what] for one in varied) for what in ("runs", "flagged"))
        yield [name, *map(str, (len(mutants), len(exploited), *counts)), f"{flagged} of {runs}" if runs else "-"]


# --- docs/paper.md ----------------------------------------------------------------------------


def paper() -> dict[str, str]:
    """Decisions of each task where the paper is silent, and its differences.

    The text is taken from the docstrings of the families: everything after the paragraph that begins with "Bottleneck".
    """
    tasks = sorted(map(load_task, list_tasks()), key=lambda task: (task.category[:1] != "P", task.category, task.code))
    seen: set[str] = set()
    parts = []
    for task in tasks:
        text = decisions(task)
        told = text if text not in seen else f"As {next(t.name for t in tasks if decisions(t) == text)}."
        seen.add(text)
        parts.append(f"\n## {task.code} {link(task.name)}\n\n{told}\n{ending(task)}")
    return {"decisions": "".join(parts)}


def ending(task: Task) -> str:
    """The means of a task, and what ends an episode, as Markdown."""
    reasons, means = failures(task.family), "; ".join(task.nominal.means())
    lines = [f"Means: {means}.\n"] if means else []
    lines += [f"Failures: {'; '.join(reasons)}.\n"] if reasons else []
    return "\n" + "\n".join(lines) if lines else ""


def decisions(task: Task) -> str:
    """Text after the bottleneck in the docstring of a family, as Markdown."""
    text = ast.get_docstring(ast.parse(Path(inspect.getfile(task.family)).read_text())) or ""
    found = re.search(r"^Bottleneck.*?\n\n", text, re.M | re.S)
    if found is None or not text[found.end() :].strip():
        sys.exit(f"{task.name}: its docstring has no decisions after a paragraph that begins with Bottleneck")
    return text[found.end() :].strip()


# --- docs/results.md --------------------------------------------------------------------------

RESULTS = Path(__file__).parents[1] / "docs" / "results.md"
HEAD = """# Results

<!-- Written by `make results` -->

One line for each task, on the newest version that was measured. *-*: not measured. The name of a task leads
to its page in the built documentation (`make docs`), and on GitHub to its picture.

* **ID**, **axes**: scenarios certified at level `quick`, of the draws tried in training and on all axes together.
* **broken**: axes that break what was right in training, of the axes measured ([every split, measured](axes.md)).
* **policy**: percent of the scenarios that the best trained policy solves in training, and after the arrow on average
  over the axes ([baselines](baselines.md)).
* **ways around**: hits of the adversary that bypass the task, of its rollouts, and the one-sided 95 % bound of their
  rate ([attacks](attacks.md)).
* **core s**: processor time of one certified training scenario ([cost of pools](cluster.md#cost)).

"""
RESULT = ("task", "code", "version", "ID", "axes", "broken", "policy", "ways around", "core s")
"""Titles of the table."""
NONE = "-"
"""Cell of a figure that was not measured."""


def results() -> str:
    """The page docs/results.md."""
    tasks = sorted(map(load_task, list_tasks()), key=lambda task: ("TMX".index(task.code[0]), task.code))
    return HEAD + table(RESULT, [*map(result, tasks), list(_total(tasks))])


def result(task: Task) -> list[str]:
    """The line of a task."""
    found = figures.certified(task.name)
    own = found.get(ID)
    return [
        f"[{task.name}](tasks/{task.name}.jpg)",
        task.code,
        str(own.version if own else task.version),
        certified_of([own] if own else []),
        certified_of([row for split, row in found.items() if split in task.axes]),
        broken([task]),
        best_policy(task),
        ways_around([report] if (report := figures.attack(task.name)) else []),
        f"{own.value['cpu']:.1f}" if own else NONE,
    ]


def certified_of(rows: Sequence[Evidence]) -> str:
    """Scenarios certified of the draws tried."""
    tried = sum(row.value["indices"] for row in rows)
    return f"{sum(row.value['certified'] for row in rows)} of {tried}" if tried else NONE


def broken(tasks: Sequence[Task]) -> str:
    """Axes that break, of the measured ones."""
    verdicts = [cells["verdict"] for task in tasks for cells in of_axes(task.name).values()]
    measured = [verdict for verdict in verdicts if not verdict.startswith("not ")]
    told = f"{sum(verdict.startswith('breaks') for verdict in measured)} of {len(measured)}"
    return told if len(measured) == len(verdicts) else f"{told} measured of {len(verdicts)}"


def best_policy(task: Task) -> str:
    """The policy that solves most training scenarios, among those that learn."""
    means = {name: rates for name, rates in baselines_page.means(task.name).items() if name in POLICIES}
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
    found = [figures.certified(task.name) for task in tasks]
    own = [rows[ID] for rows in found if ID in rows]
    yield from (f"**{len(tasks)} tasks**", "", "")
    yield certified_of(own)
    yield certified_of(
        [row for rows, task in zip(found, tasks, strict=True) for s, row in rows.items() if s in task.axes]
    )
    yield broken(tasks)
    yield ""
    yield ways_around([*reports().values()])
    yield f"{np.mean([row.value['cpu'] for row in own]):.1f}"
