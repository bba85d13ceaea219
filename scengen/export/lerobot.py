"""A LeRobot data set, format v3.0, written with pyarrow and PyAV only.

    README.md                               card for people and for the Hugging Face Hub
    meta/info.json                          columns, and numbers of episodes and rows
    meta/stats.json                         statistics of every column, with smallest spreads (`scengen.export.floors`)
    meta/tasks.parquet                      instructions
    meta/episodes/chunk-000/file-000.parquet   one row per episode: its rows, its frames, and its scenario
    meta/cameras/<camera>.json              intrinsics and extrinsics; an addition of the paper's to LeRobot's format
    data/chunk-000/file-000.parquet         rows of many episodes
    videos/<key>/chunk-000/file-000.mp4     their pictures, one frame per row

A video holds many episodes; the frames of an episode start at its `from_timestamp`. A file ends after the episode in
which it reaches LeRobot's usual size.
"""

import json
from collections import defaultdict
from collections.abc import Mapping
from contextlib import nullcontext, suppress
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
from .dataset_card import card
from .floors import floors_of, with_floors
from .stats import Shades, Stats, describe

VERSION = "v3.0"
"""Version of LeRobot's format."""
FILES_PER_CHUNK = 1000
"""Largest number of files in a folder "chunk-..."."""
DATA_FILE_SIZE = 100
"""Size at which a file of rows is full [MiB]."""
VIDEO_FILE_SIZE = 200
"""Size at which a video file is full [MiB]."""
FILE_PATH = "chunk-{chunk_index:03d}/file-{file_index:03d}"
"""Pattern of the paths of all files, without prefix and ending."""
DATA_PATH = f"data/{FILE_PATH}.parquet"
"""Pattern of the paths of files of rows."""
VIDEO_PATH = f"videos/{{video_key}}/{FILE_PATH}.mp4"
"""Pattern of the paths of videos."""
EPISODES_PATH = f"meta/episodes/{FILE_PATH}.parquet"
"""Pattern of the paths of tables of episodes."""
KEYFRAME_INTERVAL = 2
"""Number of frames per keyframe, as in LeRobot, so that training reaches single frames quickly."""
IMAGES_PREFIX = "observation.images."
"""LeRobot's prefix of the names of cameras."""


@dataclass(frozen=True)
class Feature:
    """A column: its element type and its shape, () for a number."""

    dtype: str
    shape: tuple[int, ...] = ()
    names: tuple[str, ...] | None = None
    """Names of the entries of a vector, or of the axes of a grid."""

    def arrow(self) -> pa.DataType:
        """The Arrow type that Hugging Face's `datasets` expects: lists of fixed length, and plain lists for grids."""
        kind = pa.from_numpy_dtype(np.dtype(self.dtype))
        if len(self.shape) == 1:
            return pa.list_(kind, self.shape[0])
        return pa.list_(pa.list_(kind)) if self.shape else kind

    def datasets(self) -> dict[str, Any]:
        """The column in the format of `datasets`."""
        value = {"dtype": self.dtype, "_type": "Value"}
        if len(self.shape) == 1:
            return {"feature": value, "length": self.shape[0], "_type": "Sequence"}
        return {"shape": list(self.shape), "dtype": self.dtype, "_type": "Array2D"} if self.shape else value

    def info(self) -> dict[str, Any]:
        """The column in LeRobot's format, in which a number has the shape (1,)."""
        names = None if self.names is None else list(self.names)
        return {"dtype": self.dtype, "shape": list(self.shape or (1,)), "names": names}


INDEX_FEATURES = {
    "timestamp": Feature("float32"),
    "frame_index": Feature("int64"),
    "episode_index": Feature("int64"),
    "index": Feature("int64"),
    "task_index": Feature("int64"),
}
"""Columns of every LeRobot data set: time since the episode's start [s], row in the episode, episode, row in the data
set, instruction."""


