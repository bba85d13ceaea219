"""Train and evaluate small policies, and write docs/baselines.md: `python tools/baselines.py [axes=all] [task ...]`

Without `axes=all`, policies are evaluated on two axes of a task. With `page` alone, the tool only writes the page.
Pools, demonstrations and policies are made in generated/baselines, results are stored in records/baselines, which
docs/axes.md and docs/predictors.md read, too. A repeated call continues.
"""

import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import axis_records

from scengen import cli, list_tasks, load_task
from scengen.learn.models import BC, KNN, MIP
from scengen.learn.store import read_settings
from scengen.pool import Pool
from scengen.samplers.split import ID
from scengen.statistics import rate

AXES = {
    "domino_single": ("diagonal", "stout_starter"),
    "mirror_pick_place": ("small", "far"),
    "tool_retrieve": ("mirrored_hook", "long_handle"),
    "seesaw_balance": ("turned", "weight_beyond"),
    "pick_place_ycb": ("far_jumps", "unseen_item"),
    "pendulum_grasp": ("plane_45", "wide_swing"),
}
"""Axes on which the policies of a task are evaluated without `axes=all`."""
ALL_AXES = "axes=all"
"""Argument: evaluate on all axes of the tasks."""
POLICIES = (BC, MIP, KNN)
"""Trained policies."""
REPLAY = "replay"
"""Policy that replays the witness of the nearest other training scenario."""
SCENARIOS = 20
"""Number of scenarios of each split."""
DEMONSTRATIONS = 200
"""Number of demonstrations of each task, held-out ones included."""
MADE = Path("generated/baselines")
"""Folder of pools, demonstrations and policies."""
RECORDS = Path("records/baselines")
"""Folder of the results, one file for each task."""
PAGE = Path("docs/baselines.md")
HEAD = f"""# Baselines

Written by `make baselines`: success rates of small policies that `scengen train` trains with default settings on
{DEMONSTRATIONS} demonstrations (`scengen demos`, default styles), on {SCENARIOS} certified scenarios of each split.

**What these figures may not be compared with.** The policies read poses of all bodies and of the hand. The paper's
policies see pictures, which is a harder problem. A low rate on an axis says that this policy does not transfer, not
that none can: the oracle solves every scenario, and doing nothing solves none; otherwise it would not be certified.

* **bc**, **mip**, **knn**: see [Training](policies.md#training). They are deterministic: each scenario is played once.
* **replay**: the witness of the nearest other training scenario, played without looking: the success of pure memory.
* Brackets: 95 % Wilson interval. **why not**: the most frequent reasons of failures.

What films of failures show (`scengen evaluate keep=[episodes]`, `scengen film`): in training of `balance_medium`
the hand stops a few millimetres over the ridge, drifts along it by 9 to 65 mm, and lets the rod go beside its
middle. With the force at the wrist as another stream, and with three and ten times as many epochs, the rate stays
between 35 and 60 %.

"""
COLUMNS = ("task", "split", "policy", "solved", "rate [%]", "why not")


def main(*arguments: str) -> None:
    """Train and evaluate on the tasks of `AXES`, or on some tasks, and write the page."""
    if arguments != ("page",):
        tasks = [argument for argument in arguments if argument != ALL_AXES]
        if unknown := set(tasks) - set(list_tasks() if ALL_AXES in arguments else AXES):
            sys.exit(f"no task named {min(unknown)!r}; known: {', '.join(AXES)}, and every task with {ALL_AXES}")
        for task in tasks or AXES:
            measure(task, tuple(load_task(task).axes) if ALL_AXES in arguments else AXES[task])
    PAGE.write_text(page())


