"""Stage 1: scores from measured terms, relative to the other episodes of the same task in the recording."""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...control.loop import ACTION
from ...export.dataset import EpisodeData
from ...robots.panda import Names

INNER = 1.5
"""Excess over the upper quartile beyond which a term is high [interquartile ranges] (Tukey's inner fence)."""
OUTER = 3.0
"""Excess beyond which a term is far too high [interquartile ranges] (Tukey's outer fence)."""
LEAST_SPREAD = 0.1
"""Smallest interquartile range that is assumed [medians]: demonstrations of a script are nearly alike, and one that is
a little slower is not worse."""
LEAST_GRIPS = 1.0
"""Smallest interquartile range that is assumed for the number of grips: one more change is not a retry, two are."""
KEPT_SCORE = 4
"""Lowest score that is kept (paper, App. C)."""


def terms_of(episode: EpisodeData, fps: float) -> dict[str, float]:
    """Measured terms of an episode, small ones being good.

    `seconds`: length [s]. `jerk`: root mean square of the third difference of the hands' positions [m/s3].
    `path_ratio`: length of the hands' paths in relation to their extent. `grips`: number of changes of the gripper
    commands.
    """
    action = np.asarray(episode.columns["action"], float)
    grips = action[:, ACTION - 1 :: ACTION] > 0
    paths = [
        np.asarray(episode.columns[f"{Names(number).arm}eef_pos"], float) for number in range(action.shape[1] // ACTION)
    ]
    return {
        "seconds": len(episode) / fps,
        "jerk": max(_jerk(path, fps) for path in paths),
        "path_ratio": sum(_length(path) for path in paths) / max(0.01, max(_extent(path) for path in paths)),
        "grips": float((grips[1:] != grips[:-1]).sum()),
    }


def scores_of(terms: Sequence[Mapping[str, float]], tasks: Sequence[str], solved: Sequence[bool]) -> list[int]:
    """Scores from 1 to 5.

    5: no term is high. 4: one is. 3: several are, or one is far too high. 2: several are far too high. 1: no success.

    Args:
        terms: terms of all episodes.
        tasks: their tasks.
        solved: whether each reached the goal.
    """
    fences: dict[str, dict[str, tuple[float, float]]] = {}
    groups: dict[str, list[int]] = defaultdict(list)
    for number, task in enumerate(tasks):
        groups[task].append(number)
    for task, numbers in groups.items():
        measured = {name: np.array([terms[k][name] for k in numbers]) for name in terms[numbers[0]]}
        fences[task] = {name: _fences(name, values) for name, values in measured.items()}
    found = []
    for own, task, success in zip(terms, tasks, solved, strict=True):
        high = sum(value > fences[task][name][0] for name, value in own.items())
        extreme = sum(value > fences[task][name][1] for name, value in own.items())
        score = 2 if extreme > 1 else 3 if extreme or high > 1 else 4 if high else 5
        found.append(score if success else 1)
    return found


def _fences(name: str, values: NDArray[np.float64]) -> tuple[float, float]:
    low, median, high = np.quantile(values, [0.25, 0.5, 0.75])
    spread = max(high - low, LEAST_SPREAD * median, LEAST_GRIPS if name == "grips" else 0.0)
    return float(high + INNER * spread), float(high + OUTER * spread)


def _jerk(path: NDArray[np.float64], fps: float) -> float:
    third: NDArray[Any] = np.diff(path, 3, axis=0) * fps**3
    return float(np.sqrt((third**2).sum(axis=1).mean())) if len(third) else 0.0


def _length(path: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def _extent(path: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.ptp(path, axis=0)))
