"""Certify the first draws of every split of some tasks, and write what came of it into conf/certified.yaml.

    python tools/certified.py N [split=SPLIT] [TASK ...]

N draws of every split, or of the one that is named, are tried at level quick. Measure with nothing else running: beside
other work processor time doubles. What is not measured stays as it was.
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


def main(n: str, *others: str) -> None:
    """Measure, and write after every task, so that two processes may share the tasks."""
    only = [other.partition("=")[2] for other in others if other.startswith("split=")]
    for name in [other for other in others if "=" not in other] or config.tasks():
        found = {split: measured(name, split, int(n)) for split in only or (ID, *config.task(name).axes)}
        print(name, found, flush=True)
        every = certified()
        every[name] = {**every.get(name, {}), **found}
        lines = yaml.safe_dump({name: every[name] for name in sorted(every)}, default_flow_style=None, sort_keys=False)
        FILE.write_text(HEAD + lines)


if __name__ == "__main__":
    main(*sys.argv[1:])
