"""Certify on a Ray cluster, here one of this machine alone, and in one process. Prints that both pools are equal."""

import sys

from scengen.cli import run
from scengen.pool import Pool

FOLDER = "generated/examples"
COMMAND = ["generate", "task=domino_single", "n=2"]
RAY = [
    "executor=ray",
    "executor.address=local",
    "workers=2",
]  # address=auto or HOST:PORT: a cluster, see docs/cluster.md

if status := run([*COMMAND, f"pool={FOLDER}/ray", *RAY]) or run([*COMMAND, f"pool={FOLDER}/local"]):
    sys.exit(status)
hashes = [Pool.open(f"{FOLDER}/{name}").sha256 for name in ("ray", "local")]
print(f"the pools have {'the same bytes' if hashes[0] == hashes[1] else 'different bytes'}: {hashes[0][:12]}")
