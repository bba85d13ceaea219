"""Add an OOD axis to a task and certify a scenario of it. Prints the proof that it leaves the training distribution,
and how an axis that does not leave it is refused. docs/axis.md shows how to keep an axis in a file and evaluate it."""

import scengen
from scengen.errors import BadConfig

AXIS = "+task.axes.heavy_tiles={why: The tiles are heavier than any in training, replace: {tile: {mass: %s}}}"

task = scengen.load_task("domino_single", [AXIS % "[uniform, 0.065, 0.075]"])
for proof in task.proofs["heavy_tiles"]:
    print(f"{proof.parameter} leaves training by {proof.gap:.3f} kg = {proof.relative:.2f} training widths")

trained, draw = (task.draw(split, seed=0, index=1) for split in ("id", "heavy_tiles"))
print(f"a tile has {trained.scenario.tile.mass:.3f} kg in training, {draw.scenario.tile.mass:.3f} kg in its OOD twin")
certified = scengen.certify(draw.scenario, task.horizon)
print(f"the twin is {certified.certificate.verdict}")

try:
    scengen.load_task("domino_single", [AXIS % "[uniform, 0.05, 0.07]"])  # training has 0.03 to 0.06 kg
except BadConfig as error:
    print(f"refused: {error}")
