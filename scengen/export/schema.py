"""Types of what a recording says of itself. A fault names the file, the field, and what stands there."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from math import prod
from typing import Any, TypeVar

from ..errors import BadConfig, cut
from ..sim.embodiment import EMBODIMENTS
from ..work.typed import typed

T = TypeVar("T")

MAX_FPS = 1000
"""Largest rate of rows [1/s]."""
MAX_ENTRIES = 2**20
"""Largest number of entries of a column in a row."""
TEXT = "string"
"""LeRobot's name of the type of columns that hold texts."""
MAX_ROW = 2**40
"""Bound of the numbers of rows, files and frames."""


@dataclass(frozen=True)
class ColumnInfo:
    """A column in `meta/info.json`."""

    dtype: str
    shape: list[int]
    names: list[str] | Mapping[str, Any] | None


@dataclass(frozen=True)
class Info:
    """The entries of `meta/info.json` that are read."""

    fps: float
    robot_type: str
    total_episodes: int
    features: Mapping[str, ColumnInfo]


EPISODE: Mapping[str, type] = {
    "dataset_from_index": int,
    "dataset_to_index": int,
    "length": int,
    "scengen/task": str,
    "scengen/id": str,
    "scengen/params": str,
    "scengen/horizon": float,
    "scengen/success": bool,
}
"""Columns of the table of episodes that are read, with their types."""
VIDEO: Mapping[str, type] = {"chunk_index": int, "file_index": int, "from_timestamp": float, "to_timestamp": float}
"""Columns of each camera in the table of episodes, with their types."""


def check_info(info: Mapping[str, Any]) -> Info:
    """The content of `meta/info.json` with its types.

    Raises:
        BadConfig: it is something else.
    """
    found = _of_file("meta/info.json", Info, info)
    if not 0 < found.fps <= MAX_FPS:
        raise BadConfig(f"meta/info.json: fps = {found.fps:g}; it must lie in (0, {MAX_FPS}]")
    if found.robot_type not in EMBODIMENTS:
        told = f"robot_type = {cut(repr(found.robot_type))}; it must be {', '.join(EMBODIMENTS)}"
        raise BadConfig(f"meta/info.json: {told}")
    for name, column in found.features.items():
        if not all(size >= 1 for size in column.shape) or prod(column.shape) > MAX_ENTRIES:
            raise BadConfig(f"meta/info.json: features.{cut(name)}.shape = {cut(str(column.shape))}")
        if (
            isinstance(column.names, list)
            and column.names
            and len(column.names) not in (len(column.shape), *column.shape)
        ):
            told = f"{len(column.names)} names for entries of shape {column.shape}"
            raise BadConfig(f"meta/info.json: features.{cut(name)} has {told}")
    return found


def check_episode(number: int, row: Mapping[str, Any]) -> None:
    """Raise `BadConfig` unless a row of the table of episodes has the columns that are read, with their types."""
    _check_columns(number, row, EPISODE)


def is_instruction(row: Mapping[str, Any]) -> bool:
    """Whether a row of `meta/tasks.parquet` has the number and the text of an instruction."""
    return type(row.get("task_index")) is int and isinstance(row.get("task"), str)


def check_film(number: int, row: Mapping[str, Any], camera: str) -> None:
    """Raise `BadConfig` unless a row of the table of episodes says where the pictures of a camera are."""
    _check_columns(number, row, {f"videos/{camera}/{name}": kind for name, kind in VIDEO.items()})


def _check_columns(number: int, row: Mapping[str, Any], columns: Mapping[str, type]) -> None:
    for name, kind in columns.items():
        if name not in row:
            raise BadConfig(f"meta/episodes: the column {name} is missing")
        value = row[name]
        right = isinstance(value, (int, float) if kind is float else kind) and isinstance(value, bool) == (kind is bool)
        if not right or (kind in (int, float) and not 0 <= value < MAX_ROW):
            raise BadConfig(f"meta/episodes: {name} of episode {number} is {cut(repr(value))}")


def _of_file(file: str, cls: type[T], node: Mapping[str, Any]) -> T:
    """The known entries of a file as an object; other entries are left alone."""
    try:
        return typed("", cls, _known(cls, node), exact=True)
    except BadConfig as error:
        raise BadConfig(f"{file}: {error}") from None


def _known(cls: type, node: Mapping[str, Any]) -> dict[str, Any]:
    found = {f.name: node[f.name] for f in fields(cls) if node.get(f.name) is not None}
    if isinstance(columns := found.get("features"), Mapping):
        found["features"] = {
            str(name): _known(ColumnInfo, column) if isinstance(column, Mapping) else column
            for name, column in columns.items()
        }
    return found
