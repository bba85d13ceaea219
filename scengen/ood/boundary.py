"""The points of an axis at which the replayed ID witness and the oracle fall to 50 % success.

A point on the path of an axis is a fraction: 0 is the edge of training, 1 the axis' far end. Beyond 1 the path goes on
to the bounds of the parameters, or to where it would come nearer to training again. Twin i is scenario i of training
with the axis' parameters put at that point. Every trial has its own twin.

The boundary is the first point at which half of the twins or fewer are solved. The first looks are fixed: at both ends
and at places along the whole path, so that a hole of a tenth of the axis is seen. The other looks go to where the
boundary is likely, in turn for replay and oracle. `threshold` evaluates the trials; it assumes no curve.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BadConfig, OutOfBounds
from ..params import Value, with_values
from ..samplers.axis import Axis
from ..samplers.dists import Choice, Fixed
from ..samplers.keyed import unit
from ..samplers.split import ID
from ..samplers.support import distance
from ..samplers.task import Task
from ..validate.identity import source_sha256
from ..work.log import FRESH, Log
from . import threshold
from .behaviour import try_both, twin_actions
from .threshold import Bools, Floats, Ints

REPLAY = "replay"
"""Boundary of the actions that solved the ID twin."""
ORACLE = "oracle"
"""Boundary of the task's own solution."""
TRIALS_PER_ROUND = 4
"""Number of trials in a round. A trial costs three rollouts: replay, oracle, and the one that gives the witness."""
MIN_WIDTH = 2
"""Width below which an interval is not narrowed further [gaps between points, 0.01 each up to 1]."""
LONGEST_PATH = 10.0
"""Maximum length of a path [lengths of the axis]. It ends earlier at the bounds of its parameters."""
PATH_STEP = 0.02
"""Step in which the end of a path is searched [lengths of the axis]."""

HOLDS = "holds to the end of the path"
"""Verdict: success lasts to the end of the path."""
OPEN = "may hold to the end of the path"
"""Verdict: success may last to the end of the path."""
FAILS = "fails on the path"
"""Verdict: success ends on the path."""
FAILS_AT_ONCE = "fails at the edge of training"
"""Verdict: success ends at the edge of training."""


@dataclass(frozen=True)
class Looks:
    """Outcomes of the looks at one end of the path, which were fixed beforehand."""

    solved: int
    """Number of looks that were solved."""
    tried: int
    """Number of looks."""

    @property
    def least(self) -> float:
        """Lower bound of the success rate: exact, one-sided, 95 % confidence."""
        return threshold.at_least(self.solved, self.tried)

    @property
    def most(self) -> float:
        """Upper bound of the success rate: exact, one-sided, 95 % confidence."""
        return 1 - threshold.at_least(self.tried - self.solved, self.tried)

    def __str__(self) -> str:
        return f"{self.solved} of {self.tried} solved there"


