"""The level at which a chance of success falls to a given value, estimated from single looks at whole levels.

Level 0 is without a shift, 1 to n are the levels of an axis or a perturbation. The breaking point is a number of
levels: 2.4 lies between levels 2 and 3. A look is one rollout at a level, each of another scenario.

A chance is taken to fall along a logistic curve between two plateaus, one above the value and one below it. The
likelihood of a breaking point is its mean over slopes and plateaus of a grid. Two more candidates never cross the
value: lines that stay above it, and lines that stay below it. The interval holds all candidates whose likelihood is
near enough to the largest one. `MARGIN` is larger than for independent looks, because earlier looks decide on later
ones and on the end of the search; the fewer the looks, the larger it is. tests/evaluate/test_threshold_search.py
simulates how often intervals hold the breaking point, for curves of other shapes, too.

A chance that rises again belongs to no such curve. All pairs of levels are compared by the likelihood ratio of two
chances against one. While a higher level looks better than a lower one, the next looks go to this pair. If the ratio
stays large, the interval is that of the first fall: levels from the rise on do not count.

All functions take many searches at once: arrays of shape (searches, levels + 1).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, logit, xlogy

LOOKS_AT_LEVEL = 3
"""Number of first looks at each level: three failures between successes are seen as a fall and a rise."""
LOOKS_PER_ROUND = 2
"""Number of further looks that are chosen together."""
MARGIN = 4.2
"""Twice the largest logarithm of a likelihood ratio within an interval, after `FULL_SEARCH` looks."""
FULL_SEARCH = 60
"""Number of looks from which on the margin stays the same. With half as many it is twice as large."""
SUSPECTED_RISE = 1.5
"""Twice the logarithm of the likelihood ratio of a rise that is looked at again: that of 2 of 3 after 3 of 3 solved."""
RISE = 9.0
"""The same for a rise that is reported. Of two chances that are equal, it is as large in 1 of 700 cases."""
STEP = 0.05
"""Distance between candidates [levels]."""
SCALES = (0.003, 0.2, 0.5, 0.9, 1.4, 2.2)
"""Scales of the logistic curves [levels]: from a step to a fall over the whole axis."""
PLATEAUS = (0.2, 0.4, 0.6, 0.76, 0.9, 0.998)
"""Distances of the plateaus from the value, as shares of its distances from 0 and 1."""
LINES = 10
"""Number of heights of the lines that never cross the value."""
MIN_CHANCE = 1e-3
"""Smallest chance of an outcome: no single look refutes a curve."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Estimates:
    """What some searches show, arrays of shape (searches,)."""

    low: Floats
    """Lower end of the interval [levels]; -1 if the chance may be below the value without a shift."""
    middle: Floats
    """Most likely breaking point [levels]: half of the likelihood lies on either side."""
    high: Floats
    """Upper end of the interval [levels]; the number of levels + 1 if the chance may never fall to the value."""
    fallen: Ints
    """Lower level of the pair with the clearest rise."""
    risen: Ints
    """Higher level of this pair."""
    rise: Floats
    """Twice the logarithm of the likelihood ratio of the rise; 0 without one."""

    @property
    def returns(self) -> Bools:
        """Whether the chance rises again."""
        return self.rise > RISE

    def is_decided(self, width: float, levels: int) -> Bools:
        """Whether the interval is narrow, lies on one side of no shift and of the last level, and no rise is suspected.

        Args:
            width: largest width [levels].
            levels: number of levels.
        """
        narrow = self.high - self.low <= width + STEP / 2
        for end in (0, levels):
            narrow &= (self.low >= end) | (self.high <= end)
        return narrow & (self.returns | (self.rise < SUSPECTED_RISE))


