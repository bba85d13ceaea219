"""Reads recordings as LeRobot's trainers do. Runs in LeRobot's environment: python read_lerobot.py RECORDING ...

Prints a line of JSON for each fault.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import torch
from lerobot.configs.types import FeatureType
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.utils.feature_utils import dataset_to_policy_features

CHUNK = 8
"""Rows of actions that a sample has, as for a policy that predicts several."""


def faults(folder: Path):
    """What differs from what the files hold, as texts."""
    info = json.loads((folder / "meta" / "info.json").read_text())
    ahead = {"action": [k / info["fps"] for k in range(CHUNK)], "observation.state": [-1 / info["fps"], 0.0]}
    data = LeRobotDataset("any/name", root=folder, delta_timestamps=ahead, video_backend="pyav")
    table = pq.read_table(folder / "data" / "chunk-000" / "file-000.parquet")
    if (len(data), data.num_episodes) != (table.num_rows, info["total_episodes"]):
        yield f"{len(data)} rows in {data.num_episodes} episodes, not {table.num_rows} in {info['total_episodes']}"
    actions, state = (np.array(table[name].to_pylist(), np.float32) for name in ("action", "observation.state"))
    episodes = np.array(table["episode_index"].to_pylist())
    for number in np.linspace(0, len(data) - 1, 12).astype(int).tolist():
        sample = data[number]
        last = int(np.flatnonzero(episodes == episodes[number])[-1])
        wanted = actions[[min(number + k, last) for k in range(CHUNK)]]
        if not np.array_equal(sample["action"].numpy(), wanted):
            yield f"row {number}: other actions than in the file"
        if not np.array_equal(sample["observation.state"][1].numpy(), state[number]):
            yield f"row {number}: another state than in the file"
        for name in data.meta.camera_keys:
            picture = sample[name]
            if picture.shape != (3, *info["features"][name]["shape"][:2]) or not 0.02 < float(picture.std()):
                yield f"row {number}: no picture of {name}"
    features = dataset_to_policy_features(data.meta.features)
    outputs = [name for name, feature in features.items() if feature.type is FeatureType.ACTION]
    if outputs != ["action"]:
        yield f"a policy would predict {outputs}"
    for name, values in data.meta.stats.items():
        if not all(np.isfinite(np.asarray(value, float)).all() for value in values.values()):
            yield f"statistics of {name} are not finite"
    batch = next(iter(torch.utils.data.DataLoader(data, batch_size=8, shuffle=True)))
    if batch["action"].shape[:2] != (8, CHUNK):
        yield f"a batch has actions of shape {tuple(batch['action'].shape)}"


for path in map(Path, sys.argv[1:]):
    for text in faults(path):
        print(json.dumps({"recording": path.name, "check": "LeRobotDataset", "severity": "error", "message": text}))