@dataclass(frozen=True)
class Boundary:
    """The first point of the path at which half of the twins or fewer are solved."""

    who: str
    """Kind of solution: `REPLAY` or `ORACLE`."""
    middle: float
    """Most likely place of the boundary, as a fraction of the path: a guess, within the interval."""
    low: float
    """Lower end of the 95 % interval, see `threshold.interval`."""
    high: float | None
    """Upper end of the 95 % interval; None if success may last to the end of the path."""
    end: float
    """End of the path."""
    again: tuple[float, float] | None
    """Stretch beyond the boundary on which success has returned; None if none was found."""
    at_edge: Looks
    """Looks at the edge of training."""
    at_end: Looks
    """Looks at the end of the path."""
    values: Mapping[str, Value]
    """Values of the axis' parameters at `middle`; empty if it lies off the path or a parameter has several values."""
    trials: int
    """Number of trials with an outcome."""

    @property
    def verdict(self) -> str:
        """Verdict: `HOLDS`, `OPEN`, `FAILS` or `FAILS_AT_ONCE`."""
        if self.high is None:
            return HOLDS if self.low >= self.end else OPEN
        return FAILS if self.high > 0 else FAILS_AT_ONCE

    @property
    def words(self) -> str:
        """The boundary in a sentence, in shares of the way from the edge of training to the far end of the axis."""
        way = "of the way from the edge of training to the far end of the axis"
        high = self.end if self.high is None else self.high
        text = {
            HOLDS: f"holds to the end of the path, {self.end:.0%} {way} ({self.at_end})",
            OPEN: f"holds for {self.low:.0%} {way}, perhaps to the end of the path at {self.end:.0%} ({self.at_end})",
            FAILS: f"fails first at {self.middle:.0%} {way}, 95 % interval {self.low:.0%} to {high:.0%}",
            FAILS_AT_ONCE: f"fails at the edge of training ({self.at_edge})",
        }[self.verdict]
        return text + (f"; holds again from {self.again[0]:.0%} to {self.again[1]:.0%}" if self.again else "")

    def __str__(self) -> str:
        """The boundary in short, in fractions of the path."""
        at_end = f"{self.at_end}, at least {self.at_end.least:.2f} at 95 %"
        at_edge = f"{self.at_edge}, at most {self.at_edge.most:.2f} at 95 %"
        high = self.end if self.high is None else self.high
        text = {
            HOLDS: f"> {self.end:.2f} ({at_end})",
            OPEN: f"> {self.low:.2f}, perhaps > {self.end:.2f} ({at_end})",
            FAILS: f"{self.middle:.2f} [{self.low:.2f}, {high:.2f}]",
            FAILS_AT_ONCE: f"< 0 ({at_edge})",
        }[self.verdict]
        return text + (f", holds again from {self.again[0]:.2f} to {self.again[1]:.2f}" if self.again else "")


def search(
    task: Task,
    axis: str,
    folder: Path,
    seed: int = 0,
    rounds: int = 20,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, Boundary]:
    """Find both boundaries of an axis, continuing the run in `folder`.

    Args:
        rounds: maximum number of rounds of 4 trials. The fixed looks take 9 rounds, on long paths up to 12. The search
            ends earlier if both intervals are narrow.
        progress: called with the number of trials done, and their maximum.

    Raises:
        BadConfig: the axis has no path, only separate values; or `folder` holds another search.
    """
    path = AxisPath(task, task.axes[axis])
    points = threshold.points(path.end)
    fixed = threshold.fixed(len(points) - 1)
    identity = {
        "task": task.name,
        "axis": axis,
        "seed": seed,
        "path": path.spelled,
        "fixed": [float(points[i]) for i in fixed],
        "source": source_sha256(task.family),
    }
    with Log(folder / "boundary.jsonl", identity, FRESH) as log:
        for index in range(len(log.records), rounds * TRIALS_PER_ROUND):
            point = fixed[index] if index < len(fixed) else _next_point(log.records, points, seed)
            if point is None:
                break
            log.add(_try(path, seed, float(points[point]), index))
            progress(index + 1, rounds * TRIALS_PER_ROUND)
        trials = log.records[: rounds * TRIALS_PER_ROUND]
    return {who: _boundary(who, trials, path, points) for who in (REPLAY, ORACLE)}


def why_no_path(task: Task, axis: Axis) -> str:
    """Reason why an axis has no path along which to search a boundary; empty if it has one."""
    separate = [n for n in axis.replace if task.known[n].integer]
    if not separate:
        return ""
    return (
        f"axis {axis.name} of {task.name} moves {', '.join(separate)}, which has separate values; a boundary search "
        "needs continuous parameters"
    )


