"""Coverage of a distribution by a pool, and the choice of a subset with the best coverage."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist
from scipy.stats import qmc

from .space import Points


@dataclass(frozen=True)
class Evenness:
    """Centred discrepancy of a pool's numbers in the unit cube."""

    discrepancy: float
    """Squared centred L2 discrepancy (Hickernell 1998), as `scipy.stats.qmc.discrepancy` gives it."""
    independent: float
    """Mean squared discrepancy of the same number of independent draws."""

    @property
    def relative(self) -> float:
        """Ratio to independent draws. Below 1: more even. Far above 1: parts of the distribution are missing."""
        return self.discrepancy / self.independent


def evenness(numbers: Points) -> Evenness:
    """Evenness of numbers in the unit cube.

    For independent draws the expected value is ((5/4)^d - (13/12)^d) / n: all mixed terms of the discrepancy average to
    (13/12)^d, the n^-2 diagonal ones to (5/4)^d.

    Args:
        numbers: shape (n, d), the design's number for each parameter that varies.
    """
    n, d = numbers.shape
    return Evenness(float(qmc.discrepancy(numbers, method="CD")), ((5 / 4) ** d - (13 / 12) ** d) / n)


def farthest_points(points: Points, count: int) -> NDArray[np.int64]:
    """Choose points so that the smallest distance between two of them is large.

    Greedy: start in the middle, then always take the point that is farthest from all chosen ones (Gonzalez 1985: at
    least half the best possible distance). The first m of n chosen points are those that would be chosen for m.

    Args:
        points: shape (n, d).
        count: number of points to choose, at most n.

    Returns:
        Numbers of the points, in the order in which they are chosen.
    """
    chosen = [int(np.argmin(np.linalg.norm(points - np.median(points, axis=0), axis=1)))]
    away = cdist(points, points[chosen])[:, 0]
    while len(chosen) < count:
        away[chosen[-1]] = -1.0  # equal points may all be chosen, but none twice
        chosen.append(int(np.argmax(away)))
        np.minimum(away, cdist(points, points[chosen[-1:]])[:, 0], out=away)
    return np.array(chosen)
