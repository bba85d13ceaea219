"""Where along an axis the replayed ID witness and the oracle fall to 50 % success: a search in the axis' own direction.

A point on the path is a fraction: 0 is the edge of training, 1 the axis' far end, and beyond 1 the path goes on to the
bounds of the parameters, or to where it would come nearer to training again. Twin i is scenario i of training with the
axis' parameters put at that point.

The chance of success is taken to fall along the path as a logistic curve, 1 / (1 + exp((x - middle) / spread)); what
is known of middle and spread is kept as a posterior on a grid. Looking at the median of the middle is bisection that
bears noise; after some rounds of it the search looks where success is between 30 and 70 percent. Success may come back
farther out (a ball that slips on a rough ramp rolls on a rougher one): what lies beyond the first point at which all
fail is left out.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BadConfig, OutOfBounds
from ..log import Log
from ..params import Value, with_values
from ..samplers.axis import Axis
from ..samplers.dists import Choice, Fixed
from ..samplers.keyed import unit
from ..samplers.split import ID
from ..samplers.support import distance
from ..samplers.task import Task
from ..validate.identity import source_sha256
from .behaviour import try_both, twin_actions

REPLAY, ORACLE = "replay", "oracle"
BATCH = 4
"""Twins that are tried at one point before the search moves on; a round."""
FIRST = (math.inf, 0.0, 1.0)
"""Where the first rounds look: the end of the path, the edge of training, the far end of the axis."""
BISECTIONS = 4
"""Rounds at the most likely middle, for each of replay and oracle, before the band is sampled."""
BAND = 0.7
"""The band of interest: chances of success from 1 - BAND to BAND."""
FARTHEST, STEP = 10.0, 0.02
"""A path ends at the bounds of its parameters, found in these steps, and at the latest after ten times its length."""


HOLDS, FAILS, FAILS_AT_ONCE = "holds to the end of the path", "fails on the path", "fails at the edge of training"
"""What a boundary means."""


@dataclass(frozen=True)
class Boundary:
    """Where success falls to one half."""

    who: str
    """`replay`: actions that solved the ID twin; `oracle`: the task's own solution."""
    middle: float
    """The point on the path, as a fraction: posterior median."""
    low: float
    high: float
    """95 % credible interval."""
    end: float
    """How far the path goes."""
    values: Mapping[str, Value]
    """The axis' parameters at the middle; empty if it lies off the path or a parameter takes several values there."""
    trials: int

    @property
    def verdict(self) -> str:
        """What the boundary means: one of the three sentences above."""
        if self.middle >= self.end:
            return HOLDS
        return FAILS_AT_ONCE if self.middle <= 0 else FAILS


def search(
    task: Task,
    axis: str,
    folder: Path,
    seed: int = 0,
    rounds: int = 16,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Boundary]:
    """Find both boundaries of an axis, continuing what stands in `folder`.

    Args:
        rounds: how many points are looked at, with 4 twins each.
        progress: told how many trials are done, and how many there are to be.

    Raises:
        BadConfig: the axis has no path, only separate values.
    """
    path = AxisPath(task, task.axes[axis])
    source = source_sha256(task.family)
    identity = {"task": task.name, "axis": axis, "seed": seed, "path": path.spelled, "source": source}
    with Log(folder / "boundary.jsonl", identity) as log:
        for number in range(rounds):
            fraction = _next(number, log.records[: number * BATCH], path.end)
            for index in range(len(log.records), (number + 1) * BATCH):
                log.add(_try(path, seed, fraction, index))
                progress(index + 1, rounds * BATCH)
        trials = log.records[: rounds * BATCH]
    return {who: _boundary(who, trials, path) for who in (REPLAY, ORACLE)}


def why_no_path(task: Task, axis: Axis) -> str:
    """Why there is no line along which to look for a boundary; empty if there is one."""
    separate = [n for n in axis.replace if task.known[n].integer]
    if not separate:
        return ""
    return (
        f"axis {axis.name} of {task.name} moves {', '.join(separate)}, which takes separate values; a boundary search "
        "needs continuous parameters"
    )


