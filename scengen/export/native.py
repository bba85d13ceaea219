"""Streams at the paper's rates, next to the rows of a LeRobot data set (paper, App. C, table of modalities).

    native/100hz/chunk-000/file-000.parquet    a row per control period: all streams but the following, action, reward
    native/50hz/chunk-000/file-000.parquet     a row per two control periods: wrists' wrenches and tactile grids

Both have `episode_index`, `period` (number of the control period in its episode), `timestamp` [s], `frame_index` (row
of the data set in the episode), and `frame_index.<camera>`: the latest picture of the camera at that time, counted from
the beginning of the episode. The table of episodes says where in the videos the pictures of an episode begin.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..control.loop import Loop
from ..envs.observations import PADS, Stream
from .lerobot import FILE_PATH, Feature
from .replay import DatasetRow
from .streams import column_of

FULL_RATE = round(1 / Loop.PERIOD)
"""Rate of proprioception, actions and rewards [1/s]."""
CONTACT_RATE = 50
"""Rate of wrenches and tactile grids [1/s]."""
CONTACT = ("force_torque", "force_torque_world", *PADS)
"""Ends of the names of the streams that have `CONTACT_RATE`."""
FOLDER = "native"
POINTERS = ("episode_index", "period", "frame_index")
"""Columns of both tables, without those of the cameras."""


def is_contact(name: str) -> bool:
    """Whether a stream has `CONTACT_RATE`."""
    return name.endswith(CONTACT)


class NativeWriter:
    """Writer of the tables of both rates."""

    def __init__(self, folder: Path, rate: int, streams: Mapping[str, Stream], size: int, cameras: Sequence[str]):
        """
        Args:
            folder: folder of the data set.
            rate: rows of the data set, and pictures, per second.
            streams: streams of the data set.
            size: number of entries of an action.
            cameras: names of the cameras.
        """
        self._row_periods, self._cameras = FULL_RATE // rate, cameras
        self._tables = {
            FULL_RATE: _Table(
                folder, FULL_RATE, {n: s for n, s in streams.items() if not is_contact(n)}, size, cameras
            ),
            CONTACT_RATE: _Table(folder, CONTACT_RATE, {n: s for n, s in streams.items() if is_contact(n)}, 0, cameras),
        }
        self._period = 0

    def add(self, row: DatasetRow) -> None:
        """Append the control periods of a row of the data set."""
        for k, (sample, action) in enumerate(zip(row.samples, row.actions, strict=True)):
            reward = np.float32(row.success and k == len(row.actions) - 1)
            frame = self._period // self._row_periods
            for rate, table in self._tables.items():
                if self._period % (FULL_RATE // rate) == 0:
                    table.add(self._period, frame, sample, action, reward)
            self._period += 1

    def end_episode(self, number: int) -> None:
        """Write the rows of the current episode."""
        self._period = 0
        for table in self._tables.values():
            table.end_episode(number)

    def about(self) -> dict[str, str]:
        """Paths of the tables by rate, for `meta/scengen.json`."""
        return {f"{rate} Hz": str(table.pattern) for rate, table in self._tables.items()}

    def close(self) -> None:
        """Close the files."""
        for table in self._tables.values():
            table.close()


class _Table:
    """The table of one rate."""

    def __init__(self, folder: Path, rate: int, streams: Mapping[str, Stream], size: int, cameras: Sequence[str]):
        self.pattern = Path(FOLDER, f"{rate}hz", f"{FILE_PATH}.parquet")
        path = folder / str(self.pattern).format(chunk_index=0, file_index=0)
        acting = {"action": Feature("float32", (size,)), "reward": Feature("float32")} if size else {}
        self._features = {
            **{name: Feature("int64") for name in POINTERS},
            "timestamp": Feature("float32"),
            **{f"frame_index.{camera}": Feature("int64") for camera in cameras},
            **{column_of(name): Feature("float32", stream.shape) for name, stream in streams.items()},
            **acting,
        }
        self._streams, self._pictures = streams, [f"frame_index.{camera}" for camera in cameras]
        self._acts = bool(size)
        self._columns: dict[str, list[Any]] = defaultdict(list)
        path.parent.mkdir(parents=True)
        schema = pa.schema([(name, feature.arrow()) for name, feature in self._features.items()])
        self._writer: pq.ParquetWriter | None = pq.ParquetWriter(path, schema)

    def add(self, period: int, frame: int, sample: Mapping[str, Any], action: Any, reward: np.float32) -> None:
        told = {"period": period, "frame_index": frame, "timestamp": np.float32(period * Loop.PERIOD)}
        seen = {column_of(name): sample[name] for name in self._streams}
        done = {"action": action, "reward": reward} if self._acts else {}
        for name, value in {**told, **dict.fromkeys(self._pictures, frame), **seen, **done}.items():
            self._columns[name].append(value)

    def end_episode(self, number: int) -> None:
        assert self._writer is not None
        self._columns["episode_index"] = [number] * len(self._columns["period"])
        columns = {name: np.array(self._columns[name], feature.dtype) for name, feature in self._features.items()}
        self._columns.clear()
        schema = self._writer.schema
        self._writer.write_table(pa.table([pa.array(columns[f.name].tolist(), f.type) for f in schema], schema=schema))

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()
            self._writer = None
