"""Reads recordings as the trainers of LeRobot or robomimic do, in their environment: python read.py READER PATH ...

READER is lerobot or robomimic. A line of JSON is printed for each fault.
"""

import json
import sys
from pathlib import Path

import numpy as np

CHUNK = 8
"""Rows of actions that a sample of LeRobot has, as for a policy that predicts several."""
LENGTH = 10
"""Rows of a sample of robomimic."""


def by_lerobot(folder: Path):
    """Differences between what LeRobot's trainers read and what the files hold, as texts."""
    import pyarrow.parquet as pq
    import torch
    from lerobot.configs.types import FeatureType
    from lerobot.datasets.lerobot_dataset import LeRobotDataset
    from lerobot.utils.feature_utils import dataset_to_policy_features

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


def by_robomimic(path: Path):
    """Differences between what robomimic's trainers read and what the file holds, as texts."""
    import h5py
    import robomimic.utils.file_utils as file_utils
    import robomimic.utils.obs_utils as obs_utils
    from robomimic.utils.dataset import SequenceDataset

    with h5py.File(path) as file:
        demos = sorted(file["data"], key=lambda name: int(name[5:]))
        lengths = [int(file[f"data/{name}"].attrs["num_samples"]) for name in demos]
        keys = {name: value.shape[1:] for name, value in file[f"data/{demos[0]}/obs"].items()}
        actions = np.concatenate([file[f"data/{name}/actions"][()] for name in demos])
        filters = [*file["mask"]]
    pictures = [name for name, shape in keys.items() if name.endswith("_image")]
    others = [name for name in keys if name not in pictures]
    obs_utils.initialize_obs_utils_with_obs_specs({"obs": {"low_dim": others, "rgb": pictures}})
    about = file_utils.get_env_metadata_from_dataset(str(path))
    shapes = file_utils.get_shape_metadata_from_dataset(str(path), all_obs_keys=[*keys])
    if about["type"] != 1 or shapes["ac_dim"] != actions.shape[1]:
        yield f"environment of type {about['type']}, actions of {shapes['ac_dim']} numbers"
    asked = {"obs_keys": [*keys], "dataset_keys": ["actions", "rewards", "dones"], "load_next_obs": True}
    ways = [{"seq_length": LENGTH, "frame_stack": 2, "pad_frame_stack": True}]
    if not pictures:
        ways.append({"seq_length": 1, "hdf5_normalize_obs": True})  # robomimic 0.3 normalises single rows alone
    for way in ways:
        data = SequenceDataset(str(path), **asked, **way, pad_seq_length=True)
        if len(data) != sum(lengths):
            yield f"{len(data)} samples, not {sum(lengths)}"
        first, ahead = way.get("frame_stack", 1) - 1, way["seq_length"]
        for number in np.linspace(0, lengths[0] - LENGTH, 5).astype(int).tolist():
            sample = data[number]
            if not np.array_equal(sample["actions"][first:], actions[number : number + ahead]):
                yield f"sample {number}: other actions than in the file"
            if not all(np.isfinite(value).all() for value in sample["obs"].values()):
                yield f"sample {number}: observations that are not finite"
    for name in filters:
        if not len(SequenceDataset(str(path), **asked, seq_length=LENGTH, filter_by_attribute=name)):
            yield f"no samples for the filter key {name}"


READERS = {"lerobot": ("LeRobotDataset", by_lerobot), "robomimic": ("SequenceDataset", by_robomimic)}
"""Class that reads, and the function that checks what it reads."""

check, faults = READERS[sys.argv[1]]
for path in map(Path, sys.argv[2:]):
    for text in faults(path):
        print(json.dumps({"recording": path.name, "check": check, "severity": "error", "message": text}))
