"""Certify the first draws of every split of some tasks, and write what came of it into conf/certified.yaml.

    python tools/certified.py N [TASK ...]

N draws of a split are tried, at level quick. Measure with nothing else running: beside other work processor time
doubles. Lines of tasks that are not named stay.
"""

import sys
import tempfile
from pathlib import Path

import yaml

from scengen import config
from scengen.runs.generate import Settings, generate
from scengen.samplers.split import ID
from scengen.task_files import certified

FILE = Path(__file__).parent.parent / "conf" / "certified.yaml"
HEAD = """# What certification came to: by task and split the draws tried, those certified among them at level quick,
# and the processor time of each that was [s], on one core of an idle machine. Written by tools/certified.py.
"""


def measured(task: str, split: str, n: int) -> dict[str, float]:
    """What becomes of the first n draws of a split."""
    with tempfile.TemporaryDirectory() as folder:
        settings = Settings(split=split, n=n, limit=n, pool=f"{folder}/pool")
        found = config.task(task)
        made = generate(found, config.levels(found)["quick"], settings, lambda *_: None)
    each = round(made.cpu / made.certified, 1) if made.certified else 0.0
    for reason, times in made.reasons.items():
        print(f"  {task}/{split}: {times} times {reason}", flush=True)
    return {"indices": made.indices, "certified": made.certified, "cpu": each}


def main() -> None:
    n, names = int(sys.argv[1]), sys.argv[2:] or config.tasks()
    every = certified()
    for name in names:
        every[name] = {split: measured(name, split, n) for split in (ID, *config.task(name).axes)}
        print(name, every[name], flush=True)
        lines = yaml.safe_dump({name: every[name] for name in sorted(every)}, default_flow_style=None, sort_keys=False)
        FILE.write_text(HEAD + lines)


if __name__ == "__main__":
    main()