class AxisPath:
    """The line that an axis moves its parameters along."""

    def __init__(self, task: Task, axis: Axis):
        self.task, self.axis = task, replace(axis, limits={})  # limits are what a search is to find
        if reason := why_no_path(task, axis):
            raise BadConfig(reason)
        self.end = self._end()

    @property
    def spelled(self) -> str:
        """What the path depends on, in words."""
        supports = {n: (self.task.training[n].support, d.support) for n, d in self.axis.replace.items()}
        return f"{supports}, to {self.end:g}"

    def values(self, fraction: float, seed: int, index: int) -> dict[str, Value]:
        """The axis' parameters of one twin at one point; a keyed one where there are several."""
        return {
            name: dist.quantile(unit(self.task.name, name, seed, index, 0)) for name, dist in self._at(fraction).items()
        }

    def single(self, fraction: float) -> dict[str, Value]:
        """The axis' parameters at one point, where each takes one value."""
        return {name: dist.value for name, dist in self._at(fraction).items() if isinstance(dist, Fixed)}

    def _at(self, fraction: float) -> Mapping[str, Fixed | Choice]:
        return self.axis.along(fraction, self.task.training, self.task.known)

    def _end(self) -> float:
        """The largest fraction whose values lie in the bounds of their parameters and still lead away from training."""
        end, gaps = 1.0, self._gaps(1.0)
        for fraction in map(float, np.arange(1.0 + STEP, FARTHEST + STEP / 2, STEP)):
            if not self._inside(fraction):
                break
            gaps, before = self._gaps(fraction), gaps
            if any(gaps[name] < before[name] for name in gaps):
                break
            end = fraction
        return end

    def _inside(self, fraction: float) -> bool:
        try:
            for name, dist in self._at(fraction).items():
                for interval in dist.support:
                    self.task.known[name].check(name, interval.low)
        except OutOfBounds:
            return False
        return True

    def _gaps(self, fraction: float) -> dict[str, float]:
        """How far each parameter is from training at a point."""
        return {
            name: distance(self.task.training[name].support, dist.support, self.task.known[name].period)
            for name, dist in self._at(fraction).items()
        }


def _try(path: AxisPath, seed: int, fraction: float, index: int) -> dict[str, Any]:
    """One twin at one point; None for a twin whose own oracle fails, and so says nothing about the axis."""
    task = path.task
    scenario = task.draw(ID, seed, index).scenario
    actions = twin_actions(task, seed, index)
    found: tuple[bool | None, bool | None] = (None, None)
    if actions is not None:
        twin = with_values(scenario, path.values(fraction, seed, index))
        found = (False, False) if twin.infeasible() else try_both(task, actions, twin)[:2]
    return {"index": index, "fraction": fraction, REPLAY: found[0], ORACLE: found[1]}


def _next(number: int, trials: list[dict[str, Any]], end: float) -> float:
    """Where to look in round `number`, given all earlier trials."""
    if number < len(FIRST):
        return min(end, FIRST[number])
    who = (REPLAY, ORACLE)[number % 2]
    middle, spread = _Posterior(trials, who, end).centre
    if number >= len(FIRST) + 2 * BISECTIONS:
        logit = math.log(BAND / (1 - BAND))
        middle += spread * logit * (2 * unit("band", number) - 1)
    return round(min(max(middle, 0.0), end), 6)


def _boundary(who: str, trials: list[dict[str, Any]], path: AxisPath) -> Boundary:
    low, middle, high = _Posterior(trials, who, path.end).quantiles
    values = path.single(middle) if 0 < middle < path.end else {}
    return Boundary(who, middle, low, high, path.end, values, sum(t[who] is not None for t in trials))


def _before_recovery(trials: list[dict[str, Any]], who: str) -> list[dict[str, Any]]:
    """The trials without those beyond a point where all fail, if success comes back there."""
    at: dict[float, list[bool]] = {}
    for trial in trials:
        at.setdefault(trial["fraction"], []).append(trial[who])
    lost = min((point for point, solved in at.items() if len(solved) > 2 and not any(solved)), default=math.inf)
    recovers = any(point > lost and sum(solved) > 0.7 * len(solved) for point, solved in at.items())
    return [t for t in trials if t["fraction"] <= lost] if recovers else trials


class _Posterior:
    """What trials say about middle and spread of the logistic curve; priors are flat, that of the spread in log."""

    def __init__(self, trials: list[dict[str, Any]], who: str, end: float):
        tried = _before_recovery([t for t in trials if t[who] is not None], who)
        points = np.array([t["fraction"] for t in tried])
        solved = np.array([t[who] for t in tried], bool)
        self.middles = np.linspace(-0.5 * end, 1.5 * end, 401)
        self.spreads = end * np.geomspace(0.005, 0.5, 25)
        z = (points - self.middles[:, None, None]) / self.spreads[None, :, None]
        chance = -np.logaddexp(0.0, np.where(solved, z, -z)).sum(axis=2)
        weight = np.exp(chance - chance.max())
        self.weight: NDArray[np.float64] = weight / weight.sum()

    @property
    def quantiles(self) -> tuple[float, float, float]:
        """The middle: 2.5 %, 50 % and 97.5 %."""
        total = self.weight.sum(axis=1).cumsum()
        low, middle, high = np.interp([0.025, 0.5, 0.975], total, self.middles)
        return float(low), float(middle), float(high)

    @property
    def centre(self) -> tuple[float, float]:
        """Median of the middle, mean of the spread."""
        return self.quantiles[1], float((self.weight.sum(axis=0) * self.spreads).sum())
