"""Disturb the world and the actions of a solution: poses, masses, friction, noise, latency. Prints where it breaks."""

from dataclasses import replace

import scengen
from scengen.sim.scene_text import emit
from scengen.validate.rollout import Jitter
from scengen.validate.settings import Robust

RUNS = 4
CERTIFIED = Robust()  # the jitter under which a certificate wants the oracle to succeed
KINDS = {
    "none": Robust(position=0, turn=0, mass=0, friction=0, noise=0, latency=0),
    "as in a certificate": CERTIFIED,
    "poses 10 mm and 5 deg": replace(CERTIFIED, position=0.01, turn=5.0),
    "masses and friction 40 %": replace(CERTIFIED, mass=0.4, friction=0.4),
    "noise of the whole range": replace(CERTIFIED, noise=1.0),
    "latency 0.5 s": replace(CERTIFIED, latency=50),
}

task = scengen.load_task("domino_single")
scenario = task.draw("id", seed=0, index=1).scenario
world = scengen.World.load(emit(scenario.build())[0])
for name, limits in KINDS.items():
    rollouts = []
    for number in range(RUNS):  # every second run has latency
        jitter = Jitter.within(limits, scenario.id, number)
        rollouts.append(scengen.run(scenario, jitter.disturbed(world), scenario.oracle, task.horizon, jitter=jitter))
    why = next((f"such as: {rollout.reason}" for rollout in rollouts if not rollout.solved), "")
    print(f"{name:25} {sum(rollout.solved for rollout in rollouts)} of {RUNS} solved  {why}")
