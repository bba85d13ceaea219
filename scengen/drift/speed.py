"""The costs of the control loop under several versions of MuJoCo: `scengen bench mujoco=[3.5.0,4.0.0]`.

Runs in each environment. The versions work in turn, a repetition each, so that what else the machine does slows all of
them.
"""

import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import mujoco
from rich.table import Table

from ..bench.speed import PROMISES, core
from ..bench.timing import Measure
from .environment import Environment, answer

MODULE = "scengen.drift.speed"
"""Name of this module, for `Environment.lines`."""


def measured(environments: Sequence[Environment], repeats: int) -> dict[str, dict[str, Measure]]:
    """The measures of `core` by version.

    Raises:
        ScengenError: they cannot be taken in an environment.
    """
    found: dict[str, list[dict[str, float]]] = {each.mujoco: [] for each in environments}
    for _ in range(repeats):
        for each in environments:
            found[each.mujoco] += [line["measures"] for line in each.lines(MODULE, {})]
    return {
        version: {name: Measure(tuple(one[name] for one in results)) for name in results[0]}
        for version, results in found.items()
    }


def table(found: Mapping[str, Mapping[str, Measure]]) -> Table:
    """The measures, a column for each version, with their limits."""
    rows = Table("measure", *found, "limit", "what", title="bench by version of MuJoCo", title_justify="left")
    for name in next(iter(found.values())):
        promise, cells = PROMISES[name], []
        for measures in found.values():
            kept = "" if promise.holds(measures[name].median) else " MISSED"
            cells.append(f"{measures[name].median:.2f} ± {measures[name].spread / 2:.2f}{kept}")
        rows.add_row(name, *cells, f"{promise.side} {promise.limit:g}", promise.what)
    return rows


def answers(request: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """One line: the version, and a repetition of each measure."""
    yield {"mujoco": mujoco.__version__, "measures": {name: one.median for name, one in core(1).items()}}


if __name__ == "__main__":
    sys.exit(answer(answers))