def measure(task: str, axes: tuple[str, ...]) -> None:
    """Make what is missing for a task, and store its results after each policy."""
    folder, splits = MADE / task, (ID, *axes)
    pools = [folder / split for split in splits]
    for split, pool in zip(splits, pools, strict=True):
        if not (pool / "manifest.json").is_file():
            run("generate", f"task={task}", f"split={split}", f"n={SCENARIOS}", f"pool={pool}")
    demos, data = folder / "demos", folder / "recording"
    if not data.exists():
        run("demos", f"task={task}", f"n={DEMONSTRATIONS}", f"to={demos}", f"apart=[{','.join(map(str, pools))}]")
        run("record", f"pool={demos}", f"to={data}", "cameras=none")
    found: list[dict[str, Any]] = []
    RECORDS.mkdir(parents=True, exist_ok=True)
    for policy in (*POLICIES, REPLAY):
        trained = folder / policy
        if policy in POLICIES:
            run("train", f"policy={policy}", f"data={data}", f"to={trained}")
        played = folder / f"{policy}-evaluation-{len(axes)}"  # an evaluation is bound to its pools
        name, pooled = str(trained) if policy in POLICIES else policy, ",".join(map(str, pools))
        run("evaluate", f"policy={name}", f"pool={pooled}", f"seeds={SCENARIOS}", "rollouts=1", f"to={played}")
        found += _results(task, policy, trained, played, dict(zip(map(str, pools), splits, strict=True)))
        lines = "".join(json.dumps(record, sort_keys=True) + "\n" for record in found)
        (RECORDS / f"{task}.jsonl").write_text(lines)


def run(*argv: str) -> None:
    """Run a command of scengen; its failure ends the tool."""
    if cli.run(list(argv)):
        sys.exit(f"scengen {' '.join(argv)} failed")


def _results(task: str, policy: str, trained: Path, played: Path, splits: dict[str, str]) -> list[dict[str, Any]]:
    """One record for each split."""
    told: dict[str, Any] = {"task": task, "policy": policy}
    if policy in POLICIES:
        own = read_settings(trained)
        names = ("demonstrations", "rows", "epochs", "data_sha256", "weights_sha256")
        told |= {name: getattr(own, name) for name in names}
    episodes = [json.loads(line) for line in (played / "episodes.jsonl").read_text().splitlines()[1:]]
    records = []
    for pool, split in splits.items():
        own = [episode for episode in episodes if episode["pool"] == pool]
        reasons = Counter(episode["reason"] for episode in own if not episode["success"])
        counts = {"scenarios": len(own), "solved": sum(episode["success"] for episode in own), "reasons": dict(reasons)}
        made = Pool.open(pool)
        number = dict(made.columns("id", "index"))
        outcomes = [[number[episode["scenario"]], episode["success"]] for episode in own]
        moved = {"shifts": axis_records.shifts(load_task(task), split), "pool_sha256": made.sha256}
        records.append({**told, "split": split, **moved, **counts, "outcomes": sorted(outcomes)})
    return records


def page() -> str:
    """The whole page, from the records."""
    lines = [f"| {' | '.join(COLUMNS)} |", "|---" * len(COLUMNS) + "|"]
    for task in list_tasks():
        records = axis_records.lines(RECORDS / f"{task}.jsonl")
        order = {split: k for k, split in enumerate((ID, *load_task(task).axes))} if records else {}
        known = [record for record in records if record["split"] in order]
        lines += [_line(record) for record in sorted(known, key=lambda record: order[record["split"]])]
    return HEAD + "\n".join(lines) + "\n"


def _line(record: dict[str, Any]) -> str:
    solved, count = record["solved"], record["scenarios"]
    interval = rate([[True]] * solved + [[False]] * (count - solved))
    frequent = sorted(record["reasons"].items(), key=lambda item: -item[1])[:2]
    why = "; ".join(f"{number} x {reason}" for reason, number in frequent)
    shown = f"{100 * interval.value:.0f} [{100 * interval.low:.0f}, {100 * interval.high:.0f}]"
    task = f"[{record['task']}](tasks/{record['task']}.md)"
    return f"| {task} | {record['split']} | {record['policy']} | {solved} of {count} | {shown} | {why} |"


if __name__ == "__main__":
    main(*sys.argv[1:])