class DatasetWriter:
    """A LeRobot data set that is being written."""

    def __init__(
        self,
        folder: Path,
        fps: int,
        robot: str,
        features: Mapping[str, Feature],
        cameras: list[str],
        size: tuple[int, int],
    ):
        """Start in an empty folder.

        Args:
            features: columns besides `INDEX_FEATURES`.
            cameras: names of cameras; each gives one picture per row.
            size: width and height of the pictures [pixels].
        """
        self.folder, self.fps, self.robot = folder, fps, robot
        self.features = {**features, **INDEX_FEATURES}
        self.rows, self.tasks, self._table = 0, dict[str, int](), list[dict[str, Any]]()
        self._videos = {
            f"{IMAGES_PREFIX}{name}": _Video(folder, f"{IMAGES_PREFIX}{name}", fps, size) for name in cameras
        }
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
        """Number of episodes written so far."""
        return len(self._table)

    def calibrate(self, camera: str, calibration: dict[str, Any], scenario: str) -> None:
        """Set the calibration of a camera in the next episode.

        Raises:
            BadConfig: it was different before. A data set has one calibration for each camera.
        """
        if self._cameras.setdefault(camera, calibration) != calibration:
            raise BadConfig(
                f"{camera} has another pose or orientation in scenario {scenario} than in earlier ones; "
                "record this scenario separately"
            )

    def add(self, values: Mapping[str, Any], pictures: Mapping[str, Picture]) -> None:
        """Append a row to the current episode."""
        frame = len(self._columns["index"])
        own = (np.float32(frame / self.fps), frame, self.episodes, self.rows + frame)
        for name, value in {**values, **dict(zip(INDEX_FEATURES, own, strict=False))}.items():
            self._columns[name].append(value)
        for name, picture in pictures.items():
            self._videos[f"{IMAGES_PREFIX}{name}"].add(picture)

    def end_episode(self, instruction: str, about: Mapping[str, Any]) -> None:
        """Write the current episode. `about` holds further columns of the table of episodes."""
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
            **_file_columns("data", self._file),
            "dataset_from_index": self.rows,
            "dataset_to_index": self.rows + length,
            **_file_columns("meta/episodes", 0),
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
        """Write all files under meta. `source` describes the origin of the data."""
        self._close()
        path = EPISODES_PATH.format(chunk_index=0, file_index=0)
        _write_table(self.folder / path, pa.Table.from_pylist(self._table))
        _write_table(self.folder / "meta" / "tasks.parquet", _task_table(self.tasks))
        for name, calibration in self._cameras.items():
            _write_json(self.folder / "meta" / "cameras" / f"{name}.json", calibration)
        stats = self._stats()
        source = {**source, "constant": self._constant(stats)}
        _write_json(self.folder / "meta" / "stats.json", self._floored(stats))
        _write_json(self.folder / "meta" / "info.json", self._info())
        _write_json(self.folder / "meta" / "scengen.json", source)
        (self.folder / "README.md").write_text(card(self._info(), self.tasks, source))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(OSError) if error else nullcontext():  # the first error counts
            self._close()

    def _write(self, columns: Mapping[str, np.ndarray]) -> None:
        path = self.folder / DATA_PATH.format(**_chunk_and_file(self._file))
        if self._writer is None:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = pq.ParquetWriter(path, self._schema)
        arrays = [pa.array(columns[f.name].tolist(), f.type) for f in self._schema]
        self._writer.write_table(pa.table(arrays, schema=self._schema))
        if path.stat().st_size >= DATA_FILE_SIZE * 2**20:
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

    def _floored(self, stats: Mapping[str, Stats]) -> dict[str, Stats]:
        """The statistics with smallest spreads in all columns that trainers normalise."""
        floats = {name: f for name, f in self.features.items() if f.dtype == "float32"}
        floored = {n: with_floors(stats[n], floors_of(n, f.names, f.shape)) for n, f in floats.items()}
        return {**stats, **floored}

    def _constant(self, stats: Mapping[str, Stats]) -> list[str]:
        """Names of the entries of vectors that never change in the data set."""
        return [
            entry
            for name, feature in self.features.items()
            if feature.names and len(feature.shape) == 1
            for entry, low, high in zip(feature.names, stats[name]["min"], stats[name]["max"], strict=True)
            if low == high
        ]

    def _info(self) -> dict[str, Any]:
        return {
            "codebase_version": VERSION,
            "robot_type": self.robot,
            "total_episodes": self.episodes,
            "total_frames": self.rows,
            "total_tasks": len(self.tasks),
            "chunks_size": FILES_PER_CHUNK,
            "data_files_size_in_mb": DATA_FILE_SIZE,
            "video_files_size_in_mb": VIDEO_FILE_SIZE,
            "fps": self.fps,
            "splits": {"train": f"0:{self.episodes}"},
            "data_path": DATA_PATH,
            "video_path": VIDEO_PATH if self._videos else None,
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
    """The pictures of one camera, in files of limited size."""

    def __init__(self, folder: Path, key: str, fps: int, size: tuple[int, int]):
        self.folder, self.key, self.fps, self.size = folder, key, fps, size
        self.shades, self.all = Shades(), Shades()
        self._file, self._first = 0, 0
        self._movie: Movie | None = None

    def add(self, picture: Picture) -> None:
        if self._movie is None:
            path = self.folder / VIDEO_PATH.format(video_key=self.key, **_chunk_and_file(self._file))
            self._movie, self._first = Movie(path, self.fps, *self.size, key_every=KEYFRAME_INTERVAL), 0
        self._movie.add(picture)
        self.shades.add(picture)

    def end_episode(self) -> dict[str, Any]:
        """End the episode, and return the columns of the table of episodes that locate its frames."""
        assert self._movie is not None
        self.all += self.shades
        self.shades = Shades()
        where = {
            **_file_columns(f"videos/{self.key}", self._file),
            f"videos/{self.key}/from_timestamp": self._first / self.fps,
            f"videos/{self.key}/to_timestamp": self._movie.frames / self.fps,
        }
        self._first = self._movie.frames
        if self._movie.path.stat().st_size >= VIDEO_FILE_SIZE * 2**20:
            self.close()
            self._file += 1
        return where

    def close(self) -> None:
        if self._movie is not None:
            self._movie.close()
            self._movie = None


def _chunk_and_file(file: int) -> dict[str, int]:
    chunk, number = divmod(file, FILES_PER_CHUNK)
    return {"chunk_index": chunk, "file_index": number}


def _file_columns(what: str, file: int) -> dict[str, int]:
    return {f"{what}/{name}": number for name, number in _chunk_and_file(file).items()}


def _task_table(tasks: Mapping[str, int]) -> pa.Table:
    """Instructions and their numbers. LeRobot needs the instructions as pandas' index, which the schema declares."""
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
