"""Success rates and their differences, with cluster-robust intervals.

Everything is computed from one number per scenario, the share of its rollouts that succeed. Scenarios are independent
draws; rollouts of one scenario count as dependent, and no model of their dependence is assumed.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

CONFIDENCE = 0.95
"""Confidence level of the intervals."""
NORMAL_QUANTILE = NormalDist().inv_cdf(0.5 + CONFIDENCE / 2)
"""Half width of a 95 % interval in standard errors."""
ORDERINGS = 8192
"""Number of random orderings from which Gaffke's bound takes its quantile: the confidence is exact within +-0.2
points."""
CACHED_SCENARIOS = 500
"""Number of scenarios up to which those orderings are cached for the next call: 33 MB."""


@dataclass(frozen=True)
class Rate:
    """A success rate and its 95 % interval."""

    value: float
    """Success rate."""
    low: float
    """Lower end of the interval."""
    high: float
    """Upper end of the interval."""
    scenarios: int
    """Number of scenarios."""
    rollouts: int
    """Number of rollouts."""


@dataclass(frozen=True)
class Difference:
    """A difference between two success rates and its 95 % interval."""

    value: float
    """Difference of the rates."""
    low: float
    """Lower end of the interval."""
    high: float
    """Upper end of the interval."""
    twins: int = 0
    """Number of pairs of twins; 0 if the two sides are unpaired."""

    @property
    def is_significant(self) -> bool:
        """Whether the interval excludes 0."""
        return self.low > 0 or self.high < 0


def rate(successes: Sequence[Sequence[bool]], confidence: float = CONFIDENCE) -> Rate:
    """The success rate of several scenarios with one or more rollouts each: the mean over scenarios of their shares.

    Args:
        successes: outcomes of the rollouts of every scenario.
        confidence: confidence of the interval, see `mean_interval`.
    """
    shares = np.array([np.mean(s) for s in successes])
    low, high = mean_interval(shares, confidence)
    return Rate(float(shares.mean()), low, high, len(successes), sum(map(len, successes)))


def mean_interval(values: ArrayLike, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Interval for the mean of independent numbers in [0, 1], of any distribution, by Gaffke's bound on either side.

    The upper bound is the quantile, over ordered uniform numbers u, of 1 - sum_i u_i (x_(i+1) - x_i), with the values
    in order and x_(n+1) = 1 (Gaffke 2005; Learned-Miller and Thomas 2019, arXiv:1905.06208). For single rollouts it is
    Clopper and Pearson's. A value that grows never makes a bound smaller: a better policy never gets a worse bound.

    Raises:
        ValueError: there is no value, or one is outside [0, 1].
    """
    x = np.sort(np.asarray(values, float))
    if not len(x) or not (x[0] >= 0.0 and x[-1] <= 1.0):
        raise ValueError("an interval needs numbers in [0, 1]")
    tail = (1 + confidence) / 2
    return 1.0 - _upper_bound(np.sort(1.0 - x), tail), _upper_bound(x, tail)


def _upper_bound(ordered: NDArray[np.float64], tail: float) -> float:
    """Upper bound of the mean of ordered values in [0, 1]."""
    steps = np.diff(np.append(ordered, 1.0))
    means = np.concatenate([1.0 - block @ steps for block in _uniforms(len(ordered))])
    return float(np.clip(np.quantile(means, tail), ordered.mean(), 1.0))


