"""Processes that are forked after a picture end with a line that says spawn, and do not wait for ever."""

import os
import subprocess
import sys

import helpers
import pytest

SCRIPT = """
import os, sys
from scengen.envs.gym import PoolEnv
def drawn():
    env = PoolEnv("domino_single", sys.argv[1], render_mode="rgb_array", width=32, height=32)
    env.reset(seed=0)
    return env, env.render()
env, _ = drawn()
if not os.fork():
    drawn()
print("ended with", os.waitstatus_to_exitcode(os.wait()[1]))
env.render()
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.skipif(not helpers.pictures_are_possible(), reason="no OpenGL")
def test_a_process_forked_after_a_picture_says_spawn_and_ends():
    argv = [sys.executable, "-c", SCRIPT, str(helpers.REFERENCE)]
    found = subprocess.run(argv, capture_output=True, text=True, timeout=100)
    assert found.stdout == "ended with 1\n" and not found.returncode
    assert "Forked" in found.stderr.splitlines()[-1] and "start processes with spawn" in found.stderr.splitlines()[-1]
