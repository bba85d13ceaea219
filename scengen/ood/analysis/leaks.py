"""Hidden parameters that observations reveal: regressions of each hidden parameter on each stream.

A parameter is hidden if no observation may reveal it (`param(hidden=True)`). Poses may still reveal it: the tilt
of a rod that rests on its supports may depend on its centre of mass. Observations are taken at the start and after a
time without action. A regression is fitted on half of the draws, and its explained variance measured on the other half.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

from ...control.loop import Loop
from ...envs.object_state import ObjectState, bodies_of
from ...envs.observations import privileged, streams_of
from ...episode import Episode
from ...errors import Infeasible, Unstable
from ...params import values
from ...samplers.task import Task
from ...sim.embodiment import hands
from ...validate.rebuilt import world_of
from ...work.parallel import Limits, Workers, each

SEARCH = 1
"""Number of the search and of the observations that it reads. It rises when either changes: then results are old."""
IDLE_TIME = 0.3
"""Time without action before the second observation [s]. Events whose moment is hidden come later: those that have come
may be seen."""
MIN_EXPLAINED = 0.2
"""Explained variance on held-out draws from which a stream counts as revealing a parameter."""
COLUMNS = 8
"""Number of columns of a stream that a regression uses: those that depend most on the parameter in the fitted half."""
RIDGE = 1e-3
"""Penalty of the regression, as a share of the number of draws."""
MIN_DRAWS = 40
"""Number of feasible draws below which nothing is measured."""
LIMITS = Limits(60.0, 4000)
"""Limits on the observation of one draw."""


@dataclass(frozen=True)
class Leak:
    """A hidden parameter that a stream reveals."""

    parameter: str
    stream: str
    explained: float
    """Explained variance on held-out draws; 1 if the stream reveals the parameter exactly."""


@dataclass(frozen=True)
class Leaks:
    """The result for one split."""

    split: str
    draws: int
    """Number of draws that were observed."""
    hidden: tuple[str, ...]
    """Hidden parameters that vary in these draws."""
    found: tuple[Leak, ...]
    """For each revealed parameter, the stream that reveals most of it; the clearest one first."""


Observed = tuple[Mapping[str, float], Mapping[str, NDArray[np.float64]]]
"""Hidden parameters of a draw, and its observations by stream: at the start, and their changes without action."""


def leaks(
    task: Task,
    split: str,
    n: int,
    seed: int,
    workers: Workers = 1,
    progress: Callable[[int], None] = lambda done: None,
) -> Leaks:
    """Measure which hidden parameters the streams of a task reveal in a split.

    Args:
        n: number of draws.
        progress: called with the number of draws that were observed.
    """
    bodies = bodies_of(task)
    observe = partial(_observed, task, bodies, split, seed)
    seen: list[Observed] = []
    for done, one in enumerate(each(observe, range(n), workers, LIMITS, lambda index, why: None), 1):
        if one is not None:
            seen.append(one)
        progress(done)
    if len(seen) < MIN_DRAWS:
        return Leaks(split, len(seen), (), ())
    truth = {name: np.array([hidden[name] for hidden, _ in seen]) for name in seen[0][0]}
    truth = {name: column for name, column in truth.items() if np.ptp(column) > 0.0}
    found = []
    for name, column in truth.items():
        shares = {stream: explained([readings[stream] for _, readings in seen], column) for stream in seen[0][1]}
        best = max(shares, key=shares.__getitem__)
        if shares[best] >= MIN_EXPLAINED:
            found.append(Leak(name, best, shares[best]))
    found.sort(key=lambda leak: -leak.explained)
    return Leaks(split, len(seen), tuple(truth), tuple(found))


def explained(readings: Sequence[NDArray[np.float64]], column: NDArray[np.float64]) -> float:
    """Explained variance of a regression on held-out draws, at least 0.

    Args:
        readings: readings of a stream, one row for each draw.
        column: the parameter in these draws.
    """
    rows = np.array(readings)
    rows = rows[:, np.ptp(rows, axis=0) > 0.0]
    if not rows.shape[1]:
        return 0.0
    half = len(rows) // 2
    ranks = np.apply_along_axis(rankdata, 0, rows[:half])
    ranked = rankdata(column[:half])
    with np.errstate(invalid="ignore", divide="ignore"):
        near = np.abs(np.nan_to_num(((ranks - ranks.mean(0)).T @ (ranked - ranked.mean())) / ranks.std(0)))
    chosen = rows[:, np.argsort(-near)[:COLUMNS]]
    scale = chosen[:half].std(axis=0)
    chosen = chosen[:, scale > 0.0]
    if not chosen.shape[1]:
        return 0.0
    known = (chosen - chosen[:half].mean(axis=0)) / chosen[:half].std(axis=0)
    inputs = np.hstack([np.ones((len(known), 1)), known, known**2])
    fitted, expected = inputs[:half], column[:half]
    weights = np.linalg.solve(fitted.T @ fitted + RIDGE * half * np.eye(inputs.shape[1]), fitted.T @ expected)
    left = column[half:] - inputs[half:] @ weights
    return max(0.0, 1.0 - float(np.mean(left**2) / np.var(column[half:])))


def _observed(task: Task, bodies: Mapping[str, bool], split: str, seed: int, index: int) -> Observed | None:
    """The hidden parameters and observations of a draw; None if it is infeasible or unstable."""
    try:
        scenario = task.draw(split, seed, index).scenario
    except Infeasible:
        return None
    world = world_of(scenario, task.embodiment)
    state = ObjectState(bodies, len(hands(task.embodiment)))
    streams = {**streams_of(task.embodiment), **privileged(state, task.family, lambda: scenario.orientation)}

    def read() -> dict[str, NDArray[np.float64]]:
        return {
            name: np.asarray(stream.read(world), np.float32).astype(float).ravel() for name, stream in streams.items()
        }

    before, episode = read(), Episode(scenario, world)
    try:
        for _ in range(round(IDLE_TIME / Loop.PERIOD)):
            episode.step(world.received(world.idle))
    except Unstable:
        return None
    after = read()
    hidden = {name: float(value) for name, value in values(scenario).items() if task.known[name].hidden}
    return hidden, {name: np.concatenate([before[name], after[name] - before[name]]) for name in streams}
