"""Certify N scenarios of every split of every task with certify=full. `python tools/certify_all.py 20 [split ...]`"""

import sys

from scengen import cli, config


def main(n: str, *splits: str) -> None:
    """Go through all tasks and say at the end which pools fell short."""
    failed = []
    for task in config.tasks():
        for split in ("id", *config.task(task).axes):
            if splits and split not in splits:
                continue
            pool = f"generated/certify/{task}-{split}"
            argv = ("generate", f"task={task}", f"split={split}", f"n={n}", "certify=full", "workers=2", f"pool={pool}")
            if cli.run(argv):
                failed.append(f"{task}/{split}")
    sys.exit(f"fewer than {n} certified: {', '.join(failed)}" if failed else 0)


if __name__ == "__main__":  # worker processes import this file again
    main(*sys.argv[1:])
