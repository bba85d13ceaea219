"""Simulated searches: how often the interval holds the breaking point of a known curve, and how wide it is."""

from dataclasses import dataclass

import numpy as np

from .curves import LOOKS_AT_LEVEL, LOOKS_PER_ROUND, Bools, Curves, Estimates, Floats, Ints


@dataclass(frozen=True)
class Simulated:
    """Results of simulated searches, arrays of shape (searches,)."""

    low: Floats
    """Lower end of the interval [levels], see `curves.Estimates`."""
    high: Floats
    """Upper end of the interval [levels]."""
    returns: Bools
    """Whether the curve was reported as one that is not monotone."""
    looks: Ints
    """Number of rollouts."""

    def covers(self, points: Floats) -> float:
        """Share of the intervals that hold the breaking points: -1 is without a shift, levels + 1 is never."""
        return float(((self.low <= points) & (points <= self.high)).mean())


def simulate(
    chances: Floats, seed: int = 0, budget: int = 60, precision: float = 1.0, success: float = 0.5
) -> Simulated:
    """Search in worlds with known chances of success.

    Args:
        chances: chance at each level, shape (searches, levels + 1).
        seed: seed of the outcomes.
        budget, precision, success: as in `ThresholdSettings`.
    """
    rng, levels = np.random.default_rng(seed), chances.shape[1] - 1
    curves = Curves(levels, success)
    tried = np.full(chances.shape, LOOKS_AT_LEVEL)
    solved = rng.binomial(tried, chances)
    searching = np.arange(len(chances))
    while len(searching):
        found = curves.estimates(tried[searching], solved[searching])
        ends = tried[searching].sum(axis=1) + LOOKS_PER_ROUND > budget
        searching = searching[~(found.is_decided(precision, levels) | ends)]
        if len(searching):
            level = curves.next_level(tried[searching], solved[searching])
            tried[searching, level] += LOOKS_PER_ROUND
            solved[searching, level] += rng.binomial(LOOKS_PER_ROUND, chances[searching, level])
    return _simulated(curves.estimates(tried, solved), tried)


def _simulated(found: Estimates, tried: Ints) -> Simulated:
    return Simulated(found.low, found.high, found.returns, tried.sum(axis=1))
