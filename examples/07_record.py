"""Record witnesses as a LeRobot data set and open it, with LeRobot if it is installed, else with pyarrow.
Prints the columns and an episode."""

import shutil
import sys
from pathlib import Path

import pyarrow.parquet as parquet

import scengen
from scengen.cli import run

POOL = scengen.reference_pool("domino_single")
DATA = Path("generated/examples/recording")

shutil.rmtree(DATA, ignore_errors=True)
if status := run(["record", f"pool={POOL}", "n=2", f"to={DATA}", "cameras=none"]):  # cameras=[rgb_ego_cam] for videos
    sys.exit(status)
try:
    from lerobot.datasets.lerobot_dataset import LeRobotDataset
except ImportError:
    print("LeRobot is not installed; its files are Parquet, which pyarrow reads:")
    table = parquet.read_table(next(DATA.glob("data/**/*.parquet")))
    for field in table.schema:
        print(f"  {field.name}: {field.type}")
    print(f"{table.num_rows} rows, episodes {sorted(set(table['episode_index'].to_pylist()))}")
else:
    dataset = LeRobotDataset("scengen/reference", root=DATA)
    for name, value in dataset[0].items():
        print(f"  {name}: {tuple(getattr(value, 'shape', ())) or value}")
    print(f"{dataset.num_frames} rows, {dataset.num_episodes} episodes")
