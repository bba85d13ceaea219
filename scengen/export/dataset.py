"""Reader of the LeRobot recordings of `scengen record`. What cannot be read is one line with the remedy.

A recording may be untrusted: only plain files in its folder are opened, and what they unpack to is bounded.
"""

import json
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from io import BufferedReader
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ..episode import STRICT, Rules, check_rules
from ..errors import BadConfig, PoolError, ScengenError, cut
from ..look.looks import Look, look_told
from ..pool.files import MAX_JSON
from ..pool.kinds import check_one
from ..pool.shards import check_groups
from ..pool.untrusted import READING_MEMORY
from ..work.machine import memory_bounded
from ..work.plain import open_plain
from .lerobot import IMAGES_PREFIX, VIDEO_PATH
from .schema import TEXT, check_episode, check_film, check_info, is_instruction
from .streams import ENVIRONMENT

TASK_VERSION = "scengen/task_version"
"""Column of the table of episodes with the version of the task. Recordings of earlier releases lack it."""
CURATION = "curation"
"""Folder of the results of a curation, below that of the recording."""
MAX_FRAMES = 200_000
"""Largest number of rows of an episode that is read."""
MAX_ROWS = 50_000_000
"""Largest number of rows of a table that is read."""
MAX_PIXELS = 4096 * 4096
"""Largest size of a picture that is decoded [pixels]."""
_KINDS = {"float": pa.types.is_floating, "int": pa.types.is_integer, "bool": pa.types.is_boolean}
"""Kinds of numbers by the beginning of their names in `meta/info.json`."""


@dataclass(frozen=True, eq=False)
class EpisodeData:
    """Rows of one episode."""

    number: int
    about: Mapping[str, Any]
    """Row of the table of episodes."""
    columns: Mapping[str, NDArray[Any]]
    """Columns by name, each of shape (rows, ...)."""

    def __len__(self) -> int:
        return int(self.about["dataset_to_index"]) - int(self.about["dataset_from_index"])

    @property
    def task(self) -> str:
        """Name of the task."""
        return str(self.about["scengen/task"])


def rules_of(about: Mapping[str, Any]) -> Rules:
    """Rules of a recorded episode. Witnesses, and recordings that say nothing of them, have all rules.

    Args:
        about: row of the table of episodes.

    Raises:
        UnknownName: there are no such rules.
    """
    return check_rules(str(about.get("scengen/rules", STRICT)))


