"""Distances of scenarios and pools from training and from each other."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist
from scipy.stats import permutation_test

from ...params import values
from ...samplers.support import Support, nearest
from ...samplers.task import Task
from ...scenario import Scenario
from ...symmetry import motions
from .space import Batch, Points, of_tables, scale

MAX_PAIRS = 10_000
"""Maximum number of near duplicates that are searched: a line or a plane of a million scenarios has billions."""
NEIGHBOUR_BATCH = 10_000
"""Number of points whose neighbours are counted at a time."""
MAX_ENERGY_SCENARIOS = 2000
"""Maximum number of scenarios of each of two pools, the first ones, of which an energy distance is computed: it needs a
matrix of all distances, and permutations of it."""
NEAR_DUPLICATE_DISTANCE = 0.01
"""Difference in every parameter below which two scenarios are near duplicates [training widths]. The jitter of the
robustness check is larger: actions that solve one of them solve the other."""


@dataclass(frozen=True)
class Offset:
    """Distance of a value from the training support of its parameter."""

    parameter: str
    value: float
    gap: float
    """Signed gap, negative below the nearest training value [unit of the parameter]."""
    relative: float
    """Absolute gap [training widths; widths of the parameter's bounds if training has one value only]."""


@dataclass(frozen=True)
class Energy:
    """The energy distance of two samples, with a permutation test."""

    distance: float
    """Distance sqrt(2 E|X - Y| - E|X - X'| - E|Y - Y'|) [unit of the coordinates]; 0 only for equal distributions."""
    pvalue: float
    """Share of permutations of the two samples that are as far apart."""
    chance: float = 0.0
    """Mean distance of the permutations: the distance of finite samples of equal distributions."""

    def __str__(self) -> str:
        """The distance with its test, as text: `0.42 (by chance 0.11, p = 0.001)`."""
        if self.distance == 0.0:
            return "equal"
        return f"{self.distance:.2g} (by chance {self.chance:.2g}, p = {self.pvalue:.2g})"


@dataclass(frozen=True)
class NearDuplicate:
    """Two scenarios that are nearly the same up to the family's symmetries."""

    one: str
    other: str
    distance: float
    """Largest difference of any parameter [training widths]."""


def offsets(task: Task, scenario: Scenario) -> list[Offset]:
    """The parameters of a scenario that lie outside their training support, farthest first."""
    found = []
    for name, value in values(scenario).items():
        edge = nearest(task.training[name].support, value, task.known[name].period)
        if value != edge:
            found.append(Offset(name, value, value - edge, abs(value - edge) / scale(task, name)))
    return sorted(found, key=lambda o: -o.relative)


def energy(x: Points, y: Points, permutations: int = 999, seed: int = 0, twins: bool = False) -> Energy:
    """Energy distance of two samples of vectors (Szekely and Rizzo 2013), with a permutation test.

    In one dimension the distance is that of `scipy.stats.energy_distance`. If a sample is a single vector, the test is
    not possible and the p value is 1.

    Args:
        x, y: shapes (n, d) and (m, d).
        permutations: number of permutations; all permutations if there are fewer.
        seed: seed of the permutations.
        twins: whether number i of both samples are twins, which differ only in what is examined. Then the members of a
            pair are exchanged, so that the variation that twins share does not hide a difference.
    """
    if twins and np.array_equal(x, y):
        return Energy(0.0, 1.0)
    pooled = np.concatenate([x, y])
    apart = cdist(pooled, pooled)

    def squared(a: NDArray[np.int64], b: NDArray[np.int64], axis: int = -1) -> NDArray[np.float64]:
        weight = np.zeros((*a.shape[:-1], len(pooled)))
        np.put_along_axis(weight, a, 1 / a.shape[-1], -1)
        np.put_along_axis(weight, b, -1 / b.shape[-1], -1)
        return -np.sum((weight @ apart) * weight, axis=-1)

    one, other = np.arange(len(x)), np.arange(len(x), len(pooled))
    if min(len(x), len(y)) < 2:
        alone = math.sqrt(max(0.0, float(squared(one, other))))
        return Energy(alone, 1.0, alone)
    tested = permutation_test(
        (one, other),
        squared,
        vectorized=True,
        n_resamples=permutations,
        batch=100,
        alternative="greater",
        permutation_type="samples" if twins else "independent",
        rng=np.random.default_rng(seed),
    )
    by_chance = float(np.sqrt(np.maximum(0.0, tested.null_distribution)).mean())
    return Energy(math.sqrt(round(max(0.0, float(tested.statistic)), 12)), float(tested.pvalue), by_chance)


def near_duplicates(
    task: Task, batch: Batch, others: Batch | None = None, within: float = NEAR_DUPLICATE_DISTANCE
) -> list[NearDuplicate]:
    """Pairs of scenarios that differ by less than `within` in every parameter, nearest first, at most `MAX_PAIRS`.

    Between two pools such pairs are leakage; within one pool (`others` left out) they are repetitions. Every symmetric
    image of a scenario is compared, so that two identical cubes that have changed places do not hide a pair.

    Args:
        within: maximum difference of any parameter [training widths].
    """
    beside = batch if others is None else others
    if not len(batch) or not len(beside):
        return []
    space, least = of_tables(task, batch.values, beside.values), dict[tuple[str, str], float]()
    here = _with_a_coordinate(space.of(batch.values, len(batch)))
    tree = KDTree(here)
    for motion in motions(beside.values, task.family.SYMMETRIES):
        moved = {name: to.sign * beside.values[to.source] + to.offset for name, to in motion.items()}
        there = _with_a_coordinate(space.of(moved, len(beside)))
        for number, neighbours in _neighbours(tree, there, within):
            other = beside.name(number)
            for i in neighbours:
                if others is None and batch.name(i) >= other:
                    continue
                apart, pair = float(np.abs(here[i] - there[number]).max()), (batch.name(i), other)
                least[pair] = min(apart, least.get(pair, np.inf))
                if len(least) == MAX_PAIRS:
                    return _nearest_first(least)
    return _nearest_first(least)


def _neighbours(tree: KDTree, points: Points, within: float) -> Iterator[tuple[int, list[int]]]:
    """Every point that has neighbours in the tree: its number, and the numbers of the neighbours."""
    for start in range(0, len(points), NEIGHBOUR_BATCH):
        some = points[start : start + NEIGHBOUR_BATCH]
        for k in np.flatnonzero(tree.query_ball_point(some, within, p=np.inf, return_length=True)):
            yield start + int(k), tree.query_ball_point(some[k], within, p=np.inf)


def _with_a_coordinate(points: Points) -> Points:
    """The points with at least one coordinate: if no parameter varies, all points coincide."""
    return points if points.shape[1] else np.zeros((len(points), 1))


def _nearest_first(least: Mapping[tuple[str, str], float]) -> list[NearDuplicate]:
    return sorted((NearDuplicate(*pair, apart) for pair, apart in least.items()), key=lambda p: p.distance)


def per_parameter(task: Task, batch: Batch) -> dict[str, tuple[float, float]]:
    """Minimum and mean distance of a pool from training, by parameter that leaves training [training widths]."""
    found = {}
    for name, column in batch.values.items():
        support, period = task.training[name].support, task.known[name].period
        outside = ~np.any([(low <= column) & (column <= high) for low, high in _ends(support)], axis=0)
        values, places = np.unique(column[outside], return_inverse=True)
        far = np.array([abs(value - nearest(support, value, period)) for value in values.tolist()])
        if len(far) and far.max() > 0:
            relative = np.zeros(len(column))
            relative[outside] = far[places] / scale(task, name)
            found[name] = (float(relative.min()), float(relative.mean()))
    return found


def _ends(support: Support) -> list[tuple[float, float]]:
    return [(interval.low, interval.high) for interval in support]
