"""Train small policies on more and more demonstrations, into records/curves.

    python tools/learning_curves.py [TASK ...]

Pools and recordings are those of tools/baselines.py, which makes missing ones. Three trainings of each size differ in
their seed, and are evaluated in training and on two axes. A repeated call continues. `python tools/baselines.py page`
shows the results in docs/baselines.md.
"""

import json
import sys
from collections.abc import Iterator

import axis_records
import baselines

from scengen.learn.models import BC, KNN, MIP
from scengen.pool import Pool

SIZES = (25, 50, 100, 200)
"""Numbers of demonstrations, held-out ones included."""
SEEDS = {BC: (0, 1, 2), MIP: (0, 1, 2), KNN: (0,)}
"""Seeds of the trainings of a policy; nearest neighbours have none."""


def main(*tasks: str) -> None:
    """Train and evaluate what is missing."""
    if unknown := {*tasks} - {*baselines.AXES}:
        sys.exit(f"no task named {min(unknown)!r}; known: {', '.join(baselines.AXES)}")
    for task in tasks or baselines.AXES:
        measure(task)


def measure(task: str) -> None:
    """Train and evaluate what is missing for a task, and store its results after each policy."""
    pools, data = baselines.prepare(task, baselines.AXES[task])
    hashes = {split: Pool.open(pool).sha256 for split, pool in pools.items()}
    path = baselines.CURVES / f"{task}.jsonl"
    found = [one for one in axis_records.lines(path) if one["pools_sha256"] == hashes]
    known = {(one["policy"], one["size"], one["seed"]) for one in found}
    for policy, size, seed in runs():
        if (policy, size, seed) not in known:
            folder = baselines.MADE / task / "curves" / f"{policy}-{size}-{seed}"
            settings = (f"policy={policy}", f"data={data}", f"demonstrations={size}", f"seed={seed}")
            baselines.run("train", *settings, f"to={folder}")
            played = folder / "evaluation"
            baselines.play(str(folder), [*pools.values()], played)
            episodes = baselines.episodes(played, pools)
            solved = {split: sum(one["success"] for one in own) for split, own in episodes.items()}
            told = {"policy": policy, "size": size, "seed": seed, "solved": solved, "pools_sha256": hashes}
            found.append(told)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("".join(json.dumps(one, sort_keys=True) + "\n" for one in found))


def runs() -> Iterator[tuple[str, int, int]]:
    """Policy, number of demonstrations and seed of every training; all of one seed come before the next one."""
    for seed in max(SEEDS.values(), key=len):
        for size in SIZES:
            for policy in SEEDS:
                if seed in SEEDS[policy]:
                    yield policy, size, seed


if __name__ == "__main__":
    main(*sys.argv[1:])
