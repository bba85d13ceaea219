"""Demonstrations for training: the observations and actions of each episode of a recording, at its own rate."""

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..control.loop import ACTION, Loop
from ..envs.object_state import NAME
from ..envs.observations import proprioception
from ..errors import BadConfig, PoolError, UnknownName, cut
from ..export.dataset import CURATION, TASK_VERSION, EpisodeData, Recording
from ..export.streams import ENVIRONMENT
from ..pool.files import read_json_file, sha256, sha256_of_file
from .goals import pose_streams

KEPT = Path(CURATION, "kept.json")
"""File in which `scengen curate` lists the episodes that are kept."""
MIN_EPISODES = 2
"""Smallest number of demonstrations: one to learn from, one held out."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Rows of one demonstration."""

    scenario: str
    """Id of its scenario."""
    observations: NDArray[np.float32]
    """Observed entries, shape (rows, entries)."""
    hands: NDArray[np.float32]
    """Poses of the hands: positions [m] and quaternions xyzw, shape (rows, 7 * arms)."""
    actions: NDArray[np.float32]
    """Action that is held until the next row, shape (rows, 7 * arms)."""


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Demonstrations of one task."""

    task: str
    task_version: int | None
    """Version of the task; None in recordings that do not state it."""
    embodiment: str
    rate: int
    """Rows per second, a divisor of 100."""
    streams: tuple[str, ...]
    """Names of the observed streams."""
    entries: tuple[str, ...]
    """Names of the entries of these streams, one after the other."""
    trajectories: tuple[Trajectory, ...]
    sha256: str
    """Hash of the recording's rows, and of the choice of episodes."""
    left_out: Mapping[str, int]
    """Number of episodes that are not learned from, by reason."""

    @classmethod
    def read(
        cls,
        folder: str | Path,
        observations: Sequence[str] | None = None,
        demonstrations: int | None = None,
        task: str | None = None,
    ) -> "TrainingData":
        """Read the demonstrations of one task in a recording.

        Failed episodes are left out, and those that a curation of the recording has not kept.

        Args:
            folder: a LeRobot recording of `scengen record`.
            observations: streams to observe; default: proprioception and `object-state`.
            demonstrations: number of demonstrations, the first ones; default: all.
            task: the task; default: that of the recording, if it holds no other.

        Raises:
            ScengenError: the recording is damaged, holds several tasks of which none is named, fewer demonstrations or
                no success, or lacks a stream.
        """
        recording = Recording.open(folder)
        task = _task(recording, task)
        robot = str(recording.info["robot_type"])
        streams = tuple(observations or (*proprioception(robot), NAME))
        columns, hands = _columns(recording, streams), tuple(_columns(recording, pose_streams(robot)))
        kept = kept_episodes(recording)
        found, left_out = [], {"of another task": 0, "failed": 0, "not kept by the curation": 0}
        for episode in recording.read():
            if episode.task != task:
                left_out["of another task"] += 1
            elif not episode.about.get("scengen/success"):
                left_out["failed"] += 1
            elif kept is not None and episode.number not in kept:
                left_out["not kept by the curation"] += 1
            else:
                found.append(_trajectory(recording, episode, columns, hands))
        if len(found) < MIN_EPISODES:
            text = ", ".join(f"{count} {why}" for why, count in left_out.items() if count) or "no episodes"
            raise BadConfig(f"{folder}: {len(found)} demonstrations to learn from ({text}); at least {MIN_EPISODES}")
        if demonstrations is not None and demonstrations > len(found):
            raise BadConfig(f"demonstrations = {demonstrations}; {folder} has {len(found)} to learn from")
        found = found[:demonstrations]
        entries = tuple(name for names in columns.values() for name in names)
        identity = [*_hashes(recording), json.dumps([trajectory.scenario for trajectory in found])]
        version, rate, hashed = _task_version(recording, task), _rate(recording), sha256("\n".join(identity))
        return cls(task, version, robot, rate, streams, entries, tuple(found), hashed, left_out)

    @property
    def rows(self) -> int:
        """Number of rows of all demonstrations."""
        return sum(len(trajectory.actions) for trajectory in self.trajectories)


def entry_names(stream: str, names: Sequence[str], shape: Sequence[int]) -> tuple[str, ...]:
    """Names of the entries of a stream, one for each of its numbers; those of a grid are counted.

    Args:
        names: names of the entries of a vector, or of the axes of a grid.
    """
    return tuple(names) if len(shape) < 2 else tuple(f"{stream}.{i}" for i in range(prod(shape)))


