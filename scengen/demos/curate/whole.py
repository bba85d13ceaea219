"""The other files of a recording, compared with its rows: statistics, instructions, and the table of episodes."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...envs.object_state import BOX, MOTION, POSE
from ...envs.observations import action_names, named, proprioception, streams_of
from ...export.dataset import EpisodeData, Recording
from ...export.floors import floors_of, with_floors
from ...export.lerobot import DATA_PATH, VIDEO_PATH
from ...export.native import FULL_RATE
from ...export.recording import CONTROL_ACTIONS, STATE
from ...export.stats import describe
from ...export.streams import ENVIRONMENT, feature_of
from .findings import Finding
from .replays import state_of

KINDS = {**POSE, **MOTION, **BOX}
"""Names of the entries of streams of bodies, by the end of their name."""

TOLERANCE = 1e-6
"""Largest difference of statistics, relative beyond 1."""


@dataclass
class Whole:
    """The rows of all episodes that were read."""

    recording: Recording
    columns: dict[str, list[NDArray[Any]]] = field(default_factory=lambda: defaultdict(list))
    rows: int = 0
    """Number of rows so far."""
    faulty: set[str] = field(default_factory=set)
    """Columns of which an episode has other statistics than the table of episodes says."""

    partial: bool = False
    """Whether the rows of an episode cannot be read."""

    def skip(self, episode: EpisodeData) -> None:
        """Go on after an episode that cannot be read."""
        self.partial, self.rows = True, int(episode.about["dataset_to_index"])

    def of_episode(self, episode: EpisodeData) -> Iterator[Finding]:
        """Findings about the other files of the next episode."""
        about, recording = episode.about, self.recording
        if about.get("episode_index") != episode.number or about["dataset_from_index"] != self.rows:
            yield _finding("EPISODE_TABLE", "the table of episodes leaves rows out, or counts them twice")
        place = recording.file_of(self.rows)
        told = tuple(about.get(f"data/{name}") for name in ("chunk_index", "file_index"))
        if told != place:
            yield _finding("EPISODE_TABLE", f"the table of episodes names file {told}, the rows are in {place}")
        self.rows = int(about["dataset_to_index"])
        yield from _wrong_instruction(episode, recording)
        for name, values in episode.columns.items():
            self.columns[name].append(values)
            kept = {key.rpartition("/")[2]: v for key, v in about.items() if key.startswith(f"stats/{name}/")}
            if not alike(kept, describe(values)):
                self.faulty.add(name)
                yield _finding("STATS", f"the table of episodes has other statistics of {name}")

    def of_all(self) -> Iterator[Finding]:
        """Findings about the files of the whole recording."""
        info, stats = self.recording.info, self.recording.stats
        counts = {"total_episodes": len(self.recording.episodes), "total_frames": self.rows}
        counts["total_tasks"] = len(self.recording.tasks)
        split = {"train": f"0:{counts['total_episodes']}"}
        made = {**counts, "splits": split, "data_path": DATA_PATH, "fps": FULL_RATE / self.periods}
        made["video_path"] = VIDEO_PATH if self.recording.cameras else None
        if lacking := [name for name in self.columns if name not in info["features"]]:
            yield _finding("INFO", f"meta/info.json lacks the columns {', '.join(lacking)[:100]}")
        for name, here in made.items():
            if info.get(name) != here:
                yield _finding("INFO", f"meta/info.json: {name} is {str(info.get(name))[:40]}, not {here}")
        yield from self._wrong_names()
        if self.rows != self.recording.total:
            yield _finding("EPISODE_TABLE", f"the table of episodes has {self.rows} rows of {self.recording.total}")
        if self.partial:
            why = "meta/stats.json was not compared: an episode cannot be read"
            yield from [Finding("STATS", "warning", (), {}, why)] if self.columns else []
            return
        for name, parts in self.columns.items():
            feature = info["features"].get(name, {})
            made = describe(np.concatenate(parts))
            if feature.get("dtype") == "float32":
                made = with_floors(made, floors_of(name, feature.get("names"), tuple(feature["shape"])))
            if not alike(stats.get(name), made):
                # one faulty episode does not keep the others out
                severity = "warning" if name in self.faulty else "error"
                yield Finding("STATS", severity, (), {}, f"meta/stats.json has other statistics of {name}")

    @property
    def periods(self) -> int:
        """Number of control periods in a row."""
        actions = self.columns.get(CONTROL_ACTIONS)
        return actions[0].shape[1] if actions else round(FULL_RATE / self.recording.fps)

    def _wrong_names(self) -> Iterator[Finding]:
        """Whether the entries of columns have the names of what they hold: `train` chooses inputs by them."""
        features, robot = self.recording.info["features"], str(self.recording.info["robot_type"])
        own = streams_of(robot)
        made: dict[str, Sequence[str] | None] = {n: feature_of(n, stream).names for n, stream in own.items()}
        made |= {"action": action_names(robot), CONTROL_ACTIONS: ("period", "action")}
        made[STATE] = named(own, proprioception(robot))
        made[ENVIRONMENT] = state_of(self.recording.entries, robot).names
        for name, feature in features.items():
            kind = next((kind for kind in KINDS if name.endswith(f"_{kind}")), None)
            entries = made.get(name) or (kind and [f"{name}.{entry}" for entry in KINDS[kind]])
            if entries and feature.get("names") != list(entries):
                yield _finding("INFO", f"meta/info.json: the entries of {name} have other names")

    @property
    def claimed(self) -> list[str]:
        """Files with claims that the rows do not decide."""
        pictures = ["statistics of pictures"] if self.recording.cameras else []
        native = ["native/"] if (self.recording.folder / "native").is_dir() else []
        return [*self.recording.texts, *pictures, *native, "meta/scengen.json", "README.md"]


def alike(told: Any, made: Mapping[str, Any]) -> bool:
    """Whether statistics are those that were made again."""
    if not isinstance(told, Mapping) or told.keys() != made.keys():
        return False
    try:
        pairs = [(np.array(told[name], float), np.array(made[name], float)) for name in made]
    except (TypeError, ValueError):
        return False
    return all(a.shape == b.shape and np.allclose(a, b, TOLERANCE, TOLERANCE) for a, b in pairs)


def _wrong_instruction(episode: EpisodeData, recording: Recording) -> Iterator[Finding]:
    """Whether every row names the instruction of its episode."""
    numbers, told = {*episode.columns["task_index"].ravel().tolist()}, episode.about.get("tasks")
    named = [recording.tasks.get(number) for number in numbers]
    if not isinstance(told, list) or named != told:
        yield _finding("INSTRUCTION", "task_index, meta/tasks.parquet and the table of episodes contradict each other")


def _finding(check: str, why: str) -> Finding:
    return Finding(check, "error", (), {}, why)
