"""What selection does to a distribution: a certifier that lets only easy scenarios through must be seen."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import energy_distance, false_discovery_control, ks_2samp

from ..errors import BadConfig
from .distance import Energy, energy

SIGNIFICANCE = 0.05
BINS = 4
"""Cells per parameter: quarters of the proposals."""
FEW = 6
"""Parameters with at most so many different values have one cell for each."""
MOST = 1000
"""Proposals in the joint test at most; it needs a matrix of their distances. The first ones are taken."""

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Bin:
    """Part of the range of a parameter."""

    low: float
    high: float
    proposed: int
    accepted: int

    @property
    def rate(self) -> float:
        """Share that was accepted."""
        return self.accepted / self.proposed


@dataclass(frozen=True)
class Marginal:
    """What selection did to one parameter or feature."""

    name: str
    ks: float
    """Largest difference between the distribution functions of accepted and proposed values (Kolmogorov-Smirnov)."""
    energy: float
    """Energy distance between them, in ranges of the proposed values."""
    pvalue: float
    """Of accepted against rejected values, which share no draw; corrected for the number of marginals (Benjamini and
    Hochberg), and too large rather than too small for parameters with few values."""
    cells: tuple[Bin, ...]

    @property
    def effective(self) -> float:
        """Effective sample size (Kish): so many unbiased draws tell as much about this marginal as the accepted ones,
        reweighted to the proposed distribution. Cells without any accepted draw cannot be reweighted."""
        used = [c for c in self.cells if c.accepted]
        return sum(c.proposed for c in used) ** 2 / sum(c.proposed**2 / c.accepted for c in used)

    @property
    def lost(self) -> float:
        """Share of the proposals that lie in cells where nothing was accepted."""
        return sum(c.proposed for c in self.cells if not c.accepted) / sum(c.proposed for c in self.cells)


@dataclass(frozen=True)
class Bias:
    """What selection did to a distribution."""

    proposed: int
    accepted: int
    marginals: tuple[Marginal, ...]
    """Most telling first."""
    joint: Energy
    """All marginals at once, accepted against rejected."""

    @property
    def flagged(self) -> tuple[str, ...]:
        """Marginals that were changed, `(joint)` for all together; empty if chance explains everything."""
        names = [m.name for m in self.marginals if m.pvalue < SIGNIFICANCE]
        return (*names, *(["(joint)"] if self.joint.pvalue < SIGNIFICANCE else []))

    @property
    def effective(self) -> float:
        """Smallest effective sample size of any marginal."""
        return min((m.effective for m in self.marginals), default=float(self.accepted))


def bias(table: Mapping[str, Numbers], accepted: Flags, permutations: int = 999) -> Bias:
    """Compare what was accepted with what was proposed.

    Args:
        table: value of every proposal, by parameter or feature; constant ones are left out of the result.
        accepted: which proposals were.
        permutations: size of the joint test.

    Raises:
        BadConfig: nothing was accepted.
    """
    if not accepted.any():
        raise BadConfig("none of the proposals was accepted; there is nothing to compare")
    varied = {name: column for name, column in table.items() if np.ptp(column) > 0}
    raw = [_pvalue(column, accepted) for column in varied.values()]
    pvalues = false_discovery_control(raw) if raw else []
    marginals = [_marginal(n, c, accepted, float(p)) for (n, c), p in zip(varied.items(), pvalues, strict=True)]
    joint = Energy(0.0, 1.0)
    if varied and _can_tell(accepted):
        points = np.column_stack([column / np.ptp(column) for column in varied.values()])[:MOST]
        taken = accepted[:MOST]
        if _can_tell(taken):
            joint = energy(points[taken], points[~taken], permutations)
    order = sorted(marginals, key=lambda m: (m.pvalue, -m.ks))
    return Bias(len(accepted), int(accepted.sum()), tuple(order), joint)


@dataclass(frozen=True)
class AcceptanceMap:
    """Where in the plane of two parameters selection takes what. Empty cells have 0 proposals."""

    names: tuple[str, str]
    edges: tuple[Numbers, Numbers]
    proposed: NDArray[np.int64]
    """Shape (cells of the first, cells of the second)."""
    accepted: NDArray[np.int64]


def acceptance_map(names: tuple[str, str], table: Mapping[str, Numbers], accepted: Flags) -> AcceptanceMap:
    """Count proposed and accepted draws over two parameters."""
    columns = np.column_stack([table[name] for name in names])
    first, second = (_edges(column) for column in columns.T)
    proposed, _ = np.histogramdd(columns, (first, second))
    taken, _ = np.histogramdd(columns[accepted], (first, second))
    return AcceptanceMap(names, (first, second), proposed.astype(np.int64), taken.astype(np.int64))


def _pvalue(column: Numbers, accepted: Flags) -> float:
    return 1.0 if not _can_tell(accepted) else float(ks_2samp(column[accepted], column[~accepted]).pvalue)  # type: ignore[attr-defined]


def _can_tell(accepted: Flags) -> bool:
    """Whether there are two on either side at least: one draw has no distribution."""
    return bool(2 <= accepted.sum() <= len(accepted) - 2)


def _marginal(name: str, column: Numbers, accepted: Flags, pvalue: float) -> Marginal:
    taken, edges = column[accepted], _edges(column)
    proposed, chosen = np.histogram(column, edges)[0], np.histogram(taken, edges)[0]
    cells = (
        Bin(float(low), float(high), int(n), int(k))
        for low, high, n, k in zip(edges[:-1], edges[1:], proposed, chosen, strict=True)
        if n
    )
    span = np.ptp(column)
    ks = float(ks_2samp(taken, column).statistic)  # type: ignore[attr-defined]
    return Marginal(name, ks, float(energy_distance(taken / span, column / span)), pvalue, tuple(cells))


def _edges(column: Numbers) -> Numbers:
    """Between different values if there are few, else between quarters of the draws."""
    different = np.unique(column)
    if len(different) <= FEW:
        between = (different[:-1] + different[1:]) / 2
        return np.array([different[0], *between, different[-1]])
    return np.unique(np.quantile(column, np.linspace(0, 1, BINS + 1)))
