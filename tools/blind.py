"""How often the best fixed answers of training are right on other training draws: `python tools/blind.py [task ...]`.

A model that sees nothing cannot do better. Every question is measured whose answers differ in training. Results are
stored in records/blind.json.
"""

import json
import sys
from pathlib import Path

from scengen import list_tasks, load_task
from scengen.agents.facts import load
from scengen.agents.priors import answers, priors, share

DRAWS = 300
"""Number of draws from which the answers are taken, and of those to which they are given."""
MOST = 0.05 + 3.0 * (0.5 / DRAWS) ** 0.5
"""Largest excess of a share over its prior: five points, and three standard errors of a difference of two shares."""
FILE = Path(__file__).parents[1] / "records" / "blind.json"


def measured(name: str) -> dict[str, list[float]]:
    """Prior and share on other draws, by question."""
    task = load_task(name)
    sheet = load(task)
    others = answers(task, sheet, DRAWS, seed=0)
    return {
        id_: [round(prior.share, 3), round(share(prior.answer, others[id_], sheet.facts[id_].within), 3)]
        for id_, prior in priors(task, sheet, DRAWS).items()
        if prior.share < 1.0
    }


def main(*names: str) -> None:
    """Measure, store, and end with status 1 if a share exceeds its prior by more than `MOST`."""
    stored = json.loads(FILE.read_text()) if FILE.exists() else {}
    for name in names or list_tasks():
        stored[name] = measured(name)
        print(name, stored[name], flush=True)
        FILE.write_text(json.dumps(stored, indent=1, sort_keys=True) + "\n")
    every = [pair for of in stored.values() for pair in of.values()]
    excess = [share - prior for prior, share in every]
    largest, mean = 100 * max(excess), 100 * sum(excess) / len(excess)
    print(f"{len(every)} questions, largest excess {largest:.1f} points, mean {mean:.1f}")
    sys.exit(int(max(excess) > MOST))


if __name__ == "__main__":
    main(*sys.argv[1:])
