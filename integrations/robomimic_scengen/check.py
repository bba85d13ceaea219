"""Trains with the recipe for 20 batches, and compares actions of the checkpoint in both packages.

    python check.py POOL [POOL ...]

The first pool is recorded. While its witnesses are played again, the checkpoint must act on what the environment
observes as robomimic does on the recorded row. Exit status 1 if an action differs.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import h5py
import numpy as np
import torch
from robomimic.utils.file_utils import policy_from_checkpoint
from robomimic.utils.obs_utils import process_obs
from robomimic_scengen.checkpoint import VARIABLE, policy

from scengen import cli
from scengen.envs.gym import PoolEnv
from scengen.envs.observations import proprioception
from scengen.pool import Pool

EPISODES = 3
"""Number of recorded witnesses."""
WITHIN = 1e-5
"""Largest difference between two actions: the streams of the environment are rounded to single precision."""


def checkpoint(pool: str, folder: Path) -> Path:
    """A checkpoint after 20 batches on the witnesses of a pool."""
    data = folder / "data.hdf5"
    argv = ["record", f"pool={pool}", f"to={data}", "format=robomimic", "cameras=none", f"n={EPISODES}"]
    if cli.run(argv) or cli.run(["recipe", "train=robomimic_bc_rnn", f"data={data}", f"to={folder}", "device=cpu"]):
        sys.exit("the recipe was not written")
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    subprocess.run(["sh", folder / "smoke.sh"], check=True, env={**os.environ, "PATH": path}, stdout=subprocess.DEVNULL)
    return next(folder.glob("smoke/*/models/*.pth"))


def largest_difference(env: PoolEnv, file: Path, recorded: Path) -> float:
    """The largest difference between an action in the environment and one in robomimic, in all recorded rows."""
    ours, (theirs, stored) = policy(env), policy_from_checkpoint(ckpt_path=str(file))
    keys, differences = stored["shape_metadata"]["all_obs_keys"], []
    with h5py.File(recorded) as data:
        for number in range(EPISODES):
            demo = data[f"data/demo_{number}"]
            observation, info = env.reset(options={"scenario": json.loads(demo.attrs["ep_meta"])["scenario"]})
            ours.reset(observation, info, 0)
            theirs.start_episode()
            for row, action in enumerate(demo["actions"][()]):
                seen = {key: process_obs(demo[f"obs/{key}"][row], obs_key=key) for key in keys}
                torch.manual_seed(row)
                expected = theirs(ob=seen)
                torch.manual_seed(row)
                differences.append(np.abs(ours.act(observation) - expected).max())
                observation = env.step(action)[0]
    return float(max(differences))


def main() -> int:
    pools = sys.argv[1:]
    task = next(Pool.open(pools[0]).rows(witness=False)).task
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = checkpoint(pools[0], folder)
        os.environ[VARIABLE] = str(file)
        streams = [*proprioception("panda_jaw"), "object-state"]
        found = largest_difference(PoolEnv(task, pool=[pools[0]], observations=streams), file, folder / "data.hdf5")
        print(f"largest difference of an action: {found:.1e}")
        argv = ["evaluate", "policy=robomimic_scengen.checkpoint:policy", f"pool={','.join(pools)}", "seeds=2"]
        more = ["rollouts=1", f"observations=[{','.join(streams)}]", f"to={folder / 'evaluation'}"]
        played = cli.run([*argv, *more])
    return 0 if found < WITHIN and played == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
