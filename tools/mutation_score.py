"""Mutation score of the adversary: `python tools/mutation_score.py [budget] [task ...]`.

Every mutant of tests/attack/mutants.py that a written cheat exploits is attacked, without the declared shortcuts, until
an attempt succeeds that the sound family refuses. For comparison: the hits of random macros with the same number of
rollouts, and the number of varied runs of the oracle that would be taken for a way around the task. Results are stored
in records/mutation, and a repeated call continues there: first the varied runs, then a mutant of each task,
then the next ones, so that an interrupted call has measured all tasks alike.

`python tools/mutation_score.py hits [budget] [task ...]` counts, for each mutant that a written cheat exploits, all
successes that the sound family refuses, of the adversary and of random macros with the same number of rollouts.
"""

import json
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, cast
from unittest import mock

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "attack"))

from cheats import written
from mutants import BARS, TASKS, Mutant, mutants
from opened import Opened

from scengen import load_task
from scengen.attack.adversary import MEMORY, PRIOR, RANDOM, TIERS, Attack
from scengen.attack.campaign import FITTING_SEED, GRAMMAR, AttackJob, AttackSettings, Subject, drawn, fitted, player_of
from scengen.attack.evidence import CausalContacts, Hit
from scengen.attack.experience import Experience, experience
from scengen.attack.macros import Macro
from scengen.attack.player import SETTLE_TIME, Attempt, Player
from scengen.attack.signature import pairs
from scengen.evidence import ledger, measuring
from scengen.evidence.ledger import Evidence
from scengen.samplers.split import ID
from scengen.samplers.task import Task
from scengen.validate.rollout import Jitter, run
from scengen.validate.settings import Robust

SCENARIOS = 10
"""Number of scenarios for each mutant, as for a task in `scengen measure kind=attack`."""
CHEATED = 2
"""Number of these scenarios in which written cheats are played."""
PLAYED = tuple(tier for tier in TIERS if tier != "shortcut")
"""Tiers that attack a mutant: shortcuts are written cheats, so that they would find nothing by themselves."""
VARIED_RUNS = 40
"""Number of varied runs of the oracle for each task."""
WIDER_JITTER = Robust(position=0.003, turn=2.0, mass=0.08, friction=0.15, noise=0.04)
"""Jitter of these runs: 1.5 times that of a certificate."""


def main(budget: str = "500", *tasks: str) -> None:
    """Score all mutants, or those of some tasks, and print the score."""
    for task in map(load_task, tasks or TASKS):
        if not done(task, ""):
            found = flagged(task.name)
            _keep(task, "", found["runs"], found)
    for mutant in mutants():
        task = load_task(mutant.task)
        if (not tasks or mutant.task in tasks) and not done(task, mutant.name):
            found = scored(mutant, int(budget))
            _keep(task, mutant.name, SCENARIOS if found["cheats"] else CHEATED, found)
    print(_summary(stored()))


def stored() -> list[Evidence]:
    """The rows about today's tasks and plans."""
    return [row for task in TASKS for row in ledger.newest("mutation", task) if counts(row)]


def done(task: Task, mutant: str) -> bool:
    """Whether the ledger has a mutant of a task, or with an empty name its varied runs."""
    rows = [row for row in ledger.newest("mutation", task.name) if row.has(mutant=mutant) and counts(row)]
    return any(not measuring.stale(task, row) for row in rows)


def counts(row: Evidence) -> bool:
    """Whether a row was made with today's plans, or without any: where no written cheat succeeds, none is played."""
    return row.has(grammar=GRAMMAR) or not row.value.get("cheats")


def compare(budget: str = "60", *tasks: str) -> None:
    """Count hits of the adversary and of random macros at equal cost."""
    ours, luck = 0, 0
    for mutant in mutants():
        if mutant.narrow or (tasks and mutant.task not in tasks):
            continue
        with mutant.weakened():
            subjects = mutant.subjects(SCENARIOS)
            if not exploits(mutant, subjects):
                continue
            found, random = (
                counted(mutant, subjects, int(budget), PLAYED),
                counted(mutant, subjects, int(budget), [RANDOM]),
            )
        ours, luck = ours + found, luck + random
        print(json.dumps({"task": mutant.task, "mutant": mutant.name, "hits": found, "random": random}), flush=True)
    print(f"{ours} hits of the adversary, {luck} of random macros at equal cost")


