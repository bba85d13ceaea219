"""Statistics of the episodes of recordings, task by task: lengths, actions, smoothness, and how different they are."""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import pdist, squareform

from ...control.loop import ACTION
from ...control.teleop import LARGEST_CHANGE, MOTION
from ...envs.observations import action_names
from ...errors import BadConfig
from ...export.dataset import EpisodeData, Recording
from ...export.recording import CONTROL_ACTIONS
from ...export.replay import asks_for_motion
from ...export.streams import ENVIRONMENT
from ...robots.panda import Names
from ...samplers.task_files import paper_lengths
from .checks import MISSING_FIELD, Subject, fields, movable_bodies
from .score import terms_of

PHASES = 50
"""Number of points of a path that are compared: at equal shares of the episode's time."""
SHOWN_PHASES = 10
"""Number of phases for which the spread is given."""
MOVED = 0.01
"""Distance from its place at the start at which a body has been moved [m]."""
SHOWN_BODIES = 3
"""Number of bodies in the order of a way."""
AT_LIMIT = 1.0 - 1e-6
"""Absolute value from which an action is at its limit."""


@dataclass(frozen=True)
class Channel:
    """Statistics of one number of the actions of all control periods."""

    name: str
    mean: float
    std: float
    q01: float
    q99: float
    at_limit: float
    """Share of control periods at -1 or 1."""
    at_clamp: float
    """Share of changes at the largest that the teleoperation filter allows."""


@dataclass(frozen=True)
class TaskStats:
    """Statistics of the episodes of one task."""

    task: str
    episodes: int
    solved: int
    styles: Mapping[str, int]
    """Number of episodes by style; empty for witnesses."""
    seconds: float
    """Mean length [s]."""
    paper_seconds: float | None
    """Mean length of the paper's demonstrations [s]; None for a task that the paper lacks."""
    idle: float
    """Share of rows whose action commands no motion."""
    jerk: float
    """Mean of the episodes' jerk, see `score.terms_of` [m/s3]."""
    path_ratio: float
    """Mean length of a path over its extent."""
    nearest: float
    """Median distance of an episode's path from the nearest other one, root mean square over the phases [m]."""
    least: float
    """Smallest distance of two paths [m]; 0 for a repeated episode."""
    spread: tuple[float, ...]
    """Root mean square distance of the hands from their mean path in each phase, scenes included [m]."""
    channels: tuple[Channel, ...]
    ways: Mapping[str, int]
    """Number of episodes by the order in which bodies were moved first, such as `cube > bowl`; empty if the
    recordings do not hold the state of the bodies."""


def paths_of(recordings: Sequence[Recording]) -> dict[str, list[NDArray[np.float64]]]:
    """Paths of the hands of all episodes by task, each of shape (rows, 3 * arms) [m]."""
    found: dict[str, list[NDArray[np.float64]]] = defaultdict(list)
    for recording in recordings:
        for episode in recording.read():
            found[episode.task].append(_path(episode))
    return dict(found)


def statistics_of(recordings: Sequence[Recording]) -> list[TaskStats]:
    """Statistics of all tasks of some recordings.

    Raises:
        ScengenError: a recording cannot be read, or lacks a column.
    """
    groups: dict[str, list[tuple[Recording, EpisodeData]]] = defaultdict(list)
    for recording in recordings:
        for episode in recording.read():
            if wrong := [one for one in fields(Subject(episode, recording)) if one.check == MISSING_FIELD]:
                raise BadConfig(f"{recording.folder}: {wrong[0].explanation}; see scengen curate")
            groups[episode.task].append((recording, episode))
    return [_of_task(task, episodes) for task, episodes in sorted(groups.items())]