def _task(recording: Recording, wanted: str | None) -> str:
    """The task whose demonstrations are read.

    Raises:
        ScengenError: the recording lacks the task, or has several tasks and none is requested.
    """
    tasks = sorted({str(row["scengen/task"]) for row in recording.episodes})
    if wanted is not None and wanted not in tasks:
        raise UnknownName(f"task in {recording.folder}", wanted, tasks)
    if wanted is None and len(tasks) > 1:
        raise BadConfig(f"{recording.folder} holds demonstrations of {' and '.join(tasks)}; pass task=...")
    return wanted or tasks[0]


def _task_version(recording: Recording, task: str) -> int | None:
    """The version of the task of which a recording is; None if its episodes do not state it.

    Raises:
        PoolError: the episodes state several versions, or something else.
    """
    first, *others = (row.get(TASK_VERSION) for row in recording.episodes if row["scengen/task"] == task)
    if all(other == first for other in others) and (first is None or (isinstance(first, int) and first >= 1)):
        return first
    raise PoolError(f"{recording.folder}: {TASK_VERSION} of {task} is not one number; record one version alone")


def _columns(recording: Recording, streams: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Columns of the recording that hold the streams, and the names of their entries.

    Raises:
        UnknownName: there is no such column.
    """
    known = {
        NAME if column == ENVIRONMENT else column: (column, feature)
        for column, feature in recording.info["features"].items()
        if feature["dtype"] == "float32" and feature.get("names") and "." not in column.removeprefix("observation.")
    }
    found = {}
    for stream in streams:
        if stream not in known:
            if stream == NAME:
                raise BadConfig(
                    f"{recording.folder} holds no {NAME}: record with environment_state=true, or set observations=[...]"
                )
            raise UnknownName("recorded stream", stream, known)
        column, feature = known[stream]
        found[column] = entry_names(stream, feature["names"], feature["shape"])
        if len(found[column]) != prod(feature["shape"]):
            raise PoolError(f"{recording.folder}: {column} has not one name for each entry; record it again")
    return found


def _trajectory(recording: Recording, episode: EpisodeData, columns: Iterable[str], hands: Iterable[str]) -> Trajectory:
    seen, poses, actions = (_values(episode, names) for names in (columns, hands, ("action",)))
    if not (np.isfinite(seen).all() and np.isfinite(poses).all() and np.isfinite(actions).all()):
        raise PoolError(f"{recording.folder}: episode {episode.number} has numbers that are not finite; see curate")
    if poses.shape != actions.shape or not poses.reshape(-1, ACTION)[:, 3:].any(axis=1).all():
        raise PoolError(f"{recording.folder}: episode {episode.number} has no pose of a hand for each action")
    return Trajectory(str(episode.about["scengen/id"]), seen, poses, actions)


def _values(episode: EpisodeData, columns: Iterable[str]) -> NDArray[np.float32]:
    """Columns of an episode side by side, shape (rows, entries)."""
    names = list(columns)
    if missing := [name for name in names if name not in episode.columns]:
        raise PoolError(f"episode {episode.number} lacks the column {missing[0]}; record it again")
    found = [episode.columns[name].reshape(len(episode), -1) for name in names]
    return np.concatenate(found, axis=1, dtype=np.float32)


def kept_episodes(recording: Recording) -> set[int] | None:
    """Numbers of the episodes that a curation has kept; None without one.

    Raises:
        PoolError: the list is damaged.
    """
    path = recording.folder / KEPT
    if not os.path.lexists(path):
        return None
    try:
        found = read_json_file(path)
        if not (isinstance(found, list) and all(type(number) is int for number in found)):
            raise ValueError("not a list of numbers")
        if strange := [number for number in found if not 0 <= number < len(recording.episodes)]:
            raise ValueError(f"there is no episode {strange[0]}")
    except (ValueError, OSError) as error:
        raise PoolError(f"{path} is damaged ({cut(str(error))}); repeat scengen curate, or remove it") from None
    return set(found)


def _hashes(recording: Recording) -> list[str]:
    return [sha256_of_file(path) for path in sorted((recording.folder / "data").glob("*/*.parquet"))]


def _rate(recording: Recording) -> int:
    full, rate = round(1 / Loop.PERIOD), round(recording.fps)
    if rate < 1 or full % rate:
        raise PoolError(f"{recording.folder} has {rate} rows per second, which does not divide {full}; record it again")
    return rate
