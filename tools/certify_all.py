"""Certify N scenarios of every split of every task with certify=full.

python tools/certify_all.py [N] [TASK ...] [SPLIT ...]
"""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

from scengen.samplers import task_files

POOLS = 2
"""Number of pools that are made at a time, each by one process: a pool of one scenario keeps one core busy."""


def shortfall(task: str, split: str, n: int) -> str:
    """Make one pool, and print its result when it is done.

    Returns:
        Which pool fell short, and the last thing that was said of it; empty where none did.
    """
    asked = (f"task={task}", f"split={split}", f"n={n}", "certify=full", f"pool=generated/certify/{task}-{split}")
    command = [sys.executable, "-m", "scengen", "generate", *asked]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    print(done.stdout, end="", flush=True)
    return f"{task}/{split}: {(done.stdout.splitlines() or [''])[-1]}" if done.returncode else ""


def main(n: str = "20", *names: str) -> None:
    """Certify all tasks, or the named ones, and list at the end the pools that fell short."""
    every = [(task, split) for task in task_files.tasks() for split in task_files.splits(task)]
    tasks, splits = ({pair[k] for pair in every}.intersection(names) for k in (0, 1))
    if unknown := [*([] if n.isdecimal() else [n]), *sorted(set(names) - tasks - splits)]:
        sys.exit(f"{', '.join(unknown)}: not known; say certify_all.py N [TASK ...] [SPLIT ...]")
    asked = [(task, split) for task, split in every if task in (tasks or {task}) and split in (splits or {split})]
    with ThreadPoolExecutor(POOLS) as threads:
        short = [line for line in threads.map(lambda one: shortfall(*one, int(n)), asked) if line]
    sys.exit("\n".join([f"fewer than {n} certified:", *short]) if short else 0)


if __name__ == "__main__":
    main(*sys.argv[1:])
