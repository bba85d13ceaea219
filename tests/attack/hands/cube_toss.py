"""T10: one swing for all distances, turned to the bearing of the tray."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from hand import Hand, otherwise

from scengen.geometry import UP
from scengen.scenario import Plan, Scenario
from scengen.sim.world import World
from scengen.skills.motion import CLOSED, OPEN
from scengen.tasks.cube_toss import CubeToss

FORMER_DISTANCES = (1.000, 1.045)  # training range before the mend [m]
DISTANCES = (0.968, 1.075)  # training range [m]


def unmended(scenario: Scenario) -> Scenario:
    """The task without means, with the tray and the distances that it had before."""
    assert isinstance(scenario, CubeToss)
    distance = float(np.interp(scenario.distance, DISTANCES, FORMER_DISTANCES))
    return otherwise(replace(scenario, distance=distance, opening=0.095))


def to_one_distance(distance: float) -> Callable[[Scenario, World], Plan]:
    """Throw as precisely as the oracle, always to the same distance, towards the tray.

    Args:
        distance: place where the cube comes down, from the robot's axis [m].
    """

    def plan(scenario: Scenario, world: World) -> Plan:
        assert isinstance(scenario, CubeToss)
        return replace(scenario, distance=distance).oracle(world)

    return plan


def by_one_swing(drive: float, seconds: float, wrist: float = 1.0) -> Callable[[Scenario, World], Plan]:
    """Swing by the same actions, turned to the bearing of the tray, and open the jaw at a fixed time.

    Args:
        drive: speed of the hand outwards, as a share of the fastest along an axis.
        seconds: time from the start of the swing until the jaw opens [s].
        wrist: share of the pitch that goes with the swing.
    """

    def plan(scenario: Scenario, world: World) -> Plan:
        assert isinstance(scenario, CubeToss)
        yield from scenario.wind_up(world)
        begin = world.time
        while world.time < begin + seconds + 0.2:
            action = np.zeros(7)
            action[:3], action[3:6] = drive * scenario.u + 0.3 * UP, -wrist * drive * scenario.across
            action[6] = CLOSED if world.time < begin + seconds else OPEN
            yield np.clip(action, -1.0, 1.0)

    return plan


HANDS = {
    "to_one_distance": Hand(to_one_distance(1.045), unmended),
    "by_one_swing": Hand(by_one_swing(1.0, 0.5), unmended),
}