def counted(mutant: Mutant, subjects: Sequence[Subject], budget: int, tiers: Sequence[str]) -> int:
    """Number of successes that the sound family refuses, in `budget` rollouts."""
    job = _job(mutant, subjects, budget // len(subjects), tiers)
    return sum(
        mutant.kills(hit, subject.scenario, subject.scene_xml)
        for number, subject in enumerate(subjects)
        for hit in job(number).hits
    )


def scored(mutant: Mutant, budget: int) -> dict[str, Any]:
    """The result of one mutant."""
    start = time.process_time()
    if mutant.narrow:
        return guessed(mutant)
    with mutant.weakened():
        cheats = exploits(mutant, mutant.subjects(CHEATED))
        subjects = mutant.subjects(SCENARIOS) if cheats else []
        used, found = hunted(mutant, subjects, budget, PLAYED) if cheats else (0, None)
        luck = hunted(mutant, subjects, used, [RANDOM])[1] if found else None
    return {
        "cheats": cheats,
        "rollouts": used,
        "found": _told(found),
        "random": _told(luck),
        "cpu": round(time.process_time() - start, 1),
    }


def guessed(mutant: Mutant) -> dict[str, Any]:
    """The result of a task whose ranges are too narrow: fixed answers, by statics and in rollouts."""
    start = time.process_time()
    priors = fitted(mutant.asked, AttackSettings())
    above = [p for p in priors if p.fresh is not None and p.fresh > BARS.get(len(p.values), 1.0)]
    hits, used = [], 0
    for number, subject in enumerate(subjects := mutant.subjects(SCENARIOS)):
        result = Attack(player_of(subject), 0, number, len(subjects), priors).run(2 * len(priors), [PRIOR])
        used += sum(rate.rollouts for rate in result.rates)
        hits += [hit for hit in result.hits if len(above) and hit.tier == f"prior_{len(above[-1].values)}"]
    told = _told(hits[0]) if hits else ""
    return {
        "cheats": [f"{len(p.values)} fixed: {p.fresh:.0%}" for p in above],
        "rollouts": used,
        "found": told,
        "random": "",
        "cpu": round(time.process_time() - start, 1),
    }


def exploits(mutant: Mutant, subjects: Sequence[Subject]) -> list[str]:
    """Names of the written cheats that reach the goal because of the weakness."""
    found = set()
    for subject in subjects:
        player, known = player_of(subject), written(mutant.task, subject.scenario)
        with mock.patch.object(type(subject.scenario), "shortcuts", lambda self, known=known: known):
            for name in known:
                for raw in (False, True):
                    attempt = Attempt("shortcut", (Macro("shortcut", name),))
                    played = player.play(attempt.macros, raw)
                    if played.solved and mutant.kills(
                        _hit(player, attempt, played), subject.scenario, subject.scene_xml
                    ):
                        found.add(name)
    return sorted(found)


def hunted(mutant: Mutant, subjects: Sequence[Subject], budget: int, tiers: Sequence[str]) -> tuple[int, Hit | None]:
    """Attack until a hit that the sound family refuses.

    Returns:
        The number of rollouts, and the hit; None if there was none.
    """
    used = 0
    job = _job(mutant, subjects, budget // len(subjects), tiers)
    for number, subject in enumerate(subjects):

        def kills(hit: Hit, subject: Subject = subject) -> bool:
            return mutant.kills(hit, subject.scenario, subject.scene_xml)

        result = replace(job, until=kills)(number)
        used += sum(rate.rollouts for rate in result.rates)
        if result.hits and kills(result.hits[-1]):
            return used, result.hits[-1]
    return used, None


def _job(mutant: Mutant, subjects: Sequence[Subject], budget: int, tiers: Sequence[str]) -> AttackJob:
    """The attack on a mutant, with `budget` rollouts for each scenario."""
    task = load_task(mutant.task)
    asked = cast(Task, Opened(task, mutant.change)) if mutant.change else task
    priors = fitted(asked, AttackSettings()) if PRIOR in tiers else []
    known = trained(mutant.task) if MEMORY in tiers else Experience()
    return AttackJob(tuple(subjects), budget, 0, tuple(tiers), tuple(priors), known=known)


@cache
def trained(task: str) -> Experience:
    """What training tells of a task."""
    return experience(load_task(task), FITTING_SEED, PLAYED)


def flagged(task: str) -> dict[str, Any]:
    """The number of varied runs of the oracle that lack a contact which counts as causal, and these contacts."""
    runs, taken, lacking = 0, 0, set()
    subjects = drawn(load_task(task), "id", 4, 7)
    for subject in subjects:
        player = player_of(subject)
        causal = CausalContacts(player)
        for k in range(VARIED_RUNS // len(subjects)):
            jitter = Jitter.within(WIDER_JITTER, f"varied/{subject.scenario.id}", k)
            world = jitter.disturbed(player.world, player.scenario.DISTURBED)
            rollout = run(subject.scenario, world, subject.scenario.oracle, subject.horizon, SETTLE_TIME, jitter)
            if rollout.solved:
                runs += 1
                found = causal.lacking(pairs(world))
                taken += bool(found)
                lacking |= found
    return {"runs": runs, "flagged": taken, "lacking": sorted(lacking)}


def _hit(player: Player, attempt: Attempt, played: Any) -> Hit:
    """A success as a hit that lacks nothing."""
    scenario, digest = player.scenario.id, played.digest
    return Hit(scenario, attempt.tier, False, str(attempt), played.seconds, digest, (), (), {}, played.actions)


def _told(hit: Hit | None) -> str:
    if hit is None:
        return ""
    return f"{hit.tier} {'raw' if hit.raw else 'filtered'}: {hit.plan[:120]}"


def _keep(task: Task, mutant: str, n: int, found: dict[str, Any]) -> None:
    """Store a result."""
    row = measuring.keep(task, ID, "mutation", n, found, {"mutant": mutant, "grammar": GRAMMAR})
    print(json.dumps({"task": row.task, "mutant": mutant, **found}), flush=True)


def _summary(rows: Sequence[Evidence]) -> str:
    scores = [row.value for row in rows if row.made_with["mutant"]]
    exploited = [one for one in scores if one["cheats"]]
    lines = [f"{len(scores)} mutants, {len(exploited)} exploited by a written cheat"]
    for what in ("found", "random"):
        lines.append(f"{what}: {sum(bool(one[what]) for one in exploited)} of {len(exploited)}")
    varied = [row.value for row in rows if not row.made_with["mutant"]]
    runs, taken = (sum(one[what] for one in varied) for what in ("runs", "flagged"))
    lines.append(f"varied oracle runs flagged: {taken} of {runs}")
    return "\n".join(lines)


if __name__ == "__main__":
    if sys.argv[1:2] == ["hits"]:
        compare(*sys.argv[2:])
    else:
        main(*sys.argv[1:])
