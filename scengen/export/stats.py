"""Statistics of columns and of pictures, which LeRobot's data sets contain for normalisation."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..pictures.render import Picture

QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
"""Quantiles of the statistics, by LeRobot's names."""
PIXEL_STRIDE = 4
"""Distance between the rows and columns of pictures that are counted; every fourth is enough for colours."""

Stats = dict[str, Any]
"""min, max, mean, std, count and quantiles as nested lists."""


def describe(values: NDArray[Any]) -> Stats:
    """Statistics over the first axis, element by element. Numbers give lists of one entry, as in LeRobot."""
    rows = values.astype(np.float64)
    if rows.ndim == 1:
        rows = rows[:, None]
    quantiles = np.quantile(rows, list(QUANTILES.values()), axis=0)
    return {
        "min": rows.min(axis=0).tolist(),
        "max": rows.max(axis=0).tolist(),
        "mean": rows.mean(axis=0).tolist(),
        "std": rows.std(axis=0).tolist(),
        "count": [len(rows)],
        **{name: quantile.tolist() for name, quantile in zip(QUANTILES, quantiles, strict=True)},
    }


class Shades:
    """Histogram of the 256 values of each channel over some pictures."""

    def __init__(self) -> None:
        self.counts, self.frames = np.zeros((3, 256), np.int64), 0

    def add(self, picture: Picture) -> None:
        """Count one picture."""
        sample = picture[::PIXEL_STRIDE, ::PIXEL_STRIDE]
        self.counts += [np.bincount(sample[:, :, channel].ravel(), minlength=256) for channel in range(3)]
        self.frames += 1

    def __iadd__(self, other: "Shades") -> "Shades":
        self.counts += other.counts
        self.frames += other.frames
        return self

    def describe(self) -> Stats:
        """Statistics of each channel in [0, 1], shape (3, 1, 1)."""
        shades, total = np.arange(256) / 255, self.counts.sum(axis=1)
        below = self.counts.cumsum(axis=1)
        mean = self.counts @ shades / total
        std = np.sqrt(np.maximum(0.0, self.counts @ shades**2 / total - mean**2))
        levels = {"min": 0.0, "max": 1.0, **QUANTILES}
        found = {name: shades[(below > level * (total[:, None] - 1)).argmax(axis=1)] for name, level in levels.items()}
        numbers = {**found, "mean": mean, "std": std}
        return {name: value.reshape(3, 1, 1).tolist() for name, value in numbers.items()} | {"count": [self.frames]}