@dataclass(frozen=True)
class Recording:
    """A recording in a folder."""

    folder: Path

    @classmethod
    def open(cls, folder: str | Path) -> "Recording":
        """Open a recording.

        Raises:
            PoolError: the folder holds no LeRobot recording of scengen.
        """
        found = cls(Path(folder))
        if not (found.folder / "meta" / "info.json").is_file():
            raise PoolError(f"no recording at {folder}: meta/info.json is missing; see scengen record")
        check_one(folder)
        found.check_places()
        try:
            check_info(found.info)
            if not found.episodes:
                raise BadConfig("meta/episodes: there is no episode")
            for number, row in enumerate(found.episodes):
                check_episode(number, row)
        except ScengenError as error:
            remedy = "name a folder that scengen record has written"
            raise PoolError(f"{folder} is not a recording of scengen: {error}; {remedy}") from None
        return found

    def check_places(self) -> None:
        """Raise `PoolError` unless the folders that are read and written hold plain files and folders, and no links."""
        for folder in (self.folder / "meta", self.folder / CURATION):
            for path in (folder, *(folder.iterdir() if folder.is_dir() and not folder.is_symlink() else ())):
                if os.path.lexists(path) and (path.is_symlink() or not (path.is_dir() or path.is_file())):
                    raise PoolError(f"{path} is a link, or no plain file; replace it, with cp -rL if there are links")

    @cached_property
    def info(self) -> dict[str, Any]:
        """Content of `meta/info.json`."""
        return self._read_json("info.json")

    @property
    def fps(self) -> float:
        """Rows per second."""
        return float(self.info["fps"])

    @cached_property
    def episodes(self) -> list[dict[str, Any]]:
        """Rows of the table of episodes."""
        files = sorted((self.folder / "meta" / "episodes").glob("*/*.parquet"))
        return [row for file in files for row in self._table(file).to_pylist()]

    @property
    def cameras(self) -> list[str]:
        """Keys of the videos."""
        return [name for name, feature in self.info["features"].items() if feature["dtype"] == "video"]

    @cached_property
    def calibrations(self) -> dict[str, dict[str, Any]]:
        """Calibration of each camera by the key of its video.

        Raises:
            PoolError: one is missing or damaged.
        """
        return {key: self._read_json(f"cameras/{key.removeprefix(IMAGES_PREFIX)}.json") for key in self.cameras}

    @property
    def entries(self) -> tuple[str, ...]:
        """Names of the entries of the environment state; empty if it was not recorded."""
        names = self.info["features"].get(ENVIRONMENT, {}).get("names")
        return tuple(names) if isinstance(names, list) else ()

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height of the pictures [pixels]; 0 and 0 if there are none.

        Raises:
            PoolError: the description of a video has no size.
        """
        shapes = [self.info["features"][name].get("shape") for name in self.cameras]
        match shapes:
            case []:
                return 0, 0
            case [[int(height), int(width), *_], *_]:
                return width, height
            case _:
                raise PoolError(f"{self.folder}/meta/info.json has no size of the pictures; record it again")

    @cached_property
    def stats(self) -> dict[str, Any]:
        """Content of `meta/stats.json`."""
        return self._read_json("stats.json")

    @property
    def look(self) -> Look:
        """Look of the pictures.

        Raises:
            PoolError: this version of scengen cannot show it.
        """
        try:
            return look_told(self.source.get("look"))
        except BadConfig as error:
            raise PoolError(f"{self.folder}/meta/scengen.json: {error}; record it again") from None

    @cached_property
    def source(self) -> dict[str, Any]:
        """Content of `meta/scengen.json`: what was recorded."""
        return self._read_json("scengen.json")

    @cached_property
    def tasks(self) -> dict[int, str]:
        """Instructions by their number."""
        path = self.folder / "meta" / "tasks.parquet"
        rows = self._table(path).to_pylist()
        found = {row["task_index"]: row["task"] for row in rows if is_instruction(row)}
        if len(found) != len(rows):
            raise PoolError(f"{path}: every line must have a task, and a separate task_index; record it again")
        return found

    @cached_property
    def _files(self) -> list[tuple[Path, int]]:
        """Files of rows, and the number of rows up to the end of each."""
        files, ends = sorted((self.folder / "data").glob("*/*.parquet")), 0
        return [(file, ends := ends + self._table(file).num_rows) for file in files]

    @property
    def total(self) -> int:
        """Number of rows of all files."""
        return self._files[-1][1] if self._files else 0

    def file_of(self, row: int) -> tuple[int, int] | None:
        """Numbers of the chunk and of the file of a row; None if there is none."""
        found = next((path for path, end in self._files if row < end), None)
        parts = [] if found is None else [found.parent.name, found.stem]
        numbers = [part.rpartition("-")[2] for part in parts]
        return (int(numbers[0]), int(numbers[1])) if all(map(str.isdecimal, numbers)) and numbers else None

    def read(self) -> Iterator[EpisodeData]:
        """All episodes in their order.

        Raises:
            PoolError: the rows cannot be read, or are not those of the table of episodes.
        """
        files = sorted((self.folder / "data").glob("*/*.parquet"))
        if not files:
            raise PoolError(f"{self.folder} has no rows; record it again")
        whole = self._rows(files)
        for number, about in enumerate(self.episodes):
            start, end = int(about["dataset_from_index"]), int(about["dataset_to_index"])
            if not 0 <= start < end <= whole.num_rows or end - start > MAX_FRAMES:
                raise PoolError(f"{self.folder}: episode {number} has rows {start} to {end} of {whole.num_rows}")
            part = whole.slice(start, end - start)
            columns = {n: self._values(part[n], n) for n in part.column_names if n not in self.texts}
            yield EpisodeData(number, about, columns)

    def frames(self, episode: EpisodeData, camera: str) -> Iterator[NDArray[np.uint8]]:
        """Pictures of a camera in an episode, decoded, shape (height, width, 3)."""
        import av
        from av.error import FFmpegError

        about, key = episode.about, f"videos/{camera}"
        try:
            check_film(episode.number, about, camera)
        except BadConfig as error:
            raise PoolError(f"{self.folder}: {error}; record it again") from None
        chunk, file = (int(about[f"{key}/{name}"]) for name in ("chunk_index", "file_index"))
        path = self.folder / VIDEO_PATH.format(video_key=camera, chunk_index=chunk, file_index=file)
        first, last = (round(about[f"{key}/{name}"] * self.fps) for name in ("from_timestamp", "to_timestamp"))
        try:
            # Of a playlist, which also is a video, ffmpeg would open other files.
            with self._opened(path) as content, av.open(content, "r", format="mp4") as container:
                shape = container.streams.video[0].codec_context
                if not 0 < shape.width * shape.height <= MAX_PIXELS:
                    raise PoolError(
                        f"{path} has pictures of {shape.width} x {shape.height}; at most {MAX_PIXELS} pixels"
                    )
                for number, frame in enumerate(container.decode(video=0)):
                    if number >= min(last, first + MAX_FRAMES):
                        return
                    if number >= first:
                        yield np.asarray(frame.to_ndarray(format="rgb24"), np.uint8)
        except (OSError, IndexError, FFmpegError) as error:
            raise PoolError(
                f"{path} cannot be decoded ({' '.join(str(error).split())[:120]}); record it again"
            ) from None

    def _opened(self, path: Path) -> BufferedReader:
        """A plain file of the recording, open for reading.

        Raises:
            PoolError: it is a link, a pipe or a device, or lies outside the folder.
        """
        try:
            if not path.resolve().is_relative_to(self.folder.resolve()):
                raise ValueError("it lies outside the folder")
            return open_plain(path)
        except (OSError, ValueError, RuntimeError) as error:  # RuntimeError: links in a circle
            why = " ".join(str(error).split())[:120]
            raise PoolError(f"{path} cannot be read: {why}; restore it, with cp -rL if it consists of links") from None

    @cached_property
    def texts(self) -> list[str]:
        """Columns of rows that hold texts. They are not read."""
        return [name for name, feature in self.info["features"].items() if feature["dtype"] == TEXT]

    def _rows(self, files: Sequence[Path]) -> pa.Table:
        """The rows of some files."""
        try:
            return pa.concat_tables([self._table(file) for file in files])
        except pa.ArrowException:
            raise PoolError(f"{self.folder / 'data'}: the files have different columns; record it again") from None

    def _values(self, column: pa.ChunkedArray, name: str) -> NDArray[Any]:
        """A column as an array of the kind and the shape that `meta/info.json` says; a number has no shape.

        Raises:
            PoolError: it has another kind or shape, or empty cells.
        """
        feature = self.info["features"].get(name, {})
        shape = tuple(feature.get("shape", ()))
        flat, kind = column.combine_chunks(), column.type
        while pa.types.is_list(kind) or pa.types.is_fixed_size_list(kind):
            flat, kind = flat.flatten(), kind.value_type
        told, is_kind = feature.get("dtype"), next((k for k, test in _KINDS.items() if test(kind)), None)
        if is_kind is None or (told and not str(told).startswith(is_kind)):
            wanted = f"meta/info.json says {cut(str(told))}" if told else "only numbers are read"
            raise PoolError(f"{self.folder}: column {cut(name)} holds {cut(str(kind))}, {wanted}; record it again")
        size = (len(column), *shape) if column.type != kind else (len(column),)
        if len(flat) != prod(size) or prod(shape) != prod(size[1:]):
            raise PoolError(f"{self.folder}: column {cut(name)} has not the shape of meta/info.json; record it again")
        if flat.null_count and is_kind != "float":
            raise PoolError(f"{self.folder}: column {cut(name)} has empty cells; record it again")
        return flat.to_numpy(zero_copy_only=False).reshape(size)

    def _table(self, path: Path) -> pa.Table:
        try:
            with self._opened(path) as content, pq.ParquetFile(content) as file:
                if file.metadata.num_rows > MAX_ROWS:
                    raise ValueError(f"it has {file.metadata.num_rows} rows; at most {MAX_ROWS} are read")
                check_groups(file.metadata, range(file.num_row_groups))
                if double := [name for name, count in Counter(file.schema_arrow.names).items() if count > 1]:
                    raise ValueError(f"it has two columns {double[0]}")
                with memory_bounded(READING_MEMORY):
                    return file.read(use_threads=False)
        except (OSError, ValueError, MemoryError, pa.ArrowException) as error:
            raise PoolError(
                f"{path} cannot be read ({' '.join(str(error).split())[:120]}); restore it, or record it again"
            ) from None

    def _read_json(self, name: str) -> dict[str, Any]:
        try:
            with self._opened(self.folder / "meta" / name) as content:
                found = json.loads(content.read(MAX_JSON).decode())
            if not isinstance(found, dict):
                raise ValueError("it holds no group of settings")
            return found
        except (OSError, ValueError, RecursionError) as error:
            raise PoolError(f"{self.folder}/meta/{name} is damaged ({str(error)[:120]}); record it again") from None