def _of_task(task: str, episodes: Sequence[tuple[Recording, EpisodeData]]) -> TaskStats:
    terms = [terms_of(episode, recording.fps) for recording, episode in episodes]
    paths = np.array([at_phases(_path(episode)) for _, episode in episodes])
    moves = np.concatenate([asks_for_motion(e.columns["action"]).any(axis=1) for _, e in episodes])
    apart = squareform(pdist(paths.reshape(len(paths), -1))) / np.sqrt(PHASES)
    np.fill_diagonal(apart, np.inf)
    nearest = apart.min(axis=1) if len(paths) > 1 else np.zeros(1)
    away = np.sqrt(((paths - paths.mean(axis=0)) ** 2).sum(axis=2).mean(axis=0))
    styles = Counter(str(e.about["scengen/style"]) for _, e in episodes if e.about.get("scengen/style"))
    return TaskStats(
        task=task,
        episodes=len(episodes),
        solved=sum(bool(episode.about["scengen/success"]) for _, episode in episodes),
        styles=dict(styles),
        seconds=float(np.mean([own["seconds"] for own in terms])),
        paper_seconds=paper_lengths().get(task),
        idle=float(1.0 - moves.mean()),
        jerk=float(np.mean([own["jerk"] for own in terms])),
        path_ratio=float(np.mean([own["path_ratio"] for own in terms])),
        nearest=float(np.median(nearest)),
        least=float(nearest.min()),
        spread=tuple(float(part.mean()) for part in np.array_split(away, SHOWN_PHASES)),
        channels=_channels(episodes),
        ways=dict(Counter(filter(None, (way_of(recording, e) for recording, e in episodes))).most_common()),
    )


def way_of(recording: Recording, episode: EpisodeData) -> str:
    """The order in which an episode moves bodies first, `SHOWN_BODIES` of them; empty if that is not recorded.

    A body has moved once it is `MOVED` from where it started. Bodies that move by themselves count, too.
    """
    if ENVIRONMENT not in episode.columns:
        return ""
    state, first = np.asarray(episode.columns[ENVIRONMENT], float), dict[str, int]()
    for body, start in movable_bodies(recording.entries).items():
        away = np.linalg.norm(state[:, start : start + 3] - state[0, start : start + 3], axis=1) > MOVED
        if away.any():
            first[body] = int(away.argmax())
    order = sorted(first, key=lambda body: (first[body], body))
    return " > ".join(order[:SHOWN_BODIES]) or "nothing"


def _channels(episodes: Sequence[tuple[Recording, EpisodeData]]) -> tuple[Channel, ...]:
    robot = str(episodes[0][0].info["robot_type"])
    size = episodes[0][1].columns["action"].shape[1]
    played = [np.asarray(e.columns[CONTROL_ACTIONS], float).reshape(-1, size) for _, e in episodes]
    every = np.concatenate(played)
    steps = np.concatenate([np.abs(np.diff(actions, axis=0)) for actions in played])
    low, high = np.quantile(every, [0.01, 0.99], axis=0)
    found = []
    for k, name in enumerate(action_names(robot)):
        clamped = float((steps[:, k] > LARGEST_CHANGE - 1e-5).mean()) if k % ACTION < MOTION else 0.0
        limit = float((np.abs(every[:, k]) > AT_LIMIT).mean())
        mean, std = float(every[:, k].mean()), float(every[:, k].std())
        found.append(Channel(name, mean, std, float(low[k]), float(high[k]), limit, clamped))
    return tuple(found)


def at_phases(path: NDArray[np.float64]) -> NDArray[np.float64]:
    """A path at `PHASES` equal shares of its time, shape (PHASES, n)."""
    shares, phases = np.linspace(0.0, 1.0, len(path)), np.linspace(0.0, 1.0, PHASES)
    return np.column_stack([np.interp(phases, shares, column) for column in path.T])


def _path(episode: EpisodeData) -> NDArray[np.float64]:
    arms = episode.columns["action"].shape[1] // ACTION
    return np.hstack([np.asarray(episode.columns[f"{Names(k).arm}eef_pos"], float) for k in range(arms)])
