"""Train and evaluate small policies, and write docs/baselines.md: `python tools/baselines.py [page | task ...]`

They are evaluated in training and on all axes. With `page` alone, the tool only writes the page. Pools, demonstrations
and policies are made in generated/baselines, results are stored in records/baselines, which docs/axes.md and
docs/predictors.md read, too. A repeated call continues.
"""

import json
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import product
from pathlib import Path
from typing import Any, Literal

import axis_records

from scengen import cli, list_tasks, load_task
from scengen.learn.models import BC, KNN, MIP
from scengen.learn.store import read_settings
from scengen.learn.train import TrainSettings
from scengen.pool import Pool
from scengen.samplers.split import ID
from scengen.statistics import paired, rate

TASKS = (
    "domino_single",
    "mirror_pick_place",
    "linear_intercept",
    "pendulum_grasp",
    "edge_slide",
    "tool_retrieve",
    "pick_place_ycb",
    "slip_recovery",
    "balance_medium",
    "cube_toss",
    "domino_select",
    "bounce_intercept",
)
"""Tasks that are measured by default."""
POLICIES = (BC, MIP, KNN)
"""Trained policies."""
AGAIN = (1, 2)
"""Further seeds of trainings of `bc`. One of `mip` takes as long as three of these; nearest neighbours have no seed."""
REPLAY = "replay"
"""Policy that replays the witness of the nearest other training scenario."""
UNTRAINED = ("idle", "random", "oracle")
"""Policies that are played in training alone: a certificate tells how they do on an axis."""
SCENARIOS = 20
"""Number of scenarios of each split."""
DEMONSTRATIONS = 200
"""Number of demonstrations of each task, held-out ones included."""
MADE = Path("generated/baselines")
"""Folder of pools, demonstrations and policies."""
RECORDING = "recording"
"""Name of the folder of the recording of a task."""
RECORDS = Path("records/baselines")
"""Folder of the results, one file for each task."""
TRAININGS = Path("records/trainings")
"""Folder of the results of tools/trainings.py, one file for each task."""
Question = Literal["curves", "styles", "curation", "wrench"]
"""What tools/trainings.py can be asked."""
MIXED = "mixed"
"""Set of demonstrations: the recording of default styles."""
NOMINAL, VARIED = "nominal", "varied"
"""Sets of demonstrations: the nominal style alone, and the two others."""
BLIND, FELT = "poses alone", "poses and forces"
"""Sets of demonstrations: the recording of default styles, without and with the wrench at the wrist."""
ALL, CURATED, RANDOM = "all", "curated", "random"
"""Sets of demonstrations: a recording that is spoiled in part, what a curation keeps, and as many at random."""
PAGE = Path("docs/baselines.md")
HEAD = f"""# Baselines

Written by `make baselines`: success rates of small policies that `scengen train` trains on {DEMONSTRATIONS}
demonstrations (`scengen demos`, default styles), on {SCENARIOS} certified scenarios of each split.

**What these figures may not be compared with.** The policies read poses and outer sizes of all bodies, and the pose of
the hand. The paper's policies see pictures, which is a harder problem. A low rate on an axis says that this policy does
not transfer, not that none can: the oracle solves every scenario, and doing nothing solves none; otherwise it would not
be certified.

* **bc**, **mip**, **knn**: see [Training](policies.md#training). They are deterministic: each scenario is played once,
  by each of up to three trainings.
* **replay**: the witness of the nearest other training scenario, played without looking: the success of pure memory.
* **idle**, **random**, **oracle**: nothing, uniformly random actions at 100 Hz, and what `scengen` certifies with; in
  training alone. Random actions solve 24 of 200 episodes of `domino_single`, whose first tile need only be tipped, and
  none of 20 to 60 episodes of each of 18 other tasks in which they were tried.
* Brackets: 95 % Wilson interval over the scenarios. **why not**: the most frequent reasons of failures.

What failures in training are (`scengen evaluate keep=[episodes]`, `scengen film`, and the states that were passed):

* `balance_medium`: the hand lets the rod go 4 to 15 mm beside the middle of the ridge, which is 12 mm wide.
* `tool_retrieve`: the hook passes beside the cube or leaves it behind half way, and the hand creeps on with it.
* `pick_place_ycb`: the hand sinks while it follows the square, until the object touches the table 8 to 12 cm short of
  it and is released or held (`bc` 5 of 7), or the jaw closes beside or above the object.
* `slip_recovery`: the open hand hovers 10 cm above the object, 2 to 4 cm beside it, and does not come down.
* `cube_toss`: misses strike the rim of the tray.
* `bounce_intercept`: the hand waits 2 to 10 cm beside the way of the ball that comes back, leaves the place again, or
  goes to the ball at a wall. The place follows from one to three bounces.
* `domino_select`: the hand tips one chain of five, the right one in 4 to 7 of 20, where chance is 4.

What was tried, with 20 training scenarios of each task, of which a difference of 3 is noise. On scenarios apart from
those of the table:

* 2, 3 and 4 goals before the next prediction: 247, 247 and 223 of 300, by `bc` and `mip` in `slip_recovery` (76, 66 and
  49 of 80), `balance_medium` (55, 69 and 67 of 80), `pendulum_grasp` (70, 71 and 70 of 80) and `pick_place_ycb` (46, 41
  and 37 of 60).

On those of the table, three trainings of `bc`, and one of `mip`:

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
COLUMNS = ("task", "split", "policy", "solved", "rate [%]", "why not")
LEARNING_CURVES = """
## Learning curves

