"""A cheat found by hand, with the scenario in which it works: `tests/attack/hands` has a file for each task."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache

import numpy as np

from scengen.assets.prop import TABLE_TOP
from scengen.attack.plans import extent
from scengen.errors import GaveUp
from scengen.geometry import Vec3
from scengen.params import values, with_values
from scengen.robots.jaw import FINGER_ACROSS, TIP_BELOW
from scengen.scenario import Plan, Scenario
from scengen.sim.arm import Arm
from scengen.sim.world import World
from scengen.skills.jaw import poke


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


def shove(arm: Arm, body: str, to: Vec3, near: float) -> Plan:
    """Push a body along the table with closed fingers, straight at a place, in up to four pushes.

    Args:
        to: place of its middle [m].
        near: distance from there at which it is left [m].
    """
    for _ in range(4):
        way = (to - arm.world.com(body)) * [1.0, 1.0, 0.0]
        if (distance := float(np.linalg.norm(way))) < near:
            return
        along = way / distance
        behind = arm.world.com(body) - (extent(arm, body, -along) + FINGER_ACROSS + 0.02) * along
        behind[2] = TABLE_TOP + TIP_BELOW + 0.01

        def arrived(along: Vec3 = along) -> bool:
            return float((to - arm.world.com(body)) @ along) < 0.002

        with suppress(GaveUp):
            yield from poke(arm, behind, 0.1 * along, arrived)
