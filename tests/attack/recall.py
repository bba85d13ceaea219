"""Which cheats of people does the adversary find by itself? `python tests/attack/recall.py [n] [budget] [task ...]`

`python tests/attack/recall.py play [task ...]` plays each cheat on the same draws of training in its task as it is and
without its mend, into `records/cheat`. docs/kept_cheats.md shows both.

Every kept cheat (`hands`) has a mend. Here the mend is taken out, and the adversary attacks the open task. If the mend
is a rule, a success counts if the closed task refuses the same actions. If it changes the physics or the events, the
same actions prove nothing; there the closed task is attacked as well, and must be solved less than half as often.
Results are in `records/recall`; the command continues them.
"""

import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from opened import Opened
from test_hands import HANDS, outcome

from scengen.attack.adversary import CLOCK, MEMORY, PRIOR, RANDOM, SEARCH, SERVO, SHORTCUT, TIERS
from scengen.attack.campaign import GRAMMAR, AttackJob, AttackSettings, drawn, fitted
from scengen.attack.experience import experience
from scengen.compose import load_task
from scengen.evidence import measuring
from scengen.sim import scene_text
from scengen.sim.world import World
from scengen.validate.rollout import replay

UNAIDED = (SHORTCUT, PRIOR, MEMORY, CLOCK, SERVO, RANDOM, SEARCH)
"""Tiers that do not continue the witness of the scenario, which of course reaches the goal. They alone attack a task
whose mend changes the physics or the events."""
SEED = 21
DRAWS = 12
"""Number of training draws on which cheats are played."""


def play(*tasks):
    """Play the cheats that the ledger lacks."""
    for name, cheat in HANDS:
        task, made_with = load_task(name), {"cheat": cheat, "draws": DRAWS}
        if (tasks and name not in tasks) or measuring.measured(task, "id", "cheat", made_with):
            continue
        found = {
            which: [outcome(name, cheat, index, mended) for index in range(DRAWS)].count("success")
            for which, mended in (("closed", True), ("open", False))
        }
        measuring.keep(task, "id", "cheat", DRAWS, found, made_with)
        print(f"{name} {cheat}: {found['closed']} of {DRAWS}, {found['open']} without its mend", flush=True)


def job(task, n, budget, tiers):
    """The attack on the first draws."""
    settings = AttackSettings(n=n, budget=budget, seed=SEED)
    subjects, priors = drawn(task, "id", n, SEED), fitted(task, settings)
    return AttackJob(tuple(subjects), budget // n, SEED, tiers, tuple(priors), known=experience(task, SEED + 1, tiers))


def counted(results):
    """Hits and rollouts by tier."""
    found, made = Counter(), Counter()
    for result in results:
        for rate in result.rates:
            found[rate.tier] += rate.hits
            made[rate.tier] += rate.rollouts
    return {tier: [found[tier], made[tier]] for tier in made}


def compared(task, unmended, n, budget):
    """Results of a mend that changes the physics or the events: hits in the open and in the closed task."""
    jobs = {"open": job(Opened(task, unmended), n, budget, UNAIDED), "closed": job(task, n, budget, UNAIDED)}
    found = {which: counted(map(one, range(len(one.subjects)))) for which, one in jobs.items()}
    new = [tier for tier, (hits, _) in found["open"].items() if hits > 2 * found["closed"].get(tier, [0])[0]]
    return {**found, "found": ", ".join(new)}


def hunted(task, unmended, n, budget):
    """Results of a mend that is a rule: attack until a success whose actions the closed task refuses."""
    attack, results = job(Opened(task, unmended), n, budget, TIERS), []
    for number, subject in enumerate(attack.subjects):
        world = World.load(subject.scene_xml, task.embodiment)
        scenario = task.draw("id", SEED, subject.name.index).scenario

        def refused(hit, world=world, scenario=scenario):
            world.reset()
            return not replay(scenario, world, hit.actions, task.horizon, until_settled=True).solved

        results.append(replace(attack, until=refused)(number))
        if results[-1].hits and refused(last := results[-1].hits[-1]):
            return {"open": counted(results), "found": f"{last.tier}: {last.plan}"}
    return {"open": counted(results), "found": ""}


def attacked(task, unmended, n, budget):
    """Results of one mend."""
    example = task.draw("id", SEED, 0).scenario
    opened = unmended(example)
    texts = [scene_text.emit(one.build())[0] for one in (example, opened)]
    rule = texts[0] == texts[1] and type(example).events is type(opened).events
    return (hunted if rule else compared)(task, unmended, n, budget)


def main(n=4, budget=320, *tasks):
    n, budget = int(n), int(budget)
    mends = {(task, hand.unmended): cheat for (task, cheat), hand in reversed(HANDS.items())}
    found = 0
    for (name, unmended), cheat in sorted(mends.items(), key=lambda item: item[0][0]):
        if tasks and name not in tasks:
            continue
        task, made_with = load_task(name), {"cheat": cheat, "budget": budget, "grammar": GRAMMAR, "n": n}
        row = measuring.measured(task, "id", "recall", made_with)
        if row is None:
            row = measuring.keep(task, "id", "recall", n, attacked(task, unmended, n, budget), made_with)
        found += bool(row.value["found"])
        print(f"{name} {cheat}: {row.value['found'] or 'not found'}", flush=True)
    print(f"found {found} of {sum(not tasks or task in tasks for task, _ in mends)} cheats")


if __name__ == "__main__":
    play(*sys.argv[2:]) if sys.argv[1:2] == ["play"] else main(*sys.argv[1:])
