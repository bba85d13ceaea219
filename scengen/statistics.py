"""Success rates with cluster-robust intervals: repeated rollouts of one scenario are not independent."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

Z = NormalDist().inv_cdf(0.975)
"""Half width of a 95 % interval in standard errors."""


@dataclass(frozen=True)
class Rate:
    """A success rate and its 95 % interval."""

    value: float
    low: float
    high: float
    scenarios: int
    rollouts: int
    effective: float
    """How many independent rollouts carry the same information."""


@dataclass(frozen=True)
class Difference:
    """A difference between two success rates and its 95 % interval."""

    value: float
    low: float
    high: float


def rate(successes: Sequence[Sequence[bool]]) -> Rate:
    """The success rate of several scenarios with one or more rollouts each.

    Wilson's score interval for the effective number of rollouts, n / (1 + (k - 1) icc), with k rollouts in each of
    the scenarios and their intra-cluster correlation icc (Kish's design effect). Where all rollouts end alike the
    correlation cannot be estimated and is taken as 1: then each scenario counts once.

    Args:
        successes: for every scenario the outcomes of its rollouts.
    """
    counts = np.array([len(s) for s in successes], float)
    means = np.array([np.mean(s) for s in successes])
    n, k = counts.sum(), counts.mean()
    value = float((counts * means).sum() / n)
    effective = float(n / (1 + (k - 1) * correlation(successes)))
    low, high = wilson(value, effective)
    return Rate(value, low, high, len(successes), int(n), effective)


def correlation(successes: Sequence[Sequence[bool]]) -> float:
    """Intra-cluster correlation of binary outcomes, by one-way analysis of variance, within [0, 1].

    1 where it cannot be estimated: with one scenario, with one rollout each, or when all end alike.
    """
    counts = np.array([len(s) for s in successes], float)
    n, groups = counts.sum(), len(counts)
    means = np.array([np.mean(s) for s in successes])
    overall = (counts * means).sum() / n
    if groups < 2 or n == groups or overall in (0.0, 1.0):
        return 1.0
    between = (counts * (means - overall) ** 2).sum() / (groups - 1)
    within = (counts * means * (1 - means)).sum() / (n - groups)
    size = (n - (counts**2).sum() / n) / (groups - 1)
    return float(np.clip((between - within) / (between + (size - 1) * within), 0.0, 1.0))


def wilson(value: float, n: float) -> tuple[float, float]:
    """Wilson's 95 % score interval of a proportion observed in `n` trials, which need not be a whole number."""
    centre = (value + Z**2 / (2 * n)) / (1 + Z**2 / n)
    half = Z / (1 + Z**2 / n) * np.sqrt(value * (1 - value) / n + Z**2 / (4 * n**2))
    return float(max(0.0, centre - half)), float(min(1.0, centre + half))


def difference(a: Rate, b: Rate) -> Difference:
    """`a` minus `b`, with Newcombe's hybrid score interval for two independent sets of scenarios."""
    value = a.value - b.value
    low = value - np.hypot(a.value - a.low, b.high - b.value)
    high = value + np.hypot(a.high - a.value, b.value - b.low)
    return Difference(value, float(low), float(high))
