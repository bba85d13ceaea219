"""Power of a comparison of success rates: the analysis of `evaluate`, applied to simulated experiments."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.special import ndtr

from ..errors import BadConfig
from ..work.limits import at_least
from .statistics import ORDERINGS

EXPERIMENTS = 1000
"""Number of simulated experiments: a probability of 0.8 is accurate to 3 points at 95 % confidence."""
MIN_IN_TAIL = 40
"""Minimum number of the random orderings of a bound that lie beyond it, see `statistics.mean_interval`."""
MAX_SCENARIOS = 1_000_000
"""Maximum number of scenarios in all experiments together; larger analyses have fewer experiments."""
MAX_SIMULATED = 1000
"""Maximum number of scenarios for which experiments are simulated. Above, the normal approximation is accurate to 2
points."""

Shares = NDArray[np.float64]
"""Share of its rollouts that a scenario solves, shape (experiments, scenarios)."""


@dataclass(frozen=True)
class PowerAnalysis:
    """A comparison of two success rates, each over `seeds` scenarios with `rollouts` rollouts.

    A drop is found if the interval that `scengen evaluate` gives for the difference excludes 0. The difficulty of
    scenarios is beta-distributed; the difficulties of twins are correlated through a Gaussian copula.
    """

    seeds: int = 20
    """Number of scenarios (the paper's S)."""
    rollouts: int = 5
    """Number of rollouts of each scenario (the paper's K)."""
    correlation: float = 0.5
    """Intra-cluster correlation of the outcomes of one scenario: 0 if only noise decides, 1 if only the scenario does.
    `scengen.evaluate.statistics.correlation` measures it."""
    twins: float = 0.0
    """Correlation of the difficulties of an OOD scenario and its ID twin: the higher, the more pairing saves. At 0,
    both sides are compared as if they were unpaired."""
    significance: float = 0.05
    """Probability of a false alarm in all comparisons together, shared equally among them (Bonferroni)."""
    comparisons: int = 1
    """Number of comparisons."""
    power: float = 0.8
    """Probability of finding an existing drop."""

    def __post_init__(self) -> None:
        at_least(self, seeds=2, rollouts=1, comparisons=1)
        for name in ("correlation", "twins"):
            if not 0 <= getattr(self, name) <= 1:
                raise BadConfig(f"{name} = {getattr(self, name):g}; it must lie in [0, 1]")
        for name in ("significance", "power"):
            if not 0 < getattr(self, name) < 1:
                raise BadConfig(f"{name} = {getattr(self, name):g}; it must lie in (0, 1)")

    @property
    def effective(self) -> float:
        """Number of independent rollouts with as much information as all rollouts of a split (Kish's design effect)."""
        return self.seeds * self.rollouts / (1 + (self.rollouts - 1) * self.correlation)

    @property
    def tail(self) -> float:
        """Probability of a false alarm on either side of one comparison."""
        return self.significance / self.comparisons / 2

    def chance(self, before: float, after: float) -> float:
        """Probability that a change from one success rate to another is found."""
        if self.seeds > MAX_SIMULATED:
            return self._in_the_limit(before, after)
        return _Experiments.of(self).chance(before, after)

    def smallest_drop(self, before: float) -> float | None:
        """Smallest drop from a success rate that is found with the requested power, to 0.2 points; None if not even a
        drop to 0 is found."""
        if before <= 0 or self.chance(before, 0.0) < self.power:
            return None
        low, high = 0.0, before
        while high - low > 0.002:
            middle = (low + high) / 2
            low, high = (low, middle) if self.chance(before, before - middle) >= self.power else (middle, high)
        return high

    def _in_the_limit(self, before: float, after: float) -> float:
        """Probability as `chance`, for many scenarios, where intervals are normal: two proportions with Kish's design
        effect."""
        a, b = before * (1 - before), after * (1 - after)
        together = 2 * self.twins * self.correlation * np.sqrt(a * b) / self.seeds
        error = float(np.sqrt(max((a + b) / self.effective - together, 1e-18)))
        return float(ndtr(abs(before - after) / error - stats.norm.isf(self.tail)))


class _Experiments:
    """The random numbers of many experiments, the same for every success rate, so that chances rise with the drop."""

    def __init__(self, analysis: PowerAnalysis):
        self.analysis = analysis
        orderings = max(ORDERINGS, round(MIN_IN_TAIL / analysis.tail))
        count = min(EXPERIMENTS, MAX_SCENARIOS // analysis.seeds)
        random = np.random.default_rng(0)
        self.normal = random.standard_normal((2, count, analysis.seeds))
        self.luck = random.random((2, count, analysis.seeds, analysis.rollouts))
        uniform = np.random.default_rng(analysis.seeds).random((orderings, analysis.seeds))
        self.ordered = np.sort(uniform, axis=1).T.astype(np.float32)
        self.known: dict[float, tuple[Shares, NDArray[np.float64]]] = {}
        """Results of the side before the drop, which a search needs repeatedly."""

    @staticmethod
    @lru_cache(maxsize=2)
    def of(analysis: PowerAnalysis) -> "_Experiments":
        return _Experiments(analysis)

    def chance(self, before: float, after: float) -> float:
        """Share of the experiments in which the interval of the difference excludes 0."""
        if before not in self.known:
            self.known = {before: self._side(before, 0, False)}
        (a, low), (b, high) = self.known[before], self._side(after, 1, True)
        apart = a.mean(axis=1) - b.mean(axis=1)
        together = _correlations(a, b) if self.analysis.twins else 0.0
        down = np.sqrt(np.maximum(0.0, low**2 + high**2 - 2 * together * low * high))
        return float((apart > down).mean())

    def _side(self, p: float, number: int, above: bool) -> tuple[Shares, NDArray[np.float64]]:
        """Shares of one side, and the distance of the bound from their mean.

        Args:
            p: success rate.
            number: 0 for the side before the drop, 1 for the other one.
            above: whether the upper bound is meant, not the lower one.
        """
        analysis = self.analysis
        scores = self.normal[0]
        if number:
            scores = analysis.twins * scores + np.sqrt(1 - analysis.twins**2) * self.normal[1]
        shares = (self.luck[number] < _chances(ndtr(scores), p, analysis.correlation)[..., None]).mean(axis=2)
        mean = shares.mean(axis=1)
        x = np.sort(shares if above else 1.0 - shares, axis=1)
        steps = np.diff(x, axis=1, append=1.0).astype(np.float32)
        means = 1.0 - steps @ self.ordered
        rank = int(np.ceil((1 - analysis.tail) * means.shape[1])) - 1
        bound = np.partition(means, rank, axis=1)[:, rank]
        return shares, np.maximum(0.0, bound - (mean if above else 1.0 - mean))


def _chances(ranks: NDArray[np.float64], p: float, correlation: float) -> NDArray[np.float64]:
    """Success probabilities of scenarios with the given ranks of easiness."""
    if correlation == 0.0 or p in (0.0, 1.0):
        return np.full_like(ranks, p)
    if correlation == 1.0:
        return (ranks > 1 - p).astype(float)
    size, grid = (1 - correlation) / correlation, np.linspace(0.0, 1.0, 2001)
    return np.interp(ranks, grid, stats.beta.ppf(grid, p * size, (1 - p) * size))


def _correlations(a: Shares, b: Shares) -> NDArray[np.float64]:
    """Correlation of twins in every experiment; 0 if all outcomes of one side are equal."""
    a, b = a - a.mean(axis=1, keepdims=True), b - b.mean(axis=1, keepdims=True)
    spread = np.sqrt((a**2).mean(axis=1) * (b**2).mean(axis=1))
    return np.divide((a * b).mean(axis=1), spread, out=np.zeros(len(a)), where=spread > 1e-12)


def seeds_for(analysis: PowerAnalysis, before: float, drop: float, most: int = 100_000) -> int | None:
    """Smallest number of scenarios per split for which a drop is found with the requested power.

    Args:
        most: largest number of scenarios that is tried.

    Returns:
        The number, or None if `most` scenarios are too few.
    """

    def enough(seeds: int) -> bool:
        return replace(analysis, seeds=seeds).chance(before, before - drop) >= analysis.power

    if not enough(most):
        return None
    low, high = 1, most
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return max(2, high)
