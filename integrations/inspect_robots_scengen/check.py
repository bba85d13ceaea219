"""Compares verdicts: the policy `replay` in `inspect_robots.eval`, and in `scengen evaluate`. Tests conformance.

    python check.py POOL [POOL ...]

Every scenario of the pools is played in both. Exit status 1 if a verdict differs, or the lines do not verify.
"""

import sys
from tempfile import TemporaryDirectory

import inspect_robots
import numpy as np
from inspect_robots.conformance import assert_embodiment_conformant
from inspect_robots.policy import PolicyBase, PolicyInfo
from inspect_robots.scene import Scene
from inspect_robots.types import Action, ActionChunk, Observation
from inspect_robots_scengen import ScengenEmbodiment, scengen_task

from scengen import cli
from scengen.evaluate.policies import NearestReplay
from scengen.evaluate.verdicts import compared, replay_verdicts
from scengen.pool import Pool
from scengen.pool.library import Library


class Replay(PolicyBase):
    """scengen's policy `replay`."""

    def __init__(self, body: ScengenEmbodiment):
        self.info = PolicyInfo("replay", body.info.action_space, body.info.observation_space, body.info.control_hz)
        memory = Library([Pool.open(folder) for folder in body.pools]).of_split("id")
        self.body, self.policy, self.begun = body, NearestReplay(body.env, memory), False

    def reset(self, scene: Scene) -> None:
        self.begun = False

    def act(self, observation: Observation) -> ActionChunk:
        if not self.begun:
            self.policy.reset({}, {}, 0)
            self.begun = True
        return ActionChunk([Action(np.asarray(self.policy.act({}), float) * self.body.units)])


def main() -> int:
    pools = sys.argv[1:]
    splits = {row.split for pool in pools for row in Pool.open(pool).rows(witness=False)}
    count = min(len(Pool.open(folder)) for folder in pools)
    there: dict[str, bool] = {}
    with TemporaryDirectory() as folder:
        lines = f"{folder}/lines"
        body = ScengenEmbodiment(",".join(pools), hz=100, cameras=False, lines=lines, policy="replay")
        assert_embodiment_conformant(body.info)
        for split in sorted(splits):
            task = scengen_task(",".join(pools), split=split, n=count)
            (log,) = inspect_robots.eval(task, Replay(body), body, log_dir=folder, store_actions=False)
            there |= {sample.scene_id: bool(sample.reduced["success_at_end"]) for sample in log.samples}
        body.close()
        sound = cli.run(["verify", f"results={lines}"]) == 0
    line, same = compared(there, replay_verdicts(pools))
    print(line)
    return 0 if same and sound else 1


if __name__ == "__main__":
    sys.exit(main())
