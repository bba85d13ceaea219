"""Certify N scenarios of every split of every task with certify=full. `python tools/certify_all.py 20 [split ...]`"""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

from scengen import config

POOLS = 2
"""How many are made at a time, each by a process of its own: a pool of one scenario keeps one core busy."""


def certified(task: str, split: str, n: str) -> bool:
    """Make one pool, and print what came of it once it is done."""
    asked = (f"task={task}", f"split={split}", f"n={n}", "certify=full", f"pool=generated/certify/{task}-{split}")
    command = [sys.executable, "-m", "scengen", "generate", *asked]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    print(done.stdout, end="", flush=True)
    return done.returncode == 0


def main(n: str, *splits: str) -> None:
    """Go through all tasks and say at the end which pools fell short."""
    every = [(task, split) for task in config.tasks() for split in ("id", *config.task(task).axes)]
    asked = [(task, split) for task, split in every if not splits or split in splits]
    with ThreadPoolExecutor(POOLS) as threads:
        held = list(threads.map(lambda one: certified(*one, n), asked))
    failed = [f"{task}/{split}" for (task, split), holds in zip(asked, held, strict=True) if not holds]
    sys.exit(f"fewer than {n} certified: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":
    main(*sys.argv[1:])
