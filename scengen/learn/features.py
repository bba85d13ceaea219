"""From observations to the inputs of a policy.

Quaternions become the first two columns of their rotation matrix, six numbers that are continuous in the rotation (Zhou
et al., CVPR 2019). Each number is shifted by its mean in training and divided by its standard deviation, or by the
smallest spread of its unit (`scengen.export.floors`) if that is larger. Numbers that do not vary in training by more
than this spread are left out: nothing can be learned about them, and an untrained weight would turn their first change
into noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..export.floors import ANGLE, floor_of

LARGEST_INPUT = 5.0
"""Largest absolute value of an input [standard deviations]. What lies farther out would saturate a network anyway."""
ROTATION = 6
"""Numbers of a rotation."""
QUATERNION = ("x", "y", "z", "w")


@dataclass(frozen=True, eq=False)
class Features:
    """The inputs of a policy: `steps` observations one after the other, the present one first."""

    entries: tuple[str, ...]
    """Names of the entries of an observation."""
    steps: int
    """Number of observations."""
    mean: NDArray[np.float32]
    """Mean of each number, shape (numbers,)."""
    scale: NDArray[np.float32]
    """Divisor of each number, shape (numbers,); infinite for a number that is left out."""

    @classmethod
    def of(cls, entries: Sequence[str], steps: int, observations: NDArray[np.float32]) -> "Features":
        """Features with the means and spreads of some observations, shape (rows, entries)."""
        numbers = _numbers(tuple(entries), observations)
        floors = np.array(_floors(entries), np.float32)
        spread = numbers.max(axis=0) - numbers.min(axis=0)
        scale = np.where(spread > floors, np.maximum(numbers.std(axis=0), floors), np.inf)
        return cls(tuple(entries), steps, numbers.mean(axis=0), scale.astype(np.float32))

    @property
    def size(self) -> int:
        """Number of inputs."""
        return self.steps * int(np.isfinite(self.scale).sum())

    @property
    def used(self) -> set[str]:
        """Names of the entries that are not left out."""
        numbers = zip(number_names(self.entries), self.scale, strict=True)
        readings = {name.rpartition(".rot")[0] or name for name, scale in numbers if np.isfinite(scale)}
        return {entry for entry in self.entries if readings & {entry, entry.rpartition(".")[0]}}

    def inputs(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Inputs at each row of one episode, shape (rows, size). Before the first row is the first row.

        Args:
            observations: shape (rows, entries).
        """
        used = np.isfinite(self.scale)
        numbers = _numbers(self.entries, observations)[:, used]
        scaled = ((numbers - self.mean[used]) / self.scale[used]).clip(-LARGEST_INPUT, LARGEST_INPUT)
        rows = np.arange(len(scaled))
        return np.hstack([scaled[np.maximum(rows - step, 0)] for step in range(self.steps)]).astype(np.float32)


@cache
def _quaternions(entries: tuple[str, ...]) -> list[int]:
    """Places at which a quaternion starts."""
    names = [name.rpartition(".") for name in entries]
    return [
        i
        for i in range(len(names) - 3)
        if "quat" in names[i][0] and names[i : i + 4] == [(names[i][0], ".", last) for last in QUATERNION]
    ]


def number_names(entries: Sequence[str]) -> tuple[str, ...]:
    """Names of the numbers that entries become: those of a quaternion end in `.rot0` to `.rot5`."""
    starts, found, i = set(_quaternions(tuple(entries))), list[str](), 0
    while i < len(entries):
        if i in starts:
            found += [f"{entries[i].rpartition('.')[0]}.rot{k}" for k in range(ROTATION)]
            i += len(QUATERNION)
        else:
            found.append(entries[i])
            i += 1
    return tuple(found)


def _floors(entries: Sequence[str]) -> list[float]:
    """Smallest spreads of the numbers. Those of a rotation change by the angle, not by half of it."""
    return [ANGLE if ".rot" in name else floor_of(name) for name in number_names(entries)]


def _numbers(entries: tuple[str, ...], observations: NDArray[np.float32]) -> NDArray[np.float32]:
    """Observations with rotations in place of quaternions, shape (rows, numbers)."""
    parts, after = [], 0
    for start in _quaternions(entries):
        parts += [observations[:, after:start], _rotations(observations[:, start : start + 4])]
        after = start + 4
    return np.concatenate([*parts, observations[:, after:]], axis=1, dtype=np.float32)


def _rotations(quats: NDArray[np.float32]) -> NDArray[np.float32]:
    """The first two columns of the rotation matrices of quaternions xyzw, shapes (n, 6) and (n, 4); 0 for 0."""
    x, y, z, w = quats.T
    n = np.maximum(x * x + y * y + z * z + w * w, 1e-12)
    first = (w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y))
    second = (2 * (x * y - w * z), w * w - x * x + y * y - z * z, 2 * (y * z + w * x))
    return (np.stack([*first, *second], axis=1) / n[:, None]).astype(np.float32)
