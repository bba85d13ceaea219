"""Compares verdicts: the policy `replay` in lerobot-eval's own rollout, and in `scengen evaluate`.

    python check.py POOL [POOL ...]

Every scenario of the pools is played in both. Exit status 1 if a verdict differs, or the lines do not verify.
"""

import sys
from tempfile import TemporaryDirectory

import numpy as np
import torch
from lerobot.scripts.lerobot_eval import rollout
from lerobot_env_scengen import ScengenEnv

from scengen import cli
from scengen.envs.gym import PoolEnv
from scengen.evaluate.policies import NearestReplay
from scengen.evaluate.verdicts import compared, replay_verdicts
from scengen.pool import Pool
from scengen.pool.library import Library


class Replay(torch.nn.Module):
    """scengen's policy `replay` for a batch of environments, with the interface of LeRobot's policies."""

    def __init__(self, envs: list[PoolEnv], memory: Library):
        super().__init__()
        self.policies, self.begun = [NearestReplay(env, memory) for env in envs], False

    def reset(self) -> None:
        """Start an episode. LeRobot calls it before the environments are reset."""
        self.begun = False

    def select_action(self, batch: dict) -> torch.Tensor:
        """The next action of every environment, shape (batch, 7)."""
        if not self.begun:
            for policy in self.policies:
                policy.reset({}, {}, 0)
            self.begun = True
        return torch.from_numpy(np.array([policy.act({}) for policy in self.policies], np.float32))


def lerobot_verdicts(pools: list[str], lines: str) -> dict[str, bool]:
    """Whether each scenario is solved in LeRobot's rollout, by id; lines of the episodes are written into a folder."""
    first = next(Pool.open(pools[0]).rows(witness=False))
    config = ScengenEnv(task=first.task, pool=",".join(pools), fps=100, lines=lines, policy_name="replay")
    found: dict[str, bool] = {}
    memory = Library([Pool.open(folder) for folder in pools]).of_split("id")
    for vector in (batches[0] for batches in config.create_envs(n_envs=1).values()):
        env = vector.envs[0].unwrapped
        policy = Replay([env], memory)
        for seed in range(1000, 1000 + len(env.scenarios)):
            played = rollout(vector, policy, _same, _same, _same, _same, seeds=[seed])
            found[env.scenarios[seed % len(env.scenarios)]] = bool(played["success"].any())
        vector.close()
    return found


def _same(value: object) -> object:
    return value


def main() -> int:
    pools = sys.argv[1:]
    with TemporaryDirectory() as folder:
        line, same = compared(lerobot_verdicts(pools, f"{folder}/lines"), replay_verdicts(pools))
        sound = cli.run(["verify", f"results={folder}/lines"]) == 0
    print(line)
    return 0 if same and sound else 1


if __name__ == "__main__":
    sys.exit(main())
