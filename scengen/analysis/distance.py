"""How far scenarios and pools are from training and from each other."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist
from scipy.stats import permutation_test

from ..params import values
from ..samplers.support import Support, nearest
from ..samplers.task import Task
from ..scenario import Scenario
from ..symmetry import motions
from .space import Batch, Points, of_tables, scale

MOST_PAIRS = 10_000
"""Near duplicates after which no more are looked for: a line or a plane of a million scenarios has billions."""
AT_A_TIME = 10_000
"""Points whose neighbours are counted at a time."""
ENERGY_OF = 2000
"""Scenarios of each of two pools at most, the first ones, whose energy distance is taken: it needs a matrix of all
distances, and permutations of it."""
CLOSE = 0.01
"""Scenarios that differ by less than this in every parameter are near duplicates [training widths]. The jitter of the
robustness check moves more: actions that solve one of them solve the other."""


@dataclass(frozen=True)
class Offset:
    """How far a value lies from the training support of its parameter."""

    parameter: str
    value: float
    gap: float
    """In the parameter's unit, signed: negative below the nearest training value."""
    relative: float
    """The gap in training widths; in widths of the parameter's bounds where training knows one value only."""


@dataclass(frozen=True)
class Energy:
    """The energy distance of two samples, and whether chance explains it."""

    distance: float
    """sqrt(2 E|X - Y| - E|X - X'| - E|Y - Y'|), in the unit of the coordinates; 0 for equal distributions only."""
    pvalue: float
    """Share of permutations of the two samples that are as far apart."""
    chance: float = 0.0
    """Mean distance of the permutations: what finite samples of equal distributions show."""

    def __str__(self) -> str:
        """In words: `0.42 (by chance 0.11, p = 0.001)`."""
        if self.distance == 0.0:
            return "equal"
        return f"{self.distance:.2g} (by chance {self.chance:.2g}, p = {self.pvalue:.2g})"


@dataclass(frozen=True)
class NearDuplicate:
    """Two scenarios that are nearly the same, their symmetries considered."""

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

    In one dimension the distance is that of `scipy.stats.energy_distance`. Nothing is told from chance where a sample
    is a single vector.

    Args:
        x, y: shapes (n, d) and (m, d).
        permutations: size of the test; all permutations where there are fewer.
        seed: of the permutations.
        twins: number i of both samples differs in what is examined and in nothing else; then pairs change sides, and
            what twins have in common hides no difference.
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
    task: Task, batch: Batch, others: Batch | None = None, within: float = CLOSE
) -> list[NearDuplicate]:
    """Pairs of scenarios that differ by less than `within` in every parameter, nearest first, of `MOST_PAIRS` at most.

    Between two pools this is leakage; within one pool (`others` left out) these are repetitions. Every symmetric image
    of a scenario is compared, so that two identical cubes that have changed places do not hide a pair.

    Args:
        within: largest difference of any parameter that counts [training widths].
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
                if len(least) == MOST_PAIRS:
                    return _nearest_first(least)
    return _nearest_first(least)


def _neighbours(tree: KDTree, points: Points, within: float) -> Iterator[tuple[int, list[int]]]:
    """Every point that has neighbours in the tree, by its number, and theirs."""
    for start in range(0, len(points), AT_A_TIME):
        some = points[start : start + AT_A_TIME]
        for k in np.flatnonzero(tree.query_ball_point(some, within, p=np.inf, return_length=True)):
            yield start + int(k), tree.query_ball_point(some[k], within, p=np.inf)


def _with_a_coordinate(points: Points) -> Points:
    """Points that have a coordinate: where nothing varies all are one scenario."""
    return points if points.shape[1] else np.zeros((len(points), 1))


def _nearest_first(least: Mapping[tuple[str, str], float]) -> list[NearDuplicate]:
    return sorted((NearDuplicate(*pair, apart) for pair, apart in least.items()), key=lambda p: p.distance)


def per_parameter(task: Task, batch: Batch) -> dict[str, tuple[float, float]]:
    """Least and mean distance of a pool from training, by parameter that leaves it [training widths]."""
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
