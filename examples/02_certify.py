"""Draw a scenario out of distribution, certify it, and replay its witness. Prints what changed and every check."""

import scengen

task = scengen.load_task("domino_single")
draw = task.draw("diagonal", seed=0, index=3)  # scenario 3 of training, with a chain that runs diagonally
print(f"scenario {draw.scenario.id}, training twin {draw.id_twin}; the axis changed {dict(draw.shifted)}")

certified = scengen.certify(draw.scenario, task.horizon)
for check in certified.certificate.checks:
    print(f"{check.name:10} {'passed' if check.passed else check.reason}")
print(f"verdict: {certified.certificate.verdict}")

# The witness is the recorded actions of a success. It solves the scenario without the solver, bit for bit.
world = scengen.World.load(certified.scene_xml)  # world.model and world.data are MuJoCo's
rollout = scengen.replay(draw.scenario, world, certified.witness, task.horizon)
print(
    f"replay: {rollout.outcome} after {rollout.seconds:.2f} s, same final state: {rollout.digest == certified.digest}"
)
