"""T22: the ball is brought out of a cage that is tilted less than it needs, by jerks of the hand."""

from collections.abc import Callable

import numpy as np
from hand import Hand

from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.motion import CLOSED
from scengen.tasks.ball_cage_escape import BallCageEscape

SHAKE_TIME = 5.0  # time for which the cage is shaken [s]


def shaken(level: Callable[[float], float]) -> Callable[[Scenario, World], Plan]:
    """Plan that tilts the cage nearly as far as the ball needs and moves it along its length.

    Args:
        level: action towards the hole, from the time since the beginning [s].
    """

    def plan(scenario: Scenario, world: World) -> Plan:
        assert isinstance(scenario, BallCageEscape)
        yield from scenario.tip_only(world, 0.9 * scenario.way * scenario.rolling_tilt)
        start = world.time
        while world.time < start + SHAKE_TIME:
            towards_hole = scenario.way * world.rot("cage")[:, 0]
            yield np.array([*(level(world.time - start) * towards_hole), 0.0, 0.0, 0.0, CLOSED])

    return plan


def to_and_fro(seconds: float) -> float:
    """Full speed one way for 0.3 s, then the other way."""
    return 1.0 if seconds % 0.6 < 0.3 else -1.0


def slow_and_fast(seconds: float) -> float:
    """Slowly towards the hole for 0.75 s, so that the ball rides along, and fast back, so that it does not."""
    return 0.3 if seconds % 1.0 < 0.75 else -1.0


HANDS = {
    "jerk": Hand(shaken(to_and_fro)),
    "jerk_raw": Hand(shaken(to_and_fro), raw=True),
    "creep": Hand(shaken(slow_and_fast)),
}
