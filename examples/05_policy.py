"""Evaluate a policy in distribution and on an axis. This one sees where the first tile stands, but always pushes at a
height that suits the tiles of training. Prints success rates: on the axis, the hand passes over the low first tile."""

import sys

import numpy as np

import scengen
from scengen.cli import run

ID, AXIS = scengen.reference_pool("domino_single"), "generated/examples/low_starter"


class Habit:
    observations = ("robot0_eef_pos", "object-state")  # what it needs; scengen evaluate follows

    def __init__(self, env):
        self.names = env.metadata["names"]["object-state"]  # one for each number of the stream

    def position(self, observation, body):
        start = self.names.index(f"{body}_pos.x")
        return observation["object-state"][start : start + 3]

    def reset(self, observation, info, seed):
        first, slab = (self.position(observation, body) for body in ("tile_0", "slab"))
        along = (slab - first) / np.linalg.norm(slab - first)
        ways = ((-0.05, 0.18), (-0.05, 0.07), (0.03, 0.07), (-0.06, 0.07))  # behind, down, push, back [m]
        self.goals = [first + way * along + [0, 0, up] for way, up in ways]

    def act(self, observation):
        ahead = self.goals[0] - observation["robot0_eef_pos"]
        if len(self.goals) > 1 and np.linalg.norm(ahead) < 0.01:
            self.goals.pop(0)
        return [*np.clip(ahead / 0.05, -0.6, 0.6), 0, 0, 0, 1]  # translation, rotation, closed gripper


generate = ["generate", "task=domino_single", "split=low_starter", "n=3", f"pool={AXIS}"]
evaluate = ["evaluate", "policy=__main__:Habit", f"pool={ID},{AXIS}", "seeds=3", "rollouts=1"]
evaluate += ["to=generated/examples/habit"]
sys.exit(run(generate) or run(evaluate))  # the same as `scengen generate ...` and `scengen evaluate ...`
