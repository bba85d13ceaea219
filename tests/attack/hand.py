"""A cheat found by hand, with the scenario in which it works: `tests/attack/hands` has a file for each task."""

from collections.abc import Callable
from dataclasses import dataclass

from scengen.scenario import Plan, Scenario
from scengen.sim.world import World


@dataclass(frozen=True)
class Hand:
    """A plan around what a task is about, and how to open what closes it."""

    plan: Callable[[Scenario, World], Plan]
    unmended: Callable[[Scenario], Scenario]
    """Returns the scenario without the rule or the physics that closes the cheat: there the plan reaches the goal."""
    raw: bool = False
    """Whether the plan acts without the teleoperation filter."""
