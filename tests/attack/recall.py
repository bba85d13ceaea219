"""Which cheats of people does the adversary find by itself? `python tests/attack/recall.py [n] [budget] [task ...]`

Every kept cheat (`hands`) has a mend. Here the mend is taken out, and the adversary attacks the open task. A success
counts if the closed task refuses the same actions. Where the mend changes the physics or the events, the same actions
prove nothing; there the closed task is attacked as well, and must be solved less than half as often. A line for each:
hits by tier. Records are in `records/recall.jsonl`; the command continues them.
"""

import json
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from test_hands import HANDS

from scengen.attack.adversary import CLOCK, MEMORY, PRIOR, RANDOM, SEARCH, SERVO, SHORTCUT
from scengen.attack.campaign import GRAMMAR, AttackJob, AttackSettings, drawn, fitted
from scengen.attack.experience import experience
from scengen.compose import load_task
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.validate.identity import source_sha256
from scengen.validate.rollout import replay

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


def hits(task, n, budget, refused=None):
    """Hits and rollouts by tier.

    Args:
        refused: test of the number of a subject and a hit; a hit that does not pass it does not count.
    """
    subjects = drawn(task, "id", n, SEED)
    settings = AttackSettings(n=n, budget=budget, seed=SEED)
    job = AttackJob(
        tuple(subjects), budget // n, SEED, TIERS, tuple(fitted(task, settings)), experience(task, SEED + 1, TIERS)
    )
    found, made = Counter(), Counter()
    for number, subject in enumerate(subjects):
        result = job(number)
        made.update({rate.tier: 0 for rate in result.rates})
        for rate in result.rates:
            made[rate.tier] += rate.rollouts
        found.update(hit.tier for hit in result.hits if refused is None or refused(subject, hit))
    return {tier: [found[tier], made[tier]] for tier in made}


def attacked(task, unmended, n, budget):
    """Results of one mend: hits in the open task, and in the closed one if it must be attacked as well."""
    example = task.draw("id", SEED, 0).scenario
    opened = unmended(example)
    texts = [scene_text.emit(one.build())[0] for one in (example, opened)]
    if texts[0] != texts[1] or type(example).events is not type(opened).events:
        return {"open": hits(Opened(task, unmended), n, budget), "closed": hits(task, n, budget)}
    closed = {one.name.index: one.scenario for one in drawn(task, "id", n, SEED)}

    def refused(subject, hit):
        scenario = closed.get(subject.name.index) or task.draw("id", SEED, subject.name.index).scenario
        world = World.load(scene_text.emit(scenario.build())[0], task.embodiment)
        return not replay(scenario, world, hit.actions, task.horizon, until_settled=True).solved

    return {"open": hits(Opened(task, unmended), n, budget, refused), "closed": {}}


def main(n=4, budget=320, *tasks):
    n, budget = int(n), int(budget)
    known = [json.loads(line) for line in RECORDS.read_text().splitlines()] if RECORDS.exists() else []
    mends = {(task, hand.unmended): cheat for (task, cheat), hand in reversed(HANDS.items())}
    found = 0
    for (name, unmended), cheat in sorted(mends.items(), key=lambda item: item[0][0]):
        if tasks and name not in tasks:
            continue
        task = load_task(name)
        about = {"task": name, "cheat": cheat, "n": n, "budget": budget, "grammar": GRAMMAR,
                 "source_sha256": source_sha256(task.family)}  # fmt: skip
        record = next((one for one in known if about.items() <= one.items()), None)
        if record is None:
            record = {**about, **attacked(task, unmended, n, budget)}
            with open(RECORDS, "a") as file:
                file.write(json.dumps(record) + "\n")
        open_, closed = ({t: h for t, h in record[which].items() if h[0]} for which in ("open", "closed"))
        new = [tier for tier, (k, _) in open_.items() if k > 2 * closed.get(tier, [0])[0]]
        found += bool(new)
        told = f"found by {', '.join(new)}" if new else "not found"
        print(f"{name} {cheat}: {told}; open {open_}, closed {closed}", flush=True)
    print(f"found {found} of {sum(not tasks or task in tasks for task, _ in mends)} cheats")


if __name__ == "__main__":
    main(*sys.argv[1:])
