"""A LeRobot data set, format v3.0, written with pyarrow and PyAV alone.

    meta/info.json                          what the columns are, and how many episodes and rows there are
    meta/stats.json                         statistics of every column
    meta/tasks.parquet                      instructions
    meta/episodes/chunk-000/file-000.parquet   one row an episode: which rows and frames are its own, and what it shows
    meta/cameras/<camera>.json              intrinsics and extrinsics; not LeRobot's, the paper's
    data/chunk-000/file-000.parquet         the rows of many episodes
    videos/<key>/chunk-000/file-000.mp4     their pictures, one frame a row

A video holds many episodes; an episode's frames begin at its `from_timestamp`. Files are closed at LeRobot's usual
sizes, after the episode in which they reach them.
"""

import json
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from ..errors import BadConfig
from ..pictures.render import Picture
from ..pictures.video import CODEC, PIXELS, Movie
from .stats import Shades, Stats, describe

VERSION = "v3.0"
FILES = 1000
"""Files in a folder "chunk-..."."""
DATA_SIZE, VIDEO_SIZE = 100, 200
"""A file is full at this size [MiB]."""
FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
DATA, VIDEO, EPISODES = f"data/{FILE}.parquet", f"videos/{{video_key}}/{FILE}.mp4", f"meta/episodes/{FILE}.parquet"
KEY_EVERY = 2
"""Every second frame is stored whole, as LeRobot does, so that training reaches single frames quickly."""
IMAGES = "observation.images."
"""What LeRobot puts before a camera's name."""


@dataclass(frozen=True)
class Feature:
    """A column: its element type and shape; () for a number."""

    dtype: str
    shape: tuple[int, ...] = ()
    names: tuple[str, ...] | None = None
    """What each entry of a vector is; of a grid, what its axes are."""

    def arrow(self) -> pa.DataType:
        """The type that Hugging Face's `datasets` expects: lists of known length, and plain lists for grids."""
        kind = pa.from_numpy_dtype(np.dtype(self.dtype))
        if len(self.shape) == 1:
            return pa.list_(kind, self.shape[0])
        return pa.list_(pa.list_(kind)) if self.shape else kind

    def datasets(self) -> dict[str, Any]:
        """The same in the words of `datasets`."""
        value = {"dtype": self.dtype, "_type": "Value"}
        if len(self.shape) == 1:
            return {"feature": value, "length": self.shape[0], "_type": "Sequence"}
        return {"shape": list(self.shape), "dtype": self.dtype, "_type": "Array2D"} if self.shape else value

    def info(self) -> dict[str, Any]:
        """The same in the words of LeRobot, which calls a number a list of one."""
        names = None if self.names is None else list(self.names)
        return {"dtype": self.dtype, "shape": list(self.shape or (1,)), "names": names}


OWN = {
    "timestamp": Feature("float32"),
    "frame_index": Feature("int64"),
    "episode_index": Feature("int64"),
    "index": Feature("int64"),
    "task_index": Feature("int64"),
}
"""Columns of every LeRobot data set: time since the episode's start [s], row in the episode, row in the whole ..."""


