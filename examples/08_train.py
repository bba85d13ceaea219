"""Make demonstrations, train a small policy on them, and evaluate it. Prints its success rate and why episodes failed.
So few demonstrations show the steps, not a good policy; docs/policies.md has the usual numbers and other learners."""

import sys

import scengen
from scengen.cli import run

POOL, FOLDER = scengen.reference_pool("domino_single"), "generated/examples"
COMMANDS = [
    f"demos task=domino_single n=10 styles=[nominal] apart={POOL} to={FOLDER}/demos",  # none of a scenario of the pool
    f"train policy=bc data={FOLDER}/demos members=1 epochs=60 to={FOLDER}/policy",
    f"evaluate policy={FOLDER}/policy pool={POOL} seeds=3 rollouts=1 to={FOLDER}/evaluation",  # pool=A,B adds an axis
]
for command in COMMANDS:
    print(f"\n$ scengen {command}", flush=True)
    if status := run(command.split()):
        sys.exit(status)
