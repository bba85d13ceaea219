"""What asks for little loads little: help, the version and a mistyped command import none of the heavy packages."""

import json
import subprocess
import sys

import pytest

HEAVY = {"mujoco", "numba", "scipy", "numpy", "hydra", "pyarrow", "matplotlib", "robosuite", "gymnasium"}
MOST = 250
"""Modules, the some 60 of the bare interpreter included."""
COUNT = "import json, sys; from scengen import cli; print(json.dumps([cli.run({}), list(sys.modules)]))"


@pytest.mark.parametrize(
    ("given", "status"),
    [([], 0), (["--help"], 0), (["--version"], 0), (["generat"], 2), (["generate", "--help"], 0)],
)
def test_what_asks_for_little_loads_little(given, status):
    done = subprocess.run([sys.executable, "-c", COUNT.format(given)], capture_output=True, text=True, check=True)
    told, modules = json.loads(done.stdout.splitlines()[-1])
    assert told == status and not HEAVY & set(modules) and len(modules) < MOST
