"""The energy distance between two pools of one task, and what it is over."""

from dataclasses import dataclass

from ...pool import Pool
from ...samplers.task import Task
from .distance import MAX_ENERGY_SCENARIOS, Energy, energy
from .redraw import first_scenarios
from .space import Space, of_features, with_parameters


@dataclass(frozen=True)
class Apart:
    """Distance between two pools."""

    energy: Energy
    """Energy distance [training ranges]."""
    over: tuple[str, ...]
    """Names of the features and of the moved parameters that it is over."""

    def __str__(self) -> str:
        return f"energy distance {self.energy} over {', '.join(self.over)}"


def apart(task: Task, one: Pool, other: Pool, permutations: int = 999) -> Apart:
    """Distance over the features of the family and the parameters that an axis of either pool moves.

    Pools of the same draws are compared twin by twin.
    """
    ones, others = (first_scenarios(task, pool, MAX_ENERGY_SCENARIOS) for pool in (one, other))
    moved = dict.fromkeys([*task.shifts(one.split), *task.shifts(other.split)])
    space: Space = with_parameters(of_features(task, ones, others), task, tuple(moved))
    twins = list(one.columns("seed", "index")) == list(other.columns("seed", "index"))
    return Apart(energy(space.points(ones), space.points(others), permutations, twins=twins), space.names)
