"""Tables of selection bias, near duplicates, statistical power and shrunk scenarios, for the console."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from rich.table import Table

from ...evaluate.power import PowerAnalysis
from .bias import AcceptanceMap, Bias
from .distance import NearDuplicate
from .shrink import Shrunk

SHOWN_PAIRS = 20
"""Number of near duplicates that are listed."""
CORRELATIONS = (0.0, 0.2, 0.5, 1.0)
"""Intra-cluster correlations in the table of a power analysis, in addition to the requested one."""
ID_RATES = (0.9, 0.7, 0.5, 0.3)
"""ID success rates in the table of a power analysis."""


def bias_table(found: Bias, title: str) -> Table:
    """The change of each distribution by selection, one line per parameter or feature."""
    table = Table("parameter", "KS", "energy", "p", "accepted by part of the range", "effective n", title=title)
    table.title_justify = "left"
    for m in found.marginals:
        style = "red" if m.name in found.flagged else None
        rates = "  ".join(f"{c.rate:.0%}" for c in m.cells)
        lost = f", {m.lost:.0%} of the range lost" if m.lost else ""
        numbers = (f"{m.ks:.2f}", f"{m.energy:.2f}", _chance(m.pvalue), rates, f"{m.effective:.1f}{lost}")
        table.add_row(m.name, *numbers, style=style)
    style = "red" if "(joint)" in found.flagged else None
    table.add_section()
    joint = (f"{found.joint.distance:.2f}", _chance(found.joint.pvalue))
    table.add_row("all together", "", *joint, "", "", style=style)
    return table


def map_table(found: AcceptanceMap) -> Table:
    """Accepted of proposed draws by two parameters: the first one down, the second one across."""
    down, across = found.names
    table = Table(down, *(_range(found.edges[1], j) for j in range(found.proposed.shape[1])))
    table.title, table.title_justify = f"accepted of proposed: {down} (down) by {across} (across)", "left"
    for i, (all_, taken) in enumerate(zip(found.proposed, found.accepted, strict=True)):
        cells = (f"{k} of {n}" if n else "-" for n, k in zip(all_, taken, strict=True))
        table.add_row(_range(found.edges[0], i), *cells)
    return table


def pairs_table(pairs: list[NearDuplicate], one: str, other: str, names: Mapping[str, str]) -> Table:
    """Scenarios that are nearly the same.

    Args:
        one, other: titles of the two columns.
        names: names of the listed scenarios, by id.
    """
    table = Table(one, other, "distance [training widths]", title="near duplicates", title_justify="left")
    for pair in pairs[:SHOWN_PAIRS]:
        table.add_row(names[pair.one], names[pair.other], f"{pair.distance:.2g}")
    if len(pairs) > SHOWN_PAIRS:
        table.add_row(f"and {len(pairs) - SHOWN_PAIRS} more", "", "")
    return table


def power_table(analysis: PowerAnalysis, progress: Callable[[int, int], None]) -> Table:
    """The smallest drop that is found with the given power, by ID success rate and intra-cluster correlation."""
    size = f"{analysis.seeds} seeds x {analysis.rollouts} rollouts a split"
    title = f"smallest drop found with probability {analysis.power:g}: {size}"
    correlations = sorted({*CORRELATIONS, analysis.correlation})
    table = Table("ID success", *(f"correlation {c:g}" for c in correlations), title=title, title_justify="left")
    for done, before in enumerate(ID_RATES):
        progress(done, len(ID_RATES))
        drops = [replace(analysis, correlation=c).smallest_drop(before) for c in correlations]
        table.add_row(f"{before:g}", *("none" if d is None else f"{d:.2f}" for d in drops))
    return table


def shrunk_table(shrunk: Shrunk, units: dict[str, str]) -> Table:
    """The parameters that a failure needs."""
    table = Table(
        "parameter", "centre", "fails at", "was", "training widths", title="what matters", title_justify="left"
    )
    for c in shrunk.causes:
        unit = units[c.parameter]
        table.add_row(c.parameter, f"{c.centre:.4g}", f"{c.value:.4g} {unit}", f"{c.started:.4g}", f"{c.departure:.2f}")
    return table


def _chance(pvalue: float) -> str:
    return f"{pvalue:.3f}" if pvalue >= 0.001 else "< 0.001"


def _range(edges: np.ndarray, i: int) -> str:
    return f"{edges[i]:.3g} to {edges[i + 1]:.3g}"
