"""Knowledge of a task that a policy may have from training: memorised solutions, and the durations of waits."""

from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import islice

from ..control.loop import Loop
from ..errors import Infeasible
from ..samplers.split import ID
from ..samplers.task import Task
from ..scenario import Scenario
from ..sim.world import World
from ..validate.rebuilt import world_of
from ..validate.rollout import run
from .clock import CLOCK
from .memories import FIRST_JUDGES, FURTHER_JUDGES, MEMORY, SOLUTIONS, Memory, candidates, fit
from .phases import Trace, trace

SOLVED_DRAWS = 8
"""Number of training draws whose solutions are known."""
MAX_DRAWS = 24
"""Maximum number of draws for them."""


@dataclass(frozen=True)
class Experience:
    """Data from training that the tiers `memory` and `clock` use."""

    memories: tuple[Memory, ...] = ()
    """Training solutions, the best one first."""
    durations: tuple[tuple[float, ...], ...] = ()
    """Durations of the waits in each known solution [s]."""


def experience(task: Task, seed: int, tiers: Collection[str]) -> Experience:
    """The experience that some tiers need, from training draws of a seed."""
    if not {MEMORY, CLOCK} & {*tiers}:
        return Experience()
    solved = list(islice(_solved(task, seed), SOLVED_DRAWS))
    memories: list[Memory] = []
    if MEMORY in tiers:
        for number, (scenario, world, found) in enumerate(solved[:SOLUTIONS]):
            memories += candidates(scenario, world, found, number)
        others = [scenario for scenario, *_ in solved[SOLUTIONS:]]
        judges = [
            *others,
            *islice(feasible(task, ID, seed + 1, MAX_DRAWS), FIRST_JUDGES + FURTHER_JUDGES - len(others)),
        ]
        memories = fit(task, memories, judges)
    return Experience(tuple(memories), tuple(_durations(found) for *_, found in solved))


def _durations(found: Trace) -> tuple[float, ...]:
    """Durations of the waits of a solution, in order [s]."""
    return tuple((end - begin) * Loop.PERIOD for begin, end in found.waits)


def _solved(task: Task, seed: int) -> Iterator[tuple[Scenario, World, Trace]]:
    """Training scenarios that the oracle solves, with their worlds and traces."""
    for scenario in feasible(task, ID, seed, MAX_DRAWS):
        world = world_of(scenario, task.embodiment)
        rollout = run(scenario, world, scenario.oracle, task.horizon)
        if rollout.solved and (found := trace(scenario, world, rollout.actions)):
            yield scenario, world, found


def feasible(task: Task, split: str, seed: int, count: int) -> Iterator[Scenario]:
    """The feasible scenarios of the first `count` indices of a split."""
    for index in range(count):
        with suppress(Infeasible):
            yield task.draw(split, seed, index).scenario
