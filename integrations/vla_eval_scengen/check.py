"""Compares verdicts: the policy `replay` in `vla-eval run` behind a separate model server, and in `scengen evaluate`.

    python check.py POOL [POOL ...]

Every scenario of the pools is played in both. Exit status 1 if a verdict differs, or the lines do not verify.
"""

import json
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml
from vla_eval.model_servers.base import SessionContext
from vla_eval.model_servers.predict import PredictModelServer
from vla_eval.model_servers.serve import serve
from vla_eval.specs import RAW, DimSpec
from vla_eval.types import Action, Observation

from scengen import cli
from scengen.envs.gym import PoolEnv
from scengen.evaluate.policies import NearestReplay
from scengen.evaluate.verdicts import compared, replay_verdicts
from scengen.pool import Pool
from scengen.pool.library import Library

PORT = 8753
LINES = "lines"
"""Folder of the lines."""


class ReplayServer(PredictModelServer):
    """scengen's policy `replay`. It knows the scenario from the episode, as the policy does in `scengen evaluate`."""

    def __init__(self, pools: list[str]):
        super().__init__()
        task = next(Pool.open(pools[0]).rows(witness=False)).task
        self.memory = Library([Pool.open(folder) for folder in pools]).of_split("id")
        self.env_of = lambda split: PoolEnv(task, pools, split=split)

    async def on_episode_start(self, config: dict, ctx: SessionContext) -> None:
        await super().on_episode_start(config, ctx)
        env = self.env_of(config["task"]["suite"])
        env.reset(options={"scenario": env.scenarios[config["task"]["episode_idx"]]})
        self.policy = NearestReplay(env, self.memory)
        self.policy.reset({}, {}, 0)

    def predict(self, obs: Observation, ctx: SessionContext) -> Action:
        return {"actions": self.policy.act({})}

    def get_action_spec(self) -> dict[str, DimSpec]:
        return {"raw": RAW}

    def get_observation_spec(self) -> dict[str, DimSpec]:
        return {}


def theirs(pools: list[str], folder: Path) -> dict[str, bool]:
    """Whether each scenario is solved in `vla-eval run`, by id."""
    first = next(Pool.open(pools[0]).rows(witness=False))
    config = {
        "server": {"url": f"ws://127.0.0.1:{PORT}"},
        "output_dir": str(folder),
        "benchmarks": [
            {
                "benchmark": "vla_eval_scengen:ScengenBenchmark",
                "episodes_per_task": min(len(Pool.open(pool)) for pool in pools),
                "params": {
                    "task": first.task,
                    "pool": pools,
                    "hz": 100,
                    "lines": str(folder / LINES),
                    "policy": "replay",
                },
            }
        ],
    }
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    server = subprocess.Popen([sys.executable, __file__, "--serve", *pools])
    try:
        _wait_for(f"http://127.0.0.1:{PORT}/health")
        run = [str(Path(sys.executable).with_name("vla-eval")), "run", "-c", str(folder / "config.yaml")]
        subprocess.run([*run, "--no-docker", "--render", "cpu"], check=True)
    finally:
        server.kill()
    found: dict[str, bool] = {}
    for path in folder.rglob("*.json"):
        for task in json.loads(path.read_text()).get("tasks", []):
            for episode in task["episodes"]:
                found[episode["metrics"]["scenario"]] = episode["metrics"]["success"]
    return found


def _wait_for(address: str) -> None:
    for _ in range(120):
        try:
            urllib.request.urlopen(address, timeout=1)
            return
        except OSError:
            time.sleep(0.5)
    sys.exit(f"no answer from {address}")


def main() -> int:
    if sys.argv[1] == "--serve":
        serve(ReplayServer(sys.argv[2:]), host="127.0.0.1", port=PORT)
        return 0
    pools = [str(Path(pool).absolute()) for pool in sys.argv[1:]]
    with TemporaryDirectory() as folder:
        line, same = compared(theirs(pools, Path(folder)), replay_verdicts(pools))
        sound = cli.run(["verify", f"results={Path(folder) / LINES}"]) == 0
    print(line)
    return 0 if same and sound else 1


if __name__ == "__main__":
    sys.exit(main())
