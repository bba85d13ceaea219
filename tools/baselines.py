"""Train and evaluate small policies in training and on all axes: `python tools/baselines.py [TASK ...]`

Pools, demonstrations and policies are made in generated/baselines. Results are stored in records/baseline, from which
`make docs` shows them on the pages of baselines, axes and predictors. A repeated call
continues.
"""

import json
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Literal

from scengen import cli, list_tasks, load_task
from scengen.evidence import measuring
from scengen.learn.models import BC, KNN, MIP
from scengen.learn.store import read_settings
from scengen.pool import Pool
from scengen.samplers.split import ID
from scengen.samplers.task import Task

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


def main(*arguments: str) -> None:
    """Train and evaluate on some tasks, or on `TASKS`."""
    if unknown := set(arguments) - set(list_tasks()):
        sys.exit(f"no task named {min(unknown)!r}; known: {', '.join(list_tasks())}")
    for task in map(load_task, arguments or TASKS):
        measure(task)


def measure(task: Task) -> None:
    """Make what is missing for a task, and store its results after each policy."""
    pools = make_pools(task, task.axes)
    folder = made_of(task)
    data = folder / RECORDING
    record(task, data, folder / "demos", pools.values())
    first = [(policy, 0) for policy in (*POLICIES, REPLAY, *UNTRAINED)]
    for policy, seed in [*first, *((BC, seed) for seed in AGAIN)]:
        trained = folder / (f"{policy}-{seed}" if seed else policy)
        if policy in POLICIES:
            run("train", f"policy={policy}", f"seed={seed}", f"data={data}", f"to={trained}")
        own = {ID: pools[ID]} if policy in UNTRAINED else pools
        played = folder / f"{trained.name}-evaluation-{len(own) - 1}"  # an evaluation is bound to its pools
        play(str(trained) if policy in POLICIES else policy, [*own.values()], played)
        _store(task, policy, trained, played, own)


def made_of(task: Task) -> Path:
    """Folder of what is made for a version of a task."""
    return MADE / f"{task.name}-v{task.version}"


def make_pools(task: Task, axes: Iterable[str]) -> dict[str, Path]:
    """Make the pools of a task in training and on some axes that are missing. Returns them by split."""
    pools = {split: made_of(task) / split for split in (ID, *axes)}
    for split, pool in pools.items():
        if not (pool / "manifest.json").is_file():
            run("generate", f"task={task.name}", f"split={split}", f"n={SCENARIOS}", f"pool={pool}")
    return pools


def record(task: Task, to: Path, demos: Path, apart: Iterable[Path], *settings: str) -> None:
    """Record demonstrations of a task, unless the recording is there.

    Args:
        demos: folder of the demonstrations.
        apart: pools of evaluation.
        settings: further settings of `scengen demos`.
    """
    if not to.exists():
        pools = ",".join(map(str, apart))
        run("demos", f"task={task.name}", f"n={DEMONSTRATIONS}", f"to={demos}", f"apart=[{pools}]", *settings)
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


def _store(task: Task, policy: str, trained: Path, played: Path, pools: dict[str, Path]) -> None:
    """Store one row for each split."""
    made_with: dict[str, Any] = {"policy": policy}
    if policy in POLICIES:
        own = read_settings(trained)
        made_with |= {name: getattr(own, name) for name in ("demonstrations", "epochs", "seed")}
    for split, own in episodes(played, pools).items():
        reasons = Counter(episode["reason"] for episode in own if not episode["success"])
        solved = sum(episode["success"] for episode in own)
        value = {"solved": solved, "reasons": dict(reasons), "outcomes": outcomes(own, Pool.open(pools[split]))}
        measuring.keep(task, split, "baseline", len(own), value, made_with)


if __name__ == "__main__":
    main(*sys.argv[1:])