Scenarios solved of 20 by policies that were trained on the first demonstrations: the mean of up to three trainings with
different seeds, and in brackets the lowest and the highest of them. `knn` has no seed. Made by
`python tools/trainings.py curves`; empty cells are not measured yet. The last column is that of the table above.

"""
STYLES = """
## What styles are worth

Scenarios solved of 20 by `bc`, trained on 200 nominal demonstrations and on 200 of which three quarters are varied and
a quarter recover: mean of three trainings, lowest and highest. Difference: points of percent with a 95 % interval over
the scenarios, each with its three trainings; one that holds 0 is below its noise. These trainings, and those below,
take 20 epochs, predict actions instead of goals, 4 before the next prediction, and see no sizes. Made by
`python tools/trainings.py styles`.

"""
CURATION = """
## What curation is worth

`scengen curate` keeps all 200 scripted demonstrations of these tasks, so that there is nothing to compare. Here every
third episode of the recording is spoiled by turns: its actions are late by 0.2 s, or its observations stand still for
a second, or its actions are those of the next episode. **all**: `bc` learns from the recording as it is; **curated**:
from what `scengen curate` keeps; **random**: from as many episodes of it at random. Columns as above. Made by
`python tools/trainings.py curation`.

"""
WRENCH = """
## What the wrench is worth

The masses of `mass_sort` are hidden: a heavy cube looks like a light one, and is known by the force at the wrist once
it is lifted. Three cubes lie in one of the five orders that are not the wanted one, so that 4 of 20 are chance.
Scenarios solved of 20 by `bc`, trained on 200 demonstrations, without and with `force_torque` among its
observations. Columns as above, over two trainings. Made by `python tools/trainings.py wrench`.

