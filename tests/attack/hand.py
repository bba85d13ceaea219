"""A cheat found by hand, with the scenario in which it works: `tests/attack/hands` has a file for each task."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

from scengen.params import values, with_values
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World


def otherwise(scenario: Scenario) -> Scenario:
    """The scenario if a goal counts however it is reached."""
    return with_values(_without_means(type(scenario))(), values(scenario))


@cache
def _without_means(family: type[Scenario]) -> type[Scenario]:
    return type(family.__name__, (family,), {"means": lambda self: {}})


@dataclass(frozen=True)
class Hand:
    """A plan around what a task is about, and how to open what closes it."""

    plan: Callable[[Scenario, World], Plan]
    unmended: Callable[[Scenario], Scenario] = otherwise
    """Returns the scenario without the means or the physics that close the cheat: there the plan reaches the goal."""
    raw: bool = False
    """Whether the plan acts without the teleoperation filter."""
