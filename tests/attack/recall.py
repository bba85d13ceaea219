"""Which cheats of people does the adversary find by itself? `python tests/attack/recall.py [n] [budget] [task ...]`

Every kept cheat (`hands`) has a mend. Here the mend is taken out, and the adversary attacks the open task and the
closed one. A line for each: hits by tier in the open task, and in the closed one. Records are in
`records/recall.jsonl`; the command continues them.
"""

import json
import sys
from collections import Counter
from dataclasses import asdict, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from test_hands import HANDS

from scengen.attack.adversary import CLOCK, MEMORY, PRIOR, RANDOM, SEARCH, SERVO, SHORTCUT
from scengen.attack.campaign import GRAMMAR, AttackJob, AttackSettings, drawn, fitted
from scengen.attack.experience import experience
from scengen.compose import load_task
from scengen.validate.identity import source_sha256

RECORDS = Path(__file__).parents[2] / "records" / "recall.jsonl"
TIERS = (SHORTCUT, PRIOR, MEMORY, CLOCK, SERVO, RANDOM, SEARCH)
"""Tiers that do not continue the witness of the scenario, which of course reaches the goal."""
SEED = 21


class Opened:
    """A task whose draws lack a mend."""

    def __init__(self, task, unmended):
        self._task, self._unmended = task, unmended

    def __getattr__(self, name):
        return getattr(self._task, name)

    def draw(self, *where):
        draw = self._task.draw(*where)
        return replace(draw, scenario=self._unmended(draw.scenario))


def hits(task, n, budget):
    """Hits and rollouts by tier."""
    subjects = drawn(task, "id", n, SEED)
    settings = AttackSettings(n=n, budget=budget, seed=SEED)
    job = AttackJob(
        tuple(subjects), budget // n, SEED, TIERS, tuple(fitted(task, settings)), experience(task, SEED + 1, TIERS)
    )
    found, made = Counter(), Counter()
    for number in range(len(subjects)):
        for rate in map(asdict, job(number).rates):
            found[rate["tier"]] += rate["hits"]
            made[rate["tier"]] += rate["rollouts"]
    return {tier: [found[tier], made[tier]] for tier in made}


def main(n=3, budget=120, *tasks):
    n, budget = int(n), int(budget)
    known = [json.loads(line) for line in RECORDS.read_text().splitlines()] if RECORDS.exists() else []
    for name in dict.fromkeys(task for task, _ in HANDS):
        task, seen = load_task(name), set()
        for (of, cheat), hand in HANDS.items():
            if of != name or hand.unmended in seen or (tasks and name not in tasks):
                continue
            seen.add(hand.unmended)
            about = {"task": name, "cheat": cheat, "n": n, "budget": budget, "grammar": GRAMMAR,
                     "source_sha256": source_sha256(task.family)}  # fmt: skip
            record = next((one for one in known if about.items() <= one.items()), None)
            if record is None:
                record = {
                    **about,
                    "open": hits(Opened(task, hand.unmended), n, budget),
                    "closed": hits(task, n, budget),
                }
                with open(RECORDS, "a") as file:
                    file.write(json.dumps(record) + "\n")
            open_, closed = ({t: h for t, h in record[which].items() if h[0]} for which in ("open", "closed"))
            new = [tier for tier, (k, _) in open_.items() if k > 2 * closed.get(tier, [0])[0]]
            told = f"found by {', '.join(new)}" if new else "not found"
            print(f"{name} {cheat}: {told}; open {open_}, closed {closed}", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