"""


def main(*arguments: str) -> None:
    """Train and evaluate on some tasks, or on `TASKS`, and write the page."""
    if arguments != ("page",):
        if unknown := set(arguments) - set(list_tasks()):
            sys.exit(f"no task named {min(unknown)!r}; known: {', '.join(list_tasks())}; or page alone")
        for task in arguments or TASKS:
            measure(task)
    PAGE.write_text(page())


def measure(task: str) -> None:
    """Make what is missing for a task, and store its results after each policy."""
    pools = make_pools(task, load_task(task).axes)
    folder = MADE / task
    data = folder / RECORDING
    record(task, data, folder / "demos", pools.values())
    found: list[dict[str, Any]] = []
    RECORDS.mkdir(parents=True, exist_ok=True)
    first = [(policy, 0) for policy in (*POLICIES, REPLAY, *UNTRAINED)]
    for policy, seed in [*first, *((BC, seed) for seed in AGAIN)]:
        trained = folder / (f"{policy}-{seed}" if seed else policy)
        if policy in POLICIES:
            run("train", f"policy={policy}", f"seed={seed}", f"data={data}", f"to={trained}")
        own = {ID: pools[ID]} if policy in UNTRAINED else pools
        played = folder / f"{trained.name}-evaluation-{len(own) - 1}"  # an evaluation is bound to its pools
        play(str(trained) if policy in POLICIES else policy, [*own.values()], played)
        found += _results(task, policy, trained, played, own)
        lines = "".join(json.dumps(record, sort_keys=True) + "\n" for record in found)
        (RECORDS / f"{task}.jsonl").write_text(lines)


def make_pools(task: str, axes: Iterable[str]) -> dict[str, Path]:
    """Make the pools of a task in training and on some axes that are missing. Returns them by split."""
    pools = {split: MADE / task / split for split in (ID, *axes)}
    for split, pool in pools.items():
        if not (pool / "manifest.json").is_file():
            run("generate", f"task={task}", f"split={split}", f"n={SCENARIOS}", f"pool={pool}")
    return pools


def record(task: str, to: Path, demos: Path, apart: Iterable[Path], *settings: str) -> None:
    """Record demonstrations of a task, unless the recording is there.

    Args:
        demos: folder of the demonstrations.
        apart: pools of evaluation.
        settings: further settings of `scengen demos`.
    """
    if not to.exists():
        pools = ",".join(map(str, apart))
        run("demos", f"task={task}", f"n={DEMONSTRATIONS}", f"to={demos}", f"apart=[{pools}]", *settings)
        run("record", f"pool={demos}", f"to={to}", "cameras=none")


def play(policy: str, pools: list[Path], to: Path) -> None:
    """Evaluate a policy once on each scenario of some pools."""
    pooled = ",".join(map(str, pools))
    run("evaluate", f"policy={policy}", f"pool={pooled}", f"seeds={SCENARIOS}", "rollouts=1", f"to={to}")


def episodes(played: Path, pools: dict[str, Path]) -> dict[str, list[dict[str, Any]]]:
    """The episodes of an evaluation, by split.

    Args:
        pools: the pools that were played, by split.
    """
    every = [json.loads(line) for line in (played / "episodes.jsonl").read_text().splitlines()[1:]]
    return {split: [one for one in every if one["pool"] == str(pool)] for split, pool in pools.items()}


def outcomes(episodes: Sequence[dict[str, Any]], pool: Pool) -> list[list[Any]]:
    """Number of the scenario and success of each episode, by number."""
    number = dict(pool.columns("id", "index"))
    return sorted([number[episode["scenario"]], episode["success"]] for episode in episodes)


def run(*argv: str) -> None:
    """Run a command of scengen; its failure ends the tool."""
    if cli.run(list(argv)):
        sys.exit(f"scengen {' '.join(argv)} failed")


def _results(task: str, policy: str, trained: Path, played: Path, pools: dict[str, Path]) -> list[dict[str, Any]]:
    """One record for each split."""
    told: dict[str, Any] = {"task": task, "policy": policy}
    if policy in POLICIES:
        own = read_settings(trained)
        names = ("demonstrations", "rows", "epochs", "seed", "data_sha256", "weights_sha256")
        told |= {name: getattr(own, name) for name in names}
    records = []
    for split, own in episodes(played, pools).items():
        reasons = Counter(episode["reason"] for episode in own if not episode["success"])
        counts = {"scenarios": len(own), "solved": sum(episode["success"] for episode in own), "reasons": dict(reasons)}
        made = Pool.open(pools[split])
        moved = {"shifts": axis_records.shifts(load_task(task), split), "pool_sha256": made.sha256}
        records.append({**told, "split": split, **moved, **counts, "outcomes": outcomes(own, made)})
    return records


def page() -> str:
    """The whole page, from the records."""
    lines: list[str] = []
    for task in list_tasks():
        records = axis_records.lines(RECORDS / f"{task}.jsonl")
        for split, policy in product((ID, *load_task(task).axes), (*POLICIES, REPLAY, *UNTRAINED)) if records else ():
            own = [one for one in records if (one["split"], one["policy"]) == (split, policy)]
            lines += [_line(own)] if own else []
    return (
        HEAD
        + _table(COLUMNS, lines)
        + _learning_curves()
        + _worth(STYLES, NOMINAL, VARIED)
        + _worth(CURATION, ALL, RANDOM, CURATED)
        + _worth(WRENCH, BLIND, FELT)
    )


def _table(columns: Sequence[str], lines: Sequence[str]) -> str:
    return "\n".join([f"| {' | '.join(columns)} |", "|---" * len(columns) + "|", *lines]) + "\n"


def _trainings(*sets: str) -> dict[str, list[dict[str, Any]]]:
    """Records of trainings on some sets of demonstrations, by task."""
    known = {task: axis_records.lines(TRAININGS / f"{task}.jsonl") for task in list_tasks()}
    chosen = {task: [record for record in own if record["data"] in sets] for task, own in known.items()}
    return {task: own for task, own in chosen.items() if own}


def _learning_curves() -> str:
    """The section of the learning curves; nothing if there is no record of any."""
    lines = []
    curves = _trainings(MIXED)
    sizes = sorted({record["size"] for known in curves.values() for record in known})
    for task, known in curves.items():
        whole = axis_records.lines(RECORDS / f"{task}.jsonl")
        for split, policy in product(_splits(task, known), POLICIES):
            own = [record for record in known if record["policy"] == policy]
            solved = [[one["solved"][split] for one in own if one["size"] == size] for size in sizes]
            solved.append([one["solved"] for one in whole if (one["policy"], one["split"]) == (policy, split)])
            lines.append(f"| [{task}](tasks/{task}.md) | {split} | {policy} | {' | '.join(map(_spread, solved))} |")
    columns = ("task", "split", "policy", *(f"{size} demonstrations" for size in (*sizes, DEMONSTRATIONS)))
    return LEARNING_CURVES + _table(columns, lines) if lines else ""


def _splits(task: str, records: Iterable[dict[str, Any]]) -> list[str]:
    """The splits on which all trainings were evaluated, training first, in the order of the task's file."""
    tried = [set(record["solved"]) for record in records]
    return [split for split in (ID, *load_task(task).axes) if all(split in known for known in tried)]


