"""Certify N scenarios of every split of every task at level full. `python tools/certify_all.py 20 [split ...]`"""

import sys

from scengen import cli, config

n, *splits = sys.argv[1:]
pools = [
    (name, split)
    for name in config.tasks()
    for split in ("id", *config.task(name).axes)
    if not splits or split in splits
]
failed = [
    f"{name}/{split}"
    for name, split in pools
    if cli.run(
        (
            "generate",
            f"task={name}",
            f"split={split}",
            f"n={n}",
            "certify=full",
            "workers=2",
            f"pool=generated/certify/{name}-{split}",
        )
    )
]
sys.exit(f"fewer than {n} certified: {', '.join(failed)}" if failed else 0)
