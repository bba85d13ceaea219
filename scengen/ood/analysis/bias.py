"""Selection bias: the change of a distribution by certification. If only easy scenarios are certified, it shows."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import energy_distance, false_discovery_control, ks_2samp

from ...errors import BadConfig
from .distance import Energy, energy

SIGNIFICANCE = 0.05
"""P value below which a marginal is flagged."""
BINS = 4
"""Number of bins per parameter: quarters of the proposals."""
MAX_SINGLE_VALUES = 6
"""Maximum number of different values of a parameter for which each value has a separate bin."""
MAX_JOINT = 1000
"""Maximum number of proposals in the joint test, which needs a matrix of their distances. The first ones are taken."""

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Bin:
    """Part of the range of a parameter."""

    low: float
    high: float
    proposed: int
    """Number of proposals in the bin."""
    accepted: int
    """Number of accepted draws in the bin."""

    @property
    def rate(self) -> float:
        """Acceptance rate in the bin."""
        return self.accepted / self.proposed


@dataclass(frozen=True)
class Marginal:
    """Change of the distribution of one parameter or feature by selection."""

    name: str
    ks: float
    """Largest difference between the distribution functions of accepted and proposed values (Kolmogorov-Smirnov)."""
    energy: float
    """Energy distance between accepted and proposed values [ranges of the proposed values]."""
    pvalue: float
    """P value of accepted against rejected values, which share no draw. It is corrected for the number of marginals
    (Benjamini and Hochberg), and conservative for parameters with few values."""
    cells: tuple[Bin, ...]
    """Bins of the range, in order."""

    @property
    def effective(self) -> float:
        """Effective sample size (Kish): the number of unbiased draws that carry as much information on this marginal as
        the accepted ones, reweighted to the proposed distribution. Bins without an accepted draw are left out."""
        used = [c for c in self.cells if c.accepted]
        return sum(c.proposed for c in used) ** 2 / sum(c.proposed**2 / c.accepted for c in used)

    @property
    def lost(self) -> float:
        """Share of the proposals that lie in bins without an accepted draw."""
        return sum(c.proposed for c in self.cells if not c.accepted) / sum(c.proposed for c in self.cells)


@dataclass(frozen=True)
class Bias:
    """Change of a distribution by selection."""

    proposed: int
    """Number of proposals."""
    accepted: int
    """Number of accepted draws."""
    marginals: tuple[Marginal, ...]
    """Marginals, the most significant change first."""
    joint: Energy
    """Energy distance of accepted and rejected draws in all marginals at once."""

    @property
    def flagged(self) -> tuple[str, ...]:
        """Marginals with a significant change, `(joint)` for all together; empty if chance explains everything."""
        names = [m.name for m in self.marginals if m.pvalue < SIGNIFICANCE]
        return (*names, *(["(joint)"] if self.joint.pvalue < SIGNIFICANCE else []))

    @property
    def effective(self) -> float:
        """Smallest effective sample size of any marginal."""
        return min((m.effective for m in self.marginals), default=float(self.accepted))


def bias(table: Mapping[str, Numbers], accepted: Flags, permutations: int = 999) -> Bias:
    """Compare the accepted draws with all proposals.

    Args:
        table: values of the proposals, by parameter or feature. Constant ones are left out of the result.
        accepted: whether each proposal was accepted.
        permutations: number of permutations in the joint test.

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
    if varied and _comparable(accepted):
        points = np.column_stack([column / np.ptp(column) for column in varied.values()])[:MAX_JOINT]
        taken = accepted[:MAX_JOINT]
        if _comparable(taken):
            joint = energy(points[taken], points[~taken], permutations)
    order = sorted(marginals, key=lambda m: (m.pvalue, -m.ks))
    return Bias(len(accepted), int(accepted.sum()), tuple(order), joint)


@dataclass(frozen=True)
class AcceptanceMap:
    """Numbers of proposed and accepted draws in the plane of two parameters. Empty bins have 0 proposals."""

    names: tuple[str, str]
    """Names of the two parameters."""
    edges: tuple[Numbers, Numbers]
    """Edges of the bins of each parameter."""
    proposed: NDArray[np.int64]
    """Numbers of proposals, shape (bins of the first parameter, bins of the second)."""
    accepted: NDArray[np.int64]
    """Numbers of accepted draws, of the same shape."""


def acceptance_map(names: tuple[str, str], table: Mapping[str, Numbers], accepted: Flags) -> AcceptanceMap:
    """Count proposed and accepted draws in bins of two parameters."""
    columns = np.column_stack([table[name] for name in names])
    first, second = (_edges(column) for column in columns.T)
    proposed, _ = np.histogramdd(columns, (first, second))
    taken, _ = np.histogramdd(columns[accepted], (first, second))
    return AcceptanceMap(names, (first, second), proposed.astype(np.int64), taken.astype(np.int64))


def _pvalue(column: Numbers, accepted: Flags) -> float:
    return 1.0 if not _comparable(accepted) else float(ks_2samp(column[accepted], column[~accepted]).pvalue)  # type: ignore[attr-defined]


def _comparable(accepted: Flags) -> bool:
    """Whether at least two draws were accepted and two rejected: one draw has no distribution."""
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
    """Edges of the bins: between the different values if there are few, else between quarters of the draws."""
    different = np.unique(column)
    if len(different) <= MAX_SINGLE_VALUES:
        between = (different[:-1] + different[1:]) / 2
        return np.array([different[0], *between, different[-1]])
    return np.unique(np.quantile(column, np.linspace(0, 1, BINS + 1)))
