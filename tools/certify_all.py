"""Certify N scenarios of every split of every task at level full. `python tools/certify_all.py 20`"""

import sys

from scengen import cli, config

n = sys.argv[1] if len(sys.argv) > 1 else "20"
failed = [
    f"{name}/{split}"
    for name in config.tasks()
    for split in ("id", *config.task(name).axes)
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
