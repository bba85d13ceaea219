"""How many rollouts a comparison needs: repeated rollouts of one scenario are not independent."""

import math
from dataclasses import dataclass, replace
from statistics import NormalDist

from scipy.optimize import brentq

from ..errors import BadConfig, at_least

_NORMAL = NormalDist()


@dataclass(frozen=True)
class PowerAnalysis:
    """A comparison of two success rates, each over `seeds` scenarios with `rollouts` rollouts.

    Two-sided z test of two proportions (Fleiss, Levin and Paik 2003, ch. 4) with Kish's design effect: rollouts of one
    scenario share its difficulty, so that n of them count as n / (1 + (rollouts - 1) correlation).
    """

    seeds: int = 20
    """Scenarios (the paper's S)."""
    rollouts: int = 5
    """Rollouts of each (the paper's K)."""
    correlation: float = 0.5
    """Intra-cluster correlation of the outcomes of one scenario: 0 if only noise decides, 1 if the scenario does.
    `scengen.statistics.correlation` measures it."""
    twins: float = 0.0
    """Correlation between the difficulty of an OOD scenario and that of its ID twin: what pairing saves."""
    significance: float = 0.05
    """Share of false alarms, of one comparison or, shared by Bonferroni's rule, of all of them."""
    comparisons: int = 1
    power: float = 0.8
    """Probability of finding a drop that is there."""

    def __post_init__(self) -> None:
        at_least(self, seeds=2, rollouts=1, comparisons=1)
        for name in ("correlation", "twins"):
            if not 0 <= getattr(self, name) <= 1:
                raise BadConfig(f"{name} = {getattr(self, name):g}; it must lie in [0, 1]")
        for name in ("significance", "power"):
            if not 0 < getattr(self, name) < 1:
                raise BadConfig(f"{name} = {getattr(self, name):g}; it must lie between 0 and 1")

    @property
    def effective(self) -> float:
        """Independent rollouts that carry as much information as all those of one split."""
        return self.seeds * self.rollouts / (1 + (self.rollouts - 1) * self.correlation)

    def chance(self, before: float, after: float) -> float:
        """Probability that a change from one success rate to another is found significant."""
        middle = (before + after) / 2
        threshold = _NORMAL.inv_cdf(1 - self.significance / self.comparisons / 2)
        error, spread = self._error(middle, middle), self._error(before, after)
        if spread == 0:
            return float(abs(before - after) > threshold * error)
        return _NORMAL.cdf((abs(before - after) - threshold * error) / spread)

    def smallest_drop(self, before: float) -> float | None:
        """Smallest drop from a success rate that is found with the wanted power; None if not even a drop to 0 is."""

        def short(drop: float) -> float:
            return self.chance(before, before - drop) - self.power

        if before <= 0 or short(before) < 0:
            return None
        return float(brentq(short, 1e-9, before))  # type: ignore[arg-type]

    def _error(self, p: float, q: float) -> float:
        """Standard error of the difference of two success rates."""
        a, b = p * (1 - p), q * (1 - q)
        together = 2 * self.twins * self.correlation * math.sqrt(a * b) / self.seeds
        return math.sqrt(max(0.0, (a + b) / self.effective - together))


def seeds_for(analysis: PowerAnalysis, before: float, drop: float, most: int = 100_000) -> int | None:
    """Fewest scenarios per split for which a drop is found with the wanted power; None if `most` are too few."""

    def enough(seeds: int) -> bool:
        return replace(analysis, seeds=seeds).chance(before, before - drop) >= analysis.power

    if not enough(most):
        return None
    low, high = 1, most
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if enough(middle) else (middle, high)
    return max(2, high)