class DataSet:
    """A data set that is being written."""

    def __init__(
        self,
        folder: Path,
        fps: int,
        robot: str,
        features: Mapping[str, Feature],
        cameras: list[str],
        size: tuple[int, int],
    ):
        """Begin in an empty folder.

        Args:
            features: columns besides `OWN`.
            cameras: names of cameras, each of which gives one picture a row.
            size: width and height of the pictures [pixels].
        """
        self.folder, self.fps, self.robot = folder, fps, robot
        self.features = {**features, **OWN}
        self.rows, self.tasks, self._table = 0, dict[str, int](), list[dict[str, Any]]()
        self._videos = {f"{IMAGES}{name}": _Video(folder, f"{IMAGES}{name}", fps, size) for name in cameras}
        self._size = size
        self._cameras: dict[str, dict[str, Any]] = {}
        self._columns: dict[str, list[Any]] = defaultdict(list)
        info = {"info": {"features": {name: f.datasets() for name, f in self.features.items()}}}
        self._schema = pa.schema(
            [(name, f.arrow()) for name, f in self.features.items()], metadata={"huggingface": json.dumps(info)}
        )
        self._file, self._writer = 0, None

    @property
    def episodes(self) -> int:
        """How many were written so far."""
        return len(self._table)

    def calibrate(self, camera: str, calibration: dict[str, Any], scenario: str) -> None:
        """Say how a camera stands in the next episode, and how its pictures are turned.

        Raises:
            BadConfig: that was different before; a data set has one calibration for each camera.
        """
        if self._cameras.setdefault(camera, calibration) != calibration:
            raise BadConfig(
                f"{camera} stands elsewhere in scenario {scenario} than before it, or is turned; record it by itself"
            )

    def add(self, values: Mapping[str, Any], pictures: Mapping[str, Picture]) -> None:
        """Append a row to the present episode."""
        frame = len(self._columns["index"])
        own = (np.float32(frame / self.fps), frame, self.episodes, self.rows + frame)
        for name, value in {**values, **dict(zip(OWN, own, strict=False))}.items():
            self._columns[name].append(value)
        for name, picture in pictures.items():
            self._videos[f"{IMAGES}{name}"].add(picture)

    def end_episode(self, instruction: str, about: Mapping[str, Any]) -> None:
        """Write the present episode. `about`: further columns in the table of episodes."""
        task = self.tasks.setdefault(instruction, len(self.tasks))
        length = len(self._columns["index"])
        self._columns["task_index"] = [task] * length
        columns = {name: np.array(self._columns[name], f.dtype) for name, f in self.features.items()}
        self._columns.clear()
        stats = {name: describe(column) for name, column in columns.items()}
        row = {
            "episode_index": self.episodes,
            "tasks": [instruction],
            "length": length,
            **_whereabouts("data", self._file),
            "dataset_from_index": self.rows,
            "dataset_to_index": self.rows + length,
            **_whereabouts("meta/episodes", 0),
            **about,
        }
        self._write(columns)
        for name, video in self._videos.items():
            stats[name] = video.shades.describe()
            row |= video.end_episode()
        row |= {f"stats/{name}/{kind}": value for name, found in stats.items() for kind, value in found.items()}
        self._table.append(row)
        self.rows += length

    def finish(self, source: Mapping[str, Any]) -> None:
        """Write everything under meta. `source`: where the data came from."""
        self._close()
        path = EPISODES.format(chunk_index=0, file_index=0)
        _write_table(self.folder / path, pa.Table.from_pylist(self._table))
        _write_table(self.folder / "meta" / "tasks.parquet", _task_table(self.tasks))
        for name, calibration in self._cameras.items():
            _write_json(self.folder / "meta" / "cameras" / f"{name}.json", calibration)
        _write_json(self.folder / "meta" / "stats.json", self._stats())
        _write_json(self.folder / "meta" / "info.json", self._info())
        _write_json(self.folder / "meta" / "scengen.json", source)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()

    def _write(self, columns: Mapping[str, np.ndarray]) -> None:
        path = self.folder / DATA.format(**_numbers(self._file))
        if self._writer is None:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(path, self._schema)
        arrays = [pa.array(columns[f.name].tolist(), f.type) for f in self._schema]
        self._writer.write_table(pa.table(arrays, schema=self._schema))
        if path.stat().st_size >= DATA_SIZE * 2**20:
            self._writer.close()
            self._file, self._writer = self._file + 1, None

    def _close(self) -> None:
        if self._writer is not None:
            self._writer.close()
        for video in self._videos.values():
            video.close()

    def _stats(self) -> dict[str, Stats]:
        files = sorted((self.folder / "data").glob("*/*.parquet"))
        found = {name: video.all.describe() for name, video in self._videos.items()}
        for name, feature in self.features.items():
            column = pa.chunked_array([c for file in files for c in pq.read_table(file, columns=[name])[name].chunks])
            found[name] = describe(np.array(column.to_pylist(), feature.dtype))
        return found

    def _info(self) -> dict[str, Any]:
        return {
            "codebase_version": VERSION,
            "robot_type": self.robot,
            "total_episodes": self.episodes,
            "total_frames": self.rows,
            "total_tasks": len(self.tasks),
            "chunks_size": FILES,
            "data_files_size_in_mb": DATA_SIZE,
            "video_files_size_in_mb": VIDEO_SIZE,
            "fps": self.fps,
            "splits": {"train": f"0:{self.episodes}"},
            "data_path": DATA,
            "video_path": VIDEO if self._videos else None,
            "features": {name: f.info() for name, f in self.features.items()}
            | {name: self._video_info() for name in self._videos},
        }

    def _video_info(self) -> dict[str, Any]:
        width, height = self._size
        info = {"height": height, "width": width, "codec": CODEC, "pix_fmt": PIXELS, "fps": self.fps, "channels": 3}
        return {
            "dtype": "video",
            "shape": [height, width, 3],
            "names": ["height", "width", "channels"],
            "info": {f"video.{k}": v for k, v in info.items()} | {"video.is_depth_map": False, "has_audio": False},
        }


class _Video:
    """The pictures of one camera, in as many files as their size asks for."""

    def __init__(self, folder: Path, key: str, fps: int, size: tuple[int, int]):
        self.folder, self.key, self.fps, self.size = folder, key, fps, size
        self.shades, self.all = Shades(), Shades()
        self._file, self._first = 0, 0
        self._movie: Movie | None = None

    def add(self, picture: Picture) -> None:
        if self._movie is None:
            path = self.folder / VIDEO.format(video_key=self.key, **_numbers(self._file))
            self._movie, self._first = Movie(path, self.fps, *self.size, key_every=KEY_EVERY), 0
        self._movie.add(picture)
        self.shades.see(picture)

    def end_episode(self) -> dict[str, Any]:
        """Where the episode's frames are: columns of the table of episodes."""
        assert self._movie is not None
        self.all += self.shades
        self.shades = Shades()
        where = {
            **_whereabouts(f"videos/{self.key}", self._file),
            f"videos/{self.key}/from_timestamp": self._first / self.fps,
            f"videos/{self.key}/to_timestamp": self._movie.frames / self.fps,
        }
        self._first = self._movie.frames
        if self._movie.path.stat().st_size >= VIDEO_SIZE * 2**20:
            self.close()
            self._file += 1
        return where

    def close(self) -> None:
        if self._movie is not None:
            self._movie.close()
            self._movie = None


def _numbers(file: int) -> dict[str, int]:
    chunk, number = divmod(file, FILES)
    return {"chunk_index": chunk, "file_index": number}


def _whereabouts(what: str, file: int) -> dict[str, int]:
    return {f"{what}/{name}": number for name, number in _numbers(file).items()}


def _task_table(tasks: Mapping[str, int]) -> pa.Table:
    """Instructions and their numbers. LeRobot wants the former as pandas' index, and pandas asks the schema for it."""
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for name, kind, numpy in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    pandas = {"index_columns": ["task"], "column_indexes": [], "columns": columns}
    schema = pa.schema([("task_index", pa.int64()), ("task", pa.string())], metadata={"pandas": json.dumps(pandas)})
    return pa.table([list(tasks.values()), list(tasks)], schema=schema)


def _write_table(path: Path, table: pa.Table) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(table, path)


def _write_json(path: Path, content: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1) + "\n")
