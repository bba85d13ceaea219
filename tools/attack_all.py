"""Attack every task. The tables of docs/attacks.md have a line for each.

    python tools/attack_all.py 500 [rules=paper] [workers=2] [TASK ...]

Reports are stored in records/attack, hits in generated/attack. A repeated call continues. With `rules=paper` the strict
rules are lifted: hits are then no way around a task of ours, but tell what the paper's rules admit. Tasks without a
strict rule are the same under both and are left out.
"""

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import leaks_all
from arguments import parted
from paper_page import failures

from scengen import cli, list_tasks, load_task
from scengen.attack.adversary import TIERS
from scengen.attack.campaign import GRAMMAR
from scengen.attack.evidence import TierRate
from scengen.episode import PAPER, STRICT, check_rules
from scengen.evidence import ledger, measuring
from scengen.samplers.split import ID
from scengen.samplers.task import Task

SCENARIOS = 10
"""Number of scenarios of each task."""
SEED = 4242
"""Seed of the draws and of the attack."""
HITS = {STRICT: Path("generated/attack"), PAPER: Path("generated/attack/paper")}
"""Folders of the hits and logs, by the rules of the episodes."""
COLUMNS = (
    *("task", "random", "foreign", "shortcuts", "servo", "clock", "1 memory", "2 memories"),
    *("1 fixed", "2 fixed", "3 fixed", "retries", "own", "rollouts", "refuting"),
)
"""Columns of the table."""


def main(budget: str, *others: str) -> None:
    """Attack all tasks, or some."""
    names, options = parted(others, "rules", "workers")
    rules, workers = check_rules(options.get("rules", STRICT)), options.get("workers", "2")
    refuted = []
    for task in map(load_task, names or list_tasks()):
        if rules == PAPER and not has_strict_rules(task):
            continue
        if attacked(task, int(budget), rules, workers) and rules == STRICT:
            refuted.append(task.name)
    sys.exit(f"refuted, or not attacked: {', '.join(refuted)}" if refuted else 0)


def has_strict_rules(task: Task) -> bool:
    """Whether a task has a rule that the paper lacks."""
    return any(strict for _, strict in failures(task.family))


def attacked(task: Task, budget: int, rules: str, workers: str) -> int:
    """Attack a task, unless the ledger has the result, and store it. Returns the status of the command."""
    made_with = {"grammar": GRAMMAR, "rules": rules, "budget": budget, "seed": SEED}
    if known := measuring.measured(task, ID, "attack", made_with):
        return int(bool(known.value["hits"]))
    folder = HITS[rules] / f"{task.name}-v{task.version}"
    tiers = f"tiers=[{','.join(TIERS)}]"  # without leaks, which tools/leaks_all.py searches in all splits
    argv = (f"task={task.name}", f"n={SCENARIOS}", f"budget={budget}", f"seed={SEED}", f"rules={rules}", tiers)
    with TemporaryDirectory() as temporary:
        target = Path(temporary, "report.json")
        status = cli.run(("attack", *argv, f"workers={workers}", f"json={target}", f"to={folder}"))
        if target.is_file():
            report = json.loads(target.read_text())
            value = {name: report[name] for name in ("lost", "not_tried", "priors", "rates", "rollouts")}
            value["hits"] = [hit for hit in report["hits"] if hit["refutes"]]
            value["cpu"] = _cpu(folder / "attack.jsonl")
            measuring.keep(task, ID, "attack", len(report["scenarios"]), value, made_with)
    return status


def fills() -> dict[str, str]:
    """The tables of docs/attacks.md."""
    found = reports()
    hours = sum(report["cpu"] for report in found.values()) / 3600
    told = f"The rollouts of {len(found)} tasks took {hours:.1f} hours of one core."
    for missing in sorted({*list_tasks()} - {*found}):
        told += f" `{missing}`: {ledger.not_measured(missing)}."
    return {"attacks": f"{told}\n\n{_table(found)}", "leaks": _leaks(), "paper": _table(reports(PAPER))}


def of_task(task: str) -> dict[str, str]:
    """The cells of a task by title; nothing if it was not attacked."""
    report = reports().get(task)
    return dict(zip(COLUMNS[1:], _cells(report), strict=True)) if report else {}


def _leaks() -> str:
    """What the observations of all splits tell."""
    splits = {
        (task, split): row
        for task in list_tasks()
        for split, row in leaks_all.searched(task).items()
        if row.value["hidden"]
    }
    count = sum(len(row.value["hidden"]) for row in splits.values())
    told = [(*name, leak) for name, row in splits.items() for leak in row.value["found"]]
    tasks = len({task for task, _ in splits})
    text = f"Searched: {count} varying hidden parameters in {len(splits)} splits of {tasks} tasks. Told: {len(told)}.\n"
    for task, split, leak in told:
        text += f"\n* {task}, {split}: `{leak['stream']}` tells {leak['parameter']}, {leak['explained']:.0%} explained"
    return text + ("\n" if told else "")


def reports(rules: str = STRICT) -> dict[str, Mapping[str, Any]]:
    """The report on each task that was attacked, by the newest grammar of plans and with the most rollouts."""
    known = {task: [row for row in ledger.current("attack", task) if row.has(rules=rules)] for task in list_tasks()}
    newest = {
        task: max(rows, key=lambda row: (row.made_with["grammar"], row.value["rollouts"]))
        for task, rows in known.items()
        if rows
    }
    return {task: row.value for task, row in newest.items()}


def _table(reports: Mapping[str, Mapping[str, Any]]) -> str:
    rows = [(f"[{task}](tasks/{task}.md)", *_cells(report)) for task, report in reports.items()]
    return "".join(f"| {' | '.join(row)} |\n" for row in (COLUMNS, ("---",) * len(COLUMNS), *rows))


def _cells(report: Mapping[str, Any]) -> list[str]:
    """The cells of a task but for its name."""
    fixed = {len(prior["values"]): _share(prior) for prior in report["priors"]}
    return [
        *(_counted(report, tier) for tier in ("random", "foreign", "shortcut", "servo", "clock")),
        *(_counted(report, tier) for tier in ("memory_1", "memory_2")),
        *(fixed.get(count, "-") for count in (1, 2, 3)),
        *(_counted(report, *tiers) for tiers in (("retry",), ("detour", "witness", "search"))),
        str(report["rollouts"]),
        str(len(report["hits"])),
    ]


def _counted(report: Mapping[str, Any], *tiers: str) -> str:
    known = [rate for rate in report["rates"] if rate["tier"] in tiers]
    total = TierRate("", False, sum(rate["rollouts"] for rate in known), sum(rate["hits"] for rate in known))
    return f"{total.hits} of {total.rollouts} (< {total.bound:.1%})" if total.rollouts else "-"


def _cpu(log: Path) -> float:
    """Processor time of the rollouts of an attack [s], from its log."""
    return round(sum(json.loads(line).get("cpu", 0.0) for line in log.read_text().splitlines()), 1)


def _share(prior: Mapping[str, Any]) -> str:
    if prior["fresh"] is None:
        return f"{prior['fitted']:.1%} where fitted"
    return f"{prior['fresh']:.1%} (< {prior['bound']:.1%})"


if __name__ == "__main__":  # worker processes import this file again
    main(*sys.argv[1:])
