"""T07: the cup lays the bowl on two open fingers, on which it rolls upright, and eases it down to the table."""

import math
from contextlib import suppress

import numpy as np
from hand import Hand

from scengen.errors import GaveUp
from scengen.geometry import UP
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.handover import LEFT
from scengen.skills.motion import (
    CLOSED,
    COARSE,
    OPEN,
    STEADY,
    Pace,
    alone,
    facing,
    go_to,
    hold,
    push,
    together,
    turn_to,
)
from scengen.tasks.bowl_table import CARRY_PACE, BowlTable

FORK = facing(-math.pi / 2, 0.5)  # orientation of the open jaw, which points to the right and down
LOW = 0.03  # height of the fork above the table [m]
EASE = Pace(0.05, 0.01)  # pace of the cup that gives way to the bowl


def roll_it_up_on_two_fingers(scenario: Scenario, world: World) -> Plan:
    """Hold the bowl over the square with its opening level, put a fork under its rim, switch off, draw back."""
    assert isinstance(scenario, BowlTable)
    self, (right, left) = scenario, world.arms
    yield from alone(right, self.extract(right))
    yield from together(world, self.present(right), None)
    with suppress(GaveUp):
        yield from alone(right, turn_to(right, facing(math.pi / 2, -0.1), 0.5))
    over = self.goal + (LOW + 0.16) * UP + right.hand - world.pos("bowl")
    with suppress(GaveUp):
        yield from alone(right, go_to(right, over, pace=CARRY_PACE))
    fork = self.goal + (self.bowl.depth - 0.02) * LEFT + LOW * UP
    for away, pace in ((0.12 * LEFT + 0.15 * UP, COARSE), (0.12 * LEFT, STEADY), (np.zeros(3), STEADY)):
        yield from alone(left, go_to(left, fork + away, FORK, pace, OPEN))
    with suppress(GaveUp):
        lies = lambda: world.touching(left.label, "bowl")  # noqa: E731
        yield from alone(right, push(right, -0.04 * UP, lies, CLOSED, give_up=4.0))
    yield from alone(right, hold(right, 1.0, OPEN))
    yield from alone(right, go_to(right, right.hand - 0.10 * LEFT - 0.03 * UP, pace=EASE))
    yield from alone(left, go_to(left, left.hand + 0.12 * LEFT, pace=Pace(0.08, 0.01)))


HANDS = {"roll_it_up_on_two_fingers": Hand(roll_it_up_on_two_fingers)}
