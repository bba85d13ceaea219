"""Reads recordings as robomimic's trainers do. Runs in robomimic's environment: python read_robomimic.py FILE ...

Prints a line of JSON for each fault.
"""

import json
import sys
from pathlib import Path

import h5py
import numpy as np
import robomimic.utils.file_utils as file_utils
import robomimic.utils.obs_utils as obs_utils
from robomimic.utils.dataset import SequenceDataset

LENGTH = 10
"""Rows of a sample."""


def faults(path: Path):
    """What differs from what the file holds, as texts."""
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


for path in map(Path, sys.argv[1:]):
    for text in faults(path):
        print(json.dumps({"recording": path.name, "check": "SequenceDataset", "severity": "error", "message": text}))