class AxisPath:
    """The line that an axis moves its parameters along."""

    def __init__(self, task: Task, axis: Axis):
        self.task, self.axis = task, replace(axis, limits={})  # a search is to find the limits
        if reason := why_no_path(task, axis):
            raise BadConfig(reason)
        self.end = self._end()

    @property
    def spelled(self) -> str:
        """Everything that the path depends on, as a text."""
        supports = {n: (self.task.training[n].support, d.support) for n, d in self.axis.replace.items()}
        return f"{supports}, to {self.end:g}"

    def values(self, fraction: float, seed: int, index: int) -> dict[str, Value]:
        """The axis' parameters of one twin at one point. Of several values, the keyed random stream chooses one."""
        return {
            name: dist.quantile(unit(self.task.name, name, seed, index, 0)) for name, dist in self._at(fraction).items()
        }

    def single(self, fraction: float) -> dict[str, Value]:
        """Those of the axis' parameters that have a single value at a point."""
        return {name: dist.value for name, dist in self._at(fraction).items() if isinstance(dist, Fixed)}

    def _at(self, fraction: float) -> Mapping[str, Fixed | Choice]:
        return self.axis.along(fraction, self.task.training, self.task.known)

    def _end(self) -> float:
        """The largest fraction whose values lie in the bounds of their parameters and still lead away from training."""
        end, gaps = 1.0, self._gaps(1.0)
        for fraction in map(float, np.arange(1.0 + PATH_STEP, LONGEST_PATH + PATH_STEP / 2, PATH_STEP)):
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
        """Distance of each parameter from training at a point."""
        return {
            name: distance(self.task.training[name].support, dist.support, self.task.known[name].period)
            for name, dist in self._at(fraction).items()
        }


def _try(path: AxisPath, seed: int, fraction: float, index: int) -> dict[str, Any]:
    """One twin at one point. Outcomes are None if the oracle fails in training: then the twin counts for nothing."""
    task = path.task
    scenario = task.draw(ID, seed, index).scenario
    actions = twin_actions(task, seed, index)
    found: tuple[bool | None, bool | None] = (None, None)
    if actions is not None:
        twin = with_values(scenario, path.values(fraction, seed, index))
        found = (False, False) if twin.infeasible() else try_both(task, actions, twin)
    return {"index": index, "fraction": fraction, REPLAY: found[0], ORACLE: found[1]}


def _next_point(trials: list[dict[str, Any]], points: Floats, seed: int) -> int | None:
    """Number of the point to look at after some trials; None if both intervals are narrow enough."""
    last, index = len(points) - 1, len(trials)
    sides = {who: _outcomes(trials, who, points) for who in (REPLAY, ORACLE)}
    gaps = {who: threshold.interval(*sides[who], last) for who in sides}
    wide = [who for who, (low, high) in gaps.items() if high - low >= MIN_WIDTH]
    if not wide:
        return None
    who = (REPLAY, ORACLE)[index % 2]
    likely = threshold.guess(*sides[who if who in wide else wide[0]], last).cumsum()
    gap = int(np.searchsorted(likely, unit("gap", seed, index) * likely[-1]))
    before = unit("side", seed, index) < 0.5
    return min(max(gap - before, 0), last)


def _boundary(who: str, trials: list[dict[str, Any]], path: AxisPath, points: Floats) -> Boundary:
    """The boundary that follows from all trials."""
    last = len(points) - 1
    at, solved = _outcomes(trials, who, points)
    first, final = threshold.interval(at, solved, last)
    gap = int(np.searchsorted(threshold.guess(at, solved, last).cumsum(), 0.5))
    gap = min(max(gap, first), final)
    low, high = float(points[max(first - 1, 0)]), float(points[final]) if final <= last else None
    middle = float(points[max(gap - 1, 0)] + points[min(gap, last)]) / 2
    again = threshold.recovery(at, solved, final)
    return Boundary(
        who=who,
        middle=middle,
        low=low,
        high=high,
        end=path.end,
        again=(float(points[again[0]]), float(points[again[1]])) if again else None,
        at_edge=_looks_at(0.0, trials, who),
        at_end=_looks_at(path.end, trials, who),
        values=path.single(middle) if high else {},
        trials=len(at),
    )


def _outcomes(trials: list[dict[str, Any]], who: str, points: Floats) -> tuple[Ints, Bools]:
    """Number of the point and outcome of every trial that has an outcome."""
    tried = [t for t in trials if t[who] is not None]
    at = [int(np.abs(points - t["fraction"]).argmin()) for t in tried]
    return np.array(at, int), np.array([t[who] for t in tried], bool)


def _looks_at(end: float, trials: list[dict[str, Any]], who: str) -> Looks:
    """The fixed looks at one end: an exact bound must not use looks whose place depends on earlier outcomes."""
    fixed = [t[who] for t in trials[: 2 * threshold.LOOKS_AT_END] if t["fraction"] == end and t[who] is not None]
    return Looks(sum(fixed), len(fixed))