@dataclass(frozen=True)
class Curves:
    """The curves of all candidates."""

    levels: int
    """Number of levels."""
    value: float = 0.5
    """Chance of success at the breaking point."""

    def estimates(self, tried: Ints, solved: Ints) -> Estimates:
        """What looks show of the breaking point.

        Args:
            tried: number of looks at each level.
            solved: number of successes among them.
        """
        fallen, risen, rise = _clearest_rise(tried, solved)
        counts = self._counting(risen, rise)
        likelihood = self._likelihood(tried * counts, solved * counts)
        ratio = 2 * np.log(np.maximum(likelihood, 1e-300) / likelihood.max(axis=1, keepdims=True))
        share = np.clip(tried.sum(axis=1, keepdims=True) / FULL_SEARCH, 1 / FULL_SEARCH, 1.0)
        held = ratio >= -MARGIN / share
        first, last = held.argmax(axis=1), held.shape[1] - 1 - held[:, ::-1].argmax(axis=1)
        within = np.cumsum(likelihood * held, axis=1)
        middle = (within >= within[:, -1:] / 2).argmax(axis=1)
        low, high = self._ends
        return Estimates(low[first], (low + high)[middle] / 2, high[last], fallen, risen, rise)

    def next_level(self, tried: Ints, solved: Ints, possible: Bools | None = None) -> Ints:
        """The level of the next looks of each search: of a pair with a suspected rise the one with fewer looks,
        otherwise the one that is expected to reveal most about the breaking point (mutual information).

        Args:
            possible: whether further looks at each level are possible; all are by default.
        """
        fallen, risen, rise = _clearest_rise(tried, solved)
        counts = self._counting(risen, rise)
        weights = self._weights(tried * counts, solved * counts)
        of_candidate = np.add.reduceat(weights, self._starts, axis=1)
        told = np.empty(tried.shape)
        for level in range(self.levels + 1):
            chances = np.add.reduceat(weights * self._chances[:, level], self._starts, axis=1)
            given = np.divide(chances, of_candidate, out=np.zeros_like(chances), where=of_candidate > 0)
            told[:, level] = _entropy(chances.sum(axis=1)) - (of_candidate * _entropy(given)).sum(axis=1)
        open_levels = np.ones_like(counts) if possible is None else possible
        best = np.where(counts & open_levels, told, -1.0).argmax(axis=1)
        here = np.arange(len(tried))
        of_pair = np.where(tried[here, fallen] <= tried[here, risen], fallen, risen)
        suspected = (rise >= SUSPECTED_RISE) & (rise <= RISE) & open_levels[here, of_pair]
        return np.where(suspected, of_pair, best)

    def _counting(self, risen: Ints, rise: Floats) -> Bools:
        """Whether each level counts: all levels, or those before a rise."""
        return (rise <= RISE)[:, None] | (np.arange(self.levels + 1) < risen[:, None])

    def _likelihood(self, tried: Ints, solved: Ints) -> Floats:
        """Likelihood of each candidate, up to a factor, shape (searches, candidates)."""
        sizes = np.diff(np.append(self._starts, len(self._chances)))
        return np.add.reduceat(self._weights(tried, solved), self._starts, axis=1) / sizes

    def _weights(self, tried: Ints, solved: Ints) -> Floats:
        """Likelihood of each curve as a share of that of all, shape (searches, curves)."""
        success, failure = self._logarithms
        found = solved @ success + (tried - solved) @ failure
        found = np.exp(found - found.max(axis=1, keepdims=True))
        return found / found.sum(axis=1, keepdims=True)

    @cached_property
    def _logarithms(self) -> tuple[Floats, Floats]:
        """Logarithms of the chances of a success and of a failure, shape (levels + 1, curves) each."""
        chances = np.ascontiguousarray(self._chances.T)
        return np.log(chances), np.log(1 - chances)

    @cached_property
    def _candidates(self) -> Floats:
        """Breaking points of the curves, in the middle of their intervals [levels]."""
        return np.arange(-1 + STEP / 2, self.levels + 1, STEP)

    @property
    def _ends(self) -> tuple[Floats, Floats]:
        """Lower and upper ends of all candidates: lines below the value, curves, lines above it."""
        points, last = self._candidates, self.levels + 1
        low, high = np.round([points - STEP / 2, points + STEP / 2], 6)
        return np.r_[-1, low, last], np.r_[-1, high, last]

    @property
    def _starts(self) -> Ints:
        """Number of the first curve of each candidate."""
        lines, curves = LINES * (LINES + 1) // 2, len(SCALES) * len(PLATEAUS) ** 2
        return np.r_[0, lines + curves * np.arange(len(self._candidates) + 1)]

    @cached_property
    def _chances(self) -> Floats:
        """Chances of success along each curve, shape (curves, levels + 1)."""
        levels, plateaus = np.arange(self.levels + 1), np.array(PLATEAUS)
        above, below = self.value + (1 - self.value) * plateaus, self.value * (1 - plateaus)
        point, scale, top, floor = (
            part.reshape(-1, 1) for part in np.meshgrid(self._candidates, SCALES, above, below, indexing="ij")
        )
        centre = point + scale * logit((self.value - floor) / (top - floor))
        curves = floor + (top - floor) * expit((centre - levels) / scale)
        heights = (np.arange(LINES) + 0.5) / LINES
        lines = [start + (end - start) * levels / self.levels for start in heights for end in heights[heights <= start]]
        under, over = self.value * np.array(lines), self.value + (1 - self.value) * np.array(lines)
        return np.clip(np.concatenate([under, curves, over]), MIN_CHANCE, 1 - MIN_CHANCE)


def _clearest_rise(tried: Ints, solved: Ints) -> tuple[Ints, Ints, Floats]:
    """Levels of the clearest rise from a lower to a higher level, and its strength, see `Estimates`."""
    pairs = [(low, high) for high in range(tried.shape[1]) for low in range(high)]
    low, high = np.array(pairs).T
    rises = solved[:, high] * tried[:, low] > solved[:, low] * tried[:, high]
    together = _log_likelihood(tried[:, low] + tried[:, high], solved[:, low] + solved[:, high])
    apart = _log_likelihood(tried, solved)
    ratio = np.where(rises, 2 * (apart[:, low] + apart[:, high] - together), 0.0)
    best = ratio.argmax(axis=1)
    return low[best], high[best], ratio[np.arange(len(tried)), best]


def _log_likelihood(tried: Ints, solved: Ints) -> Floats:
    """Largest logarithm of the likelihood of looks at one chance."""
    chance = solved / np.maximum(tried, 1)
    return xlogy(solved, chance) + xlogy(tried - solved, 1 - chance)


def _entropy(chance: Floats) -> Floats:
    """Entropy of an outcome [nat]."""
    chance = np.clip(chance, 0.0, 1.0)
    return -xlogy(chance, chance) - xlogy(1 - chance, 1 - chance)
