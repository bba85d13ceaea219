"""Attack every task, and docs/attacks.md with a line for each.

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
PAGE = Path("docs/attacks.md")
HEAD = f"""# Every task, attacked

Written by `make attacks`: the results of the built-in adversary (`scengen attack`) on {SCENARIOS} training scenarios of
each task, with every plan both through the teleoperation filter and raw. The adversary knows the bodies of a scene, a
witness, and the kind of answer that the family declares; it knows nothing else of a task.

* **random**: one to five random moves from the start (pick, push, place, press, turn, shake, throw, wait). **foreign**:
  witnesses of the other scenarios. **shortcuts**: the declared ones, alone and in pairs. **servo**: feedback plans that
  pursue, press down, block, cradle, carry through narrow ways, and do what a latch asks for by itself. **clock**: the
  scenario's own solution, with every wait as long as in training on average; "-" if its waits hardly vary. Each
  column shows hits of rollouts, and the one-sided 95 % Clopper-Pearson bound of the rate.
* **1 memory, 2 memories**: the best training solutions, carried to the scenario by the pose of a body, one after the
  other in one episode. They are chosen among sixteen on other draws. A memory that works says how little a policy must
  see in training; it does what the oracle does, so it is no way around the task. "-" if fewer of them solved any
  other draw, or where fixed answers, which come first, leave it no rollouts.
* **1, 2, 3 fixed**: the best fixed answers (a lane, a share of a height), fitted on 300 other draws, and given one
  after the other without looking at the scene: share of fresh draws that they solve, and its bound. "-" if the answer
  is not a number, or if a wrong answer ends the episode.
* **retries**: one move is repeated while a height, a tilt, a place or a direction is swept, often from a state of the
  scenario's own witness. **own**: that witness with a phase dropped, repeated, mirrored, slowed or accelerated, with a
  detour (a move beside its place, a held body pressed on another one, a body pushed aside before it is taken, a slip),
  and a search that continues from its states. Starting from the witness, partial success is expected: these two columns
  search for ways around the task, and their rates are no bounds.
* **refuting**: hits without a contact that the oracle makes in its witness and in forty varied runs, which bypass the
  task. There should be none; if you find one, please report it.

The adversary knows the positions of the bodies, which no policy knows in `mirror_pick_place`. There a random pick at
the right place is all that the task requires, so its rate says nothing about a policy that sees a mirrored picture.
An arm with a suction cup has no servo plans but those that carry. There are none for `keyboard_typing`,
where the fingers touch keys alone: the plans are for free bodies and for those that swing.

"""
OBSERVED = """
## What observations tell

Tier `leaks` on 200 draws of a split: a regression of each hidden parameter on each stream of Gymnasium and robosuite,
at the start and after 0.3 s without action ([The adversary](adversary.md)). Made by `python tools/leaks_all.py`.

"""
UNDER_PAPER = """
## Without the strict rules

The same attack under the paper's rules alone, on the tasks that have rules of ours ([which](paper.md)): `rules=paper`
in `scengen attack` and `scengen evaluate`. Hits that are refuting here are what these rules are for.

"""
COLUMNS = (
    *("task", "random", "foreign", "shortcuts", "servo", "clock", "1 memory", "2 memories"),
    *("1 fixed", "2 fixed", "3 fixed", "retries", "own", "rollouts", "refuting"),
)
"""Columns of the table."""


def main(budget: str, *others: str) -> None:
    """Attack all tasks, or some, and write the page."""
    names, options = parted(others, "rules", "workers")
    rules, workers = check_rules(options.get("rules", STRICT)), options.get("workers", "2")
    refuted = []
    for task in map(load_task, names or list_tasks()):
        if rules == PAPER and not has_strict_rules(task):
            continue
        if attacked(task, int(budget), rules, workers) and rules == STRICT:
            refuted.append(task.name)
    PAGE.write_text(page())
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


def page() -> str:
    """The whole page, from the ledger."""
    reports = _reports(STRICT)
    hours = sum(report["cpu"] for report in reports.values()) / 3600
    told = f"The rollouts of {len(reports)} tasks took {hours:.1f} hours of one core."
    for missing in sorted({*list_tasks()} - {*reports}):
        told += f" `{missing}`: {ledger.not_measured(missing)}."
    text = HEAD + told + "\n\n" + _table(reports) + _observed()
    if relaxed := _reports(PAPER):
        text += UNDER_PAPER + _table({f"`{task}`": report for task, report in relaxed.items()})
    return text


def _observed() -> str:
    """What the observations of all splits tell; nothing if none has been searched."""
    splits = {
        (task, split): row
        for task in list_tasks()
        for split, row in leaks_all.searched(task).items()
        if row.value["hidden"]
    }
    if not splits:
        return ""
    count = sum(len(row.value["hidden"]) for row in splits.values())
    told = [(*name, leak) for name, row in splits.items() for leak in row.value["found"]]
    tasks = len({task for task, _ in splits})
    text = f"Searched: {count} varying hidden parameters in {len(splits)} splits of {tasks} tasks. Told: {len(told)}.\n"
    for task, split, leak in told:
        text += f"\n* {task}, {split}: `{leak['stream']}` tells {leak['parameter']}, {leak['explained']:.0%} explained"
    return OBSERVED + text + ("\n" if told else "")


def _reports(rules: str) -> dict[str, Mapping[str, Any]]:
    """The report on each task that was attacked, by the newest grammar of plans and with the most rollouts."""
    known = {task: [row for row in ledger.current("attack", task) if row.has(rules=rules)] for task in list_tasks()}
    newest = {
        task: max(rows, key=lambda row: (row.made_with["grammar"], row.value["rollouts"]))
        for task, rows in known.items()
        if rows
    }
    return {task: row.value for task, row in newest.items()}


def _table(reports: Mapping[str, Mapping[str, Any]]) -> str:
    lines = [line(task, report) for task, report in reports.items()]
    return f"| {' | '.join(COLUMNS)} |\n{'|---' * len(COLUMNS)}|\n" + "".join(lines)


def line(task: str, report: Mapping[str, Any]) -> str:
    """The line of one task in the table."""
    fixed = {len(prior["values"]): _share(prior) for prior in report["priors"]}
    cells = [
        task,
        *(_counted(report, tier) for tier in ("random", "foreign", "shortcut", "servo", "clock")),
        *(_counted(report, tier) for tier in ("memory_1", "memory_2")),
        *(fixed.get(count, "-") for count in (1, 2, 3)),
        *(_counted(report, *tiers) for tiers in (("retry",), ("detour", "witness", "search"))),
        str(report["rollouts"]),
        str(len(report["hits"])),
    ]
    return f"| {' | '.join(cells)} |\n"


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