def _worth(head: str, *sets: str) -> str:
    """A section that compares the last of some sets with the others; nothing if there is no record."""
    *others, last = sets
    lines = []
    records = _trainings(*sets)
    for task, known in records.items():
        own = {name: [record for record in known if record["data"] == name] for name in sets}
        if not all(own.values()):
            continue
        for split in _splits(task, known):
            cells = [_spread([record["solved"][split] for record in own[name]]) for name in sets]
            outcomes = {name: [*zip(*(one["outcomes"][split] for one in own[name]), strict=True)] for name in sets}
            for name in others:
                gain = paired(outcomes[last], outcomes[name])
                cells.append(f"{100 * gain.value:+.1f} [{100 * gain.low:.1f}, {100 * gain.high:.1f}]")
            lines.append(f"| [{task}](tasks/{task}.md) | {split} | {' | '.join(cells)} |")
    columns = ("task", "split", *sets, *(f"{last} - {name}" for name in others))
    return head + _table(columns, lines) if records else ""


def _spread(solved: list[int]) -> str:
    """The mean of some counts, and the lowest and the highest of them; nothing if there is none."""
    if len(solved) < 2:
        return "".join(map(str, solved))
    return f"{sum(solved) / len(solved):.3g} [{min(solved)}, {max(solved)}]"


def _line(records: list[dict[str, Any]]) -> str:
    """The row of a policy on a split, over all its trainings."""
    first = records[0]
    interval = rate([*axis_records.outcomes(records).values()])
    reasons = sum((Counter(record["reasons"]) for record in records), Counter[str]())
    why = "; ".join(f"{number} x {reason}" for reason, number in reasons.most_common(2))
    shown = f"{100 * interval.value:.0f} [{100 * interval.low:.0f}, {100 * interval.high:.0f}]"
    solved = ", ".join(str(record["solved"]) for record in records)
    task = f"[{first['task']}](tasks/{first['task']}.md)"
    policy, epochs = first["policy"], first.get("epochs")
    if policy in (BC, MIP) and epochs != TrainSettings().epochs:
        policy += f", {epochs} epochs"
    return f"| {task} | {first['split']} | {policy} | {solved} of {first['scenarios']} | {shown} | {why} |"


if __name__ == "__main__":
    main(*sys.argv[1:])