def _uniforms(n: int) -> Iterator[NDArray[np.float64]]:
    """`ORDERINGS` rows of n ordered uniform numbers, the same in every call, in blocks of some MB."""
    if n <= CACHED_SCENARIOS:
        yield _cached_uniforms(n)
        return
    random, rows = np.random.default_rng(n), max(1, 4_000_000 // n)
    for start in range(0, ORDERINGS, rows):
        yield np.sort(random.random((min(rows, ORDERINGS - start), n)), axis=1)


@lru_cache(maxsize=16)
def _cached_uniforms(n: int) -> NDArray[np.float64]:
    """The rows of `_uniforms` in one cached block."""
    return np.sort(np.random.default_rng(n).random((ORDERINGS, n)), axis=1)


def difference(a: Rate, b: Rate) -> Difference:
    """`a` minus `b`, for two independent sets of scenarios: Newcombe's hybrid of their intervals."""
    return Difference(*_contrast_interval([a, b], (1, -1), np.eye(2)))


def smallest_visible_drop(before: float, scenarios: int) -> float | None:
    """Smallest observed drop whose 95 % interval excludes 0, if all rollouts of a scenario end alike and twins are
    unrelated; None if not even a drop to 0 does.

    Args:
        before: success rate before the drop.
    """
    solved = round(before * scenarios)
    before_drop = rate([[k < solved] for k in range(scenarios)])

    def is_seen(drop: int) -> bool:
        return difference(rate([[k < solved - drop] for k in range(scenarios)]), before_drop).high < 0

    if not solved or not is_seen(solved):
        return None
    low, high = 0, solved
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if is_seen(middle) else (middle, high)
    return high / scenarios


def scenarios_for_drop(before: float, most: int = CACHED_SCENARIOS) -> int | None:
    """Smallest number of scenarios that can show a drop to 0; None if `most` are too few.

    Args:
        before: success rate before the drop.
        most: largest number of scenarios that is tried.
    """
    return next((n for n in range(2, most + 1) if smallest_visible_drop(before, n)), None)


def paired(a: Sequence[Sequence[bool]], b: Sequence[Sequence[bool]], confidence: float = CONFIDENCE) -> Difference:
    """`a` minus `b` over twins: scenario i of both sides is the same except for the parameters that the axis moves."""
    return contrast([a, b], (1, -1), confidence)


def contrast(
    sides: Sequence[Sequence[Sequence[bool]]], signs: Sequence[int], confidence: float = CONFIDENCE
) -> Difference:
    """A sum of success rates with signs, over twins: scenario i is the same one on all sides but for what is examined.

    The hybrid of their intervals with the correlations of their shares (Zou and Donner 2008). If a side always ends
    alike, its correlations cannot be estimated and are taken as 0, as for unpaired scenarios.

    Args:
        sides: outcomes of the rollouts of every scenario, on each side.
        signs: 1 or -1 for each side.
    """
    if len({len(side) for side in sides}) > 1:
        counts = " and ".join(str(len(side)) for side in sides)
        raise ValueError(f"{counts} scenarios; twins need the same number on all sides")
    shares = np.array([[np.mean(outcomes) for outcomes in side] for side in sides])
    return Difference(*_contrast_interval([rate(s, confidence) for s in sides], signs, _related(shares)), len(sides[0]))


def _related(shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Correlations of the shares of several sides; 0 for a side whose shares are all equal."""
    centred = shares - shares.mean(axis=1, keepdims=True)
    spread = np.sqrt((centred**2).mean(axis=1))
    scaled = np.divide(centred, spread[:, None], out=np.zeros_like(centred), where=spread[:, None] > 0)
    found = scaled @ scaled.T / shares.shape[1]
    np.fill_diagonal(found, 1.0)
    return found


def _contrast_interval(
    rates: Sequence[Rate], signs: Sequence[int], related: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Value and interval of a sum of rates with signs by the method of variance estimates recovery."""
    sign, values = np.array(signs, float), np.array([each.value for each in rates])
    below = values - np.array([each.low for each in rates])
    above = np.array([each.high for each in rates]) - values
    value, least, most = float(sign @ values), -float((sign < 0).sum()), float((sign > 0).sum())
    down, up = np.where(sign > 0, below, -above), np.where(sign > 0, above, -below)
    return value, max(least, value - _length(down, related)), min(most, value + _length(up, related))


def _length(parts: NDArray[np.float64], related: NDArray[np.float64]) -> float:
    """Length of the sum of correlated half widths."""
    return float(np.sqrt(max(0.0, parts @ related @ parts)))


def mean_rate(rates: Sequence[Rate]) -> Rate:
    """The mean of independent success rates with equal weights."""
    value, low, high = _mean(rates)
    return Rate(value, max(0.0, low), min(1.0, high), sum(r.scenarios for r in rates), sum(r.rollouts for r in rates))


def mean_difference(differences: Sequence[Difference]) -> Difference:
    """The mean of independent differences with equal weights."""
    value, low, high = _mean(differences)
    return Difference(value, max(-1.0, low), min(1.0, high), sum(d.twins for d in differences))


def _mean(parts: Sequence[Rate] | Sequence[Difference]) -> tuple[float, float, float]:
    """Value and interval of the mean of independent estimates with equal weights."""
    value = float(np.mean([p.value for p in parts]))
    down = np.sqrt(sum((p.value - p.low) ** 2 for p in parts)) / len(parts)
    up = np.sqrt(sum((p.high - p.value) ** 2 for p in parts)) / len(parts)
    return value, float(value - down), float(value + up)


def correlation(successes: Sequence[Sequence[bool]]) -> float:
    """Intra-cluster correlation of binary outcomes, by one-way analysis of variance, within [0, 1].

    The power analysis needs it; no interval depends on it. It is 1 where it cannot be estimated: with one scenario,
    with one rollout each, or when all end alike.
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
    """Wilson's 95 % score interval of a proportion observed in `n` independent trials."""
    z = NORMAL_QUANTILE
    centre = (value + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * np.sqrt(value * (1 - value) / n + z**2 / (4 * n**2))
    return float(max(0.0, centre - half)), float(min(1.0, centre + half))
